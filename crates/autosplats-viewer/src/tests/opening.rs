//! From a name to a picture, or to an explanation why there is none.

use std::path::{Path, PathBuf};

use autosplats::Camera;
use autosplats::cloud::glam::DVec3;
use autosplats::cloud::{FieldValues, PointCloud};

use super::*;
use crate::session::StoredInput;
use crate::view::storage;

#[test]
fn a_scene_is_shown_and_listed() {
    let window = Window::with_statue();
    let app = window.app();
    let shot = app.view.shot.as_ref().expect("there is a picture");
    assert_eq!(app.session.document().layers.len(), 1, "one thing is open");
    assert!(window.says(STATUE), "its name is in the list: {:?}", window.words());
    let points = app.session.document().layers[0].cloud.len();
    assert!(window.says(&format!("{} points", crate::session::document::grouped(points))), "and its number of points");
    let [width, height] = shot.size;
    let share = shot.counts.covered as f64 / f64::from(width * height);
    // The first view of the statue fills about half of the picture.
    assert!((0.1..0.9).contains(&share), "the surface covers {share} of the picture");
}

#[test]
fn what_cannot_be_read_says_why_in_place() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let broken = folder.path().join("broken.ply");
    std::fs::write(&broken, "ply\nformat ascii 1.0\nelement vertex 3\nend_header\n").expect("it can be written");
    let absent = folder.path().join("absent.laz");
    let names = [&broken, &absent].map(|path| path.display().to_string());
    let mut window = Window::new(&[&*names[0], &*names[1], STATUE]);
    window.settle();
    for name in ["broken.ply", "absent.laz"] {
        assert!(window.says(name), "{name} is explained: {:?}", window.words());
    }
    assert_eq!(window.app().session.document().layers.len(), 1, "what can be read is there all the same");
    // Errors stay until they are closed.
    window.steps(700);
    assert!(window.says("broken.ply"), "errors do not go by themselves");
    let closers = |window: &Window| window.harness.query_all_by_label_contains("Close this message").count();
    // Without a label, the button is named by its tooltip or by its text.
    if closers(&window) == 0 {
        window.harness.get_all_by_label("×").next().expect("a message can be closed").click();
    } else {
        window.harness.query_all_by_label_contains("Close this message").next().expect("counted").click();
    }
    window.steps(3);
    let left = ["broken.ply", "absent.laz"].into_iter().filter(|name| window.says(name)).count();
    assert_eq!(left, 1, "one message was closed: {:?}", window.words());
}

#[test]
fn the_first_view_is_the_same_whoever_finds_it() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let path = folder.path().join("slope.xyz");
    let rows: String = (0..500).map(|i| format!("{} {} {}\n", i % 25, i / 25, i % 7)).collect();
    std::fs::write(&path, rows).expect("it can be written");
    // The reading thread knows the picture's shape once the window has been drawn.
    let mut window = Window::new(&[]);
    window.settle();
    window.harness.state_mut().session.open(Input::file(path));
    window.until("it is read", |window| !window.app().session.document().layers.is_empty());
    window.settle();
    let camera = window.app().view.navigation.goal_camera();
    // The navigation keeps orientations as quaternions, whose conversion rounds.
    let same = |other: Camera| camera.eye.distance(other.eye) < 1e-6 && camera.look_at.distance(other.look_at) < 1e-6;
    let (_, glance) = window.app().session.glance.clone().expect("the thread that read it has looked at it");
    assert!(glance.camera.is_some_and(same), "where it says: {glance:?} is not {camera:?}");
    let app = window.harness.state_mut();
    app.session.glance = None;
    app.view.navigation.orbit(autosplats::cloud::glam::DVec2::new(0.3, 0.1));
    assert!(!same(app.view.navigation.goal_camera()), "the comparison can tell");
    app.view.first_view(&app.session);
    assert!(same(app.view.navigation.goal_camera()), "as the window finds it by itself");
}

#[test]
fn settings_survive_other_versions() {
    let mut look = Look { dots: true, dot_size: 5, ..Look::default() };
    look.settings.reconstruction.k = 33;
    let text = serde_json::to_string(&look).expect("a look can be written");
    let read: Look = serde_json::from_str(&text).expect("and read");
    assert_eq!(read, look, "as it was");
    assert_ne!(read, Look::default(), "the comparison can tell two looks apart");
    let newer = text.replacen('{', r#"{"not_yet_known":[1,2],"#, 1);
    assert_eq!(serde_json::from_str::<Look>(&newer).expect("fields of a newer version are left out"), look, "the rest");
    let older: Look = serde_json::from_str(r#"{"dot_size":7}"#).expect("missing fields are as in the beginning");
    assert_eq!(older, Look { dot_size: 7, ..Look::default() }, "all but one");
    assert!(serde_json::from_str::<Look>(r#"{"dot_size":"wide"}"#).is_err(), "what is no number is an error");
}

/// Settings in memory.
#[derive(Default)]
struct Memory(std::collections::HashMap<String, String>);

impl eframe::Storage for Memory {
    fn get_string(&self, key: &str) -> Option<String> {
        self.0.get(key).cloned()
    }

    fn set_string(&mut self, key: &str, value: String) {
        self.0.insert(key.into(), value);
    }

    fn remove_string(&mut self, key: &str) {
        self.0.remove(key);
    }

    fn flush(&mut self) {}
}

/// A recording with play options.
fn played() -> Input {
    let mut input = Input::parse("/some/drive.mcap").expect("a recording");
    (input.play.topics, input.play.fps) = (vec!["/front".into()], Some(5.0));
    input.play.latest.decay = Some(Duration::from_secs(2));
    input
}

#[test]
fn settings_are_kept_between_starts() {
    let mut window = Window::new(&[]);
    window.harness.state_mut().view.look.dot_size = 6;
    window.harness.state_mut().view.look.two_fingers = crate::view::TwoFingers::Pan;
    window.harness.state_mut().session.recent = vec![StoredInput::of(&played(), crate::session::Appearance::default())];
    let mut memory = Memory::default();
    storage::save(&window.app().session, &window.app().view, &mut memory);
    let (look, recent) = storage::load(Some(&memory));
    assert_eq!(look, window.app().view.look, "the look comes back");
    assert_eq!(recent, window.app().session.recent, "and what was opened");
    let (again, _) = recent[0].clone().open(Path::new("")).expect("a recording");
    assert_eq!(again.play, played().play, "played as it was");
    let broken = memory.0.keys().map(|key| (key.clone(), "(((".to_owned())).collect();
    assert_eq!(storage::load(Some(&Memory(broken))), (Look::default(), Vec::new()), "what is broken is left behind");
    let paths: Vec<PathBuf> = vec!["/some/where.ply".into()];
    eframe::set_value(&mut memory, "recent", &paths);
    assert_eq!(
        storage::load(Some(&memory)).1,
        [StoredInput::named("/some/where.ply".into())],
        "an older version's paths"
    );
    assert_eq!(storage::load(None).0, Look::default(), "nothing was kept");
    // Values that the renderer rejects become defaults too.
    window.harness.state_mut().view.look.settings.reconstruction.k = 100_000;
    storage::save(&window.app().session, &window.app().view, &mut memory);
    assert_eq!(storage::load(Some(&memory)).0, Look::default(), "k of 100,000 is out of range");
}

#[test]
fn noise_is_hidden_and_comes_back_with_a_click() {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let path = folder.path().join("wall.las");
    let wall = (0..1000).map(|i| [(i % 40) as f32, 0.0, (i / 40) as f32]);
    let noise = (0..50).map(|i| [(i % 5) as f32, 0.0, 9000.0 + (i / 5) as f32]);
    let classes = (0..1050).map(|i| if i < 1000 { 2 } else { 7 }).collect();
    let cloud = PointCloud::new(DVec3::ZERO, wall.chain(noise).collect());
    let cloud = cloud.with_field("Classification", FieldValues::U8(classes)).expect("a class each");
    autosplats_formats::write(&cloud, &path, &()).expect("it can be written");
    let mut window = Window::new(&[&*path.display().to_string()]);
    window.settle();
    let shown = |window: &Window| window.app().view.shot.as_ref().expect("there is a picture").shown.len();
    let share = window.app().view.shot.as_ref().map_or(0, |shot| shot.counts.covered) as f32 / window.picture().area();
    assert!(share > 0.05, "the camera sees the wall, not the noise: {share}");
    assert_eq!(window.app().session.document().layers[0].cloud.len(), 1050, "an export has all points");
    assert_eq!(shown(&window), 1000, "noise is not drawn");
    assert!(window.says("left out 50 of 1050 points: 50 low noise (class 7)"), "told: {:?}", window.words());
    assert!(window.says("50 hidden"), "beside the name too");

    window.click_on("Show");
    window.settle();
    assert_eq!(shown(&window), 1050, "a click brings them back");
    let id = window.app().session.document().layers[0].id;
    let kept = |window: &Window| {
        let input = &window.app().session.inputs[&id];
        let text = serde_json::to_string(&StoredInput::of(input, crate::session::Appearance::default()));
        text.expect("it can be written")
    };
    assert!(kept(&window).contains(r#""keep":"all""#), "a session remembers: {}", kept(&window));
    for (words, points) in [("usual", 1000), ("noise", 50), ("road", 50), ("-noise", 1000)] {
        window.harness.state_mut().session.keep(id, words.parse().expect("a filter"));
        window.settle();
        assert_eq!(shown(&window), points, "{words}");
    }
    assert!(window.says("--keep road leaves none"), "what leaves nothing changes nothing: {:?}", window.words());
    assert!(kept(&window).contains(r#""keep":"-noise""#), "the last: {}", kept(&window));
}
