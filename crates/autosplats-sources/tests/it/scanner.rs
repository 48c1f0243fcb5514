//! Compares simulated scanners with the surfaces that they scan.

use std::{sync::Arc, time::Duration};

use crate::common::shared_data;
use autosplats_cloud::{
    Contents, Error, PointCloud,
    glam::{DMat4, DVec3},
};
use autosplats_formats::ReadOptions;
use autosplats_scenes::{Scanner, Scene};
use autosplats_sources::{Animation, Next, Stream as _};

/// The scans of all scanners in a frame.
fn frame(animation: &Animation, frame: usize) -> Vec<Arc<PointCloud>> {
    let mut stream = animation.play();
    stream.seek(frame);
    let stamp = animation.timeline().stamps()[frame];
    let channels = 0..stream.updates_per_frame();
    let clouds = channels.map(|channel| match stream.next(Duration::ZERO, &()).unwrap() {
        Next::Update(update) => {
            assert_eq!((update.channel, update.stamp), (channel, stamp), "in order, at the time of the frame");
            update.cloud
        }
        other => panic!("no update: {other:?}"),
    });
    clouds.collect()
}

fn figure() -> (Scene, Animation) {
    let (scene, count) = Scene::parse("scene:figure").unwrap();
    let animation = Animation::scene(&scene, count, 10.0).unwrap();
    (scene, animation)
}

/// The first placed scanner, with few rays and without errors.
fn exact(animation: &Animation) -> Scanner {
    let scanner = animation.scanners(1, &()).unwrap().remove(0);
    Scanner { columns: 160, rows: 120, noise: 0.0, ..scanner }
}

/// A square of 2 m by 2 m across the z axis, three metres in front of a sensor at the origin.
fn wall() -> Animation {
    let corners = [[-1.0, -1.0, 3.0], [1.0, -1.0, 3.0], [1.0, 1.0, 3.0], [-1.0, 1.0, 3.0]];
    let cloud = PointCloud::new(DVec3::ZERO, corners.to_vec()).with_colors(vec![[0; 3], [0; 3], [200; 3], [200; 3]]);
    Animation::still(Contents { cloud: cloud.unwrap(), triangles: vec![[0, 1, 2], [0, 2, 3]] })
}

#[test]
fn points_without_noise_are_the_first_that_rays_meet() {
    let (scene, animation) = figure();
    let scanner = exact(&animation);
    let eye = scanner.world_from_sensor.w_axis.truncate();
    let seen = &frame(&animation.scanned(vec![scanner], 1).unwrap(), 7)[0];
    assert!(seen.len() > 500, "{} points", seen.len());
    let then = scene.at(0.7);
    for index in (0..seen.len()).step_by(7) {
        let ray = seen.world_position(index) - eye;
        let hit = then.trace(eye, ray).unwrap();
        // Positions have 24 bits, so a ray may miss a silhouette by that.
        assert!(
            (hit.distance - ray.length()).abs() < 1e-4 || then.distance(seen.world_position(index)) < 1e-6,
            "{index}"
        );
    }
    assert_eq!(seen.scans()[0].position(), eye, "where it stood");
    assert_eq!(seen.scans()[0].points, 0..seen.len(), "all of them");
}

#[test]
fn no_ray_that_meets_a_scene_is_left_out() {
    for name in ["scene:figure", "scene:herd", "scene:cathedral"] {
        let (scene, count) = Scene::parse(name).unwrap();
        let animation = Animation::scene(&scene, count, 10.0).unwrap();
        let mut scanners = animation.scanners(2, &()).unwrap();
        // One scanner stands in the middle and looks around.
        let all_around = DMat4::from_translation(DVec3::new(0.1, 0.2, 1.7));
        scanners.push(Scanner { world_from_sensor: all_around, fov_degrees: [360.0, 170.0], ..Scanner::default() });
        for scanner in &mut scanners {
            *scanner = Scanner { columns: 80, rows: 60, noise: 0.0, ..scanner.clone() };
        }
        let seen = frame(&animation.scanned(scanners.clone(), 1).unwrap(), 0);
        for (index, (scanner, seen)) in scanners.iter().zip(&seen).enumerate() {
            let pose = scanner.world_from_sensor;
            let angle = |axis: usize, ray: u32, rays: u32| {
                (scanner.fov_degrees[axis] * ((f64::from(ray) + 0.5) / f64::from(rays) - 0.5)).to_radians().sin_cos()
            };
            let met = (0..60).flat_map(|row| (0..80).map(move |column| (row, column))).filter(|&(row, column)| {
                let ((sin, cos), (down, level)) = (angle(0, column, 80), angle(1, row, 60));
                let direction = pose.transform_vector3(DVec3::new(sin * level, down, cos * level));
                scene.trace(pose.w_axis.truncate(), direction).is_some()
            });
            assert_eq!(seen.len(), met.count(), "{name}, scanner {index}");
            assert!(seen.len() > 50, "{name}, scanner {index}: {} points", seen.len());
        }
    }
}

#[test]
fn a_mesh_hides_what_is_behind_it() {
    let Some(data) = shared_data() else { return };
    let folder = data.join("animation/horse_gallop");
    let horse = Animation::sequence(folder.to_str().unwrap(), 10.0, &ReadOptions::default(), &()).unwrap();
    let scanners: Vec<_> =
        horse.scanners(3, &()).unwrap().into_iter().map(|own| Scanner { columns: 320, rows: 240, ..own }).collect();
    let scanned = horse.scanned(scanners.clone(), 5).unwrap();
    assert_eq!(scanned.timeline(), horse.timeline(), "the timeline is the horse's");
    let [first, later] = [0, 3].map(|index| frame(&scanned, index));
    assert_eq!(first.len(), 3, "an update of each");
    for (scanner, cloud) in scanners.iter().zip(&first) {
        let eye = scanner.world_from_sensor.w_axis.truncate();
        let middle = DVec3::new(0.0, 0.7, -0.2);
        let near = (0..cloud.len()).filter(|&i| cloud.world_position(i).distance(eye) < middle.distance(eye)).count();
        assert!(
            cloud.len() > 2000 && near * 10 > cloud.len() * 6,
            "most of {} points are on the near side",
            cloud.len()
        );
    }
    assert_ne!(first[0].positions(), later[0].positions(), "it moves");
}

#[test]
fn noise_dropouts_and_colours_are_as_asked_for() {
    let scanner = Scanner { fov_degrees: [30.0, 30.0], columns: 300, rows: 300, ..Scanner::default() };
    let see = |scanner: Scanner, seed: u64| frame(&wall().scanned(vec![scanner], seed).unwrap(), 0).remove(0);
    let all = see(scanner.clone(), 1);
    assert_eq!(all.len(), 300 * 300, "every ray meets the wall");
    assert!(all.positions().iter().all(|[_, _, z]| (z - 3.0).abs() < 1e-6), "where it is");
    let (colors, positions) = (all.colors().unwrap(), all.positions());
    for ([red, _, _], [_, y, _]) in colors.iter().zip(positions) {
        assert!((f32::from(*red) - 100.0 * (y + 1.0)).abs() < 1.0, "colours are interpolated");
    }
    let noisy = see(Scanner { noise: 0.02, ..scanner.clone() }, 1);
    let error = |i: usize| noisy.world_position(i).length() - all.world_position(i).length();
    let deviation = ((0..90_000).map(|i| error(i).powi(2)).sum::<f64>() / 90_000.0).sqrt();
    let mean = (0..90_000).map(error).sum::<f64>() / 90_000.0;
    // 90,000 values determine the deviation to a quarter of a percent, and the mean to 1/300 of the deviation.
    assert!((deviation - 0.02).abs() < 2e-4 && mean.abs() < 3e-4, "deviation {deviation}, mean {mean}");
    let across = |i: usize| noisy.world_position(i).normalize().dot(all.world_position(i).normalize());
    assert!((0..90_000).step_by(97).all(|i| across(i) > 1.0 - 1e-12), "along the rays alone");
    let kept = see(Scanner { dropouts: 0.25, ..scanner.clone() }, 1).len() as f64 / 90_000.0;
    assert!((kept - 0.75).abs() < 0.01, "a quarter is missing: {kept}");
    assert!(see(Scanner { dropouts: 1.0, ..scanner.clone() }, 1).is_empty(), "and all of them");
}

#[test]
fn a_wrong_pose_moves_all_points_together() {
    let scanner = Scanner { columns: 80, rows: 60, fov_degrees: [30.0, 30.0], ..Scanner::default() };
    let off = Scanner { misplaced: 0.1, misturned_degrees: 2.0, ..scanner.clone() };
    let scanned = wall().scanned(vec![scanner, off.clone(), off], 3).unwrap();
    let [right, wrong, other] = <[_; 3]>::try_from(frame(&scanned, 0)).unwrap();
    let believed = wrong.scans()[0].world_from_sensor;
    assert!((wrong.scans()[0].position().length() - 0.1).abs() < 1e-9, "so far from where it is");
    let angle = believed.to_scale_rotation_translation().1.to_axis_angle().1;
    assert!((angle.to_degrees() - 2.0).abs() < 1e-6, "turned by so much");
    for index in (0..right.len()).step_by(11) {
        let moved = believed.transform_point3(right.world_position(index));
        assert!(moved.abs_diff_eq(wrong.world_position(index), 1e-6), "point {index}");
    }
    assert_ne!(wrong.scans()[0].world_from_sensor, other.scans()[0].world_from_sensor, "each in its own way");
}

#[test]
fn the_same_seed_gives_the_same_points_with_any_number_of_threads() {
    let (_, animation) = figure();
    let scanner = Scanner { noise: 0.01, dropouts: 0.1, misplaced: 0.01, ..exact(&animation) };
    let see = |seed: u64| frame(&animation.scanned(vec![scanner.clone(); 2], seed).unwrap(), 3);
    let threads = |count| rayon::ThreadPoolBuilder::new().num_threads(count).build().unwrap();
    let one = threads(1).install(|| see(9));
    assert_eq!(threads(4).install(|| see(9)), one, "threads change nothing");
    assert_ne!(one[0].positions(), one[1].positions(), "two scanners at one place differ");
    assert_ne!(see(10)[0].positions(), one[0].positions(), "another seed");
}

#[test]
fn scanners_around_something_look_at_it_from_all_sides() {
    let scanners = Scanner::around(DVec3::new(-1.0, 4.0, 0.0), DVec3::new(1.0, 6.0, 3.0), DVec3::Z, 4);
    let centre = DVec3::new(0.0, 5.0, 1.5);
    for (index, scanner) in scanners.iter().enumerate() {
        let pose = scanner.world_from_sensor;
        let in_sensor = pose.inverse().transform_point3(centre);
        assert!(in_sensor.truncate().length() < 1e-9 && in_sensor.z > 3.0, "scanner {index} looks at it: {in_sensor}");
        assert!((pose.determinant() - 1.0).abs() < 1e-12, "turned, not mirrored");
        assert!(pose.y_axis.z < 0.0 && pose.w_axis.z > 1.5, "upright and from above");
        let next = scanners[(index + 1) % 4].world_from_sensor.w_axis.truncate() - centre;
        let own = pose.w_axis.truncate() - centre;
        assert!(own.truncate().dot(next.truncate()).abs() < 1e-9, "a quarter of a turn on");
        assert!(scanner.noise > 0.0 && scanners[..index].iter().all(|one| one.noise < scanner.noise), "noisier");
    }
}

#[test]
fn scanners_that_cannot_be_are_refused() {
    let good = Scanner::default();
    let mirrored = DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    let bad = [
        Scanner { columns: 0, ..good.clone() },
        Scanner { columns: u32::MAX, rows: u32::MAX, ..good.clone() },
        Scanner { fov_degrees: [400.0, 40.0], ..good.clone() },
        Scanner { fov_degrees: [40.0, f64::NAN], ..good.clone() },
        Scanner { noise: -1.0, ..good.clone() },
        Scanner { noise: f64::INFINITY, ..good.clone() },
        Scanner { dropouts: 1.5, ..good.clone() },
        Scanner { misplaced: f64::NAN, ..good.clone() },
        Scanner { misturned_degrees: 181.0, ..good.clone() },
        Scanner { world_from_sensor: DMat4::ZERO, ..good.clone() },
        Scanner { world_from_sensor: mirrored, ..good.clone() },
        Scanner { world_from_sensor: DMat4::from_translation(DVec3::splat(f64::NAN)), ..good.clone() },
    ];
    for scanner in bad {
        let refused = wall().scanned(vec![scanner.clone()], 1);
        assert!(matches!(refused, Err(Error::BadValue { .. })), "{scanner:?}: {refused:?}");
    }
    assert!(wall().scanned(Vec::new(), 1).is_err(), "no scanner at all");
    let points = Animation::still(PointCloud::new(DVec3::ZERO, vec![[0.0; 3]; 3]).into());
    let mut stream = points.scanned(vec![good], 1).unwrap().play();
    assert!(matches!(stream.next(Duration::ZERO, &()), Err(Error::NoSurface)), "points have no surface");
}
