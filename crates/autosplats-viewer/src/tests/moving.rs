//! Playing inputs, in the whole window.

use std::path::Path;

use autosplats_sources::Source;

use super::*;
use crate::ui::Command;

/// Frames of 400 points each. Each frame is shifted to the right of the one before.
fn frames(folder: &Path, count: usize) -> Input {
    for frame in 0..count {
        let rows: String = (0..400).map(|i| format!("{} {} {}\n", frame * 3 + i % 20, i / 20, i % 3)).collect();
        std::fs::write(folder.join(format!("frame_{frame}.xyz")), rows).expect("a frame");
    }
    Input::parse(&folder.display().to_string()).expect("a folder")
}

/// A window that shows the first points of some inputs.
fn playing(inputs: Vec<Input>) -> Window {
    let mut window = Window::new(&[]);
    let count = inputs.len();
    inputs.into_iter().for_each(|input| window.harness.state_mut().session.open(input));
    window.until("the first points", |window| window.app().session.document().layers.len() == count);
    window
}

#[test]
fn what_is_live_goes_on_when_a_recording_has_ended() {
    let [folder, live] = [(); 2].map(|()| tempfile::tempdir().expect("a folder"));
    let mut watched = frames(live.path(), 1);
    watched.play.watch = true;
    let mut window = playing(vec![frames(folder.path(), 3), watched]);
    window.harness.state_mut().session.playing.clock.looped = false;
    window.until("the end", |window| {
        let clock = &window.app().session.playing.clock;
        clock.position() == clock.length() && clock.length() > 0.0
    });
    window.steps(20);
    assert!(
        window.app().session.playing.clock.playing && window.app().session.playing.is_live(),
        "only one of them has ended"
    );
    std::fs::write(live.path().join("frame_1.xyz"), "50 0 0\n51 0 0\n50 1 0\n").expect("a frame");
    window.until("newer points", |window| {
        let layers = &window.app().session.document().layers;
        layers.iter().any(|layer| layer.cloud.len() == 3)
    });
    let live =
        window.app().session.document().layers.iter().find(|layer| layer.cloud.len() == 3).expect("it is there").id;
    window.harness.state_mut().session.give_up(live);
    window.steps(3);
    assert!(!window.app().session.playing.clock.playing, "with nothing live it stops at its end");
}

#[test]
fn what_waits_is_in_the_list() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut input = Input::parse(&folder.path().display().to_string()).expect("a folder");
    input.play.watch = true;
    let name = input.name.clone();
    let mut window = Window::new(&[]);
    window.harness.state_mut().session.open(input);
    window.until("a word", |window| window.says("waits for points"));
    assert!(window.says(&name), "with its name: {:?}", window.words());
    assert!(!window.says("Drop point clouds here") && !window.says("Nothing is open"), "something is open");
    window.click_on("×");
    window.steps(2);
    assert!(window.says("Nothing is open") && window.app().session.playing.is_empty(), "it was given up");
}

#[test]
fn the_inspector_says_how_recordings_are_aligned() {
    let Some(data) = data() else { return };
    let recording = |name: &str| Input::parse(&data.join("sequences").join(name).display().to_string()).expect("one");
    let twice = [(); 2].map(|()| recording("ouster_ros2_cdr.mcap")).to_vec();
    assert!(matches!(twice[0].source, Source::Recording(_)), "by its name");
    let mut window = playing(twice);
    let words = |window: &Window| {
        let ids: Vec<_> = window.app().session.document().layers.iter().map(|layer| layer.id).collect();
        ids.into_iter().map(|id| window.app().session.playing.alignment(id)).collect::<Vec<_>>()
    };
    let by_clock = |words: &[Option<String>]| {
        words.iter().all(|words| words.as_ref().is_some_and(|words| words.contains("by its time stamps")))
    };
    window.until("both are open", |window| by_clock(&words(window)));
    // Points of both inputs lie at the same places.
    window.harness.state_mut().ui.tools.inspected = {
        let document = window.app().session.document();
        document.describe(&document.shown(), 0)
    };
    window.steps(3);
    assert!(window.says("Begins") && window.says("0.000 s after the first input, by its time stamps"), "it is told");
    let folder = tempfile::tempdir().expect("a folder");
    let first = window.app().session.document().layers[0].id;
    window.harness.state_mut().session.give_up(first);
    window.harness.state_mut().session.open(frames(folder.path(), 3));
    window.until("the folder", |window| window.app().session.document().layers.len() == 2);
    window.until("both", |window| words(window).iter().all(Option::is_some));
    assert!(!by_clock(&words(&window)), "files have no clock: {:?}", words(&window));
}

/// Records a film with a time choice of the dialog, and returns its pictures.
fn film(window: &mut Window, choice: &str, path: &Path) -> Vec<Vec<u8>> {
    window.click_on(choice);
    window.harness.get_by_role(Role::TextInput).focus();
    window.steps(2);
    window.key(CTRL, Key::A);
    window.event(Event::Text(path.display().to_string()));
    window.press(Key::Enter);
    window.until("the film", |window| window.app().view.recording.is_some());
    window.until("its end", |window| window.app().view.recording.is_none());
    // The dialog is open again.
    window.steps(2);
    let stem = path.file_stem().expect("a name").to_string_lossy().into_owned();
    let file = |number: usize| path.with_file_name(format!("{stem}_{number:05}.png"));
    (0..).map(file).take_while(|file| file.exists()).map(|file| std::fs::read(file).expect("a picture")).collect()
}

#[test]
fn films_show_what_moves_or_stand_still() {
    let [folder, out] = [(); 2].map(|()| tempfile::tempdir().expect("a folder"));
    let mut window = playing(vec![frames(folder.path(), 3)]);
    window.harness.state_mut().session.playing.clock.toggle();
    window.harness.state_mut().session.playing.clock.seek(0.0);
    window.settle();
    let context = window.harness.ctx.clone();
    window.harness.state_mut().run(Command::Film, &context);
    window.steps(3);
    assert!(window.says("0.00 to 0.30 s at 1.00×, repeatedly"), "it runs: {:?}", window.words());
    window.harness.state_mut().ui.panels.film.still_for_tests();
    let once = film(&mut window, "runs once", &out.path().join("once.png"));
    assert_eq!(once.len(), 3, "ten a second for 0.3 s");
    assert!(once[0] != once[1] && once[1] != once[2], "each another frame, of the same camera");
    let runs = film(&mut window, "runs", &out.path().join("runs.png"));
    assert_eq!(runs.len(), 5, "as long as it is told");
    assert_eq!([&runs[..3], &runs[3..]], [&once[..], &once[..2]], "around and around");
    let stands = film(&mut window, "stands still", &out.path().join("stands.png"));
    assert!(stands.len() == 5 && stands.iter().all(|picture| *picture == once[0]), "what is seen now");
}
