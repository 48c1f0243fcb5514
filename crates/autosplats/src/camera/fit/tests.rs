use std::f64::consts::{PI, TAU};

use autosplats_cloud::Unit;
use glam::DMat4;

use super::*;

fn ball(extra: &[[f32; 3]]) -> PointCloud {
    let golden = 2.399963f32;
    let mut positions: Vec<[f32; 3]> = (0..2000)
        .map(|i| {
            let z = 1.0 - (i as f32 + 0.5) / 1000.0;
            let (sin, cos) = (i as f32 * golden).sin_cos();
            let r = (1.0 - z * z).sqrt();
            [r * cos, r * sin, z]
        })
        .collect();
    positions.extend_from_slice(extra);
    PointCloud::new(DVec3::ZERO, positions)
}

#[test]
fn far_outliers_do_not_shrink_the_object() {
    let projection = Projection::PerspectiveFovDeg(40.0);
    let distance = |cloud: &PointCloud| {
        let camera = Camera::fit(cloud, Axes::ZUp, ViewDirection::Front, 1.5, projection).expect("a fit");
        (camera.eye - camera.look_at).length()
    };
    let clean = distance(&ball(&[]));
    let littered = distance(&ball(&[[1e6, 0.0, 0.0], [0.0, -3e5, 7.0], [f32::NAN, 0.0, 0.0]]));
    assert!((littered / clean - 1.0).abs() < 0.01, "{littered} is not about {clean}");
}

#[test]
fn all_points_lie_in_the_picture() {
    let cloud = ball(&[]);
    for direction in [ViewDirection::Iso, ViewDirection::Top, ViewDirection::Left, ViewDirection::Bottom] {
        for projection in [Projection::PerspectiveFovDeg(60.0), Projection::OrthographicHeight(1.0)] {
            let camera = Camera::fit(&cloud, Axes::YUp, direction, 0.5, projection).expect("a fit");
            let view = camera.view(DVec3::ZERO, [100, 200]).expect("a view");
            for &position in cloud.positions() {
                let [x, y] = view.to_pixel(view.to_view(position));
                assert!((0.0..100.0).contains(&x) && (0.0..200.0).contains(&y), "{direction:?}: {x}, {y}");
            }
        }
    }
}

#[test]
fn what_is_seen_fills_the_picture() {
    // Ground that recedes from the eye: its near end looks wider.
    let ground = (0..10_000).map(|i| [(i % 100) as f32, (i / 100) as f32, 0.0]).collect();
    let cloud = PointCloud::new(DVec3::ZERO, ground);
    for aspect in [0.5, 1.5, 2.5] {
        let projection = Projection::PerspectiveFovDeg(40.0);
        let camera = Camera::fit(&cloud, Axes::ZUp, ViewDirection::Iso, aspect, projection).expect("a fit");
        let size = [(200.0 * aspect) as u32, 200];
        let view = camera.view(DVec3::ZERO, size).expect("a view");
        let pixels: Vec<_> = cloud.positions().iter().map(|&p| view.to_pixel(view.to_view(p))).collect();
        let free = [0, 1].map(|axis| {
            let ends = pixels.iter().fold([f32::MAX, f32::MIN], |[a, b], p| [a.min(p[axis]), b.max(p[axis])]);
            [ends[0] / size[axis] as f32, 1.0 - ends[1] / size[axis] as f32]
        });
        let least = free.as_flattened().iter().fold(1.0f32, |a, &b| a.min(b));
        assert!((0.04..0.09).contains(&least), "{aspect}: as large as it fits: {free:?}");
        assert!(free.iter().all(|[a, b]| (a - b).abs() < 0.1), "{aspect}: in the middle: {free:?}");
    }
}

/// Ground 2 to 80 m from a lidar at `sensor`, denser near the lidar, over `azimuths` radians, and `others`, relative to
/// the sensor.
fn swept(sensor: DVec3, azimuths: f64, others: impl IntoIterator<Item = DVec3>) -> PointCloud {
    let ground = (0..4000).map(|i| {
        let azimuth = azimuths * ((f64::from(i) * 0.618034).fract() - 0.5);
        (DVec2::from_angle(azimuth) * 2.0 * 40f64.powf(f64::from(i) / 4000.0)).extend(-1.7)
    });
    let positions: Vec<_> = ground.chain(others).map(|p| p.as_vec3().to_array()).collect();
    let scan = Scan { name: None, world_from_sensor: DMat4::from_translation(sensor), points: 0..positions.len() };
    PointCloud::new(sensor, positions).with_scans(vec![scan])
}

fn auto(cloud: &PointCloud, fov: f64, aspect: f64) -> Camera {
    Camera::fit(cloud, Axes::ZUp, ViewDirection::Auto, aspect, Projection::PerspectiveFovDeg(fov)).expect("a fit")
}

#[test]
fn a_scan_around_its_sensor_is_seen_from_behind_it() {
    let sensor = DVec3::new(5e5, -4e6, 80.0);
    let camera = auto(&swept(sensor, TAU, []), 40.0, 1.5);
    let [eye, look_at] = [camera.eye, camera.look_at].map(|place| place - sensor);
    assert!((10.0..50.0).contains(&eye.length()) && eye.z > 5.0, "near and above the sensor: {eye}");
    assert!(eye.truncate().dot(look_at.truncate()) < 0.0, "the sensor is between {eye} and {look_at}");
    let unknown = |sensor| swept(sensor, TAU, []).with_scans(Vec::new());
    let of_origin = auto(&unknown(DVec3::ZERO), 40.0, 1.5);
    assert!(of_origin.eye.abs_diff_eq(eye, 1e-6), "without a sensor the origin is one: {}, {eye}", of_origin.eye);
    assert!(auto(&unknown(sensor), 40.0, 1.5).eye.distance(sensor) > 100.0, "nobody knows where it stood");
    let surveyed = unknown(DVec3::ZERO).with_crs(Crs { unit: Some(Unit::Metre), ..Crs::default() });
    assert!(auto(&surveyed, 40.0, 1.5).eye.length() > 100.0, "the origin of a coordinate system is no sensor");
}

#[test]
fn what_is_in_the_way_is_gone_around() {
    // The street defines the viewing direction.
    let street = || (0..600).map(|i| DVec3::new(f64::from(i - 300) * 0.25, 3.0, -1.7));
    let free = auto(&swept(DVec3::ZERO, TAU, street()), 40.0, 1.5).eye;
    let before = |count: usize| (0..count).map(move |i| free * (0.6 + 0.2 * i as f64 / count as f64));
    let eye = |count: usize| auto(&swept(DVec3::ZERO, TAU, street().chain(before(count))), 40.0, 1.5).eye;
    assert!(eye(40).distance(free) > 5.0, "something is in the way: {}, {free}", eye(40));
    assert!(eye(3).distance(free) < 2.0, "three points are nothing: {}, {free}", eye(3));
}

#[test]
fn a_sensor_that_sees_one_side_is_seen_from_behind() {
    let behind = |i: usize| DVec3::new(-10.0, 0.1 * i as f64, 4.0);
    let wall = |i: usize| DVec3::new(30.0, 0.1 * (i as f64 - 300.0), 0.0);
    for azimuths in [1.5, PI, 3.6] {
        let others = (0..60).map(behind).chain((0..600).map(wall));
        let camera = auto(&swept(DVec3::ZERO, azimuths, others), 40.0, 1.5);
        assert!(camera.eye.x < -5.0 && camera.look_at.x > 5.0, "{azimuths}, whatever is there: {camera:?}");
    }
}

/// A wall along X, divided among sensors at these positions.
fn wall_seen_from(sensors: &[DVec3]) -> PointCloud {
    let wall: Vec<_> = (0..10_000).map(|i| [0.04 * (i / 100) as f32 - 2.0, 0.0, 0.02 * (i % 100) as f32]).collect();
    let part = wall.len() / sensors.len().max(1);
    let scan = |(i, &sensor)| {
        let world_from_sensor = DMat4::from_translation(sensor);
        Scan { name: None, world_from_sensor, points: i * part..(i + 1) * part }
    };
    let scans = sensors.iter().enumerate().map(scan).collect();
    PointCloud::new(DVec3::new(7.0, 9.0, 3.0), wall).with_scans(scans)
}

#[test]
fn what_sensors_saw_from_one_side_is_seen_from_there() {
    for projection in [Projection::PerspectiveFovDeg(40.0), Projection::OrthographicHeight(1.0)] {
        let towards_eye = |sensors: &[DVec3], direction| {
            let camera = Camera::fit(&wall_seen_from(sensors), Axes::ZUp, direction, 1.5, projection).expect("a fit");
            (camera.eye - camera.look_at).normalize()
        };
        let behind = DVec3::new(6.0, 12.0, 4.0);
        for sensors in [&[behind][..], &[behind, DVec3::new(8.0, 14.0, 4.0)]] {
            let auto = towards_eye(sensors, ViewDirection::Auto);
            assert!(auto.y > 0.7 && auto.z > 0.2, "{sensors:?}: {auto}");
        }
        let at_its_end = DVec3::new(9.05, 9.05, 4.0);
        for sensors in [&[behind, DVec3::new(8.0, 6.0, 4.0)][..], &[at_its_end], &[]] {
            let [auto, iso] =
                [ViewDirection::Auto, ViewDirection::Iso].map(|direction| towards_eye(sensors, direction));
            assert!(auto == iso && auto.y < -0.5, "{sensors:?}, on both sides, among them or unknown: {auto}, {iso}");
        }
    }
}

#[test]
fn as_much_is_seen_whatever_the_field_of_view() {
    let cloud = swept(DVec3::ZERO, TAU, []);
    for (fov, aspect) in [(20.0, 1.5), (40.0, 1.5), (70.0, 1.5), (110.0, 1.5), (40.0, 0.5)] {
        let camera = auto(&cloud, fov, aspect);
        assert!(camera.eye.truncate().dot(camera.look_at.truncate()) < 0.0, "{fov}: the sensor is in between");
        let view = camera.view(DVec3::ZERO, [(300.0 * aspect) as u32, 300]).expect("a view");
        let [x, y] = view.to_pixel(view.to_view([0.0, 0.0, -1.7]));
        let size = [300.0 * aspect as f32, 300.0];
        assert!(x > 0.1 * size[0] && x < 0.9 * size[0], "{fov}, {aspect}: {x}");
        assert!(y > 0.55 * size[1] && y < 0.95 * size[1], "{fov}, {aspect}: {y}");
    }
}

#[test]
fn what_is_high_and_thin_is_seen_whole() {
    let mast = (0..9000)
        .map(|i| (DVec2::from_angle(f64::from(i) * 2.4) * 0.5).extend(100.0 * (f64::from(i) * 0.618034).fract()));
    let camera = auto(&swept(DVec3::ZERO, TAU, mast), 40.0, 1.5);
    let view = camera.view(DVec3::ZERO, [300, 200]).expect("a view");
    let [_, y] = view.to_pixel(view.to_view([0.0, 0.0, 100.0]));
    assert!(y > 0.0, "its top is above the picture: {y}");
}

#[test]
fn an_orthographic_camera_stays_one() {
    for axes in [Axes::ZUp, Axes::Camera] {
        let projection = Projection::OrthographicHeight(1.0);
        let cloud = swept(DVec3::ZERO, TAU, []);
        let camera = Camera::fit(&cloud, axes, ViewDirection::Auto, 1.5, projection).expect("a fit");
        assert!(matches!(camera.projection, Projection::OrthographicHeight(height) if height > 10.0), "{camera:?}");
    }
}

#[test]
fn a_moved_camera_looks_the_same_way_and_sees_everything() {
    let cloud = ball(&[]);
    let before = Camera {
        eye: DVec3::new(30.0, 40.0, 5.0),
        look_at: DVec3::new(29.0, 38.0, 5.5),
        up: DVec3::new(0.2, 0.0, 1.0),
        projection: Projection::PerspectiveFovDeg(30.0),
    };
    let after = before.showing(&cloud, 1.0).expect("a place");
    let turned = |camera: &Camera| camera.axes().expect("a camera that sees");
    for (a, b) in turned(&before).into_iter().zip(turned(&after)) {
        assert!(a.abs_diff_eq(b, 1e-9), "{a} became {b}");
    }
    let view = after.view(DVec3::ZERO, [100, 100]).expect("a view");
    let inside = |&p: &[f32; 3]| view.to_pixel(view.to_view(p)).into_iter().all(|c| (0.0..100.0).contains(&c));
    assert!(cloud.positions().iter().all(inside), "all points are seen");
}
