//! Tests of the scenes, which are the ground truth for other tests.

use std::sync::LazyLock;

use autosplats_cloud::{Axes, Error, PointCloud, Progress, Random};
use glam::DVec3;

use super::Scene;
use super::body::{Body, Op};
use super::fold::Fold;
use super::model::Points;
use super::octree::Octree;
use super::paint::Paint;
use super::sample;
use super::shape::{Placement, Shape};

/// Larger than any scene.
const FAR: f64 = 100.0;

fn scene(text: &str) -> Scene {
    Scene::parse(text).expect("the scene exists").0
}

fn sample(scene: &Scene, count: usize) -> PointCloud {
    scene.sample(count, &()).expect("the scene can be sampled")
}

/// Every scene at its beginning, built once for all tests.
fn all() -> impl Iterator<Item = &'static Scene> {
    static SCENES: LazyLock<Vec<Scene>> = LazyLock::new(|| Scene::names().map(|(name, _)| scene(name)).collect());
    SCENES.iter()
}

/// A position that sees the scene: outside of it, or inside the building.
fn eye(scene: &Scene, random: &mut Random) -> DVec3 {
    match &scene.model().points {
        Points::Scanned(stations) => stations[random.below(stations.len())],
        Points::Sampled(_) => sphere(random) * 12.0 + DVec3::Z,
    }
}

fn sphere(random: &mut Random) -> DVec3 {
    let z = 2.0 * random.unit() - 1.0;
    let (sin, cos) = (std::f64::consts::TAU * random.unit()).sin_cos();
    DVec3::new(cos * (1.0 - z * z).sqrt(), sin * (1.0 - z * z).sqrt(), z)
}

/// Rays that mostly hit something.
fn rays(scene: &Scene, count: usize) -> Vec<(DVec3, DVec3)> {
    let mut random = sample::random_of(7);
    let targets = sample(scene, count);
    (0..count)
        .map(|i| {
            let eye = eye(scene, &mut random);
            (eye, (targets.world_position(i) + 0.02 * sphere(&mut random) - eye).normalize())
        })
        .collect()
}

#[test]
fn a_scene_has_exactly_as_many_points_as_asked_for() {
    for scene in all() {
        for count in [17, 20_001] {
            let cloud = sample(scene, count);
            assert_eq!(cloud.len(), count, "{}", scene.name());
            assert_eq!(cloud.colors().map(<[_]>::len), Some(count), "{}", scene.name());
            assert_eq!(cloud.axes(), Some(Axes::ZUp), "{}", scene.name());
            assert!(cloud.positions().iter().flatten().all(|x| x.is_finite()), "{}", scene.name());
        }
        assert!(sample(scene, 0).is_empty(), "{}", scene.name());
    }
}

#[test]
fn every_point_lies_on_the_surface_that_rays_meet() {
    // Rounding to f32 moves a point by half a step: 1e-6 m at 25 m.
    const TOLERANCE: f64 = 5e-6;
    for scene in all() {
        let cloud = sample(scene, 4000);
        let mut seen = 0;
        for i in 0..cloud.len() {
            let p = cloud.world_position(i);
            let off = scene.distance(p).abs();
            assert!(off < TOLERANCE, "{} point {i} at {p}: {off} m off the surface", scene.name());
            // A ray straight at the point ends there, unless something covers the point from both sides.
            let slope = |axis: DVec3| scene.distance(p + axis * 1e-5) - scene.distance(p - axis * 1e-5);
            let normal = DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z)).normalize();
            seen += usize::from([normal, -normal].into_iter().any(|side| {
                let hit = scene.trace(p + side * 0.004, -side);
                hit.is_some_and(|hit| (hit.distance - 0.004).abs() < 2.0 * TOLERANCE)
            }));
        }
        assert!(seen * 1000 > cloud.len() * 995, "{}: rays find {seen} of {} points", scene.name(), cloud.len());
    }
}

#[test]
fn normals_are_unit_and_face_the_eye() {
    for scene in all() {
        let (mut hits, mut wrong) = (0, 0);
        for (eye, direction) in rays(scene, 4000) {
            let Some(hit) = scene.trace(eye, direction) else { continue };
            hits += 1;
            assert!((hit.normal.length() - 1.0).abs() < 1e-9, "{}: normal {}", scene.name(), hit.normal);
            assert!(hit.distance > 0.0, "{}: {} m", scene.name(), hit.distance);
            // Only in a crease, where two normals are equally valid, may the difference quotient give the far one.
            wrong += usize::from(hit.normal.dot(direction) > 1e-3);
        }
        assert!(hits > 2000, "{}: only {hits} rays hit", scene.name());
        assert!(wrong <= 2, "{}: {wrong} of {hits} normals look away", scene.name());
    }
}

#[test]
fn cells_change_no_hit() {
    // The oracle: the whole body, no cells, steps of the distance bound.
    for scene in all() {
        let tree = &scene.model().tree;
        let (list, mut checked) = (tree.body().all(), 0);
        for (eye, direction) in rays(scene, 60) {
            let f = |t: f64| tree.body().distance(tree.folded(eye + direction * t), &list);
            let mut t = 0.0;
            while t < 40.0 && f(t) > 1e-6 {
                t += 0.9 * f(t);
            }
            let found = scene.trace(eye, direction).map_or(FAR, |hit| hit.distance);
            if t >= 40.0 {
                assert!(found > 39.0, "{}: {found} m, but nothing is there", scene.name());
                continue;
            }
            checked += 1;
            // Where the ray grazes, a bound below a micrometre may still be some way off along the ray.
            assert!(found > t - 1e-5 && f(0.5 * (t + found)) < 1e-4, "{}: {found} m for {t} m", scene.name());
        }
        assert!(checked > 30, "{}: only {checked} rays were checked", scene.name());
    }
}

#[test]
fn rays_together_meet_what_each_meets_alone() {
    for scene in all() {
        // Some rays leave the scene, have no direction or begin outside of it.
        let mut rays = rays(scene, 500);
        let mut random = sample::random_of(11);
        rays.extend((0..200).map(|_| (sphere(&mut random) * FAR * random.unit(), sphere(&mut random))));
        rays.insert(40, (DVec3::Z, DVec3::ZERO));
        let tree = &scene.model().tree;
        let mut together = vec![None; rays.len()];
        tree.trace_each(&rays, &mut together);
        let alone = rays.iter().map(|&(origin, direction)| tree.trace(origin, direction, 0.0..f64::INFINITY));
        let alone: Vec<_> = alone.collect();
        assert!(alone.iter().any(Option::is_some) && alone.iter().any(Option::is_none), "{}", scene.name());
        // The texts of numbers are exact.
        assert_eq!(format!("{together:?}"), format!("{alone:?}"), "{}", scene.name());
    }
}

#[test]
fn all_points_are_within_bounds_that_are_not_much_wider() {
    for scene in all() {
        let [low, high] = scene.bounds();
        let cloud = sample(scene, 100_000);
        let points = (0..cloud.len()).map(|i| cloud.world_position(i));
        let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (least, most) = points.fold(none, |(least, most), p| (least.min(p), most.max(p)));
        let name = scene.name();
        assert!(low.cmple(least).all() && high.cmpge(most).all(), "{name}: {least} to {most} in {low} to {high}");
        // A cathedral is scanned from inside; its walls are half a metre to two metres thick.
        let wider = (high - low - (most - least)).max_element() / (most - least).max_element();
        assert!(wider < 0.1, "{name}: wider by {wider}: {low} to {high}, points {least} to {most}");
    }
}

#[test]
fn rays_in_a_plane_of_the_fold_arrive() {
    let cathedral = scene("cathedral");
    // Space is folded at x = -6 (half a bay) and at y = 0 (the aisles).
    for (origin, plane) in [(DVec3::new(-6.0, 0.3, 1.75), DVec3::X), (DVec3::new(-4.7, 0.0, 1.75), DVec3::Y)] {
        for step in 0..32 {
            let (sin, cos) = (0.2 * f64::from(step)).sin_cos();
            for off in [0.0, 1e-17, -1e-13] {
                let direction = DVec3::new(0.0, cos, sin) * plane.x + DVec3::new(cos, 0.0, sin) * plane.y + plane * off;
                let hit = cathedral.trace(origin, direction).expect("nothing leads out of a cathedral");
                let distance = cathedral.distance(origin + direction.normalize() * hit.distance).abs();
                assert!(distance < 0.01, "{origin} {direction}: {distance} from the surface");
            }
        }
    }
}

#[test]
fn the_number_of_threads_changes_no_byte() {
    let with = |threads: usize, scene: &Scene| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can be had");
        pool.install(|| sample(scene, 40_000))
    };
    for scene in all() {
        let (one, two) = (with(1, scene), with(2, scene));
        assert!(one == two, "{} differs between one thread and two", scene.name());
        assert!(one == sample(&self::scene(scene.name()), 40_000), "{} differs between two runs", scene.name());
    }
}

#[test]
fn names_counts_and_times_are_read() {
    for (text, name, count, seconds) in [
        ("figure", "figure", 200_000, 0.0),
        ("scene:statue", "statue", 546_000, 0.0),
        ("scene:two-scales:1000", "two-scales", 1000, 0.0),
        ("herd:1.5M@0.25", "herd", 1_500_000, 0.25),
        ("HERD:546k@-1", "herd", 546_000, -1.0),
        ("cathedral:1g", "cathedral", 1_000_000_000, 0.0),
        ("figure@2", "figure", 200_000, 2.0),
    ] {
        let (scene, n) = Scene::parse(text).expect(text);
        assert_eq!((scene.name(), n, scene.seconds()), (name, count, seconds), "{text}");
    }
    for text in
        ["figure:", "figure:0", "figure:-5", "figure:1e5", "figure:2G", "figure:1..5M", "figure@", "figure@soon"]
    {
        let error = Scene::parse(text).expect_err(text);
        assert!(matches!(error, Error::BadScene { .. }), "{text}: {error}");
    }
    for text in ["", "scene:", "dragon:1M"] {
        let message = Scene::parse(text).expect_err(text).to_string();
        for (name, about) in Scene::names() {
            assert!(message.contains(name) && message.contains(about), "{text:?}: {message}");
        }
    }
}

#[test]
fn points_are_sampled_evenly() {
    // A ball, and a block far from it that is rotated against the cells. Expected counts follow from the areas.
    let (radius, half) = (0.7, DVec3::new(0.9, 0.5, 0.25));
    let turned = Placement::along(DVec3::new(-1.1, -1.2, -1.3), DVec3::new(0.3, 0.5, 0.8), DVec3::new(1.0, -0.2, 0.1));
    let center = DVec3::new(1.03, 1.01, 1.02);
    let mut body = Body::new(Paint::Plain(200, 200, 200));
    body.group(Op::Join, 0.0);
    body.join(0.0, Shape::ball(center, radius)).join(0.0, Shape::Block { at: turned, half, round: 0.0 });
    let tree = Octree::new(body, Fold::None, DVec3::splat(-3.0), 6.0, 7);
    let count = 300_000;
    let (mut positions, mut colors) = (vec![[0.0; 3]; count], vec![[0; 3]; count]);
    assert!(sample::Zones::new(&tree, &[1.0]).sample(0, &mut positions, &mut colors, &()), "the body is strewn");

    let ball = 4.0 * std::f64::consts::PI * radius * radius;
    let faces = [half.y * half.z, half.x * half.z, half.x * half.y].map(|quarter| 4.0 * quarter);
    let total = ball + 2.0 * faces.iter().sum::<f64>();
    // 8 bands of equal height on the ball have equal area, each cut in 4 by quadrant; then the block's 6 faces.
    let mut counts = [0; 32 + 6];
    let mut expected = vec![count as f64 * ball / total / 32.0; 32];
    expected.extend(faces.iter().flat_map(|face| [count as f64 * face / total; 2]));
    for p in &positions {
        let p = DVec3::from(p.map(f64::from));
        let q = p - center;
        if q.length() < radius + 0.01 {
            let band = (((q.z / radius + 1.0) * 4.0) as usize).min(7);
            counts[band * 4 + 2 * usize::from(q.x > 0.0) + usize::from(q.y > 0.0)] += 1;
        } else {
            let q = turned.axes.transpose() * (p - turned.origin) / half;
            let axis = (0..3).max_by(|&a, &b| q[a].abs().total_cmp(&q[b].abs())).expect("three axes");
            counts[32 + 2 * axis + usize::from(q[axis] > 0.0)] += 1;
        }
    }
    for (i, (&n, &mean)) in counts.iter().zip(&expected).enumerate() {
        // Five standard deviations of a Poisson count, with a fixed seed.
        assert!((f64::from(n) - mean).abs() < 5.0 * mean.sqrt(), "patch {i}: {n} points for {mean:.0}");
    }
}

#[test]
fn both_scales_get_as_many_points() {
    let cloud = sample(&scene("two-scales"), 10_000);
    // The ears of the large horse end below 2.2 m. The small horse, grey as stone, stands between them from 2.08 m on.
    let grey = |c: &&[u8; 3]| c[0].abs_diff(c[2]) < 14 && c[0] > 90;
    let small = cloud.colors().map_or(0, |colors| colors.iter().filter(grey).count());
    assert!((4000..=5000).contains(&small), "{small} of 10000 points are grey");
}

#[test]
fn what_is_animated_moves_stays_closed_and_repeats() {
    for scene in all() {
        let (start, later) = (sample(scene, 500), sample(&scene.at(0.23), 500));
        assert_eq!(start != later, scene.is_animated(), "{}", scene.name());
        assert!(start == sample(&scene.at(Scene::PERIOD), 500), "{} repeats", scene.name());
        if !scene.is_animated() {
            continue;
        }
        for seconds in [0.0, 0.21, 1.13] {
            let scene = scene.at(seconds);
            for (eye, direction) in rays(&scene, 100) {
                // A ray that enters a solid must leave it.
                let (mut t, mut inside) = (0.0, false);
                while let Some(hit) = scene.trace(eye + direction * t, direction) {
                    t += hit.distance + 1e-6;
                    inside = scene.distance(eye + direction * t) < 0.0;
                }
                assert!(!inside, "{} at {seconds} s: a ray from {eye} ends inside", scene.name());
            }
        }
    }
}

#[test]
fn horses_stay_on_the_meadow_and_the_dancer_above_the_floor() {
    for seconds in [0.3, 1.4] {
        for (name, low, high) in [("figure", -0.03, 2.3), ("herd", -0.7, 2.4)] {
            let cloud = sample(&scene(name).at(seconds), 5000);
            let inside = (0..5000).all(|i| (low..high).contains(&cloud.world_position(i).z));
            assert!(inside, "{name} at {seconds} s leaves its place");
        }
    }
}

/// Progress of work that nobody wants.
struct Refused;

impl Progress for Refused {
    fn report(&self, _: f32) {}

    fn cancelled(&self) -> bool {
        true
    }
}

#[test]
fn saying_no_to_progress_cancels() {
    for scene in all() {
        let error = scene.sample(100_000, &Refused).expect_err("cancelled");
        assert!(matches!(error, Error::Cancelled), "{}: {error}", scene.name());
    }
    let error = scene("figure").sample(Scene::MAX_COUNT + 1, &()).expect_err("too many");
    assert!(matches!(error, Error::BadScene { .. }), "{error}");
}
