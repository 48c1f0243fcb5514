//! A restored session plays as before.

use super::*;
use crate::session::Appearance;
use crate::view::State;

/// The application that restores the session at `path`.
fn again(path: &Path, context: &egui::Context) -> App {
    let options = Options { backend: Some(Backend::Cpu), ..Options::default() };
    let mut app = App::new(options, Look::default(), Vec::new(), context);
    let folder = path.parent().expect("a folder");
    State::read(path).expect("a session").restore(&mut app.session, &mut app.view, folder);
    app
}

/// The inputs of a session, as JSON.
fn inputs(app: &App) -> serde_json::Value {
    serde_json::to_value(State::of(&app.session, &app.view)).expect("a state")["inputs"].take()
}

#[test]
fn a_session_plays_the_same() {
    let folder = tempfile::tempdir().expect("a folder");
    let context = egui::Context::default();
    let mut input = Input::parse(&sequence(folder.path(), 5)).expect("a folder");
    input.play.fps = Some(2.0);
    input.play.latest.accumulate = true;
    let mut first = app_of(input, &context);
    first.session.playing.clock.toggle();
    let clock = &mut first.session.playing.clock;
    clock.seek(0.5);
    clock.begin_here();
    clock.seek(2.0);
    clock.end_here();
    clock.seek(1.75);
    (clock.speed, clock.looped) = (0.25, false);
    // All four frames so far, accumulated.
    until(&mut first, "the fourth frame", |app| app.session.document().counts().points == 160);
    let id = first.session.document().layers[0].id;
    first.session.settle(|document| document.set_tint(id, Some([1, 2, 3])));
    let kept = State::of(&first.session, &first.view);
    let path = folder.path().join("state.json");
    kept.write(&path).expect("written");

    let mut second = again(&path, &context);
    let clock = |app: &App| serde_json::to_string(&app.session.playing.clock).expect("a clock");
    assert_eq!(inputs(&second), inputs(&first), "all of it, even before anything is open");
    assert_eq!(clock(&second), clock(&first), "and when");
    until(&mut second, "the fourth frame", |app| app.session.document().counts().points == 160);
    assert_eq!(clock(&second), clock(&first), "nor does time pass until then");
    assert_eq!(second.session.playing.clock.length(), 2.5, "at its own rate");
    assert_eq!(second.session.playing.frame(), Some((3, 5)));
    assert_eq!(second.session.document().layers[0].tint, Some([1, 2, 3]), "in its colour");
    second.session.playing.step(true);
    until(&mut second, "the fifth frame", |app| app.session.document().counts().points == 200);
}

#[test]
fn what_waits_or_failed_is_kept_as_it_is_to_look() {
    let folder = tempfile::tempdir().expect("a folder");
    let context = egui::Context::default();
    let options = Options { backend: Some(Backend::Cpu), ..Options::default() };
    let mut first = App::new(options, Look::default(), Vec::new(), &context);
    let mut input = Input::parse(&folder.path().display().to_string()).expect("a folder");
    input.world_from_input = autosplats::cloud::glam::DMat4::from_rotation_z(0.5);
    let appearance = Appearance { visible: false, tint: Some([9, 8, 7]) };
    first.session.open_as(input, appearance);
    let waiting = State::of(&first.session, &first.view);
    let path = folder.path().join("state.json");
    waiting.write(&path).expect("written");
    // The folder holds nothing that can be played.
    until(&mut first, "the failure", |app| app.session.playing.is_empty());
    assert_eq!(State::of(&first.session, &first.view), waiting, "what failed is no less a part of it");
    let second = again(&path, &context);
    assert_eq!(second.session.playing.waiting().next().map(|waiting| waiting.appearance), Some(appearance));
    assert_eq!(inputs(&second), inputs(&first), "nor is what still waits");
}
