//! The whole viewer without a window. Events go in; the accessibility tree and the state are checked.

mod access;
mod dialogs;
mod edits;
mod mouse;
mod moving;
mod on_device;
mod opening;
mod rest;
mod shortcuts;
mod soak;
mod trees;

use std::time::{Duration, Instant};

use autosplats::Backend;
use eframe::egui::accesskit::Role;
use eframe::egui::{
    Event, Key, Modifiers, OutputCommand, PointerButton, Pos2, Rect, Vec2, ViewportCommand, ViewportId,
};
use eframe::{App as _, egui};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};

use crate::app::App;
use crate::view::{Look, WindowDevice};
use crate::{Input, Options};

/// The smallest window in which everything has to work.
const SMALL: Vec2 = egui::vec2(1024.0, 640.0);
/// Time limit for threads, on busy machines.
const WAIT: Duration = Duration::from_secs(90);
/// Ctrl, as in events.
const CTRL: Modifiers = Modifiers { ctrl: true, command: true, ..Modifiers::NONE };
const CTRL_SHIFT: Modifiers = Modifiers { shift: true, ..CTRL };
const SHIFT: Modifiers = Modifiers { shift: true, ..Modifiers::NONE };
/// A scene of few points, which the CPU renders quickly.
const STATUE: &str = "scene:statue:20K";

/// The viewer, and its requests to the system.
struct Window {
    harness: Harness<'static, App>,
    commands: Vec<ViewportCommand>,
    outputs: Vec<OutputCommand>,
    /// The device that the window shares with its pictures.
    device: Option<WindowDevice>,
}

impl Window {
    /// A window that opens the inputs of these names.
    fn new(names: &[&str]) -> Self {
        Self::on(Backend::Cpu, names)
    }

    /// A window that renders on a backend.
    fn on(backend: Backend, names: &[&str]) -> Self {
        Self::of(Options { backend: Some(backend), ..Options::default() }, names)
    }

    /// A window on a device that renders its pictures too.
    fn sharing(device: WindowDevice, names: &[&str]) -> Self {
        Self::with(Options { backend: Some(Backend::Gpu), ..Options::default() }, names, Some(device))
    }

    /// A window with options.
    fn of(options: Options, names: &[&str]) -> Self {
        Self::with(options, names, None)
    }

    fn with(options: Options, names: &[&str], device: Option<WindowDevice>) -> Self {
        let parse = |name: &&str| Input::parse(name).unwrap_or_else(|error| panic!("{name}: {error}"));
        let options = Options { inputs: names.iter().map(parse).collect(), ..options };
        let builder = Harness::builder().with_size(SMALL).with_step_dt(1.0 / 60.0).with_max_steps(2);
        let builder = builder.with_accessibility_check(false).with_os(egui::os::OperatingSystem::Nix);
        let shared = device.clone();
        let harness = builder.build_eframe(move |creation| {
            let mut app = App::new(options, Look::default(), Vec::new(), &creation.egui_ctx);
            shared.into_iter().for_each(|device| app.view.share(device));
            app
        });
        Self { harness, commands: Vec::new(), outputs: Vec::new(), device }
    }

    /// A window that shows the statue.
    fn with_statue() -> Self {
        let mut window = Self::new(&[STATUE]);
        window.settle();
        window
    }

    fn app(&self) -> &App {
        self.harness.state()
    }

    fn step(&mut self) {
        self.harness.step();
        let output = self.harness.output();
        let commands = output.viewport_output.get(&ViewportId::ROOT).map(|output| output.commands.clone());
        self.commands.extend(commands.into_iter().flatten());
        self.outputs.extend(output.platform_output.commands.iter().cloned());
    }

    fn steps(&mut self, count: usize) {
        (0..count).for_each(|_| self.step());
    }

    /// Draws the window until `done` returns true.
    fn until(&mut self, what: &str, done: impl Fn(&Self) -> bool) {
        let start = Instant::now();
        loop {
            self.step();
            if done(self) {
                return;
            }
            assert!(start.elapsed() < WAIT, "{what}: not so after {WAIT:?}; seen is {:#?}", self.words());
            std::thread::sleep(Duration::from_millis(4));
        }
    }

    /// Draws the window until everything is read and the requested picture is complete.
    fn settle(&mut self) {
        self.steps(2);
        self.until("the picture is whole", |window| {
            let app = window.app();
            let asked =
                app.session.loader.jobs().is_empty() && !app.view.navigation.is_moving() && app.session.trees.is_idle();
            let empty = app.session.document().layers.is_empty() && app.view.shot.is_none();
            asked
                && (empty
                    || app.view.shot.as_ref().is_some_and(|picture| {
                        let side = |points: f32| points.round() as u32;
                        let rect = window.picture();
                        picture.whole
                            && picture.dots == app.view.look.dots
                            && picture.camera == app.view.navigation.camera()
                            && picture.size == [side(rect.width()), side(rect.height())]
                            && picture.shown.shows(app.session.document())
                    }))
        });
    }

    /// Sends an event and draws the window. The application sees the event first, as in a real window.
    fn event(&mut self, event: Event) {
        let mut input = egui::RawInput { events: vec![event], ..egui::RawInput::default() };
        let context = self.harness.ctx.clone();
        self.harness.state_mut().raw_input_hook(&context, &mut input);
        input.events.into_iter().for_each(|event| self.harness.event(event));
        self.step();
    }

    /// Turns the mouse wheel, a number of times by some lines.
    fn wheel(&mut self, times: usize, lines: f32) {
        for _ in 0..times {
            self.event(Event::MouseWheel {
                unit: egui::MouseWheelUnit::Line,
                delta: egui::vec2(0.0, lines),
                phase: egui::TouchPhase::Move,
                modifiers: Modifiers::NONE,
                source: egui::MouseWheelSource::Wheel,
            });
        }
    }

    fn key(&mut self, modifiers: Modifiers, key: Key) {
        self.event(Event::ModifiersChanged(modifiers));
        for pressed in [true, false] {
            self.event(Event::Key { key, physical_key: None, pressed, repeat: false, modifiers });
        }
        self.event(Event::ModifiersChanged(Modifiers::NONE));
    }

    fn press(&mut self, key: Key) {
        self.key(Modifiers::NONE, key);
    }

    fn button(&mut self, pos: Pos2, button: PointerButton, pressed: bool, modifiers: Modifiers) {
        self.event(Event::PointerButton { pos, button, pressed, modifiers });
    }

    fn click(&mut self, place: Pos2) {
        self.event(Event::PointerMoved(place));
        [true, false].into_iter().for_each(|down| self.button(place, PointerButton::Primary, down, Modifiers::NONE));
    }

    /// Drags in eight steps.
    fn drag(&mut self, button: PointerButton, modifiers: Modifiers, from: Pos2, to: Pos2) {
        self.event(Event::PointerMoved(from));
        self.event(Event::ModifiersChanged(modifiers));
        self.button(from, button, true, modifiers);
        (1..=8).for_each(|step| self.event(Event::PointerMoved(from.lerp(to, step as f32 / 8.0))));
        self.button(to, button, false, modifiers);
        self.event(Event::ModifiersChanged(Modifiers::NONE));
    }

    /// Clicks a widget.
    fn click_on(&mut self, label: &str) {
        let place = self.harness.get_by_label(label).rect().center();
        self.click(place);
        self.steps(2);
    }

    /// All texts in the window.
    fn words(&self) -> Vec<String> {
        let nodes = self.harness.root().children_recursive().map(|node| node.accesskit_node());
        nodes.filter(|node| !node.is_hidden()).flat_map(|node| [node.label(), node.value()]).flatten().collect()
    }

    /// Whether the window shows a text.
    fn says(&self, text: &str) -> bool {
        self.words().iter().any(|word| word.contains(text))
    }

    /// Rectangle of the picture.
    fn picture(&self) -> Rect {
        self.harness.get_by_role_and_label(Role::Image, "Surface of the points").rect()
    }

    /// A place in the picture, by shares of its sides.
    fn place(&self, x: f32, y: f32) -> Pos2 {
        let rect = self.picture();
        rect.min + rect.size() * egui::vec2(x, y)
    }
}

/// The folder of the shared test files.
pub(crate) fn data() -> Option<std::path::PathBuf> {
    let beside = || std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let folder = std::env::var_os("AUTOSPLATS_DATA").map_or_else(beside, std::path::PathBuf::from);
    if folder.join("README.md").exists() {
        return Some(folder);
    }
    assert!(std::env::var_os("CI").is_none(), "the shared files are not at {}", folder.display());
    // The test harness hides what a passing test prints, so the message goes to stderr directly.
    let message = format!("SKIPPED: the shared files are not at {}; nothing is checked\n", folder.display());
    use std::io::Write as _;
    std::io::stderr().write_all(message.as_bytes()).expect("somewhere to say it");
    None
}

#[test]
fn what_is_not_there_is_not_found() {
    let mut window = Window::new(&[]);
    window.settle();
    assert!(window.says("Drop point clouds here"), "the welcome can be read");
    assert!(!window.says("Drop point clouds there"), "this is said nowhere");
    assert!(window.app().view.shot.is_none(), "nothing is open, so there is no picture");
}
