//! Normals against brute force in `f64`; independence of order, threads and vector width; degenerate clouds.

use std::sync::Mutex;

use autosplats_cloud::Progress;
use autosplats_cloud::glam::DMat3;

use super::*;
use crate::fit::tests::eigenvalues;
use crate::test_clouds::{self, Positions, Random};

fn estimate(positions: &[[f32; 3]], k: u32, orientation: Orientation) -> Normals {
    let cloud = PointCloud::new(DVec3::new(5e5, -4e6, 100.0), positions.to_vec());
    estimate_normals(&cloud, &NormalSettings { k, orientation }, &()).expect("valid settings")
}

fn is_finite(position: &[f32; 3]) -> bool {
    position.iter().all(|c| c.abs() <= MAX_COORDINATE)
}

/// Clouds of many kinds with up to about a thousand points.
fn clouds() -> Vec<(&'static str, Positions)> {
    let mut random = Random::new(11);
    let mut volume = |count: usize, size: f32, at: [f32; 3]| -> Positions {
        (0..count).map(|_| at.map(|c| c + size * random.signed())).collect()
    };
    let mut clouds = test_clouds::all(900);
    let mut densities = volume(300, 1.0, [0.0; 3]);
    densities.extend(volume(300, 0.01, [0.5, 0.0, 0.0]));
    densities.extend(volume(300, 1e-4, [0.5, 0.3, 0.0]));
    let mut far = volume(200, 1.0, [-3e4, 0.0, 0.0]);
    far.extend(volume(200, 1.0, [3e4, 1e4, 0.0]));
    let mut poisoned = test_clouds::sphere(500);
    for (index, bad) in (0..500).step_by(7).zip([f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 2e18].iter().cycle()) {
        poisoned[index][index % 3] = *bad;
    }
    let grid = (0..512).map(|i| [i % 8, i / 8 % 8, i / 64].map(|c| c as f32)).collect();
    let mut outlying = volume(300, 1e-3, [0.0; 3]);
    outlying.extend(volume(9, 1e3, [0.0; 3]));
    clouds.extend([
        ("volume", volume(700, 1.0, [0.0; 3])),
        ("densities", densities),
        ("two far clusters", far),
        ("poisoned", poisoned),
        ("grid", grid),
        ("outlying", outlying),
        ("coinciding", vec![[1.0, 2.0, 3.0]; 100]),
        ("no points", Vec::new()),
        ("nothing finite", vec![[f32::NAN; 3]; 20]),
        ("huge", volume(100, 9e17, [0.0; 3])),
        ("tiny", volume(100, 1e-12, [0.0; 3])),
    ]);
    clouds
}

/// The first mistake in `result` by brute force in `f64`, if any.
fn mistake(positions: &[[f32; 3]], k: u32, result: &Normals) -> Option<String> {
    let finite: Vec<DVec3> = positions.iter().filter(|p| is_finite(p)).map(|p| DVec3::from(p.map(f64::from))).collect();
    for (index, position) in positions.iter().enumerate() {
        let normal = result.normals[index];
        let [curvature, radius] = [result.curvature[index], result.radius[index]].map(f64::from);
        if !is_finite(position) {
            if !(normal.iter().all(|c| c.is_nan()) && curvature.is_nan() && radius.is_nan()) {
                return Some(format!("point {index} is not finite, its normal {normal:?}"));
            }
            continue;
        }
        let at = DVec3::from(position.map(f64::from));
        let mut neighbors: Vec<(f64, DVec3)> = finite.iter().map(|&p| ((p - at).length(), p - at)).collect();
        neighbors.sort_by(|a, b| a.0.total_cmp(&b.0));
        let k = (k as usize).min(finite.len() - 1);
        let kth = neighbors[k].0;
        let expected = 2.0 * kth / (k.max(1) as f64).sqrt();
        // f32 rounding of three products, their sum and a root. All comparisons are written so that NaN fails.
        if !((radius - expected).abs() <= 1e-6 * expected) {
            return Some(format!("point {index}: radius {radius}, should be {expected}"));
        }
        let normal = DVec3::from(normal.map(f64::from));
        if !((normal.length() - 1.0).abs() <= 1e-5 && (0.0..=0.3334).contains(&curvature)) {
            return Some(format!("point {index}: normal {normal}, curvature {curvature}"));
        }
        // f32 rounding decides whether a point so near to the k-th distance is a neighbour.
        let unsure = neighbors.iter().any(|n| n.0 != kth && (n.0 - kth).abs() < 1e-6 * kth);
        if unsure || kth == 0.0 {
            continue;
        }
        let near: Vec<DVec3> = neighbors.iter().take_while(|n| n.0 <= kth).map(|n| n.1 / kth).collect();
        let share = 1.0 / near.len() as f64;
        let mean = near.iter().sum::<DVec3>() * share;
        let outer = |v: DVec3| DMat3::from_cols(v * v.x, v * v.y, v * v.z);
        let covariance = near.iter().map(|&n| outer(n - mean)).fold(DMat3::ZERO, |sum, term| sum + term) * share;
        let [least, middle, largest] = eigenvalues(covariance).map(|value| value.max(0.0));
        // The variance along the normal has no sign and tolerates two equal axes. In units of the k-radius entries are
        // at most 1, so the loss of f32 sums and rotations is absolute.
        if normal.dot(covariance * normal) > least + 1e-5 * largest + 2e-6 {
            return Some(format!("point {index}: variance {} along the normal", normal.dot(covariance * normal)));
        }
        let expected = least / (least + middle + largest);
        let loss = 1e-5 + 2e-6 / (least + middle + largest);
        if !((curvature - expected).abs() <= loss) {
            return Some(format!("point {index}: curvature {curvature}, should be {expected}"));
        }
    }
    None
}

#[test]
fn equals_brute_force() {
    for (name, positions) in clouds() {
        for k in [3, 10, 40, 1024] {
            let result = estimate(&positions, k, Orientation::Outward);
            assert_eq!(mistake(&positions, k, &result), None, "{name}, k = {k}");
        }
    }
}

#[test]
fn the_comparison_can_fail() {
    let positions = test_clouds::sphere(300);
    let right = estimate(&positions, 10, Orientation::Outward);
    let wrong: [fn(&mut Normals); 5] = [
        |n| n.normals[7] = [n.normals[7][1], n.normals[7][2], n.normals[7][0]],
        |n| n.normals[7][0] *= 1.1,
        |n| n.curvature[7] += 0.001,
        |n| n.radius[7] *= 1.00001,
        |n| n.radius[7] = f32::NAN,
    ];
    for (case, spoil) in wrong.into_iter().enumerate() {
        let mut spoiled = right.clone();
        spoil(&mut spoiled);
        assert!(mistake(&positions, 10, &spoiled).is_some(), "mistake {case} is not seen");
    }
    assert!(mistake(&positions, 9, &right).is_some(), "another k gives the same");
}

/// The bits of a result, NaN included.
fn bits(normals: &Normals) -> Vec<u32> {
    let all = normals.normals.as_flattened().iter().chain(&normals.curvature).chain(&normals.radius);
    all.map(|value| value.to_bits()).collect()
}

#[test]
fn threads_do_not_matter() {
    let mut cloud = test_clouds::density_ramp(60_000);
    cloud.extend(test_clouds::duplicates(3000));
    cloud.extend(test_clouds::outliers(100));
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        bits(&pool.install(|| estimate(&cloud, 10, Orientation::Outward)))
    };
    let one = with(1);
    assert!(one == with(2) && one == with(5), "the number of threads changes the result");
    assert!(one != bits(&estimate(&cloud, 11, Orientation::Outward)), "the comparison sees nothing");
}

#[test]
fn vectors_of_any_width_give_the_same_bits() {
    for (name, positions) in clouds().into_iter().filter(|(_, positions)| positions.len() > 10) {
        let cloud = PointCloud::new(DVec3::ZERO, positions);
        let tree = Tree::build(finite_points(&cloud), &|_| Ok(())).expect("not cancelled");
        let sides = Sides::new(&cloud, &Orientation::Direction(DVec3::Z)).expect("a direction");
        let run = |scalar: bool| {
            let output = Output::new(cloud.len());
            let k = 10.min((tree.len as u32).saturating_sub(1));
            let job = Job { tree: &tree, sides: &sides, k, wanted: None, output: &output };
            let leaves = 0..tree.leaves.len();
            match scalar {
                true => estimate_leaves_with(pulp::Scalar, &job, leaves, &mut Scratch::default()),
                false => estimate_leaves(&job, leaves, &mut Scratch::default()),
            }
            bits(&output.finish())
        };
        assert!(run(true) == run(false), "{name}: the width of vectors changes the result");
    }
}

#[test]
fn shuffling_changes_nothing_but_rounding() {
    for (name, positions) in clouds() {
        let mut order: Vec<usize> = (0..positions.len()).collect();
        Random::new(5).shuffle(&mut order);
        let shuffled: Positions = order.iter().map(|&index| positions[index]).collect();
        let [plain, moved] = [&positions, &shuffled].map(|p| estimate(p, 10, Orientation::Direction(DVec3::Z)));
        for (to, &from) in order.iter().enumerate() {
            // The radius is exact; curvature and normals are sums in another order.
            let [a, b] = [plain.radius[from], moved.radius[to]];
            assert_eq!(a.to_bits(), b.to_bits(), "{name}: point {from}: radius {a} became {b}");
            let [a, b] = [plain.curvature[from], moved.curvature[to]];
            assert!(!((a - b).abs() > 1e-5), "{name}: point {from}: curvature {a} became {b}");
        }
        assert_eq!(mistake(&shuffled, 10, &moved), None, "{name}, shuffled");
    }
}

#[test]
fn normals_turn_to_their_viewpoint() {
    let positions = test_clouds::sphere(4000);
    let origin = DVec3::new(5e5, -4e6, 100.0);
    let viewpoint = |at: DVec3, points| Viewpoint { position: origin + at, points };
    // The first thousand are seen from one side, the third thousand from the middle, the others from nowhere.
    let viewpoints = vec![
        viewpoint(DVec3::ZERO, 2000..3000),
        viewpoint(DVec3::new(0.0, 0.0, 50.0), 0..1000),
        viewpoint(DVec3::X, 17..17),
    ];
    let result = estimate(&positions, 10, Orientation::Viewpoints(viewpoints));
    let up = estimate(&positions, 10, Orientation::Direction(DVec3::new(0.0, 0.0, 3.0)));
    for (index, position) in positions.iter().enumerate() {
        let [normal, upward] = [&result, &up].map(|normals| DVec3::from(normals.normals[index].map(f64::from)));
        let radial = DVec3::from(position.map(f64::from));
        assert!(normal.dot(radial).abs() > 0.9, "point {index}: {normal} is not the sphere's normal");
        assert!(upward.z >= 0.0, "point {index}: {upward} is not upward");
        match index / 1000 {
            0 => assert!(normal.dot(DVec3::Z * 50.0 - radial) >= -1e-5, "point {index} looks away"),
            2 => assert!(normal.dot(radial) < 0.0, "point {index} looks away from the middle"),
            _ => assert!(normal.dot(radial) > 0.0, "point {index} looks inward"),
        }
    }
}

#[test]
fn lines_and_places_look_where_they_are_asked_to() {
    let up = Orientation::Direction(DVec3::Z);
    let line: Positions = (0..50).map(|i| [i as f32, 0.0, 0.0]).collect();
    for cloud in [line, vec![[1.0; 3]; 40], vec![[2.0; 3]], vec![[0.0; 3], [1.0, 0.0, 0.0]]] {
        let result = estimate(&cloud, 10, up.clone());
        for (normal, curvature) in result.normals.iter().zip(&result.curvature) {
            assert!(normal[2] > 0.9999, "{} points: {normal:?} is not upward", cloud.len());
            assert!(*curvature < 1e-6, "{} points: curvature {curvature}", cloud.len());
        }
    }
}

/// Quadratic time in these numbers would take minutes, so no time is measured.
#[test]
fn degenerate_clouds_end() {
    let mut random = Random::new(3);
    let place = vec![[0.25f32, 0.5, 0.75]; 100_000];
    let mut outlying = place.clone();
    outlying.extend((0..50).map(|_| [0; 3].map(|_| 1e6 * random.signed())));
    let mut cluster: Positions = (0..100_000).map(|_| [0; 3].map(|_| 1e-6 * random.signed())).collect();
    cluster.extend((0..200).map(|_| [0; 3].map(|_| 1e9 * random.signed())));
    let places = (0..100_000).map(|i| [(i % 10) as f32, 0.0, 0.0]).collect();
    let line = (0..100_000).map(|_| [random.signed(), 0.0, 0.0]).collect();
    for cloud in [place, outlying, cluster, places, line] {
        for k in [10, 1024] {
            let result = estimate(&cloud, k, Orientation::Outward);
            let all = bits(&result).into_iter().map(f32::from_bits);
            assert!(all.into_iter().all(f32::is_finite), "a finite point without a result, k = {k}");
        }
    }
}

struct Watched {
    seen: Mutex<Vec<f32>>,
    stop_after: usize,
}

impl Progress for Watched {
    fn report(&self, fraction: f32) {
        self.seen.lock().expect("no panic").push(fraction);
    }

    fn cancelled(&self) -> bool {
        self.seen.lock().expect("no panic").len() >= self.stop_after
    }
}

#[test]
fn tells_how_far_it_is_and_can_be_stopped() {
    let cloud = PointCloud::new(DVec3::ZERO, test_clouds::sphere(200_000));
    let run = |stop_after| {
        let watched = Watched { seen: Mutex::new(Vec::new()), stop_after };
        let result = estimate_normals(&cloud, &NormalSettings::default(), &watched);
        (result, watched.seen.into_inner().expect("no panic"))
    };
    let (result, seen) = run(usize::MAX);
    assert!(result.is_ok(), "not asked to stop");
    assert!(seen.len() > 20 && seen.is_sorted() && seen.last() == Some(&1.0), "{seen:?}");
    for stop_after in [0, 1, 5, 15] {
        assert!(matches!(run(stop_after).0, Err(Error::Cancelled)), "asked to stop after {stop_after}");
    }
}

#[test]
fn settings_out_of_range_are_errors() {
    let cloud = PointCloud::new(DVec3::ZERO, test_clouds::plane(10));
    let seen = |position, points| Viewpoint { position, points };
    let orientations = [
        Orientation::Direction(DVec3::ZERO),
        Orientation::Direction(DVec3::NAN),
        Orientation::Viewpoints(vec![seen(DVec3::INFINITY, 0..1)]),
        Orientation::Viewpoints(vec![seen(DVec3::ZERO, 5..11)]),
        Orientation::Viewpoints(vec![seen(DVec3::ZERO, 5..8), seen(DVec3::ONE, 0..6)]),
    ];
    let ks = [0, 2, 1025].map(|k| NormalSettings { k, ..Default::default() });
    let all =
        orientations.map(|orientation| NormalSettings { orientation, ..Default::default() }).into_iter().chain(ks);
    for settings in all {
        let result = estimate_normals(&cloud, &settings, &());
        assert!(matches!(result, Err(Error::Setting { .. })), "{settings:?} gives {result:?}");
    }
}
