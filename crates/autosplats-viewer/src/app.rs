//! The application: its state, and the work of each window frame.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use autosplats::cloud::Axes;
use autosplats::cloud::glam::DVec3;
use autosplats::{AdapterSummary, Camera};
use eframe::egui;

use crate::commands::Tool;
use crate::document::{History, LayerId, ShownCloud};
use crate::editing::CachedCounts;
use crate::glance::FirstLook;
use crate::kept::StoredInput;
use crate::loading::{Appearance, Input, JobId, Loader, Watch};
use crate::look::Look;
use crate::messages::Messages;
use crate::navigation::{Flight, Navigation};
use crate::panels::Panels;
use crate::playing::Playing;
use crate::rate::Rate;
use crate::recording::Recording;
use crate::render::{Answer, Outcome, Picture, Purpose, RenderRequest, RenderThread, Task};
use crate::state::State;
use crate::tools::Tools;
use crate::turns::Turns;
use crate::{Options, keys, output, panels, storage, viewport};

/// Seconds from the last movement until the whole picture is rendered.
const REST_DELAY_S: f64 = 0.12;

/// The state of the viewer.
pub(crate) struct App {
    pub(crate) history: History,
    pub(crate) loader: Loader,
    pub(crate) playing: Playing,
    /// The layer that receives the points of a job, once the layer exists.
    pub(crate) loading: HashMap<JobId, LayerId>,
    pub(crate) render: RenderThread,
    pub(crate) navigation: Navigation,
    pub(crate) look: Look,
    pub(crate) tool: Tool,
    pub(crate) tools: Tools,
    pub(crate) panels: Panels,
    pub(crate) messages: Messages,
    /// The last picture.
    pub(crate) shot: Option<Box<Picture>>,
    pub(crate) device: Option<AdapterSummary>,
    /// The up axis that the user chose; `None` uses the guessed one.
    pub(crate) up_axis: Option<Axes>,
    pub(crate) rate: Rate,
    /// Width over height of the picture in the window.
    pub(crate) aspect: f64,
    /// The picture's rectangle in the window, screen points.
    pub(crate) view_rect: egui::Rect,
    /// Recently opened inputs, newest first.
    pub(crate) recent: Vec<StoredInput>,
    /// File of the session, written on exit.
    pub(crate) state: Option<PathBuf>,
    /// Whether files are read again when they change.
    pub(crate) watch: bool,
    pub(crate) watches: HashMap<PathBuf, Watch>,
    /// The input that each layer was read from.
    pub(crate) inputs: HashMap<LayerId, Input>,
    /// How each input that is being read will be shown.
    pub(crate) appearances: HashMap<JobId, Appearance>,
    /// Jobs that read a file again, and the layer that receives the points.
    pub(crate) reloads: HashMap<JobId, LayerId>,
    pub(crate) guessed_axes: Option<Axes>,
    /// What the reading thread found about the only open input, and the document version that this holds for.
    pub(crate) glance: Option<(u64, FirstLook)>,
    /// The camera that the program chose by itself, and the picture's width over height at the time. Until the user
    /// moves, a new camera is chosen when points arrive or the picture changes its shape.
    pub(crate) first_camera: Option<(Camera, f64)>,
    /// Version of the document; every change increases it.
    pub(crate) version: u64,
    pub(crate) counted: CachedCounts,
    /// What the last requested picture shows.
    wished: Option<RequestKey>,
    /// Whether the last requested picture is still to come.
    awaited: bool,
    /// Whether a camera was given, so that the first input is not fitted into the picture.
    pub(crate) camera_given: bool,
    /// Inputs that could not be read. A session keeps them.
    pub(crate) failed: Vec<(Input, Appearance)>,
    /// Whether a film preview has moved the view since the last window frame.
    moved_by_preview: bool,
    /// Time of the last movement, seconds.
    moved: f64,
    pub(crate) quit: bool,
    /// Key cameras of a film.
    pub(crate) keys: Vec<Camera>,
    pub(crate) recording: Option<Recording>,
    /// Pixel format of the window; `None` without a device, and then no picture is drawn in the window.
    pub(crate) format: Option<eframe::wgpu::TextureFormat>,
    /// Present if the CPU draws the window, and so competes with rendering.
    pub(crate) turns: Option<Turns>,
}

/// Everything that a picture depends on.
#[derive(Clone, PartialEq)]
struct RequestKey {
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
            history: History::default(),
            loader: Loader::start(context.clone()),
            playing: Playing::default(),
            loading: HashMap::new(),
            render: RenderThread::start(context.clone()),
            navigation: Navigation::new(),
            look,
            tool: Tool::default(),
            tools: Tools::default(),
            panels: Panels::default(),
            messages: Messages::new(context.clone()),
            shot: None,
            device: None,
            up_axis: None,
            rate: Rate::default(),
            aspect: 1.5,
            view_rect: egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(800.0, 600.0)),
            recent,
            state: options.state,
            appearances: HashMap::new(),
            watch: options.watch,
            watches: HashMap::new(),
            inputs: HashMap::new(),
            reloads: HashMap::new(),
            guessed_axes: None,
            glance: None,
            first_camera: None,
            version: 1,
            counted: CachedCounts::default(),
            wished: None,
            awaited: false,
            camera_given: false,
            failed: Vec::new(),
            moved_by_preview: false,
            moved: 0.0,
            quit: false,
            keys: Vec::new(),
            recording: None,
            format: None,
            turns: None,
        };
        if let Some(backend) = options.backend {
            app.look.backend = backend;
        }
        options.inputs.into_iter().for_each(|input| app.open(input));
        app
    }

    /// Notes that the view moves, so that pictures are rendered within the time limit.
    pub(crate) fn note_movement(&mut self) {
        self.moved_by_preview = true;
    }

    /// The up axis: as chosen, else as guessed, else Z.
    pub(crate) fn axes(&self) -> Axes {
        self.up_axis.or(self.guessed_axes).unwrap_or(Axes::ZUp)
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
        let shown = &self.shot.as_ref()?.shown;
        shown.shows(self.document()).then(|| Arc::clone(shown))
    }

    /// Receives what the threads have sent.
    fn receive(&mut self, context: &egui::Context) {
        self.follow_files();
        self.follow_streams(context);
        let now = context.input(|input| input.time);
        let answers: Vec<_> = self.render.answers().collect();
        for answer in answers {
            self.take(answer, now);
        }
    }

    /// Receives the result of a picture or a task.
    fn take(&mut self, answer: Answer, now: f64) {
        self.awaited &= matches!(answer, Answer::Finer(_) | Answer::Device(_) | Answer::Done(_));
        match answer {
            Answer::Picture(picture) => {
                self.rate.count(now, &picture);
                self.messages.forget_failure();
                self.shot = Some(picture);
            }
            Answer::Finer(image) => {
                if let Some(shot) = &mut self.shot {
                    shot.image = image;
                }
            }
            Answer::Empty => self.shot = None,
            Answer::Device(device) => self.device = device,
            Answer::Failed(why) => {
                // The failed picture may belong to the film.
                output::stop(&mut self.recording);
                self.messages.failure(why);
            }
            Answer::Done(outcome) => self.done(outcome),
        }
    }

    /// Applies the outcome of a task.
    fn done(&mut self, outcome: Outcome) {
        match outcome {
            Outcome::Picked { purpose: Purpose::Pivot, point } => {
                if let Some(seen) = point {
                    self.navigation.set_pivot(seen.surface);
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
            camera: self.navigation.camera(),
            size,
            settings: self.look.settings.clone(),
            dots: self.look.dots.then_some(self.look.dot_size),
            backend: self.look.backend,
            // A playing input keeps one up axis; a guess per frame could change from frame to frame.
            axes: self.up_axis.or(self.guessed_axes.filter(|_| !self.playing.is_empty())),
            budget_ms: self.shared_budget_ms(moving).map(|shared_budget_ms| {
                self.turns.as_ref().map_or(shared_budget_ms, |turns| turns.budget_ms(shared_budget_ms))
            }),
        }
    }

    /// Milliseconds for a picture and a window frame together, while the view moves or an input plays; `None` at rest.
    fn shared_budget_ms(&self, moving: bool) -> Option<f64> {
        let least_ms = self.look.moving_ms;
        if moving { Some(least_ms) } else { self.playing.frame_ms(least_ms) }
    }

    /// Requests a picture if anything that it depends on has changed.
    pub(crate) fn ask(&mut self, context: &egui::Context, size: [u32; 2], busy: bool) {
        let (now, seconds) = context.input(|input| (input.time, f64::from(input.stable_dt)));
        let flight = if context.egui_wants_keyboard_input() { Flight::default() } else { flight(context) };
        let busy = busy || std::mem::take(&mut self.moved_by_preview);
        self.loader.frame.set(self.frame());
        if self.navigation.advance(seconds, flight) || busy {
            self.moved = now;
        }
        if self.first_camera.is_some_and(|(_, aspect)| aspect != self.aspect) && self.is_first_view() {
            self.first_view();
        }
        let moving = now - self.moved < REST_DELAY_S;
        if moving {
            context.request_repaint();
        }
        if self.document().layers.is_empty() {
            self.shot = None;
            if self.wished.take().is_some() {
                // An empty document frees the points that the renderer holds.
                self.render.wish(self.wish(size, false));
            }
            return;
        }
        let mut look = self.look.clone();
        // The window draws the legend itself, so that its size stays the same in coarse pictures.
        look.settings.shading.legend = false;
        // Without averaging, noise would differ from picture to picture.
        look.settings.reconstruction.steady = moving;
        if self.shared_budget_ms(false).is_none() {
            // A picture at rest shows its own points only, without the coarser pictures before it.
            look.settings.reconstruction.frames_averaged = 1;
        }
        let (version, camera, axes) = (self.version, self.navigation.camera(), self.axes());
        let hurried = self.shared_budget_ms(moving).is_some();
        let key = RequestKey { version, camera, size, look, axes, hurried };
        if self.wished.as_ref() != Some(&key) {
            self.render.wish(RenderRequest { settings: key.look.settings.clone(), ..self.wish(size, moving) });
            self.wished = Some(key);
            self.awaited = true;
        }
    }

    /// Waits for the requested picture, if the window and the pictures take turns.
    fn take_turns(&mut self, context: &egui::Context) {
        let Some(turns) = &mut self.turns else { return };
        turns.begin();
        let now = context.input(|input| input.time);
        let shared_budget_ms = self.shared_budget_ms(now - self.moved < REST_DELAY_S).filter(|_| self.awaited);
        let longest =
            shared_budget_ms.and_then(|shared_budget_ms| Some(self.turns.as_ref()?.longest(shared_budget_ms)));
        if let Some(answer) = longest.and_then(|longest| self.render.answer_within(longest)) {
            self.take(answer, now);
        }
        if let Some(turns) = &mut self.turns {
            turns.end();
        }
    }

    /// Requests the point at a pixel of the picture.
    pub(crate) fn pick(&mut self, size: [u32; 2], pixel: [f32; 2], purpose: Purpose) {
        let wish = Box::new(self.wish(size, false).of_points());
        self.render.task(Task::Pick { wish, pixel, purpose });
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
        if self.quit {
            context.send_viewport_cmd(egui::ViewportCommand::Close);
        }
    }

    fn save(&mut self, storage: &mut dyn eframe::Storage) {
        storage::save(self, storage);
    }

    fn on_exit(&mut self) {
        if let Some(path) = &self.state
            && let Err(error) = State::of(self).write(path)
        {
            eprintln!("error: {error}");
        }
    }
}
