//! Inputs that are played again: after undo, and after a reload.

use super::*;

/// Removes the only layer, as its menu does.
fn remove(app: &mut App) {
    let id = app.session.document().layers[0].id;
    app.session.edit("Remove an input", |document| document.remove(id));
    app.session.follow_streams(0.0);
    assert!(app.session.playing.is_empty(), "it is not read any more");
}

/// An application stopped at the fourth of five frames, so that its points can be edited.
fn at_the_fourth(folder: &Path, context: &egui::Context) -> App {
    let mut app = app(&sequence(folder, 5), context);
    app.session.playing.clock.toggle();
    app.session.playing.clock.seek(0.35);
    until(&mut app, "the fourth frame", |app| left(app) == Some(30.0));
    until(&mut app, "a pause", |app| !app.session.document().layers[0].incomplete);
    app
}

#[test]
fn undo_brings_a_layer_back_with_its_stream() {
    let folder = tempfile::tempdir().expect("a folder");
    let context = egui::Context::default();
    let mut app = at_the_fourth(folder.path(), &context);
    remove(&mut app);
    app.session.undo();
    until(&mut app, "its timeline", |app| app.session.playing.has_timeline());
    assert_eq!(
        (app.session.playing.frame(), left(&app)),
        (Some((3, 5)), Some(30.0)),
        "at the time at which it was removed"
    );
    app.session.playing.step(true);
    until(&mut app, "the fifth frame", |app| left(app) == Some(40.0));
    remove(&mut app);
    app.session.history = crate::session::History::default();
    app.session.follow_streams(0.0);
    assert!(app.session.playing.removed.is_empty(), "what undo cannot bring back is forgotten");
}

#[test]
fn undo_brings_edits_back_with_their_time() {
    let folder = tempfile::tempdir().expect("a folder");
    let context = egui::Context::default();
    let mut app = at_the_fourth(folder.path(), &context);
    delete(&mut app);
    remove(&mut app);
    // The clock moves on meanwhile.
    app.session.playing.clock.seek(0.1);
    app.session.undo();
    until(&mut app, "its timeline", |app| app.session.playing.has_timeline());
    (0..20).for_each(|_| {
        app.session.follow_streams(0.0);
        std::thread::sleep(Duration::from_millis(2));
    });
    assert_eq!(app.session.document().counts().deleted, 7, "they are still there");
    assert_eq!(
        (app.session.playing.frame(), left(&app)),
        (Some((3, 5)), Some(30.0)),
        "on the points that they were made on"
    );
}

#[test]
fn what_is_played_is_read_again_where_it_stands() {
    let folder = tempfile::tempdir().expect("a folder");
    let context = egui::Context::default();
    let mut app = at_the_fourth(folder.path(), &context);
    let id = app.session.document().layers[0].id;
    app.session.playing.clock.begin_here();
    std::fs::write(folder.path().join("frame_3.xyz"), "77 0 0\n78 0 0\n77 1 0\n").expect("another frame");
    app.session.reload_layer(id);
    assert_eq!(app.session.playing.clock.position(), 0.35, "while it is opened");
    until(&mut app, "the new frame", |app| left(app) == Some(77.0));
    assert_eq!(
        (app.session.playing.frame(), app.session.document().layers.len()),
        (Some((3, 5)), 1),
        "in the same place"
    );
    assert_eq!(app.session.playing.clock.span()[0], 0.35, "and so is the part that is played");
    delete(&mut app);
    assert!(app.session.history.is_unsaved(id), "the comparison can tell");
    std::fs::write(folder.path().join("frame_3.xyz"), "99 0 0\n98 0 0\n99 1 0\n").expect("another frame");
    app.session.reload_layer(id);
    (0..20).for_each(|_| {
        app.session.follow_streams(0.0);
        std::thread::sleep(Duration::from_millis(2));
    });
    assert_eq!(left(&app), Some(77.0), "what has edits is not read again");
}

#[test]
fn what_has_ended_can_be_played_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let context = egui::Context::default();
    let mut app = at_the_fourth(folder.path(), &context);
    let id = app.session.document().layers[0].id;
    let away = folder.path().join("away");
    std::fs::create_dir(&away).expect("a folder");
    for frame in 0..5 {
        let name = format!("frame_{frame}.xyz");
        std::fs::rename(folder.path().join(&name), away.join(&name)).expect("moved away");
    }
    app.session.reload_layer(id);
    until(&mut app, "the failure", |app| app.session.playing.is_empty());
    assert_eq!(
        (left(&app), app.session.failed.len()),
        (Some(30.0), 0),
        "what was there stays, and is in a session once"
    );
    sequence(folder.path(), 5);
    app.session.reload_layer(id);
    until(&mut app, "its timeline", |app| app.session.playing.has_timeline());
    app.session.playing.step(true);
    until(&mut app, "the fifth frame", |app| left(app) == Some(40.0));
}
