//! Tests of thinning and shuffling.

use crate::common::{positions, rich_cloud};
use autosplats_cloud::{FieldValues, PointCloud, Random, Scan, glam::DMat4, glam::DVec3};

#[test]
fn attributes_and_scans_go_with_their_points() {
    let whole = rich_cloud(100);
    let scan = |points| Scan { name: None, world_from_sensor: DMat4::IDENTITY, points };
    let mut half = whole.clone().with_scans(vec![scan(0..31), scan(31..90), scan(95..95)]);
    half.retain(|i| i % 2 == 1);
    assert_eq!(half.len(), 50, "every other point");
    let ranges: Vec<_> = half.scans().iter().map(|scan| scan.points.clone()).collect();
    assert_eq!(ranges, [0..15, 15..45, 47..47], "ranges shrink with what they hold");
    for (kept, old) in (1..100).step_by(2).enumerate() {
        assert_eq!(half.positions()[kept], whole.positions()[old], "position of {old}");
        assert_eq!(half.colors().unwrap()[kept], whole.colors().unwrap()[old], "colour of {old}");
        for (field, before) in half.fields().iter().zip(whole.fields()) {
            assert_eq!(field.values.get(kept), before.values.get(old), "{} of {old}", field.name);
        }
    }
}

/// Position of each point's sensor; `None` for points of no scan.
fn sensors(cloud: &PointCloud) -> Vec<Option<DVec3>> {
    let of = |i: usize| cloud.scans().iter().find(|scan| scan.points.contains(&i)).map(Scan::position);
    (0..cloud.len()).map(of).collect()
}

/// Some scans with gaps between them, and a field with the number of each point's sensor.
fn scanned(random: &mut Random, count: usize) -> PointCloud {
    let mut scans = Vec::new();
    let mut start = 0;
    while start < count {
        let end = count.min(start + random.modulo(count / 2));
        let place = DVec3::from([0; 3].map(|_| (10.0 * random.unit()).floor()));
        if random.modulo(3) > 0 {
            scans.push(Scan { name: None, world_from_sensor: DMat4::from_translation(place), points: start..end });
        }
        start = end + random.modulo(5);
    }
    let cloud = PointCloud::new(DVec3::new(4e5, 5e6, 0.0), positions(count)).with_scans(scans);
    let number = |sensor: &Option<DVec3>| sensor.map_or(f64::NAN, |at| at.dot(DVec3::new(1.0, 10.0, 100.0)));
    let values = sensors(&cloud).iter().map(number).collect();
    cloud.with_field("Sensor", FieldValues::F64(values)).unwrap()
}

/// Whether each point still has its own sensor, moved by `moved`.
fn keep_their_own(cloud: &PointCloud, moved: impl Fn(DVec3) -> DVec3) -> bool {
    let own = cloud.field("Sensor").unwrap();
    let back = |number: f64| moved(DVec3::new(number % 10.0, number / 10.0 % 10.0, number / 100.0).floor());
    sensors(cloud).iter().enumerate().all(|(i, sensor)| match (sensor, own.values.get(i)) {
        (None, number) => number.is_nan(),
        (Some(sensor), number) => !number.is_nan() && sensor.distance(back(number)) < 1e-6,
    })
}

#[test]
fn whatever_is_done_to_points_their_sensors_stay_their_own() {
    let mut random = Random::from_state(17);
    let mut operations = [0; 6];
    for round in 0..200 {
        let count = 20 + random.modulo(100);
        let mut cloud = scanned(&mut random, count);
        let mut shift = DVec3::ZERO;
        for _ in 0..4 {
            let operation = random.modulo(operations.len());
            operations[operation] += 1;
            match operation {
                0 => {
                    let step = 1 + random.modulo(3);
                    cloud.keep_every(step);
                }
                1 => {
                    let kept: Vec<bool> = (0..cloud.len()).map(|_| random.modulo(4) > 0).collect();
                    cloud.retain(|i| kept[i]);
                }
                2 => cloud.thin_by_voxel(0.3 + random.unit(), &()).unwrap(),
                3 => cloud.crop(cloud.origin() + shift - 9.0, cloud.origin() + shift + 9.0),
                4 => cloud.add_noise(0.1, 3, &()).unwrap(),
                _ => {
                    // With other clouds before and after it, some without scans.
                    let pose = DMat4::from_translation(DVec3::new(1.0, 2.0, 3.0));
                    let none = PointCloud::new(cloud.origin(), positions(7));
                    let none = none.with_field("Sensor", FieldValues::F64(vec![f64::NAN; 7])).unwrap();
                    let parts = vec![(none.clone(), DMat4::IDENTITY), (cloud, pose), (none, pose)];
                    cloud = PointCloud::merge(parts);
                    shift += DVec3::new(1.0, 2.0, 3.0);
                }
            }
            assert!(keep_their_own(&cloud, |at| at + shift), "round {round}: operation {operation}");
        }
        let known = sensors(&cloud).iter().position(Option::is_some);
        if let Some(known) = known {
            let mut wrong = cloud.clone();
            wrong =
                wrong.with_scans(cloud.scans().iter().filter(|scan| !scan.points.contains(&known)).cloned().collect());
            assert!(!keep_their_own(&wrong, |at| at + shift), "not noticed: a sensor that is lost");
            assert!(!keep_their_own(&cloud, |at| at + shift + 1.0), "not noticed: one that stands elsewhere");
        }
    }
    assert!(operations.iter().all(|&count| count > 50), "every operation has its turns: {operations:?}");
}

#[test]
fn a_box_holds_its_faces() {
    let origin = DVec3::new(5e5, 5e6, 0.0);
    let mut cloud = PointCloud::new(origin, vec![[0.0; 3], [1.0, 0.0, 0.0], [1.5, 0.0, 0.0], [f32::NAN, 0.0, 0.0]]);
    cloud.crop(origin, origin + 1.0);
    assert_eq!(cloud.positions(), [[0.0; 3], [1.0, 0.0, 0.0]], "in world coordinates");
}

#[test]
fn every_third() {
    let mut cloud = PointCloud::new(DVec3::ZERO, positions(10));
    cloud.keep_every(3);
    let whole = positions(10);
    assert_eq!(cloud.positions(), [whole[0], whole[3], whole[6], whole[9]], "the first of each three");
}

#[test]
fn one_point_for_each_cube() {
    let mut cloud = PointCloud::new(DVec3::ZERO, positions(20_000));
    let whole = cloud.clone();
    cloud.thin_by_voxel(0.5, &()).unwrap();
    let cube = |[x, y, z]: [f32; 3]| [x, y, z].map(|value| (f64::from(value) / 0.5).floor() as i64);
    let cubes = |cloud: &PointCloud| {
        let mut cubes: Vec<_> = cloud.positions().iter().map(|&point| cube(point)).collect();
        cubes.sort_unstable();
        cubes.dedup();
        cubes
    };
    assert_eq!(cloud.len(), cubes(&whole).len(), "as many points as cubes");
    assert_eq!(cubes(&cloud), cubes(&whole), "and one in each");

    // The middle one of three points is nearest to their mean.
    let mut three = PointCloud::new(DVec3::ZERO, vec![[0.1; 3], [0.9; 3], [0.4; 3]]);
    three.thin_by_voxel(1.0, &()).unwrap();
    assert_eq!(three.positions(), [[0.4; 3]], "a measured point, not the mean");
    for size in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-300] {
        assert!(three.clone().thin_by_voxel(size, &()).is_err(), "cubes of {size}");
    }
}

#[test]
fn noise_has_its_size_and_repeats() {
    let still = PointCloud::new(DVec3::ZERO, vec![[0.0; 3]; 100_000]);
    let shaken = |seed| {
        let mut cloud = still.clone();
        cloud.add_noise(0.25, seed, &()).unwrap();
        cloud
    };
    let cloud = shaken(1);
    assert_eq!(cloud, shaken(1), "the same seed, the same noise");
    assert_ne!(cloud, shaken(2), "another seed, other noise");
    for axis in 0..3 {
        let values = || cloud.positions().iter().map(|point| f64::from(point[axis]));
        let mean = values().sum::<f64>() / 1e5;
        let deviation = (values().map(|value| (value - mean).powi(2)).sum::<f64>() / 1e5).sqrt();
        assert!(mean.abs() < 0.004, "mean {mean} along axis {axis}: 5 standard errors of zero");
        assert!((deviation - 0.25).abs() < 0.003, "deviation {deviation} along axis {axis}");
        let within = values().filter(|value| value.abs() < 0.25).count() as f64 / 1e5;
        assert!((within - 0.6827).abs() < 0.01, "{within} within one deviation, as the normal distribution has it");
    }
    assert!(still.clone().add_noise(-1.0, 0, &()).is_err(), "noise below zero");
}
