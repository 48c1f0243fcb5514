//! What the mouse does to the view.

use autosplats::Camera;
use autosplats::cloud::glam::{DVec2, DVec3};

use super::*;
use crate::ui::Tool;

/// Position of a world position in the picture, by shares of its sides.
fn share(window: &Window, camera: &Camera, world: DVec3) -> DVec2 {
    let size = window.app().view.shot.as_ref().expect("there is a picture").size;
    let (pixel, _) = camera.lens(size).expect("the camera sees").to_pixel(world).expect("it is before the eye");
    DVec2::new(pixel.x, pixel.y) / DVec2::new(size[0].into(), size[1].into())
}

/// World position of the surface at a place of the picture.
fn surface(window: &Window, place: DVec2) -> DVec3 {
    let picture = window.app().view.shot.as_ref().expect("there is a picture");
    picture.depths.world(&picture.camera, place).unwrap_or_else(|| panic!("there is a surface at {place}"))
}

fn camera(window: &Window) -> Camera {
    window.app().view.navigation.camera()
}

fn forward(camera: &Camera) -> DVec3 {
    (camera.look_at - camera.eye).normalize()
}

/// Tolerance by shares of the picture: depths are kept at every fourth pixel, and the surface is sloped.
const NEAR: f64 = 0.02;

#[test]
fn the_wheel_zooms_to_the_cursor() {
    wheel_zooms(Window::with_statue());
}

#[test]
fn with_pictures_of_a_gpu_too() {
    let mut window = Window::on(Backend::Gpu, &[STATUE]);
    window.settle();
    wheel_zooms(window);
}

fn wheel_zooms(mut window: Window) {
    let at = DVec2::new(0.5, 0.42);
    let world = surface(&window, at);
    let before = camera(&window);
    let place = window.place(at.x as f32, at.y as f32);
    window.event(Event::PointerMoved(place));
    window.wheel(5, 2.0);
    window.settle();
    let after = camera(&window);
    let [far, near] = [&before, &after].map(|camera| camera.eye.distance(world));
    assert!(near < 0.8 * far, "the eye comes from {far} to {near}");
    let moved = share(&window, &after, world).distance(at);
    assert!(moved < NEAR, "what is under the cursor stays there: {moved}");
    // The check can fail: a zoom to the middle moves the point.
    let toward = (before.look_at - before.eye) * (1.0 - near / far);
    let middle = Camera { eye: before.eye + toward, ..before };
    assert!(share(&window, &middle, world).distance(at) > NEAR, "the comparison can tell");
}

#[test]
fn left_drag_turns_and_right_drag_moves() {
    let mut window = Window::with_statue();
    let before = camera(&window);
    let (from, to) = (window.place(0.5, 0.5), window.place(0.65, 0.55));
    window.drag(PointerButton::Primary, Modifiers::NONE, from, to);
    window.settle();
    let turned = camera(&window);
    assert_eq!(turned.look_at, before.look_at, "about the same pivot");
    let [a, b] = [&before, &turned].map(|camera| camera.eye.distance(camera.look_at));
    assert!((a / b - 1.0).abs() < 1e-3, "from as far: {a}, {b}");
    let angle = forward(&before).angle_between(forward(&turned)).to_degrees();
    assert!(angle > 5.0, "from elsewhere: {angle}°");

    let at = DVec2::new(0.5, 0.5);
    let world = surface(&window, at);
    for (button, modifiers) in [(PointerButton::Secondary, Modifiers::NONE), (PointerButton::Primary, SHIFT)] {
        let before = camera(&window);
        let held = share(&window, &before, world);
        window.drag(button, modifiers, from, window.place(0.6, 0.4));
        window.settle();
        let moved = camera(&window);
        let angle = forward(&before).angle_between(forward(&moved)).to_degrees();
        assert!(angle < 1e-3, "{button:?} {modifiers:?}: the direction stays: {angle}°");
        let way = share(&window, &moved, world) - held;
        let wanted = DVec2::new(0.1, -0.1);
        // The second drag grabs another place, which may be nearer or farther.
        assert!(way.distance(wanted) < 0.05, "{button:?} {modifiers:?}: what was held came along: {way}");
        window.drag(button, modifiers, window.place(0.6, 0.4), from);
        window.settle();
    }
}

#[test]
fn a_double_click_makes_a_pivot() {
    let mut window = Window::with_statue();
    let at = DVec2::new(0.52, 0.45);
    let world = surface(&window, at);
    let before = camera(&window);
    let place = window.place(at.x as f32, at.y as f32);
    window.click(place);
    window.click(place);
    window
        .until("there is another pivot", |window| window.app().view.navigation.goal_camera().look_at != before.look_at);
    window.settle();
    let found = share(&window, &before, camera(&window).look_at).distance(at);
    assert!(found < NEAR, "the pivot is under the cursor: {found}");
    let size = before.eye.distance(before.look_at);
    let away = camera(&window).look_at.distance(world);
    assert!(away < 0.05 * size, "on the surface: {away} of {size}");
    assert!(before.look_at.distance(world) > 1e-3 * size, "the pivot was elsewhere before");
}

#[test]
fn points_are_inspected_and_measured_where_they_are_clicked() {
    let mut window = Window::with_statue();
    window.press(Key::X);
    let place = window.place(0.5, 0.45);
    window.click(place);
    window.until("a point is told of", |window| window.app().ui.tools.inspected.is_some());
    window.step();
    let point = window.app().ui.tools.inspected.clone().expect("it was waited for");
    assert!(window.says(&point.point.to_string()) && window.says("Index"), "its index can be read");
    for coordinate in &point.file_text {
        assert!(window.says(coordinate), "{coordinate} can be read");
    }
    let found = share(&window, &camera(&window), point.position).distance(DVec2::new(0.5, 0.45));
    assert!(found < NEAR, "it is where the click was: {found}");
    window.press(Key::M);
    assert_eq!(window.app().ui.tools.current, Tool::Measure, "M measures");
    for (number, y) in [(1, 0.40), (2, 0.55)] {
        let place = window.place(0.5, y);
        window.click(place);
        window.until("a corner is measured", |window| window.app().ui.tools.measured.len() == number);
    }
    let [a, b] = [0, 1].map(|i| window.app().ui.tools.measured[i]);
    assert!(a.distance(b) > 0.0, "two places");
    window.press(Key::Escape);
    assert!(window.app().ui.tools.measured.is_empty(), "Escape gives the measurement up");
}

/// Scrolls by fingers or wheel over the middle of the picture.
fn scroll(window: &mut Window, unit: egui::MouseWheelUnit, source: egui::MouseWheelSource, delta: Vec2) {
    let place = window.place(0.5, 0.45);
    window.event(Event::PointerMoved(place));
    for phase in [egui::TouchPhase::Start, egui::TouchPhase::Move, egui::TouchPhase::Move, egui::TouchPhase::End] {
        let delta = if phase == egui::TouchPhase::Move { delta } else { Vec2::ZERO };
        window.event(Event::MouseWheel { unit, delta, phase, modifiers: Modifiers::NONE, source });
    }
    window.settle();
}

#[test]
fn two_fingers_do_what_was_chosen_and_a_wheel_zooms() {
    use crate::view::TwoFingers;
    use egui::{MouseWheelSource as Source, MouseWheelUnit as Unit};
    let mut window = Window::with_statue();
    let first = camera(&window);
    let distance = |camera: &Camera| camera.eye.distance(camera.look_at);
    let turned = |camera: &Camera| forward(&first).angle_between(forward(camera)).to_degrees();
    for fingers in [TwoFingers::Zoom, TwoFingers::Orbit, TwoFingers::Pan] {
        window.harness.state_mut().view.look.two_fingers = fingers;
        let ways = [(Unit::Point, Source::Trackpad), (Unit::Point, Source::Unknown), (Unit::Line, Source::Wheel)];
        for (unit, source) in ways {
            window.harness.state_mut().view.navigation.go_to(&first, true);
            window.settle();
            let delta = if unit == Unit::Point { egui::vec2(40.0, 30.0) } else { egui::vec2(0.0, 2.0) };
            scroll(&mut window, unit, source, delta);
            let now = camera(&window);
            let case = format!("{fingers:?}, {unit:?}, {source:?}");
            let chosen = if unit == Unit::Line { TwoFingers::Zoom } else { fingers };
            let nearer = distance(&now) < 0.97 * distance(&first);
            let moved = now.look_at.distance(first.look_at) > 0.01 * distance(&first);
            match chosen {
                TwoFingers::Zoom => assert!(nearer && turned(&now) < 1e-3, "{case}: zooms"),
                TwoFingers::Orbit => assert!(!nearer && !moved && turned(&now) > 3.0, "{case}: turns {}", turned(&now)),
                TwoFingers::Pan => assert!(!nearer && moved && turned(&now) < 1e-3, "{case}: moves"),
            }
        }
        window.harness.state_mut().view.navigation.go_to(&first, true);
        window.settle();
        let place = window.place(0.5, 0.45);
        window.event(Event::PointerMoved(place));
        window.event(Event::Zoom(1.3));
        window.settle();
        let now = camera(&window);
        assert!(distance(&now) < 0.9 * distance(&first) && turned(&now) < 1e-3, "{fingers:?}: a pinch zooms");
    }
}
