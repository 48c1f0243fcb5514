//! The application: what is open, what is shown, and the round of each frame of the window.

use std::collections::HashMap;
use std::sync::Arc;

use autosplats::cloud::glam::DVec3;
use autosplats::cloud::{Axes, PointCloud, Source};
use autosplats::{AdapterSummary, Camera, Projection, ViewDirection, guess_axes};
use eframe::egui;

use crate::animation::Recording;
use crate::commands::Tool;
use crate::document::{Counts, Document, History, Layer, LayerId, Shown, label};
use crate::loading::{Input, JobId, Loader, News, Watch};
use crate::look::Look;
use crate::messages::Messages;
use crate::navigation::{Flight, Navigation};
use crate::panels::Panels;
use crate::render::{Answer, Outcome, Picture, Purpose, RenderThread, Task, Wish};
use crate::state::State;
use crate::tools::Tools;
use crate::{Options, keys, output, panels, storage, viewport};

/// Seconds after the last movement until the picture is made whole.
const REST: f64 = 0.12;
/// Vertical field of view of the first picture, degrees.
const FOV_DEG: f64 = 40.0;

/// The viewer.
pub(crate) struct App {
    pub(crate) history: History,
    pub(crate) loader: Loader,
    /// The layer that a file's points go to, where there is one already.
    pub(crate) loading: HashMap<JobId, LayerId>,
    pub(crate) render: RenderThread,
    pub(crate) navigation: Navigation,
    pub(crate) look: Look,
    pub(crate) tool: Tool,
    pub(crate) tools: Tools,
    pub(crate) panels: Panels,
    pub(crate) messages: Messages,
    pub(crate) shot: Option<Shot>,
    pub(crate) device: Option<AdapterSummary>,
    /// Which way is up, if the user says so; guessed otherwise.
    pub(crate) up_axis: Option<Axes>,
    pub(crate) rate: Rate,
    /// Width over height of the picture in the window.
    pub(crate) aspect: f64,
    /// Where the picture is in the window.
    pub(crate) view_rect: egui::Rect,
    pub(crate) recent: Vec<std::path::PathBuf>,
    /// Where the session is kept.
    pub(crate) state: Option<std::path::PathBuf>,
    watch: bool,
    watches: HashMap<LayerId, Watch>,
    /// What each layer was read from.
    inputs: HashMap<LayerId, Input>,
    /// Whether what is being read is to be seen, and in which colour.
    looks: HashMap<JobId, (bool, Option<[u8; 3]>)>,
    /// Files that are read again, and whose points they are.
    reloads: HashMap<JobId, LayerId>,
    guessed_axes: Option<Axes>,
    /// Where the program stood by itself, for a picture so much wider than high. As long as nobody has moved, it stands
    /// anew when points arrive and when the picture changes its shape.
    first_camera: Option<(Camera, f64)>,
    /// Grows with each change of the document.
    version: u64,
    counted: Counted,
    /// What the picture that was wished for last shows.
    wished: Option<WishKey>,
    /// Whether the first cloud has been looked at.
    placed: bool,
    /// Whether something else than the mouse moves the view.
    stirred: bool,
    /// When something moved last, seconds.
    moved: f64,
    pub(crate) quit: bool,
    /// Cameras that a film goes through.
    pub(crate) keys: Vec<Camera>,
    pub(crate) recording: Option<Recording>,
}

/// What panels say of the document, as of a version of it.
#[derive(Default)]
pub(crate) struct Counted {
    version: u64,
    /// Points of all layers.
    pub(crate) all: Counts,
    /// Points of each layer.
    pub(crate) layers: HashMap<LayerId, Counts>,
    /// Bytes of all points.
    pub(crate) bytes: usize,
    /// Bytes that undo keeps besides.
    pub(crate) old_bytes: usize,
}

/// The last picture, on its way to the screen.
pub(crate) struct Shot {
    pub(crate) texture: egui::TextureHandle,
    pub(crate) picture: Box<Picture>,
}

/// Pictures a second, while they change.
#[derive(Default)]
pub(crate) struct Rate {
    last: Option<f64>,
    /// Mean seconds between pictures; 0 while unknown.
    interval: f64,
    /// The last pictures' times per stage, for the plot.
    pub(crate) timings: std::collections::VecDeque<(autosplats::Timings, f64)>,
}

impl Rate {
    /// Pictures kept for the plot.
    const KEPT: usize = 120;

    fn count(&mut self, now: f64, picture: &Picture) {
        if let Some(last) = self.last {
            let interval = now - last;
            // A pause is no slow picture.
            if interval < 0.5 {
                self.interval = if self.interval > 0.0 { 0.8 * self.interval + 0.2 * interval } else { interval };
            } else {
                self.interval = 0.0;
            }
        }
        self.last = Some(now);
        if self.timings.len() == Self::KEPT {
            self.timings.pop_front();
        }
        self.timings.push_back((picture.timings, picture.milliseconds));
    }

    /// Pictures a second, if they follow each other.
    pub(crate) fn per_second(&self) -> Option<f64> {
        (self.interval > 0.0).then(|| 1.0 / self.interval)
    }
}

/// All that a picture depends on.
#[derive(Clone, PartialEq)]
struct WishKey {
    version: u64,
    camera: Camera,
    size: [u32; 2],
    look: Look,
    axes: Axes,
    moving: bool,
}

impl App {
    /// An application that begins to read its inputs; `context` is the window's.
    pub(crate) fn new(options: Options, look: Look, recent: Vec<std::path::PathBuf>, context: &egui::Context) -> Self {
        let mut app = Self {
            history: History::default(),
            loader: Loader::start(context.clone()),
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
            looks: HashMap::new(),
            watch: options.watch,
            watches: HashMap::new(),
            inputs: HashMap::new(),
            reloads: HashMap::new(),
            guessed_axes: None,
            first_camera: None,
            version: 1,
            counted: Counted::default(),
            wished: None,
            placed: false,
            stirred: false,
            moved: 0.0,
            quit: false,
            keys: Vec::new(),
            recording: None,
        };
        if let Some(backend) = options.backend {
            app.look.backend = backend;
        }
        options.inputs.into_iter().for_each(|input| app.open(input));
        app
    }

    /// Begins to read something.
    pub(crate) fn open(&mut self, input: Input) {
        if let Some(path) = input.source.path() {
            self.recent.retain(|known| known != path);
            self.recent.insert(0, path.into());
            self.recent.truncate(12);
        }
        self.loader.read(input);
    }

    /// Begins to read something that is shown in a certain way.
    pub(crate) fn open_as(&mut self, input: Input, visible: bool, tint: Option<[u8; 3]>) {
        let job = self.loader.read(input);
        self.looks.insert(job, (visible, tint));
    }

    /// Stands at a place whatever is opened.
    pub(crate) fn stand_at(&mut self, camera: &Camera) {
        self.navigation.go_to(camera, true);
        self.placed = true;
    }

    /// Says that the view moves, so that pictures have to hurry.
    pub(crate) fn stir(&mut self) {
        self.stirred = true;
    }

    /// What a layer was read from, as it could be typed.
    pub(crate) fn source_name(&self, id: LayerId) -> Option<String> {
        let input = self.inputs.get(&id)?;
        Some(match &input.source {
            Source::File(path) => std::path::absolute(path).unwrap_or_else(|_| path.clone()).display().to_string(),
            Source::Scene(..) => input.name.clone(),
        })
    }

    /// What is open.
    pub(crate) fn document(&self) -> &Document {
        self.history.current()
    }

    /// Numbers of points of all that is open, and of each layer; counted anew only after changes.
    pub(crate) fn counts(&mut self) -> &Counted {
        if self.counted.version != self.version {
            let document = self.document();
            self.counted = Counted {
                version: self.version,
                all: document.counts(),
                layers: document.layers.iter().map(|layer| (layer.id, document.counts_of(layer))).collect(),
                bytes: document.layers.iter().map(|layer| layer.cloud.byte_len()).sum(),
                old_bytes: self.history.old_bytes(),
            };
        }
        &self.counted
    }

    /// Changes the document in a way that can be undone.
    pub(crate) fn edit(&mut self, label: impl Into<String>, edit: impl FnOnce(&mut Document)) {
        let mut document = self.document().clone();
        edit(&mut document);
        self.history.record(label, document);
        self.version += 1;
    }

    /// Changes points in a way that can be undone; `edit` says how many it reached.
    pub(crate) fn edit_points(&mut self, verb: &str, edit: impl FnOnce(&mut Document) -> usize) {
        let mut document = self.document().clone();
        let points = edit(&mut document);
        if points > 0 {
            self.history.record(label(verb, points), document);
            self.version += 1;
        }
    }

    /// Changes the document in a way that is not worth undoing.
    pub(crate) fn change<T>(&mut self, change: impl FnOnce(&mut Document) -> T) -> T {
        let mut document = self.document().clone();
        let result = change(&mut document);
        self.history.replace(document);
        self.version += 1;
        result
    }

    /// Takes back the last edit; says which it was.
    pub(crate) fn undo(&mut self) -> Option<String> {
        self.version += 1;
        self.history.undo()
    }

    /// Does again what was taken back last; says what.
    pub(crate) fn redo(&mut self) -> Option<String> {
        self.version += 1;
        self.history.redo()
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
        let shown = &self.shot.as_ref()?.picture.shown;
        shown.shows(self.document()).then(|| Arc::clone(shown))
    }

    /// Takes in what the threads have to say.
    fn receive(&mut self, context: &egui::Context) {
        for (input, job, news) in self.loader.news() {
            match news {
                News::Preview(cloud) => self.preview(&input, job, *cloud),
                News::Read(cloud, notes) => {
                    notes.into_iter().for_each(|note| self.messages.note(format!("{}: {note}", input.name)));
                    self.read(input, job, *cloud);
                }
                News::Failed(why) => {
                    self.drop_preview(job);
                    self.messages.error(why);
                }
                News::Cancelled => {
                    self.drop_preview(job);
                    self.messages.note(format!("{}: not read to its end", input.name));
                }
            }
        }
        let changed: Vec<_> = self.loader.changed().collect();
        for path in changed {
            self.reload(&path);
        }
        let now = context.input(|input| input.time);
        let answers: Vec<_> = self.render.answers().collect();
        for answer in answers {
            match answer {
                Answer::Picture(mut picture) => {
                    self.rate.count(now, &picture);
                    let options =
                        if picture.dots { egui::TextureOptions::NEAREST } else { egui::TextureOptions::LINEAR };
                    let image = std::mem::take(&mut picture.image);
                    let texture = match self.shot.take() {
                        Some(Shot { mut texture, .. }) => {
                            texture.set(image, options);
                            texture
                        }
                        None => context.load_texture("picture", image, options),
                    };
                    self.messages.forget_failure();
                    self.shot = Some(Shot { texture, picture });
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
            Outcome::Selected { shown, hits, mode } => self.change(|document| document.select(&shown, |i| hits[i], mode)),
            Outcome::Photographed { image, goal } => output::photographed(self, *image, goal),
        }
    }

    /// Shows the first points of a file.
    fn preview(&mut self, input: &Input, job: JobId, cloud: PointCloud) {
        if self.reloads.contains_key(&job) {
            return;
        }
        let layer = Layer::new(&*input.name, None, Arc::new(cloud)).opened_at(input.world_from_input);
        self.put(job, layer);
    }

    /// Shows a file that has been read.
    fn read(&mut self, input: Input, job: JobId, cloud: PointCloud) {
        let path = input.source.path().map(std::path::Path::to_path_buf);
        let cloud = Arc::new(cloud);
        if let Some(id) = self.reloads.remove(&job) {
            if self.change(|document| document.reload(id, Arc::clone(&cloud))) {
                self.messages.note(format!("{} has changed and was read again", input.name));
            }
            if self.stands_by_itself() {
                self.first_view();
            }
            self.measure_scene();
            return;
        }
        let layer = Layer::new(&*input.name, path.clone(), cloud).opened_at(input.world_from_input);
        let id = layer.id;
        self.put(job, layer);
        self.loading.remove(&job);
        if self.watch && let Some(path) = path {
            self.watches.insert(id, self.loader.watch(path));
        }
        self.inputs.insert(id, input);
    }

    /// Puts a layer in the place of the one that had the points of `job` so far, or at the end.
    fn put(&mut self, job: JobId, layer: Layer) {
        let first = !self.placed;
        let cloud = Arc::clone(&layer.cloud);
        let before = self.loading.insert(job, layer.id);
        let look = self.looks.remove(&job);
        self.change(|document| {
            let place = before.and_then(|id| document.layers.iter().position(|layer| layer.id == id));
            let visible = before.and_then(|id| document.remove(id)).is_none_or(|layer| layer.visible);
            let mut layer = layer;
            layer.visible = visible;
            if let Some((visible, tint)) = look {
                (layer.visible, layer.tint) = (visible, tint);
            }
            let id = document.add(layer);
            if let Some(place) = place {
                document.reorder(id, place);
            }
        });
        if self.guessed_axes.is_none() || before.is_some() && self.document().layers.len() == 1 {
            self.guessed_axes = Some(guess_axes(&cloud));
        }
        if first || self.stands_by_itself() {
            self.first_view();
            self.placed = true;
        }
        self.measure_scene();
    }

    fn drop_preview(&mut self, job: JobId) {
        self.reloads.remove(&job);
        if let Some(id) = self.loading.remove(&job) {
            self.change(|document| document.remove(id));
        }
    }

    /// Reads a file again that has changed; one with edits is only told about, as they are of the points it had.
    fn reload(&mut self, path: &std::path::Path) {
        let layers = self.document().layers.iter().filter(|layer| layer.path.as_deref() == Some(path));
        let ids: Vec<_> = layers.map(|layer| layer.id).collect();
        for id in ids {
            let Some(input) = self.inputs.get(&id).cloned() else { continue };
            if self.history.is_unsaved(id) {
                self.messages.note(format!("{} has changed; it was not read again, as it has edits here", input.name));
            } else {
                let job = self.loader.read(input);
                self.reloads.insert(job, id);
            }
        }
    }

    /// Tells the navigation how large everything is.
    pub(crate) fn measure_scene(&mut self) {
        let bounds = self.document().shown_bounds();
        let up = self.up();
        if let Some([low, high]) = bounds {
            self.navigation.set_scene(low.midpoint(high), 0.5 * low.distance(high), up);
        }
    }

    /// Whether nobody has moved since the program chose where to stand.
    fn stands_by_itself(&self) -> bool {
        self.first_camera.is_some_and(|(camera, _)| camera == self.navigation.goal_camera())
    }

    /// Stands where a picture of the first input stands that names no camera.
    pub(crate) fn first_view(&mut self) {
        let scene = self.loader.jobs().iter().map(|job| &job.input).chain(self.inputs.values()).find_map(|input| {
            match &input.source {
                Source::Scene(scene, _) => Some(scene.view()),
                Source::File(_) => None,
            }
        });
        match scene {
            Some(view) if self.document().layers.len() == 1 => {
                let projection = Projection::PerspectiveFovDeg(view.fov_degrees);
                let camera = Camera { eye: view.eye, look_at: view.look_at, up: view.up, projection };
                self.measure_scene();
                self.navigation.go_to(&camera, true);
            }
            _ => self.look_from(ViewDirection::Auto, true),
        }
        self.first_camera = Some((self.navigation.goal_camera(), self.aspect));
    }

    /// Looks at everything from one side.
    pub(crate) fn look_from(&mut self, direction: ViewDirection, at_once: bool) {
        let cloud = self.document().overview();
        let fov = if direction == ViewDirection::Auto { FOV_DEG } else { self.navigation.fov_deg() };
        let projection = if self.navigation.is_orthographic() {
            Projection::OrthographicHeight(1.0)
        } else {
            Projection::PerspectiveFovDeg(fov)
        };
        self.measure_scene();
        match Camera::fit(&cloud, self.axes(), direction, self.aspect, projection) {
            Ok(camera) => self.navigation.go_to(&camera, at_once),
            Err(error) => self.messages.note(error.to_string()),
        }
    }

    /// Stands where all points of a cloud are seen, looking the same way.
    pub(crate) fn fit(&mut self, cloud: &PointCloud) {
        self.measure_scene();
        match self.navigation.goal_camera().showing(cloud, self.aspect) {
            Ok(camera) => self.navigation.go_to(&camera, false),
            Err(error) => self.messages.note(error.to_string()),
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
            axes: self.up_axis,
            budget_ms: moving.then_some(self.look.moving_ms),
        }
    }

    /// Asks for a picture if it would be another one than was asked for last.
    pub(crate) fn ask(&mut self, context: &egui::Context, size: [u32; 2], busy: bool) {
        let (now, seconds) = context.input(|input| (input.time, f64::from(input.stable_dt)));
        let flight = if context.egui_wants_keyboard_input() { Flight::default() } else { flight(context) };
        let busy = busy || std::mem::take(&mut self.stirred);
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
            self.wished = None;
            return;
        }
        let key = WishKey {
            version: self.version,
            camera: self.navigation.camera(),
            size,
            look: self.look.clone(),
            axes: self.axes(),
            moving,
        };
        if self.wished.as_ref() != Some(&key) {
            self.render.wish(self.wish(size, moving));
            self.wished = Some(key);
        }
    }

    /// Has what is at a pixel of the picture found.
    pub(crate) fn pick(&mut self, size: [u32; 2], pixel: [f32; 2], purpose: Purpose) {
        let wish = Box::new(Wish { dots: None, ..self.wish(size, false) });
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
