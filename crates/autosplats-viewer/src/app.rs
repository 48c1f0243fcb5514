//! The application: its state, and the work of each window frame.

use std::sync::Arc;

use autosplats::Camera;
use autosplats::cloud::Axes;
use autosplats::cloud::glam::DVec3;
use eframe::egui;

use crate::document::ShownCloud;
use crate::kept::StoredInput;
use crate::look::Look;
use crate::navigation::Flight;
use crate::render::{Answer, Outcome, Purpose, RenderRequest, Task};
use crate::session::Session;
use crate::state::State;
use crate::ui::Ui;
use crate::view::View;
use crate::{Options, keys, output, panels, storage, viewport};

/// Seconds from the last movement until the whole picture is rendered.
const REST_DELAY_S: f64 = 0.12;

/// The state of the viewer.
pub(crate) struct App {
    pub(crate) session: Session,
    pub(crate) view: View,
    pub(crate) ui: Ui,
}

/// Everything that a picture depends on.
#[derive(Clone, PartialEq)]
pub(crate) struct RequestKey {
    version: u64,
    camera: Camera,
    size: [u32; 2],
    look: Look,
    axes: Axes,
    /// Whether another picture is to follow soon.
    hurried: bool,
}

impl App {
    /// Creates the application and starts to read the inputs of `options`. `context` belongs to the window.
    pub(crate) fn new(options: Options, look: Look, recent: Vec<StoredInput>, context: &egui::Context) -> Self {
        let mut app = Self {
            session: Session::new(options.state, options.watch, recent, context),
            view: View::new(look, context),
            ui: Ui::new(context),
        };
        if let Some(backend) = options.backend {
            app.view.look.backend = backend;
        }
        options.inputs.into_iter().for_each(|input| app.open(input));
        app
    }

    /// Notes that the view moves, so that pictures are rendered within the time limit.
    pub(crate) fn note_movement(&mut self) {
        self.view.moved_by_preview = true;
    }

    /// The up axis: as chosen, else as guessed, else Z.
    pub(crate) fn axes(&self) -> Axes {
        self.session.up_axis.or(self.session.guessed_axes).unwrap_or(Axes::ZUp)
    }

    /// Unit vector upward, world space.
    pub(crate) fn up(&self) -> DVec3 {
        match self.axes() {
            Axes::ZUp => DVec3::Z,
            Axes::YUp => DVec3::Y,
            Axes::Camera => DVec3::NEG_Y,
        }
    }

    /// The points of the last picture, if they still match the document.
    pub(crate) fn shown(&self) -> Option<Arc<ShownCloud>> {
        let shown = &self.view.shot.as_ref()?.shown;
        shown.shows(self.document()).then(|| Arc::clone(shown))
    }

    /// Receives what the threads have sent.
    fn receive(&mut self, context: &egui::Context) {
        self.follow_files();
        self.follow_streams(context);
        let now = context.input(|input| input.time);
        let answers: Vec<_> = self.view.render.answers().collect();
        for answer in answers {
            self.take(answer, now);
        }
    }

    /// Receives the result of a picture or a task.
    fn take(&mut self, answer: Answer, now: f64) {
        self.view.awaited &= matches!(answer, Answer::Finer(_) | Answer::Device(_) | Answer::Done(_));
        match answer {
            Answer::Picture(picture) => {
                self.view.rate.count(now, &picture);
                self.ui.messages.forget_failure();
                self.view.shot = Some(picture);
            }
            Answer::Finer(image) => {
                if let Some(shot) = &mut self.view.shot {
                    shot.image = image;
                }
            }
            Answer::Empty => self.view.shot = None,
            Answer::Device(device) => self.view.device = device,
            Answer::Failed(why) => {
                // The failed picture may belong to the film.
                output::stop(&mut self.view.recording);
                self.ui.messages.failure(why);
            }
            Answer::Done(outcome) => self.done(outcome),
        }
    }

    /// Applies the outcome of a task.
    fn done(&mut self, outcome: Outcome) {
        match outcome {
            Outcome::Picked { purpose: Purpose::Pivot, point } => {
                if let Some(seen) = point {
                    self.view.navigation.set_pivot(seen.surface);
                }
            }
            Outcome::Picked { purpose, point } => self.picked(purpose, point),
            Outcome::Selected { shown, hits, mode } => {
                self.change(|document| document.select(&shown, |i| hits[i], mode));
            }
            Outcome::Photographed { image, range, goal } => output::photographed(self, *image, range, goal),
        }
    }

    /// The render request for the present view.
    pub(crate) fn wish(&self, size: [u32; 2], moving: bool) -> RenderRequest {
        RenderRequest {
            document: self.document().clone(),
            camera: self.view.navigation.camera(),
            size,
            settings: self.view.look.settings.clone(),
            dots: self.view.look.dots.then_some(self.view.look.dot_size),
            backend: self.view.look.backend,
            // A playing input keeps one up axis; a guess per frame could change from frame to frame.
            axes: self.session.up_axis.or(self.session.guessed_axes.filter(|_| !self.session.playing.is_empty())),
            budget_ms: self.shared_budget_ms(moving).map(|shared_budget_ms| {
                self.view.turns.as_ref().map_or(shared_budget_ms, |turns| turns.budget_ms(shared_budget_ms))
            }),
        }
    }

    /// Milliseconds for a picture and a window frame together, while the view moves or an input plays; `None` at rest.
    fn shared_budget_ms(&self, moving: bool) -> Option<f64> {
        let least_ms = self.view.look.moving_ms;
        if moving { Some(least_ms) } else { self.session.playing.frame_ms(least_ms) }
    }

    /// Requests a picture if anything that it depends on has changed.
    pub(crate) fn ask(&mut self, context: &egui::Context, size: [u32; 2], busy: bool) {
        let (now, seconds) = context.input(|input| (input.time, f64::from(input.stable_dt)));
        let flight = if context.egui_wants_keyboard_input() { Flight::default() } else { flight(context) };
        let busy = busy || std::mem::take(&mut self.view.moved_by_preview);
        self.session.loader.frame.set(self.frame());
        if self.view.navigation.advance(seconds, flight) || busy {
            self.view.moved = now;
        }
        if self.view.first_camera.is_some_and(|(_, aspect)| aspect != self.view.aspect) && self.is_first_view() {
            self.first_view();
        }
        let moving = now - self.view.moved < REST_DELAY_S;
        if moving {
            context.request_repaint();
        }
        if self.document().layers.is_empty() {
            self.view.shot = None;
            if self.view.wished.take().is_some() {
                // An empty document frees the points that the renderer holds.
                self.view.render.wish(self.wish(size, false));
            }
            return;
        }
        let mut look = self.view.look.clone();
        // The window draws the legend itself, so that its size stays the same in coarse pictures.
        look.settings.shading.legend = false;
        // Without averaging, noise would differ from picture to picture.
        look.settings.reconstruction.steady = moving;
        if self.shared_budget_ms(false).is_none() {
            // A picture at rest shows its own points only, without the coarser pictures before it.
            look.settings.reconstruction.frames_averaged = 1;
        }
        let (version, camera, axes) = (self.session.version, self.view.navigation.camera(), self.axes());
        let hurried = self.shared_budget_ms(moving).is_some();
        let key = RequestKey { version, camera, size, look, axes, hurried };
        if self.view.wished.as_ref() != Some(&key) {
            self.view.render.wish(RenderRequest { settings: key.look.settings.clone(), ..self.wish(size, moving) });
            self.view.wished = Some(key);
            self.view.awaited = true;
        }
    }

    /// Waits for the requested picture, if the window and the pictures take turns.
    fn take_turns(&mut self, context: &egui::Context) {
        let Some(turns) = &mut self.view.turns else { return };
        turns.begin();
        let now = context.input(|input| input.time);
        let shared_budget_ms =
            self.shared_budget_ms(now - self.view.moved < REST_DELAY_S).filter(|_| self.view.awaited);
        let longest =
            shared_budget_ms.and_then(|shared_budget_ms| Some(self.view.turns.as_ref()?.longest(shared_budget_ms)));
        if let Some(answer) = longest.and_then(|longest| self.view.render.answer_within(longest)) {
            self.take(answer, now);
        }
        if let Some(turns) = &mut self.view.turns {
            turns.end();
        }
    }

    /// Requests the point at a pixel of the picture.
    pub(crate) fn pick(&mut self, size: [u32; 2], pixel: [f32; 2], purpose: Purpose) {
        let wish = Box::new(self.wish(size, false).of_points());
        self.view.render.task(Task::Pick { wish, pixel, purpose });
    }
}

/// The flight that the held keys ask for.
fn flight(context: &egui::Context) -> Flight {
    use egui::Key;
    context.input(|input| {
        if input.modifiers.command || input.modifiers.alt {
            return Flight::default();
        }
        let axis = |more: Key, less: Key| f64::from(i8::from(input.key_down(more)) - i8::from(input.key_down(less)));
        Flight {
            right: axis(Key::D, Key::A),
            up: axis(Key::E, Key::Q),
            forward: axis(Key::W, Key::S),
            turn_right: axis(Key::ArrowRight, Key::ArrowLeft),
            turn_up: axis(Key::ArrowUp, Key::ArrowDown),
            fast: input.modifiers.shift,
        }
    })
}

impl eframe::App for App {
    fn raw_input_hook(&mut self, context: &egui::Context, input: &mut egui::RawInput) {
        keys::claim(self, context, input);
    }

    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        let context = ui.ctx().clone();
        self.receive(&context);
        keys::perform(self, &context);
        panels::show(self, ui);
        viewport::show(self, ui);
        panels::over(self, &context);
        output::record(self);
        self.take_turns(&context);
        if self.ui.quit {
            context.send_viewport_cmd(egui::ViewportCommand::Close);
        }
    }

    fn save(&mut self, storage: &mut dyn eframe::Storage) {
        storage::save(self, storage);
    }

    fn on_exit(&mut self) {
        if let Some(path) = &self.session.file
            && let Err(error) = State::of(self).write(path)
        {
            eprintln!("error: {error}");
        }
    }
}
