//! Which clouds have known noise, how much, and how it moves surfels.

use autosplats_cloud::glam::{DMat4, DQuat};

use super::*;
use crate::camera::{Camera, Projection};
use crate::test_clouds::{self, Positions, Random, room, stepped};

const STEP: f32 = 0.0029;

/// A cloud seen by a sensor with this pose; positions are in the sensor's axes.
fn seen_from(pose: DMat4, origin: DVec3, positions: &[[f32; 3]]) -> PointCloud {
    let of_world = |point: &[f32; 3]| {
        let point = DVec3::from(point.map(f64::from));
        (pose.transform_point3(point) - origin).as_vec3().to_array()
    };
    let scan = Scan { name: None, world_from_sensor: pose, points: 0..positions.len() };
    PointCloud::new(origin, positions.iter().map(of_world).collect()).with_scans(vec![scan])
}

fn by_camera(positions: Positions) -> PointCloud {
    seen_from(DMat4::IDENTITY, DVec3::ZERO, &positions)
}

/// Factor and power of the only run.
fn law(cloud: &PointCloud) -> Option<(f32, f32)> {
    let noise = DepthNoise::new(cloud, &crate::cancel::NEVER);
    assert!(noise.runs.len() <= 1, "of one scan: {noise:?}");
    noise.runs.first().map(|run| (run.factor, run.power))
}

fn near(found: Option<(f32, f32)>, factor: f32, power: f32, tolerance: f32) -> bool {
    found.is_some_and(|(f, p)| p == power && (f / factor - 1.0).abs() <= tolerance)
}

#[test]
fn steps_are_found() {
    let factor = STEP / 3f32.sqrt();
    let found = law(&by_camera(room(200, |depth| stepped(depth, STEP))));
    assert!(near(found, factor, 2.0, 0.01), "{found:?}");
    // As in files with millimetres.
    let millimetres = |depth: f32| (1000.0 * depth).round() / 1000.0;
    let found = law(&by_camera(room(200, |depth| millimetres(stepped(depth, STEP)))));
    assert!(near(found, factor, 2.0, 0.02), "{found:?}");
    // A camera with depths of eight bits.
    let found = law(&by_camera(room(200, |depth| (depth / 0.04).round() * 0.04)));
    assert!(near(found, 0.04 / 3f32.sqrt(), 0.0, 0.01), "{found:?}");
    // Some pixels are the mean of two others.
    let mut random = Random::new(1);
    let mut mixed = |depth: f32| stepped(depth, STEP) + if random.unit() < 1e-4 { 0.1 * random.unit() } else { 0.0 };
    let found = law(&by_camera(room(200, &mut mixed)));
    assert!(near(found, factor, 2.0, 0.02), "{found:?}");
}

#[test]
fn the_sensor_may_stand_and_look_anywhere() {
    let positions = room(200, |depth| stepped(depth, STEP));
    let turns = [DQuat::IDENTITY, DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -1.1, 2.0)];
    // Axes of a camera, of a robot, and of a graphics library.
    let axes = [
        DQuat::IDENTITY,
        DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2),
        DQuat::from_rotation_x(std::f64::consts::PI),
    ];
    for turn in turns {
        for axis in axes {
            let place = DVec3::new(4e5, 5e6, 100.0);
            let origin = place + DVec3::new(3.0, -2.0, 1.0);
            let pose = DMat4::from_rotation_translation(turn * axis, place);
            let turned: Positions = positions
                .iter()
                .map(|point| (axis.inverse() * DVec3::from(point.map(f64::from))).as_vec3().to_array())
                .collect();
            let noise = DepthNoise::new(&seen_from(pose, origin, &turned), &crate::cancel::NEVER);
            let [run] = noise.runs[..] else { panic!("{turn} {axis}: {noise:?}") };
            let looks = (turn * DVec3::Z).as_vec3();
            assert!(near(Some((run.factor, run.power)), STEP / 3f32.sqrt(), 2.0, 0.01), "{turn} {axis}: {run:?}");
            assert!((Vec3::from(run.axis) - looks).length() < 1e-6, "{turn} {axis}: {run:?}");
            assert!((Vec3::from(run.position) - (place - origin).as_vec3()).length() < 1e-5, "{turn} {axis}: {run:?}");
        }
    }
}

/// A room with noise of inverse depth, equal in squares of four by four pixels if `alike`.
fn disparities(sigma: f32, alike: bool) -> Positions {
    let width = 320;
    let mut random = Random::new(5);
    let errors: Vec<f32> = (0..width * width).map(|_| sigma * random.gaussian()).collect();
    let mut pixel = 0;
    room(width, |depth| {
        let [column, row] = [pixel % width, pixel / width];
        pixel += 1;
        let at = if alike { row / 4 * width + column / 4 } else { row * width + column };
        1.0 / (1.0 / depth + errors[at])
    })
}

#[test]
fn noise_of_disparities_is_found() {
    for alike in [false, true] {
        let found = law(&by_camera(disparities(0.0014, alike)));
        // Correlated noise shows less.
        let ratio = found.map_or(0.0, |(factor, power)| if power == 2.0 { factor / 0.0014 } else { 0.0 });
        assert!((0.9..1.4).contains(&ratio), "{alike}: {found:?}");
    }
}

#[test]
fn other_clouds_are_let_be() {
    let mut random = Random::new(6);
    let time_of_flight = room(320, |depth| depth + 0.005 * random.gaussian());
    // Voxels, whose coordinates all come in steps.
    let voxels = room(320, |depth| depth).iter().map(|point| point.map(|c| (c / 0.04).round() * 0.04)).collect();
    let mut random = Random::new(7);
    let surroundings =
        (0..100_000).map(|_| random.direction().map(|c| (500.0 * c).round() / 100.0)).collect::<Positions>();
    // A level camera without noise: each image row has one depth, and the rows follow the law of disparities.
    let level = |walls: bool| -> Positions {
        let at = |pixel: usize| [pixel % 240, pixel / 240].map(|at| (at as f32 + 30.0) / 240.0);
        let depth = |[x, y]: [f32; 2]| if walls { (1.0 / y).min(1.5 / x).min(5.0) } else { 1.0 / y };
        (0..240 * 180).map(at).map(|[x, y]| [x, y, 1.0].map(|c| c * depth([x, y]))).collect()
    };
    let mut random = Random::new(8);
    let chance = room(200, |depth| ((30.0 * depth) as u32 as f32).sin().abs() + random.below(2) as f32 + 1.0);
    for (name, positions) in [
        ("no noise", room(320, |depth| depth)),
        ("time of flight", time_of_flight),
        ("voxels", voxels),
        ("all around", surroundings),
        ("values by chance", chance),
        ("a level floor", level(false)),
        ("a level room", level(true)),
        ("one depth", room(200, |_| 3.0)),
        ("too few values", room(200, |depth| (depth / 2.0).ceil())),
        ("too few points", room(20, |depth| stepped(depth, STEP))),
        ("bumps", test_clouds::bumpy(50_000).iter().map(|[x, y, z]| [*x, *y, z + 3.0]).collect()),
    ] {
        assert_eq!(law(&by_camera(positions)), None, "{name}");
    }
    let stepped = room(200, |depth| stepped(depth, STEP));
    assert_eq!(law(&PointCloud::new(DVec3::ZERO, stepped.clone())), None, "nobody knows from where");
    let behind = DMat4::from_translation(DVec3::new(0.0, 0.0, 4.0));
    let scan = Scan { name: None, world_from_sensor: behind, points: 0..stepped.len() };
    assert_eq!(law(&PointCloud::new(DVec3::ZERO, stepped).with_scans(vec![scan])), None, "from amid them");
}

#[test]
fn millimetres_are_next_to_nothing() {
    let (factor, power) = law(&by_camera(room(320, |depth| (1000.0 * depth).round() / 1000.0))).unwrap_or_default();
    assert!(factor <= 0.0006 && power == 0.0, "{factor} {power}");
}

#[test]
fn hostile_values_do_no_harm() {
    let nothing = |cloud: &PointCloud, case: &str| assert_eq!(law(cloud), None, "{case}");
    nothing(&PointCloud::default(), "empty");
    for value in [0.0, 1.0, -1.0, f32::NAN, f32::INFINITY, f32::MAX, f32::MIN_POSITIVE] {
        nothing(&by_camera(vec![[value; 3]; 5000]), &format!("all {value}"));
        let line = (0..5000).map(|i| [value, value, i as f32]).collect();
        nothing(&by_camera(line), &format!("a line at {value}"));
    }
    let positions = room(200, |depth| stepped(depth, STEP));
    for value in [f64::NAN, f64::INFINITY, 1e300] {
        let whole = DMat4::from_cols_array(&[value; 16]);
        let scan = |pose| Scan { name: None, world_from_sensor: pose, points: 0..positions.len() };
        let mut place = DMat4::IDENTITY;
        place.w_axis.x = value;
        for pose in [whole, place, DMat4::ZERO] {
            let cloud = PointCloud::new(DVec3::ZERO, positions.clone()).with_scans(vec![scan(pose)]);
            nothing(&cloud, &format!("{pose}"));
        }
    }
    // Non-finite points are left out.
    let mut holes = positions;
    holes.iter_mut().step_by(3).for_each(|point| *point = [f32::NAN; 3]);
    holes.iter_mut().skip(1).step_by(997).for_each(|point| *point = [f32::INFINITY, 0.0, 1.0]);
    let found = law(&by_camera(holes));
    assert!(near(found, STEP / 3f32.sqrt(), 2.0, 0.01), "{found:?}");
}

#[test]
fn each_scan_has_its_own() {
    let positions: Positions = [STEP, 2.0 * STEP, 0.0]
        .into_iter()
        .flat_map(|step| room(200, |depth| if step > 0.0 { stepped(depth, step) } else { depth }))
        .collect();
    let each = positions.len() / 3;
    let scan = |index: usize| Scan {
        name: None,
        world_from_sensor: DMat4::IDENTITY,
        points: index * each..(index + 1) * each,
    };
    let cloud = PointCloud::new(DVec3::ZERO, positions).with_scans(vec![scan(0), scan(1), scan(2)]);
    let noise = DepthNoise::new(&cloud, &crate::cancel::NEVER);
    let at = |point: usize| noise.at(Vec3::new(0.3, 0.4, 2.0), point as u32).map(|known| known.noise);
    for (point, step) in [(0, STEP), (each - 1, STEP), (each, 2.0 * STEP), (2 * each - 1, 2.0 * STEP)] {
        let found = at(point).expect("noise");
        assert!((found / (4.0 * step / 3f32.sqrt()) - 1.0).abs() < 0.01, "point {point}: {found}");
    }
    assert_eq!(at(2 * each), None, "of a scan without");
    assert_eq!(noise.at(Vec3::NEG_Z, 0), None, "behind the sensor");
}

#[test]
fn noise_is_of_the_sensors_distance_not_the_eyes() {
    let cloud = by_camera(room(200, |depth| stepped(depth, STEP)));
    let camera = Camera {
        eye: DVec3::new(5.0, -3.0, 1.0),
        look_at: DVec3::new(0.0, 0.0, 3.0),
        up: DVec3::NEG_Y,
        projection: Projection::PerspectiveFovDeg(40.0),
    };
    let view = camera.view(DVec3::ZERO, [64, 48]).expect("a view");
    let noise = DepthNoise::new(&cloud, &crate::cancel::NEVER);
    let place = Vec3::new(0.5, -0.25, 3.0);
    let own = noise.at(place, 7).expect("noise");
    let seen = noise.seen_by(&view).at(view.view_from_world * (place - view.eye_local), 7).expect("noise");
    assert!((seen.noise / own.noise - 1.0).abs() < 1e-5, "{own:?}, {seen:?}");
    assert!((seen.ray - view.view_from_world * own.ray).length() < 1e-5, "{own:?}, {seen:?}");
    assert!((own.ray - place.normalize()).length() < 1e-6, "from the sensor: {own:?}");
}

#[test]
fn surfels_move_along_the_ray() {
    let known = KnownNoise { noise: 0.1, ray: Vec3::Z };
    let normal = Vec3::new(0.6, 0.0, -0.8);
    for normal in [normal, -normal] {
        let moved = known.onto(normal, normal * 0.05);
        assert!((moved.dot(normal) - 0.05).abs() < 1e-6, "onto the plane: {moved}");
        assert!(moved.x.abs() < 0.05 * moved.z.abs(), "along the ray: {moved}");
    }
    let across = known.onto(Vec3::X, Vec3::X * 0.05);
    assert!((across - Vec3::X * 0.05).length() < 1e-6, "along the normal where there is no other way: {across}");
    for tilt in 0..=100 {
        let angle = tilt as f32 / 100.0 * std::f32::consts::FRAC_PI_2;
        let normal = Vec3::new(angle.sin(), 0.0, angle.cos());
        let moved = known.onto(normal, normal * 0.6);
        let sideways = moved.reject_from_normalized(normal).length();
        assert!(sideways <= FARTHEST_ALONG * 0.1 + 1e-5, "not beyond what noise is: {tilt} {moved}");
    }

    let slanted = Vec3::new(0.6, 0.0, -0.8);
    let (major, ratio) = known.shadow(Vec3::NEG_Z, slanted).expect("a longer disc");
    assert!((ratio - 1.25).abs() < 1e-6 && major.dot(slanted).abs() < 1e-6 && major.y == 0.0, "{major} {ratio}");
    assert_eq!(known.shadow(slanted, Vec3::NEG_Z), None, "no shorter one");
    assert_eq!(known.shadow(Vec3::NEG_Z, Vec3::NEG_Z), None, "nor along the normal");
    let grazing = known.shadow(Vec3::NEG_Z, Vec3::X).expect("a longer disc");
    assert_eq!(grazing.1, LONGEST_SHADOW, "no end of a shadow");
}
