//! The sensor of each point, and the side of a surfel that is its back.

use autosplats_cloud::glam::{DMat4, DVec3};

use super::gpu::{OrientPass, sensor_buffer, write_sensors};
use super::*;
use crate::camera::{Camera, Projection};
use crate::cancel::NEVER;
use crate::gpu::{FrameUniform, Gpu, read_back, test_gpu};
use crate::project::Round;
use crate::project::gpu::tests::{find_work, run_round};
use crate::project::gpu::{Counter, ScreenBuffers};
use crate::test_clouds::Random;

const ORIGIN: DVec3 = DVec3::new(4e5, 5e6, 100.0);

fn scan(position: DVec3, points: std::ops::Range<usize>) -> Scan {
    Scan { name: None, world_from_sensor: DMat4::from_translation(position), points }
}

fn cloud(count: usize, scans: Vec<Scan>) -> PointCloud {
    PointCloud::new(ORIGIN, vec![[0.0; 3]; count]).with_scans(scans)
}

/// The x coordinate of each point's sensor.
fn of_points(cloud: &PointCloud) -> Vec<Option<f32>> {
    let sensors = Sensors::new(cloud);
    (0..cloud.len() as u32).map(|point| sensors.of(point).map(|sensor| sensor.x)).collect()
}

#[test]
fn each_point_has_its_own_sensor() {
    let at = |x: f64| ORIGIN + x;
    let scans = vec![
        scan(at(3.0), 6..8),
        // Points in two scans belong to the first.
        scan(at(1.0), 1..4),
        scan(at(2.0), 3..5),
        scan(at(2.5), 3..4),
        scan(at(9.0), 5..5),
        // The next scan at the same position.
        scan(at(3.0), 8..9),
        scan(at(f64::NAN), 9..10),
        scan(at(1e300), 10..11),
    ];
    let cloud = cloud(12, scans);
    let one = |x: f32| Some(x);
    let expected = [None, one(1.0), one(1.0), one(1.0), one(2.0), None, one(3.0), one(3.0), one(3.0), None, None, None];
    assert_eq!(of_points(&cloud), expected);
    assert_eq!(Sensors::new(&cloud).len(), 6, "neighbours of one sensor are one run");
}

#[test]
fn who_knows_no_sensor_has_none() {
    for scans in [vec![], vec![scan(ORIGIN, 2..2)], vec![scan(DVec3::NAN, 0..4), scan(DVec3::splat(1e200), 4..5)]] {
        let cloud = cloud(5, scans);
        assert!(!has_sensors(&cloud) && Sensors::new(&cloud) == Sensors::default());
        let view = view(Projection::PerspectiveFovDeg(30.0));
        let mut surfels = [Surfel { source: 4, normal: [0.0, 0.0, -1.0], ..Surfel::default() }];
        Sensors::new(&cloud).orient(&mut surfels, &view, &NEVER);
        assert!(!surfels[0].shows_back(), "nothing is known");
    }
}

fn view(projection: Projection) -> View {
    let camera = Camera { eye: ORIGIN - 10.0 * DVec3::Z, look_at: ORIGIN, up: DVec3::NEG_Y, projection };
    camera.view(ORIGIN, [40, 30]).expect("a view")
}

const PROJECTIONS: [Projection; 2] = [Projection::PerspectiveFovDeg(30.0), Projection::OrthographicHeight(3.0)];

/// Surfels at the cloud's origin, ten units in front of the eye, one per normal.
fn at_the_origin(normals: &[Vec3]) -> Vec<Surfel> {
    let surfel = |normal: &Vec3| Surfel {
        center: [0.0, 0.0, 10.0],
        normal: normal.normalize().to_array(),
        radius: 1.0,
        screen_and_flags: 7,
        ..Surfel::default()
    };
    normals.iter().map(surfel).collect()
}

#[test]
fn only_what_is_sure_is_a_back() {
    for projection in PROJECTIONS {
        let view = view(projection);
        let backs = |sensor: DVec3, normals: &[Vec3]| {
            let mut surfels = at_the_origin(normals);
            let sensors = Sensors::new(&cloud(1, vec![scan(ORIGIN + sensor, 0..1)]));
            sensors.orient(&mut surfels, &view, &NEVER);
            assert!(surfels.iter().all(|surfel| surfel.screen() == 7), "the index stays");
            surfels.iter().map(Surfel::shows_back).collect::<Vec<bool>>()
        };
        // In view space: towards the eye, tilted, nearly sideways, and almost exactly sideways.
        let normals = [Vec3::NEG_Z, Vec3::new(0.7, 0.0, -0.7), Vec3::new(1.0, 0.0, -0.1), Vec3::new(1.0, 0.0, -0.03)];
        assert_eq!(backs(DVec3::new(0.1, 0.2, -5.0), &normals), [false; 4], "the sensor is at the eye's side");
        assert_eq!(backs(DVec3::new(0.0, 0.0, 3.0), &normals), [true, true, false, false], "right behind");
        let right = view.view_from_world.transpose() * Vec3::X;
        let left = (-3.0 * right).as_dvec3();
        assert_eq!(backs(left, &normals), [false, true, true, false], "beside: the eye must see it surely, too");
        assert_eq!(backs(DVec3::ZERO, &normals), [false; 4], "at the point itself");
        let behind = Sensors::new(&cloud(1, vec![scan(ORIGIN + 3.0 * DVec3::Z, 0..1)]));
        let mut rough = at_the_origin(&normals[..2]);
        rough.iter_mut().for_each(|surfel| surfel.curvature = 0.3);
        behind.orient(&mut rough, &view, &NEVER);
        let found = [&rough[0], &rough[1]].map(Surfel::shows_back);
        assert_eq!(found, [true, false], "what is thick has a side only straight on");
    }
}

#[test]
fn the_device_marks_what_the_host_marks() {
    let Some(gpu) = test_gpu() else { return };
    let pass = OrientPass::new(&gpu).expect("a pass");
    let mut random = Random::new(91);
    let (mut compared, mut backs, mut different) = (0, 0, 0);
    for scans in [1, 2, 3, 1000] {
        for projection in PROJECTIONS {
            let view = view(projection);
            let mut turn = Random::new(92);
            let mut vector = || Vec3::from(turn.direction());
            let count = 3000;
            // Some points without a scan, some with an unknown sensor.
            let position = |i: usize, at: Vec3| if i % 7 == 3 { DVec3::INFINITY } else { ORIGIN + 4.0 * at.as_dvec3() };
            let run = count / scans;
            let scans = (0..scans).map(|i| scan(position(i, vector()), i * run + i % 3..(i + 1) * run));
            let sensors = Sensors::new(&cloud(count, scans.collect()));
            let mut surfels = at_the_origin(&(0..count).map(|_| vector()).collect::<Vec<_>>());
            for (index, surfel) in surfels.iter_mut().enumerate() {
                surfel.source = index as u32;
                surfel.curvature = if index % 3 == 0 { 0.1 * random.unit() } else { 0.0 };
                surfel.center = (vector() + 10.0 * Vec3::Z).to_array();
                let to_eye = if view.perspective { -Vec3::from(surfel.center) } else { Vec3::NEG_Z };
                let normal = Vec3::from(surfel.normal);
                surfel.normal = (normal * normal.dot(to_eye).signum()).to_array();
            }
            let device = on_device(&gpu, &pass, &sensors, &surfels, &view);
            sensors.orient(&mut surfels, &view, &NEVER);
            compared += surfels.len();
            backs += surfels.iter().filter(|surfel| surfel.shows_back()).count();
            different += surfels.iter().zip(&device).filter(|(host, device)| host != device).count();
        }
    }
    assert!(backs * 5 > compared && backs * 2 < compared, "some of each: {backs} of {compared}");
    // Rounding decides a few surfels.
    assert!(different * 5000 <= compared, "{different} of {compared} differ");
}

/// Marks a third of the surfels in the first round, the rest in the second.
fn on_device(gpu: &Gpu, pass: &OrientPass, sensors: &Sensors, surfels: &[Surfel], view: &View) -> Vec<Surfel> {
    let screen = ScreenBuffers::new(gpu, [view.width, view.height], false, 0, 0).expect("room");
    let active = surfels.len() / 3;
    for (counter, value) in [(Counter::Active, active), (Counter::Recovered, surfels.len() - active)] {
        gpu.queue.write_buffer(&screen.counters, 4 * counter as u64, bytemuck::bytes_of(&(value as u32)));
    }
    find_work(gpu, &screen);
    let frame = gpu.uniform::<FrameUniform>("frame").expect("room");
    gpu.queue.write_buffer(&frame, 0, bytemuck::bytes_of(&FrameUniform::new(view, 10)));
    let known = sensor_buffer(gpu, sensors.len()).expect("room");
    write_sensors(gpu, sensors, &known);
    let buffer = gpu.storage_with("surfels", surfels).expect("room");
    for round in [Round::Active, Round::Recovered] {
        run_round(gpu, &screen, round, &[pass.step(gpu, &frame, &screen, &known, &buffer, round)]);
    }
    read_back(gpu, &buffer, surfels.len()).expect("surfels")
}
