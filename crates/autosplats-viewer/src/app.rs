//! The application: what is open, what is shown, and the round of each frame of the window.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use autosplats::cloud::Axes;
use autosplats::cloud::glam::DVec3;
use autosplats::{AdapterSummary, Camera};
use eframe::egui;

use crate::commands::Tool;
use crate::document::{History, LayerId, Shown};
use crate::editing::Counted;
use crate::glance::Glance;
use crate::kept::Kept;
use crate::loading::{Appearance, Input, JobId, Loader, Watch};
use crate::look::Look;
use crate::messages::Messages;
use crate::navigation::{Flight, Navigation};
use crate::panels::Panels;
use crate::playing::Playing;
use crate::rate::Rate;
use crate::recording::Recording;
use crate::render::{Answer, Outcome, Picture, Purpose, RenderThread, Task, Wish};
use crate::state::State;
use crate::tools::Tools;
use crate::turns::Turns;
use crate::{Options, keys, output, panels, storage, viewport};

/// Seconds after the last movement until the picture is made whole.
const REST: f64 = 0.12;

/// The viewer.
pub(crate) struct App {
    pub(crate) history: History,
    pub(crate) loader: Loader,
    pub(crate) playing: Playing,
    /// The layer that a file's points go to, where there is one already.
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
    /// Which way is up, if the user says so; guessed otherwise.
    pub(crate) up_axis: Option<Axes>,
    pub(crate) rate: Rate,
    /// Width over height of the picture in the window.
    pub(crate) aspect: f64,
    /// Where the picture is in the window.
    pub(crate) view_rect: egui::Rect,
    /// What was opened last, the newest first.
    pub(crate) recent: Vec<Kept>,
    /// Where the session is kept.
    pub(crate) state: Option<PathBuf>,
    /// Files are read again when they change.
    pub(crate) watch: bool,
    pub(crate) watches: HashMap<PathBuf, Watch>,
    /// What each layer was read from.
    pub(crate) inputs: HashMap<LayerId, Input>,
    /// How what is being read is to be seen.
    pub(crate) appearances: HashMap<JobId, Appearance>,
    /// Files that are read again, and whose points they are.
    pub(crate) reloads: HashMap<JobId, LayerId>,
    pub(crate) guessed_axes: Option<Axes>,
    /// What the thread that read what is open alone knows of it, at a version of the document.
    pub(crate) glance: Option<(u64, Glance)>,
    /// Where the program stood by itself, for a picture so much wider than high. As long as nobody has moved, it stands
    /// anew when points arrive and when the picture changes its shape.
    pub(crate) first_camera: Option<(Camera, f64)>,
    /// Grows with each change of the document.
    pub(crate) version: u64,
    pub(crate) counted: Counted,
    /// What the picture that was wished for last shows.
    wished: Option<WishKey>,
    /// Whether that picture has not come yet.
    awaited: bool,
    /// Whether the first input is not to be fitted into the picture, as a camera was given.
    pub(crate) camera_given: bool,
    /// Inputs that could not be read, which a session keeps.
    pub(crate) failed: Vec<(Input, Appearance)>,
    /// Whether something else than the mouse moves the view.
    stirred: bool,
    /// When something moved last, seconds.
    moved: f64,
    pub(crate) quit: bool,
    /// Cameras that a film goes through.
    pub(crate) keys: Vec<Camera>,
    pub(crate) recording: Option<Recording>,
    /// Of the window's pixels; without a device nothing of the window is drawn.
    pub(crate) format: Option<eframe::wgpu::TextureFormat>,
    /// Where pictures and the window are drawn by the same processor.
    pub(crate) turns: Option<Turns>,
}

/// All that a picture depends on.
#[derive(Clone, PartialEq)]
struct WishKey {
    version: u64,
    camera: Camera,
    size: [u32; 2],
    look: Look,
    axes: Axes,
    /// Whether another one is to follow soon.
    hurried: bool,
}

impl App {
    /// An application that begins to read its inputs; `context` is the window's.
    pub(crate) fn new(options: Options, look: Look, recent: Vec<Kept>, context: &egui::Context) -> Self {
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
            counted: Counted::default(),
            wished: None,
            awaited: false,
            camera_given: false,
            failed: Vec::new(),
            stirred: false,
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

    /// Says that the view moves, so that pictures have to hurry.
    pub(crate) fn stir(&mut self) {
        self.stirred = true;
    }

    /// Which way is up.
    pub(crate) fn axes(&self) -> Axes {
        self.up_axis.or(self.guessed_axes).unwrap_or(Axes::ZUp)
    }

    /// Unit vector upward.
    pub(crate) fn up(&self) -> DVec3 {
        match self.axes() {
            Axes::ZUp => DVec3::Z,
            Axes::YUp => DVec3::Y,
            Axes::Camera => DVec3::NEG_Y,
        }
    }

    /// The points as they are shown now, if they have been shown yet.
    pub(crate) fn shown(&self) -> Option<Arc<Shown>> {
        let shown = &self.shot.as_ref()?.shown;
        shown.shows(self.document()).then(|| Arc::clone(shown))
    }

    /// Takes in what the threads have to say.
    fn receive(&mut self, context: &egui::Context) {
        self.follow_files();
        self.follow_streams(context);
        let now = context.input(|input| input.time);
        let answers: Vec<_> = self.render.answers().collect();
        for answer in answers {
            self.take(answer, now);
        }
    }

    /// Takes in what came of a picture or a task.
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
                // The picture that failed may have been the film's.
                output::stop(&mut self.recording);
                self.messages.failure(why);
            }
            Answer::Done(outcome) => self.done(outcome),
        }
    }

    /// What came of a task.
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

    /// What a picture of the present view is made of.
    pub(crate) fn wish(&self, size: [u32; 2], moving: bool) -> Wish {
        Wish {
            document: self.document().clone(),
            camera: self.navigation.camera(),
            size,
            settings: self.look.settings.clone(),
            dots: self.look.dots.then_some(self.look.dot_size),
            backend: self.look.backend,
            // What moves has one direction upward, whatever may be guessed of single frames.
            axes: self.up_axis.or(self.guessed_axes.filter(|_| !self.playing.is_empty())),
            budget_ms: self
                .both_ms(moving)
                .map(|both_ms| self.turns.as_ref().map_or(both_ms, |turns| turns.budget_ms(both_ms))),
        }
    }

    /// Milliseconds that a picture and the window may take: as the view moves, or until the next frame of what is played.
    fn both_ms(&self, moving: bool) -> Option<f64> {
        let least_ms = self.look.moving_ms;
        if moving { Some(least_ms) } else { self.playing.frame_ms(least_ms) }
    }

    /// Asks for a picture if it would be another one than was asked for last.
    pub(crate) fn ask(&mut self, context: &egui::Context, size: [u32; 2], busy: bool) {
        let (now, seconds) = context.input(|input| (input.time, f64::from(input.stable_dt)));
        let flight = if context.egui_wants_keyboard_input() { Flight::default() } else { flight(context) };
        let busy = busy || std::mem::take(&mut self.stirred);
        self.loader.frame.set(self.frame());
        if self.navigation.advance(seconds, flight) || busy {
            self.moved = now;
        }
        if self.first_camera.is_some_and(|(_, aspect)| aspect != self.aspect) && self.stands_by_itself() {
            self.first_view();
        }
        let moving = now - self.moved < REST;
        if moving {
            context.request_repaint();
        }
        if self.document().layers.is_empty() {
            self.shot = None;
            if self.wished.take().is_some() {
                // Lets go of the points.
                self.render.wish(self.wish(size, false));
            }
            return;
        }
        let mut look = self.look.clone();
        // It lies over the picture here, where it stays as large when pictures become coarse.
        look.settings.shading.legend = false;
        // Noise would look another in each picture.
        look.settings.reconstruction.steady = moving;
        if self.both_ms(false).is_none() {
            // At rest it is of its points alone, not of a coarser picture before it.
            look.settings.reconstruction.frames_averaged = 1;
        }
        let (version, camera, axes) = (self.version, self.navigation.camera(), self.axes());
        let hurried = self.both_ms(moving).is_some();
        let key = WishKey { version, camera, size, look, axes, hurried };
        if self.wished.as_ref() != Some(&key) {
            self.render.wish(Wish { settings: key.look.settings.clone(), ..self.wish(size, moving) });
            self.wished = Some(key);
            self.awaited = true;
        }
    }

    /// Waits for the picture asked for, where it and the window take turns.
    fn take_turns(&mut self, context: &egui::Context) {
        let Some(turns) = &mut self.turns else { return };
        turns.begin();
        let now = context.input(|input| input.time);
        let both_ms = self.both_ms(now - self.moved < REST).filter(|_| self.awaited);
        let longest = both_ms.and_then(|both_ms| Some(self.turns.as_ref()?.longest(both_ms)));
        if let Some(answer) = longest.and_then(|longest| self.render.answer_within(longest)) {
            self.take(answer, now);
        }
        if let Some(turns) = &mut self.turns {
            turns.end();
        }
    }

    /// Has what is at a pixel of the picture found.
    pub(crate) fn pick(&mut self, size: [u32; 2], pixel: [f32; 2], purpose: Purpose) {
        let wish = Box::new(self.wish(size, false).of_points());
        self.render.task(Task::Pick { wish, pixel, purpose });
    }
}

/// What the keys do that are held down.
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
