//! Every command by its shortcut.

use autosplats::cloud::Axes;
use autosplats::cloud::glam::DVec3;
use autosplats::{Camera, ViewDirection};

use super::*;
use crate::ui::Command;

/// Presses the shortcut of a command. The clipboard's keys arrive as events of their own.
fn give(window: &mut Window, command: Command) {
    window.commands.clear();
    window.outputs.clear();
    if command == Command::CopyView {
        window.event(Event::Copy);
    } else if command == Command::PasteView {
        let text = serde_json::to_string(&elsewhere(window)).expect("a camera can be written");
        window.event(Event::Paste(text));
    } else {
        let shortcut = command.shortcut().unwrap_or_else(|| panic!("{command:?} has a key"));
        let ctrl = if shortcut.modifiers.command { CTRL } else { Modifiers::NONE };
        window.key(ctrl | shortcut.modifiers, shortcut.logical_key);
    }
    window.step();
}

/// The present camera, moved to the side.
fn elsewhere(window: &Window) -> Camera {
    let camera = window.app().view.navigation.goal_camera();
    let aside = DVec3::new(0.25, 0.5, 0.0);
    Camera { eye: camera.eye + aside, look_at: camera.look_at + aside, ..camera }
}

fn forward(window: &Window) -> DVec3 {
    let camera = window.app().view.navigation.goal_camera();
    (camera.look_at - camera.eye).normalize()
}

/// View direction of a named view with Z upward; `None` for views that depend on the points.
fn wanted(direction: ViewDirection) -> Option<DVec3> {
    Some(match direction {
        ViewDirection::Front => DVec3::Y,
        ViewDirection::Back => DVec3::NEG_Y,
        ViewDirection::Right => DVec3::NEG_X,
        ViewDirection::Left => DVec3::X,
        ViewDirection::Top => DVec3::NEG_Z,
        ViewDirection::Bottom => DVec3::Z,
        _ => return None,
    })
}

/// Presses the shortcut of a command and checks its effect.
fn check(window: &mut Window, command: Command) {
    let counts = |window: &Window| window.app().session.document().counts();
    let before = counts(window);
    let view = window.app().view.navigation.goal_camera();
    let (dots, look) = (window.app().view.look.dots, window.app().ui.panels.look);
    let (inputs, statistics) = (window.app().ui.panels.inputs.open, window.app().ui.panels.statistics);
    let orthographic = window.app().view.navigation.is_orthographic();
    match command {
        Command::InvertSelection | Command::HideSelected | Command::DeleteSelected | Command::CropToSelected => {
            // Half of the points, selected without waiting for a picture.
            window.harness.state_mut().session.change(|document| {
                let shown = document.shown();
                document.select(&shown, |index| index % 2 == 0, crate::session::SelectMode::Replace);
            });
        }
        _ => {}
    }
    let selected = counts(window).selected;
    give(window, command);
    let after = counts(window);
    let now = window.app().view.navigation.goal_camera();
    let app = window.app();
    match command {
        // Tests open no system dialog, so that the text field appears.
        Command::Open => {
            window.until("a path can be typed", |window| window.says("Path of a file"));
            window.steps(2);
            assert!(window.harness.unnamed_widgets().is_empty(), "{:?}", window.harness.unnamed_widgets());
            window.click_on("Cancel");
            assert!(!window.says("Path of a file"), "it goes away");
        }
        Command::Export => {
            assert!(app.ui.panels.export.open && window.says("Export points"), "the dialog is open");
            window.press(Key::Escape);
            assert!(!window.app().ui.panels.export.open, "Escape closes it");
        }
        Command::Screenshot => {
            assert!(app.ui.panels.picture.open && window.says("Save picture"), "the dialog is open");
            window.press(Key::Escape);
            assert!(!window.app().ui.panels.picture.open, "Escape closes it");
        }
        Command::Film => {
            assert!(app.ui.panels.film.open && window.says("Film"), "the window is open");
            give(window, command);
            assert!(!window.app().ui.panels.film.open, "and goes");
        }
        Command::SaveState => {
            assert!(app.ui.panels.session.open && window.says("Save session"), "the dialog is open");
            window.press(Key::Escape);
            assert!(!window.app().ui.panels.session.open, "Escape closes it");
        }
        Command::CloseAll => {
            assert!(app.session.document().layers.is_empty(), "nothing is open any more");
            give(window, Command::Undo);
            assert_eq!(counts(window).points, before.points, "undo opens it again");
        }
        Command::Quit => assert!(window.commands.contains(&ViewportCommand::Close), "the window is to close"),
        Command::Undo | Command::Redo => {
            give(window, Command::SelectAll);
            give(window, Command::DeleteSelected);
            assert_eq!(counts(window).deleted, before.points, "all is deleted");
            give(window, Command::Undo);
            assert_eq!(counts(window).deleted, 0, "undo brings it back");
            give(window, Command::Redo);
            assert_eq!(counts(window).deleted, before.points, "redo takes it away");
            give(window, Command::Undo);
            window.settle();
        }
        Command::SelectAll => assert_eq!(after.selected, after.points, "all is selected"),
        Command::SelectNone => assert_eq!(after.selected, 0, "nothing is selected"),
        Command::InvertSelection => assert_eq!(after.selected, after.points - selected, "the others are selected"),
        Command::HideSelected => {
            assert_eq!(after.hidden, before.hidden + selected, "half is hidden");
            give(window, Command::ShowAll);
            assert_eq!(counts(window).hidden, 0, "and shown again");
        }
        Command::ShowAll => assert_eq!(after.hidden, 0, "nothing is hidden"),
        Command::DeleteSelected | Command::CropToSelected => {
            let gone = if command == Command::DeleteSelected { selected } else { before.points - selected };
            assert_eq!(after.deleted, gone, "{command:?}");
            give(window, Command::Undo);
            assert_eq!(counts(window).deleted, 0, "undone");
        }
        Command::FitAll | Command::FitSelected => {
            let far = Camera { eye: view.eye + 100.0 * (view.eye - view.look_at), ..view };
            window.harness.state_mut().view.navigation.go_to(&far, true);
            give(window, command);
            let fitted = window.app().view.navigation.goal_camera();
            let distance = fitted.eye.distance(fitted.look_at);
            assert!(distance < 0.1 * far.eye.distance(far.look_at), "{command:?} comes near: {distance}");
        }
        Command::View(direction) => {
            if let Some(wanted) = wanted(direction) {
                let angle = forward(window).angle_between(wanted).to_degrees();
                // A view straight down has no horizon, so the camera is slightly tilted.
                assert!(angle < 1.0, "{direction:?} looks along {:?}", forward(window));
            } else {
                assert_ne!(now, view, "{direction:?} stands elsewhere");
            }
        }
        Command::OppositeView => {
            let up = app.session.up();
            let [a, b] = [view, now].map(|camera| (camera.look_at - camera.eye).reject_from(up));
            let other = if a.length() > 1e-2 * view.eye.distance(view.look_at) { a.dot(b) < 0.0 } else { now != view };
            assert!(other, "{view:?} to {now:?}");
        }
        Command::Projection => assert_ne!(app.view.navigation.is_orthographic(), orthographic, "the other projection"),
        Command::UpAxis => {
            assert_eq!(app.session.up_axis, Some(Axes::ZUp), "first Z");
            for axes in Axes::ALL[1..].iter().copied().map(Some).chain([None]) {
                give(window, command);
                assert_eq!(window.app().session.up_axis, axes, "then the next");
            }
        }
        Command::Level => {
            let tilted = Camera { up: view.up + 0.5 * DVec3::X, ..Camera { eye: view.look_at + DVec3::Y, ..view } };
            window.harness.state_mut().view.navigation.go_to(&tilted, true);
            give(window, command);
            let camera = window.app().view.navigation.goal_camera();
            let [right, ..] = camera.axes().expect("it sees");
            assert!(right.dot(window.app().session.up()).abs() < 1e-9, "the horizon is level: {right}");
        }
        Command::CopyView => {
            let copied = window.outputs.iter().find_map(|output| match output {
                OutputCommand::CopyText(text) => Some(text.clone()),
                _ => None,
            });
            let copied: Camera = serde_json::from_str(&copied.expect("something is copied")).expect("it is a camera");
            assert_eq!(copied, view, "the one that sees");
        }
        Command::PasteView => {
            let wanted = view.eye + DVec3::new(0.25, 0.5, 0.0);
            assert!(now.eye.distance(wanted) < 1e-6, "{} is not {wanted}", now.eye);
        }
        Command::Play => {
            let playing = app.session.playing.clock.playing;
            give(window, command);
            assert_ne!(window.app().session.playing.clock.playing, playing, "it goes on, or stops");
            give(window, command);
        }
        // Nothing plays here; tests of these commands are in `playing`.
        Command::StepBack | Command::StepForward | Command::PlayFromHere | Command::PlayToHere => {
            assert_eq!(app.session.playing.clock.position(), 0.0, "there is no other time");
        }
        Command::Dots => {
            assert_ne!(app.view.look.dots, dots, "the other kind of picture");
            window.settle();
            give(window, command);
        }
        Command::Inputs => assert_ne!(app.ui.panels.inputs.open, inputs, "the list comes or goes"),
        Command::Look => assert_ne!(app.ui.panels.look, look, "the panel comes or goes"),
        Command::Statistics => assert_ne!(app.ui.panels.statistics, statistics, "the window comes or goes"),
        Command::Help => {
            assert!(window.says("Keys and mouse"), "the help is there");
            give(window, command);
            assert!(!window.app().ui.panels.help, "and goes");
            window.event(Event::Text("?".into()));
            assert!(window.app().ui.panels.help, "and comes by the other key");
            give(window, command);
        }
        Command::Clip => {
            let clips = |window: &Window| window.app().session.document().clip.is_some_and(|clip| clip.enabled);
            assert!(clips(window), "a box is around the points");
            give(window, command);
            assert!(!clips(window), "and clips no longer");
        }
        Command::NextPart | Command::PreviousPart => {
            assert!(focused(window).is_some(), "a control has the keyboard");
            window.press(Key::Escape);
            assert_eq!(focused(window), None, "Escape gives it back");
        }
        Command::Tool(tool) => assert_eq!(app.ui.tools.current, tool, "the tool is taken"),
        #[allow(unreachable_patterns, reason = "a new command has no case before it is written")]
        other => panic!("{other:?}: say here what its key does"),
    }
}

/// The focused control, if any.
fn focused(window: &Window) -> Option<egui::Id> {
    window.harness.ctx.memory(|memory| memory.focused())
}

/// Place of the focused control in the window.
fn place(window: &Window) -> Pos2 {
    let response = window.harness.ctx.read_response(focused(window).expect("something has the keyboard"));
    response.expect("it is seen").rect.center()
}

#[test]
fn f6_goes_round_the_window_and_tab_through_a_panel() {
    let mut window = Window::with_statue();
    window.press(Key::L);
    window.press(Key::P);
    window.settle();
    let mut places = Vec::new();
    for _ in 0..20 {
        window.press(Key::F6);
        window.step();
        if focused(&window).is_none() {
            break;
        }
        places.push(place(&window));
    }
    // The menu, the status line, the list of inputs, the look panel and the statistics.
    assert_eq!(places.len(), 5, "each part once, then the picture: {places:?}");
    let picture = window.picture();
    assert!(places[0].y < picture.top() && places[1].y > picture.bottom(), "above and below: {places:?}");
    assert!(places[2].x < picture.left() && places[3].x > picture.right(), "left and right: {places:?}");
    assert!(picture.contains(places[4]), "a window over the picture: {places:?}");
    for wanted in places.iter().rev() {
        window.key(SHIFT, Key::F6);
        window.step();
        assert_eq!(place(&window), *wanted, "backwards");
    }
    let dots = window.app().view.look.dots;
    (0..3).for_each(|_| window.press(Key::F6));
    assert!(place(&window).x > picture.right(), "the look panel");
    for _ in 0..4 {
        let before = place(&window);
        window.press(Key::Tab);
        window.step();
        assert!(place(&window) != before && place(&window).x > picture.right(), "from control to control in it");
    }
    let selected = |window: &Window| window.app().session.document().counts().selected;
    window.harness.state_mut().session.change(|document| {
        let shown = document.shown();
        document.select(&shown, |_| true, crate::session::SelectMode::Replace);
    });
    window.press(Key::Escape);
    assert_eq!(focused(&window), None, "Escape gives the keyboard back to the picture");
    assert!(selected(&window) > 0 && window.app().view.look.dots == dots, "and does nothing else");
    window.press(Key::Tab);
    assert_ne!(window.app().view.look.dots, dots, "there Tab is for points and surface");
    window.press(Key::Escape);
    assert_eq!(selected(&window), 0, "and Escape for the selection");
}

#[test]
fn every_key_does_what_its_command_says() {
    let mut window = Window::with_statue();
    for command in Command::ALL {
        if command.shortcut().is_none() {
            continue;
        }
        window.press(Key::Escape);
        window.press(Key::Escape);
        window.press(Key::Escape);
        // A camera that no view has.
        let mut camera = elsewhere(&window);
        camera.projection = autosplats::Projection::PerspectiveFovDeg(40.0);
        window.harness.state_mut().view.navigation.go_to(&camera, true);
        if command == Command::View(ViewDirection::Front) {
            // The expected directions are for Z upward.
            window.harness.state_mut().session.up_axis = Some(Axes::ZUp);
        } else if command == Command::UpAxis {
            window.harness.state_mut().session.up_axis = None;
        }
        if window.app().view.shown(&window.app().session).is_none() {
            window.settle();
        }
        check(&mut window, command);
    }
    window.settle();
}

#[test]
fn keys_that_are_typed_are_no_commands() {
    let mut window = Window::with_statue();
    window.key(CTRL, Key::E);
    window.steps(2);
    let (dots, look) = (window.app().view.look.dots, window.app().ui.panels.look);
    window.press(Key::L);
    window.press(Key::Delete);
    assert_eq!((window.app().view.look.dots, window.app().ui.panels.look), (dots, look), "letters go into the text");
    window.press(Key::Escape);
    window.steps(2);
    window.press(Key::L);
    assert_ne!(window.app().ui.panels.look, look, "without the text L opens a panel");
}
