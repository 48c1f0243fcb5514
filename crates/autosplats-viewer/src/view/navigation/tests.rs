use super::*;

/// A camera that looks north from the south of a scene of radius 10.
fn south() -> Navigation {
    let mut navigation = Navigation::new();
    navigation.set_scene(DVec3::ZERO, 10.0, DVec3::Z);
    let camera = Camera {
        eye: DVec3::new(0.0, -20.0, 0.0),
        look_at: DVec3::ZERO,
        up: DVec3::Z,
        projection: Projection::PerspectiveFovDeg(40.0),
    };
    navigation.go_to(&camera, true);
    navigation
}

/// Position of `point` in the picture, in picture heights from its middle, right and down.
fn on_screen(camera: &Camera, point: DVec3) -> DVec2 {
    let [right, down, forward] = camera.axes().expect("a camera that sees");
    let offset = point - camera.eye;
    let height = match camera.projection {
        Projection::PerspectiveFovDeg(fov) => 2.0 * (0.5 * fov).to_radians().tan() * offset.dot(forward),
        Projection::OrthographicHeight(height) => height,
        Projection::Pinhole { .. } => unreachable!("not among these cameras"),
    };
    DVec2::new(offset.dot(right), offset.dot(down)) / height
}

#[test]
fn a_camera_comes_out_as_it_went_in() {
    for projection in [Projection::PerspectiveFovDeg(55.0), Projection::OrthographicHeight(7.0)] {
        let camera = Camera {
            eye: DVec3::new(512_003.0, 5_400_001.0, 350.0),
            look_at: DVec3::new(512_000.0, 5_400_010.0, 340.0),
            up: DVec3::new(0.1, 0.0, 1.0),
            projection,
        };
        let mut navigation = Navigation::new();
        navigation.set_scene(camera.look_at, 10.0, DVec3::Z);
        navigation.go_to(&camera, true);
        let back = navigation.camera();
        for point in [camera.look_at, camera.look_at + DVec3::new(1.0, 2.0, 0.5)] {
            let (before, after) = (on_screen(&camera, point), on_screen(&back, point));
            assert!(before.distance(after) < 1e-9, "{projection:?}: {before} became {after}");
        }
    }
}

#[test]
fn movement_does_not_depend_on_the_frame_rate() {
    let run = |steps: usize| {
        let mut navigation = south();
        navigation.orbit(DVec2::new(0.3, 0.1));
        (0..steps).for_each(|_| {
            navigation.advance(0.1 / steps as f64, Flight::default());
        });
        navigation.camera().eye
    };
    let (few, many) = (run(2), run(200));
    assert!(few.distance(many) < 0.02 * 20.0, "{few} with 2 frames, {many} with 200");
    let fly = |steps: usize| {
        let mut navigation = south();
        let flight = Flight { forward: 1.0, ..Flight::default() };
        (0..steps).for_each(|_| {
            navigation.advance(0.5 / steps as f64, flight);
        });
        navigation.goal_camera().eye.y
    };
    assert!((fly(4) - fly(400)).abs() < 1e-9, "half a second of flight is as far");
}

#[test]
fn the_eye_arrives_and_rests() {
    let mut navigation = south();
    navigation.orbit(DVec2::new(0.5, 0.0));
    let mut frames = 0;
    while navigation.advance(1.0 / 60.0, Flight::default()) {
        frames += 1;
        assert!(frames < 120, "two seconds are enough");
    }
    assert!(navigation.shown == navigation.goal, "it rests");
    let eye = navigation.camera().eye;
    assert!(
        eye.distance(DVec3::new(-20.0, 0.0, 0.0)) < 1e-9,
        "a quarter turn to the right pulls the west to the front: {eye}"
    );
}

#[test]
fn an_orbit_never_goes_over_the_top() {
    let mut navigation = south();
    for _ in 0..50 {
        navigation.orbit(DVec2::new(0.01, 0.1));
    }
    navigation.shown = navigation.goal;
    let camera = navigation.camera();
    let [_, down, forward] = camera.axes().expect("a camera");
    assert!((forward - DVec3::NEG_Z).length() < 1e-6, "straight down: {forward}");
    navigation.orbit(DVec2::new(0.0, -0.25));
    navigation.shown = navigation.goal;
    let [_, down_after, _] = navigation.camera().axes().expect("a camera");
    assert!(down.is_normalized() && down_after.z < -0.1, "and back with up upward: {down_after}");
}

#[test]
fn zoom_keeps_what_is_under_the_cursor() {
    for orthographic in [false, true] {
        let mut navigation = south();
        if orthographic {
            navigation.toggle_projection();
        }
        let target = DVec3::new(3.0, 1.5, 2.0);
        let before = on_screen(&navigation.camera(), target);
        for factor in [1.2, 3.0, 0.5] {
            navigation.zoom(factor, Some(target));
            navigation.shown = navigation.goal;
            let after = on_screen(&navigation.camera(), target);
            assert!(before.distance(after) < 1e-9, "orthographic {orthographic}: {before} became {after}");
        }
    }
}

#[test]
fn zoom_ends_before_the_point_and_before_the_horizon() {
    let mut navigation = south();
    let target = DVec3::new(0.0, -5.0, 0.0);
    for _ in 0..500 {
        navigation.zoom(2.0, Some(target));
    }
    navigation.shown = navigation.goal;
    let camera = navigation.camera();
    assert!(camera.eye.y < target.y && camera.check().is_ok(), "still before it: {}", camera.eye);
    for _ in 0..500 {
        navigation.zoom(0.5, None);
    }
    navigation.shown = navigation.goal;
    assert!(navigation.camera().eye.length() < 1e5, "not lost: {}", navigation.camera().eye);
    navigation.zoom(f64::NAN, None);
    navigation.zoom(0.0, Some(DVec3::NAN));
    assert!(navigation.goal_camera().check().is_ok(), "nonsense is left alone");
}

#[test]
fn a_pan_follows_the_cursor_at_the_depth_it_grabbed() {
    let mut navigation = south();
    let grabbed = DVec3::new(2.0, 4.0, 1.0);
    let before = on_screen(&navigation.camera(), grabbed);
    let drag = DVec2::new(0.2, -0.1);
    navigation.pan(drag, Some(24.0));
    navigation.shown = navigation.goal;
    let after = on_screen(&navigation.camera(), grabbed);
    assert!((before + drag).distance(after) < 1e-9, "{before} by {drag} is {after}");
}

#[test]
fn a_new_pivot_moves_to_the_middle_without_coming_closer() {
    let mut navigation = south();
    let pivot = DVec3::new(3.0, 5.0, -2.0);
    navigation.set_pivot(pivot);
    navigation.shown = navigation.goal;
    let camera = navigation.camera();
    assert!(on_screen(&camera, pivot).length() < 1e-12, "in the middle");
    assert!((camera.eye.y + 20.0).abs() < 1e-9, "as far as before: {}", camera.eye);
}

#[test]
fn orthographic_shows_the_pivot_in_the_same_size_and_hides_nothing() {
    let mut navigation = south();
    navigation.zoom(10.0, None);
    navigation.shown = navigation.goal;
    let point = DVec3::new(0.4, 0.0, 0.2);
    let before = on_screen(&navigation.camera(), point);
    navigation.toggle_projection();
    let camera = navigation.camera();
    assert!(before.distance(on_screen(&camera, point)) < 1e-9, "same size");
    assert!(camera.eye.y < -10.0, "the eye is before the scene: {}", camera.eye);
}

#[test]
fn arrow_keys_turn_the_head_where_they_point() {
    let mut navigation = south();
    let before = navigation.goal_camera();
    navigation.advance(0.1, Flight { turn_right: 1.0, turn_up: 1.0, ..Flight::default() });
    let after = navigation.goal_camera();
    assert!(after.eye.distance(before.eye) < 1e-9, "the eye stays: {}", after.eye);
    let [_, _, forward] = after.axes().expect("a camera");
    assert!(forward.x > 0.05 && forward.z > 0.05, "to the east and up: {forward}");
    let angle = forward.angle_between(DVec3::Y);
    assert!((0.1..0.2).contains(&angle), "as fast as stated in both directions: {angle}");
}

#[test]
fn the_eye_arrives_far_from_the_origin_too() {
    let mut navigation = south();
    let far = DVec3::new(512_345.678, 5_412_345.678, 321.0);
    navigation.set_scene(far, 100.0, DVec3::Z);
    let projection = Projection::PerspectiveFovDeg(40.0);
    let camera = Camera { eye: far - DVec3::Y * 0.001, look_at: far, up: DVec3::Z, projection };
    navigation.go_to(&camera, true);
    navigation.pan(DVec2::new(0.3, 0.2), None);
    let frames = (0..600).take_while(|_| navigation.advance(1.0 / 60.0, Flight::default())).count();
    assert!(frames < 300, "it rests after {frames} frames");
}
