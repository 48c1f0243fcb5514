mod again;
mod films;
mod sessions;

use std::path::Path;
use std::time::{Duration, Instant};

use autosplats::Backend;
use eframe::egui;

use super::{LIVE_MS, LIVE_SHARE, UpdateRate};
use crate::app::App;
use crate::view::Look;
use crate::{Input, Options};

/// Frames of 40 points each. Each frame is shifted to the right of the one before.
fn sequence(folder: &Path, frames: usize) -> String {
    for frame in 0..frames {
        let rows: String =
            (0..40).map(|point| format!("{} {} {}\n", frame * 10 + point % 8, point / 8, point % 3)).collect();
        std::fs::write(folder.join(format!("frame_{frame}.xyz")), rows).expect("a frame");
    }
    folder.display().to_string()
}

#[test]
fn pictures_of_what_is_live_are_there_before_the_next_update() {
    let mut heard = UpdateRate::default();
    assert_eq!(heard.live_ms(), LIVE_MS, "before anything is known");
    for (tick, now) in (0_u32..60).map(|tick| (u64::from(tick), f64::from(tick) * 0.05)) {
        heard.count(now, tick);
    }
    assert!((heard.live_ms() - LIVE_SHARE * 50.0).abs() < 2.0, "twenty a second: {} ms", heard.live_ms());
    heard.count(10.0, 60);
    assert_eq!(heard.live_ms(), LIVE_MS, "seldom is no reason to be slow");
    heard.count(12.0, 60);
    assert_eq!(heard.live_ms(), LIVE_MS, "nor is a pause");
}

/// Runs the application until `done` returns true.
fn until(app: &mut App, what: &str, done: impl Fn(&App) -> bool) {
    let begun = Instant::now();
    while !done(app) {
        assert!(begun.elapsed() < Duration::from_secs(60), "{what} does not come");
        app.session.follow_streams(0.0);
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Smallest x of the shown points.
fn left(app: &App) -> Option<f64> {
    let layer = app.session.document().layers.first()?;
    (0..layer.cloud.len()).map(|point| layer.cloud.world_position(point).x).reduce(f64::min)
}

fn app(name: &str, context: &egui::Context) -> App {
    app_of(Input::parse(name).expect("a folder"), context)
}

/// An application that shows the first frame of an input.
fn app_of(input: Input, context: &egui::Context) -> App {
    let options = Options { inputs: vec![input], backend: Some(Backend::Cpu), ..Options::default() };
    let mut app = App::new(options, Look::default(), Vec::new(), context);
    // The context's clock stands still, so that the first frame stays.
    until(&mut app, "the first frame", |app| left(app) == Some(0.0));
    app
}

#[test]
fn a_folder_is_played_by_the_clock() {
    let folder = tempfile::tempdir().expect("a folder");
    let context = egui::Context::default();
    let mut app = app(&sequence(folder.path(), 5), &context);
    assert!(
        (app.session.playing.clock.length() - 0.5).abs() < 1e-9,
        "ten a second: {}",
        app.session.playing.clock.length()
    );
    assert_eq!(app.session.playing.frame(), Some((0, 5)));
    app.session.playing.clock.seek(0.35);
    until(&mut app, "the fourth frame", |app| left(app) == Some(30.0));
    app.session.playing.step(true);
    until(&mut app, "the fifth frame", |app| left(app) == Some(40.0));
    assert!(!app.session.playing.clock.playing, "whoever steps wants to look");
    app.session.playing.step(true);
    assert_eq!(app.session.playing.frame(), Some((4, 5)), "there is none behind the last");
    app.session.playing.step(false);
    until(&mut app, "the fourth frame again", |app| left(app) == Some(30.0));
}

#[test]
fn edits_are_not_played_over() {
    let folder = tempfile::tempdir().expect("a folder");
    let context = egui::Context::default();
    let mut app = app(&sequence(folder.path(), 5), &context);
    let incomplete = |app: &App| app.session.document().layers[0].incomplete;
    assert!(incomplete(&app), "what moves is not edited");
    app.session.playing.clock.toggle();
    until(&mut app, "a pause", |app| !incomplete(app));
    delete(&mut app);
    app.session.playing.clock.toggle();
    app.session.follow_streams(0.0);
    assert!(!app.session.playing.clock.playing, "it waits");
    app.session.undo();
    app.session.playing.clock.toggle();
    app.session.follow_streams(0.0);
    assert!(app.session.playing.clock.playing, "nothing would be lost any more");
}

/// Deletes seven points.
fn delete(app: &mut App) {
    app.session.edit_points("Delete", |document| {
        let shown = document.shown();
        document.select(&shown, |index| index < 7, crate::session::SelectMode::Replace);
        document.delete_selected()
    });
}

#[test]
fn what_is_removed_is_not_played_on() {
    let folder = tempfile::tempdir().expect("a folder");
    let context = egui::Context::default();
    let mut app = app(&sequence(folder.path(), 5), &context);
    app.session.give_up(app.session.document().layers[0].id);
    assert!(app.session.playing.is_empty() && app.session.document().layers.is_empty(), "nothing is left of it");
}

#[test]
fn what_cannot_be_played_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let context = egui::Context::default();
    let input = Input::parse(&folder.path().display().to_string()).expect("a folder");
    let options = Options { inputs: vec![input], backend: Some(Backend::Cpu), ..Options::default() };
    let mut app = App::new(options, Look::default(), Vec::new(), &context);
    until(&mut app, "the failure", |app| app.session.playing.is_empty());
    assert_eq!(app.session.failed.len(), 1, "a session keeps its name");
    assert!(app.session.document().layers.is_empty(), "and nothing is shown");
}

#[test]
fn what_waits_for_its_first_points_says_so() {
    let folder = tempfile::tempdir().expect("a folder");
    let context = egui::Context::default();
    let mut input = Input::parse(&folder.path().display().to_string()).expect("a folder");
    input.play.watch = true;
    let options = Options { inputs: vec![input.clone()], backend: Some(Backend::Cpu), ..Options::default() };
    let mut app = App::new(options, Look::default(), Vec::new(), &context);
    let why = |app: &App| app.session.playing.waiting().next().map(|waiting| waiting.why);
    until(&mut app, "a word", |app| why(app).is_some_and(|why| why.contains("points")));
    // A stream that is paused before its first points still shows them.
    app.session.playing.clock.toggle();
    std::fs::write(folder.path().join("frame_0.xyz"), "0 0 0\n1 0 0\n0 1 0\n").expect("a frame");
    until(&mut app, "the first points", |app| left(app) == Some(0.0));
    assert_eq!(why(&app), None, "it waits no longer");
    app.session.open(input);
    assert!(why(&app).is_some(), "another one does");
    let context = egui::Context::default();
    app.run(crate::ui::Command::CloseAll, &context);
    app.session.follow_streams(0.0);
    assert!(app.session.playing.is_empty() && app.session.failed.is_empty(), "closed as all is");
}
