//! Dialogs by keyboard alone: Enter performs their action, Escape closes them, and no file is replaced without a
//! question.

use std::path::{Path, PathBuf};

use super::*;
use crate::ui::Command;

/// Opens a dialog and types the output file.
fn ask(window: &mut Window, command: Command, path: &Path) {
    let context = window.harness.ctx.clone();
    window.harness.state_mut().run(command, &context);
    window.steps(3);
    if command == Command::Film {
        // A full film of two hundred large pictures would test nothing more.
        window.harness.state_mut().ui.panels.film.still_for_tests();
        // The film dialog leaves the keyboard to the picture, so the field has to be focused.
        let line = window.harness.get_by_role(Role::TextInput);
        line.focus();
        window.steps(2);
    }
    window.key(CTRL, Key::A);
    window.event(Event::Text(path.display().to_string()));
    window.step();
}

/// The four dialogs, and a file name for each.
const DIALOGS: [(Command, &str); 4] = [
    (Command::Export, "points.ply"),
    (Command::Screenshot, "picture.png"),
    (Command::Film, "film.png"),
    (Command::SaveState, "session.json"),
];

fn is_open(window: &Window, command: Command) -> bool {
    let panels = &window.app().ui.panels;
    match command {
        Command::Export => panels.export.open,
        Command::Screenshot => panels.picture.open,
        Command::Film => panels.film.open,
        _ => panels.session.open,
    }
}

/// The first file that a dialog writes: for a film its first picture.
fn written(folder: &Path, name: &str) -> PathBuf {
    folder.join(if name == "film.png" { "film_00000.png" } else { name })
}

#[test]
fn enter_writes_and_replaces_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut window = Window::with_statue();
    for (command, name) in DIALOGS {
        ask(&mut window, command, &folder.path().join(name));
        window.press(Key::Enter);
        let file = written(folder.path(), name);
        window.until(name, |window| file.is_file() && window.app().view.recording.is_none());
        window.until("it is told", |window| window.says("writ"));
        window.settle();
        (0..3).for_each(|_| window.press(Key::Escape));
        assert!(!is_open(&window, command), "{name}: the dialog is gone");

        std::fs::write(&file, "mine").expect("it can be written");
        ask(&mut window, command, &folder.path().join(name));
        for _ in 0..2 {
            window.press(Key::Enter);
            window.until("a question", |window| window.says("Replace it"));
            window.steps(20);
            assert!(window.harness.ctx.text_edit_focused(), "{name}: another name can be typed");
        }
        assert_eq!(std::fs::read_to_string(&file).ok().as_deref(), Some("mine"), "{name}: nothing was replaced");
        assert!(is_open(&window, command), "{name}: the question stays");
        window.click_on("Replace it");
        window.until(name, |window| {
            window.app().view.recording.is_none() && std::fs::read(&file).is_ok_and(|bytes| bytes != b"mine")
        });
        window.settle();
        (0..3).for_each(|_| window.press(Key::Escape));
    }
}

#[test]
fn what_may_be_replaced_is_what_was_asked_about() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("points.ply");
    std::fs::write(&file, "mine").expect("it can be written");
    let mut window = Window::with_statue();
    let question = |window: &mut Window| {
        window.press(Key::Enter);
        window.until("a question", |window| window.says("Replace it"));
    };
    ask(&mut window, Command::Export, &file);
    question(&mut window);
    window.click_on("All points, including hidden ones");
    assert!(!window.says("Replace it"), "other points are another question");
    question(&mut window);
    ask(&mut window, Command::Export, &file);
    assert!(!window.says("Replace it"), "and when the dialog is opened anew");
    question(&mut window);
    ask(&mut window, Command::Export, &folder.path().join("other.ply"));
    assert!(!window.says("Replace it"), "another file, too");
    window.steps(10);
    assert_eq!(std::fs::read_to_string(&file).ok().as_deref(), Some("mine"), "nothing was replaced");
}

#[test]
fn escape_closes_a_dialog_and_writes_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut window = Window::with_statue();
    for (command, name) in DIALOGS {
        ask(&mut window, command, &folder.path().join(name));
        assert!(is_open(&window, command), "{name}: it is open");
        window.press(Key::Escape);
        assert!(!is_open(&window, command), "{name}: once is enough, though the line had the keyboard");
    }
    window.steps(20);
    assert_eq!(std::fs::read_dir(folder.path()).expect("the folder").count(), 0, "nothing was written");
}

#[test]
fn a_name_that_cannot_be_written_is_told_in_place() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut window = Window::with_statue();
    for (command, name, why) in [
        (Command::Export, "points.unknown", "unknown output format"),
        (Command::Screenshot, "picture.bmp", "The name has to end in .png"),
        (Command::Film, "film.bmp", "The name has to end in .png, .jpg, .mp4"),
        (Command::SaveState, "", "This is a folder"),
    ] {
        ask(&mut window, command, &folder.path().join(name));
        window.press(Key::Enter);
        window.until(why, |window| window.says(why));
        assert!(is_open(&window, command) && !window.says("Replace it"), "{name}: another name can be given");
        window.press(Key::Escape);
        window.step();
    }
    assert_eq!(std::fs::read_dir(folder.path()).expect("the folder").count(), 0, "nothing was written");
}

#[test]
fn enter_leaves_by_exporting() {
    let mut window = Window::with_statue();
    window.key(CTRL, Key::A);
    window.press(Key::Delete);
    window.harness.input_mut().viewports.entry(ViewportId::ROOT).or_default().events.push(egui::ViewportEvent::Close);
    window.steps(3);
    assert!(window.says("Edits are not saved"), "it is asked");
    window.press(Key::Enter);
    assert!(window.app().ui.panels.export.open && !window.app().ui.panels.quit, "Enter does no harm");
}
