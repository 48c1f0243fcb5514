//! The form of the tree, and the neighbourhoods found in it, against brute force.

use autosplats_cloud::PointCloud;
use autosplats_cloud::glam::DVec3;

use super::*;
use crate::camera::{Camera, Projection, View};
use crate::gpu::{FrameUniform, read_back, test_gpu};
use crate::points::Points;
use crate::project::gpu::tests::{run_round, upload_screen};
use crate::project::gpu::{COUNTERS, Counter};
use crate::project::{DeviceCloud, ProjectRules, Projector, ScreenPoints, Uploader};
use crate::test_clouds::{self, EYE, Random};

const SIZE: [u32; 2] = [121, 90];

/// The result of a search.
#[derive(Debug, PartialEq)]
struct Found {
    /// Indices in the cloud of the queries, and their neighbourhoods.
    sources: Vec<u32>,
    neighborhoods: Vec<[f32; 12]>,
    points: Vec<Point>,
    nodes: Vec<Node>,
    finite: usize,
    clamped: u32,
}

impl Found {
    fn count(&self, query: usize) -> f32 {
        self.neighborhoods[query][3]
    }

    fn k_radius(&self, query: usize) -> f32 {
        self.neighborhoods[query][7]
    }
}

/// A view of the whole cloud.
fn view(scale: f64) -> View {
    let projection = Projection::OrthographicHeight(2.4 * scale);
    let camera = Camera { eye: EYE * scale, look_at: DVec3::ZERO, up: DVec3::new(0.1, -1.0, 0.0), projection };
    camera.view(DVec3::ZERO, SIZE).expect("a view")
}

fn find(gpu: &Gpu, passes: &KdTreePasses, positions: &[[f32; 3]], view: &View, k: u32, first_radius: f32) -> Found {
    let cloud = PointCloud::new(DVec3::ZERO, positions.to_vec());
    let screen: ScreenPoints =
        Projector::default().project(&cloud, view, &ProjectRules::usual(k), &crate::cancel::NEVER).clone();
    let mut device_cloud = DeviceCloud::default();
    device_cloud.resize(gpu, Points::Cloud(&cloud)).expect("room");
    let all = Points::Cloud(&cloud).written_since(None);
    Uploader::default().positions(gpu, cloud.positions(), &all, &device_cloud, &|_| true).expect("an upload");
    let uploaded = upload_screen(gpu, &screen, view);
    let neighborhoods = gpu.storage::<[f32; 12]>("neighbourhoods", uploaded.capacity as usize).expect("room");
    let frame = gpu.uniform::<FrameUniform>("frame").expect("room");
    let told = FrameUniform { first_radius, ..FrameUniform::new(view, k) };
    gpu.queue.write_buffer(&frame, 0, bytemuck::bytes_of(&told));
    let tree = TreeBuffers::new(gpu, cloud.len()).expect("room");
    let buffers =
        SearchBuffers { frame: &frame, cloud: &device_cloud, screen: &uploaded, neighborhoods: &neighborhoods };
    for (round, steps) in [Round::Active, Round::Recovered].into_iter().zip(&passes.steps_in(gpu, buffers, &tree)) {
        run_round(gpu, &uploaded, round, steps);
    }
    let queries = screen.active.iter().chain(&screen.passive);
    let counters: Vec<u32> = read_back(gpu, &uploaded.counters, COUNTERS).expect("counters");
    let state: Vec<u32> = read_back(gpu, &tree.state[0], 6).expect("a state");
    let nodes = (tree.nodes.size() / 32) as usize;
    Found {
        sources: queries.map(|&query| screen.source[query as usize]).collect(),
        neighborhoods: read_back(gpu, &neighborhoods, screen.points.len()).expect("neighbourhoods"),
        points: read_back(gpu, &tree.points[0], cloud.len()).expect("points"),
        nodes: read_back(gpu, &tree.nodes, nodes).expect("nodes"),
        finite: state[5] as usize,
        clamped: counters[Counter::Clamped as usize],
    }
}

fn squared(a: [f32; 3], b: [f32; 3]) -> f64 {
    (0..3).map(|axis| (f64::from(a[axis]) - f64::from(b[axis])).powi(2)).sum()
}

/// Distances from a point to all others at a finite distance, ascending.
fn distances(positions: &[[f32; 3]], own: u32) -> Vec<f64> {
    let center = positions[own as usize];
    let others = positions.iter().enumerate().filter(|&(index, _)| index != own as usize);
    let mut distances: Vec<f64> =
        others.map(|(_, &other)| squared(center, other).sqrt()).filter(|d| *d < 1e18).collect();
    distances.sort_unstable_by(f64::total_cmp);
    distances
}

/// A radius within which nearly all points have k neighbours, but not many more.
fn ample_radius(positions: &[[f32; 3]], k: u32) -> f32 {
    let mut radii: Vec<f64> = (0..positions.len() as u32)
        .step_by(positions.len().div_ceil(50))
        .filter_map(|own| distances(positions, own).get(k as usize - 1).copied())
        .collect();
    radii.sort_unstable_by(f64::total_cmp);
    2.0 * radii.last().copied().unwrap_or(1.0).max(1e-12) as f32
}

/// Walks through a tree and checks it. Returns the number of leaves larger than a small node, and the depth.
fn check_tree(found: &Found, positions: &[[f32; 3]], case: &str) -> (usize, usize) {
    let is_finite = |p: &[f32; 3]| p.iter().all(|c| c.abs() <= 1e18);
    let finite = positions.iter().filter(|p| is_finite(p)).count();
    assert_eq!(found.finite, finite, "{case}: finite points");
    let mut seen = vec![0; positions.len()];
    let (mut large, mut deepest) = (0, 0);
    let mut open = vec![(1, 0)];
    while let Some((node, depth)) = open.pop() {
        deepest = deepest.max(depth);
        let [low_x, low_y, low_z, first, high_x, high_y, high_z, len] = found.nodes[node as usize];
        let low = [low_x, low_y, low_z].map(f32::from_bits);
        let high = [high_x, high_y, high_z].map(f32::from_bits);
        if len == 0 {
            open.extend([(first, depth + 1), (first + 1, depth + 1)]);
            for child in [first, first + 1] {
                let child = &found.nodes[child as usize];
                let inside = |axis: usize| {
                    low[axis] <= f32::from_bits(child[axis]) && f32::from_bits(child[4 + axis]) <= high[axis]
                };
                assert!((0..3).all(inside), "{case}: node {node} holds its children");
            }
            continue;
        }
        if low[0] > high[0] {
            assert_eq!(finite, 0, "{case}: only no points at all have no box");
            continue;
        }
        for point in &found.points[first as usize..(first + len) as usize] {
            let index = point[3] as usize;
            seen[index] += 1;
            let position: [f32; 3] = std::array::from_fn(|axis| f32::from_bits(point[axis]));
            assert_eq!(position, positions[index], "{case}: point {index} is where it was");
            assert!((0..3).all(|a| low[a] <= position[a] && position[a] <= high[a]), "{case}: {index} in its box");
        }
        if len > MAX_SMALL_NODE_POINTS as u32 {
            large += 1;
            assert_eq!(low, high, "{case}: a leaf of {len} points is in one place");
        }
    }
    for (index, &seen) in seen.iter().enumerate() {
        assert_eq!(seen, usize::from(is_finite(&positions[index])), "{case}: point {index} is in one leaf");
    }
    (large, deepest)
}

#[test]
fn trees_hold_each_point_once_in_tight_boxes() {
    let Some(gpu) = test_gpu() else { return };
    let passes = KdTreePasses::new(&gpu).expect("passes");
    for (name, mut positions) in test_clouds::all(6000) {
        let found = find(&gpu, &passes, &positions, &view(1.0), 10, 0.1);
        let (large, depth) = check_tree(&found, &positions, name);
        assert_eq!(large, 0, "{name}: nothing is too large to be split");
        assert!(depth <= 24, "{name}: {depth} levels");
        positions.extend([[f32::NAN, 0.0, 0.0], [f32::INFINITY, 1.0, 0.0], [0.0, 3e38, -3e38]]);
        positions.swap_remove(0);
        check_tree(&find(&gpu, &passes, &positions, &view(1.0), 10, 0.1), &positions, &format!("{name} and others"));
    }
}

/// The queries whose k-radius equals brute force to 1e-4, and the queries compared, which have k neighbours.
fn accuracy(found: &Found, positions: &[[f32; 3]], k: u32) -> (usize, usize) {
    let (mut right, mut compared) = (0, 0);
    for (query, &own) in found.sources.iter().enumerate().step_by(7) {
        let Some(&exact) = distances(positions, own).get(k as usize - 1) else { continue };
        compared += 1;
        right += usize::from((f64::from(found.k_radius(query)) - exact).abs() <= 1e-4 * exact);
    }
    (right, compared)
}

#[test]
fn k_radii_are_those_of_brute_force() {
    let Some(gpu) = test_gpu() else { return };
    let passes = KdTreePasses::new(&gpu).expect("passes");
    // Larger k puts more neighbours into the bins of the same histogram. Two more in the bin of the k-th are one too
    // many; at k = 3 this is rare.
    for (k, least) in [(1, 1.0), (3, 0.999), (10, 0.995), (17, 0.99), (64, 0.95)] {
        let (mut right, mut compared) = (0, 0);
        for (name, positions) in test_clouds::all(4000) {
            let found = find(&gpu, &passes, &positions, &view(1.0), k, ample_radius(&positions, k));
            let (here, of) = accuracy(&found, &positions, k);
            assert!(here as f64 >= (least - 0.08) * of as f64, "k = {k}, {name}: {here} of {of}");
            (right, compared) = (right + here, compared + of);
        }
        assert!(compared > 1000, "there is something to compare: {compared}");
        assert!(right as f64 >= least * compared as f64, "k = {k}: {right} of {compared}");
    }
}

/// Sums of moments against brute force in `f64`.
#[test]
fn moments_are_those_of_the_neighbours_up_to_the_k_radius() {
    let Some(gpu) = test_gpu() else { return };
    let passes = KdTreePasses::new(&gpu).expect("passes");
    let view = view(1.0);
    for (k, first_radius) in [(1, 0.2), (10, 0.3), (64, 0.2)] {
        for (name, positions) in test_clouds::all(3000) {
            let found = find(&gpu, &passes, &positions, &view, k, first_radius);
            let mut clamped = 0;
            for (query, &own) in found.sources.iter().enumerate() {
                let [x, y, z, count, xx, xy, xz, k_radius, yy, yz, zz, _] = found.neighborhoods[query];
                clamped += u32::from(count > 0.0 && count < k as f32);
                if query % 13 != 0 || (k_radius == 0.0 && count > 0.0) {
                    continue;
                }
                let reach = f64::from(k_radius) * (1.0 + 1e-6);
                let mut sums = [0.0; 9];
                let mut neighbors = 0;
                for (index, &other) in positions.iter().enumerate() {
                    if index as u32 == own || squared(other, positions[own as usize]).sqrt() > reach {
                        continue;
                    }
                    let away: [f32; 3] = std::array::from_fn(|axis| other[axis] - positions[own as usize][axis]);
                    let [x, y, z] = (view.view_from_world * glam::Vec3A::from(away)).to_array().map(f64::from);
                    for (sum, term) in sums.iter_mut().zip([x, y, z, x * x, x * y, x * z, y * y, y * z, z * z]) {
                        *sum += term;
                    }
                    neighbors += 1;
                }
                let case = format!("{name}, k = {k}, point {own}");
                assert_eq!(count as usize, neighbors, "{case}: all up to the k-radius, and no more");
                assert!(count >= 1.0 || k_radius == 0.0, "{case}: no neighbour, no radius");
                for (at, (found, exact)) in [x, y, z, xx, xy, xz, yy, yz, zz].into_iter().zip(sums).enumerate() {
                    let unit = if at < 3 { reach } else { reach * reach };
                    assert!(
                        (f64::from(found) - exact).abs() <= 1e-6 * unit * (4.0 + f64::from(count)),
                        "{case}: sum {at}"
                    );
                }
            }
            assert_eq!(clamped, found.clamped, "{name}, k = {k}: points with fewer neighbours are counted");
        }
    }
}

/// The build ends, and every point is found.
#[test]
fn thousands_of_points_in_one_place_are_one_leaf() {
    let Some(gpu) = test_gpu() else { return };
    let passes = KdTreePasses::new(&gpu).expect("passes");
    for (name, mut positions) in [
        ("one place", Vec::new()),
        ("a place in a plane", test_clouds::plane(2000)),
        ("far from one other", vec![[1.0, 0.9, 0.3]]),
    ] {
        positions.extend([[0.1, 0.2, -0.3]; 5000]);
        for k in [1, 10, 64] {
            let found = find(&gpu, &passes, &positions, &view(1.0), k, 0.3);
            assert_eq!(check_tree(&found, &positions, name).0, 1, "{name}: the place is a leaf of its own");
            let at_place = |source: u32| positions[source as usize] == [0.1, 0.2, -0.3];
            let query = found.sources.iter().position(|&source| at_place(source)).expect("it is seen");
            assert_eq!([found.count(query), found.k_radius(query)], [k as f32, 0.0], "{name}: k others, no distance");
        }
    }
    // More points than a walk may visit.
    let positions = vec![[0.1, 0.2, 0.3]; 100_000];
    let found = find(&gpu, &passes, &positions, &view(1.0), 10, 0.3);
    assert_eq!(check_tree(&found, &positions, "a crowd").0, 1, "one leaf");
    assert_eq!([found.count(0), found.k_radius(0)], [10.0, 0.0], "k others, no distance");
}

#[test]
fn few_points_and_none() {
    let Some(gpu) = test_gpu() else { return };
    let passes = KdTreePasses::new(&gpu).expect("passes");
    let nan = [f32::NAN; 3];
    for (positions, expected) in [
        (vec![], vec![]),
        (vec![nan, nan], vec![]),
        (vec![[0.1, 0.2, 0.3]], vec![[0.0, 0.0]]),
        (vec![nan, [0.1, 0.2, 0.3], [3e37, 0.0, 0.0]], vec![[0.0, 0.0]]),
        (vec![[0.0, 0.0, 0.0], nan, [0.0, 0.5, 0.0]], vec![[1.0, 0.5]; 2]),
    ] {
        for k in [1, 64] {
            let found = find(&gpu, &passes, &positions, &view(1.0), k, 1.0);
            if !positions.is_empty() {
                check_tree(&found, &positions, "few points");
            }
            let pairs: Vec<_> = (0..found.sources.len()).map(|at| [found.count(at), found.k_radius(at)]).collect();
            assert_eq!(pairs, expected, "{positions:?}");
        }
    }
}

#[test]
fn units_do_not_matter() {
    let Some(gpu) = test_gpu() else { return };
    let passes = KdTreePasses::new(&gpu).expect("passes");
    let positions = test_clouds::edge(4000);
    // Powers of two, so that only the view rounds.
    let radii = |scale: f32| {
        let scaled: Vec<_> = positions.iter().map(|p| p.map(|c| c * scale)).collect();
        let found = find(&gpu, &passes, &scaled, &view(scale.into()), 10, 0.2 * scale);
        check_tree(&found, &scaled, "scaled");
        let radii = found.sources.iter().enumerate().map(|(query, &source)| (source, found.k_radius(query) / scale));
        radii.collect::<std::collections::BTreeMap<_, _>>()
    };
    let expected = radii(1.0);
    for scale in [2f32.powi(-20), 2f32.powi(20)] {
        let found = radii(scale);
        let both: Vec<_> = found.iter().filter_map(|(at, radius)| Some((radius, expected.get(at)?))).collect();
        assert!(both.len() > 2500, "mostly the same points are seen: {}", both.len());
        let alike = both.iter().filter(|(found, expected)| (*found - *expected).abs() <= 1e-6 * **expected).count();
        assert!(alike * 1000 >= both.len() * 999, "{scale}: {alike} of {}", both.len());
    }
}

#[test]
fn levels_are_enough_for_splits_as_uneven_as_they_may_be() {
    for capacity in [1, 64, 65, 1000, 20_000, 1_000_000, 134_217_728] {
        let levels = levels(capacity);
        let left = capacity as f64 * 0.75f64.powi(levels as i32);
        assert!(
            left <= MAX_SMALL_NODE_POINTS as f64 && levels.is_multiple_of(2),
            "{capacity}: {left} points are left after {levels} levels"
        );
    }
}

/// Clusters within clusters, for which spatial medians alone would take a level for each factor of two.
#[test]
fn clusters_far_apart_take_few_levels() {
    let Some(gpu) = test_gpu() else { return };
    let passes = KdTreePasses::new(&gpu).expect("passes");
    let mut random = Random::new(17);
    let positions: Vec<[f32; 3]> = (0..20_000).map(|at| random.direction().map(|c| c * 0.5f32.powi(at % 60))).collect();
    let found = find(&gpu, &passes, &positions, &view(1.0), 10, 0.1);
    let (large, depth) = check_tree(&found, &positions, "clusters");
    assert_eq!(large, 0, "all is split");
    assert!(depth <= levels(positions.len()) + 7, "{depth} levels");
}

#[test]
fn two_frames_are_equal_to_the_byte() {
    let Some(gpu) = test_gpu() else { return };
    let passes = KdTreePasses::new(&gpu).expect("passes");
    let positions = test_clouds::density_ramp(30_000);
    let run = || {
        let Found { sources, neighborhoods, points, .. } = find(&gpu, &passes, &positions, &view(1.0), 10, 0.1);
        let bits = neighborhoods.iter().map(|found| found.map(f32::to_bits)).collect::<Vec<_>>();
        (sources, bits, points)
    };
    assert!(run() == run(), "the order of the points and all sums are the same");
}

/// A tree that is too large is an error.
#[test]
fn a_cloud_beyond_the_limit_is_refused() {
    let Some(gpu) = test_gpu() else { return };
    let limits = gpu.device.limits();
    let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
    let refused = TreeBuffers::new(&gpu, (most / 16) as usize + 1).err();
    assert!(
        matches!(refused, Some(Error::DeviceLimit { what: "points of the kd-tree", allowed, .. }) if allowed == most),
        "{refused:?}"
    );
}

#[test]
fn comparison_sees_wrong_trees() {
    let Some(gpu) = test_gpu() else { return };
    let passes = KdTreePasses::new(&gpu).expect("passes");
    let positions = test_clouds::sphere(500);
    let wrong: [fn(&mut Found); 3] = [
        |found| found.points[7] = found.points[8],
        |found| found.nodes[1][4] = 0f32.to_bits(),
        |found| found.finite -= 1,
    ];
    for spoil in wrong {
        let mut found = find(&gpu, &passes, &positions, &view(1.0), 3, 0.1);
        spoil(&mut found);
        let checked = std::panic::catch_unwind(|| check_tree(&found, &positions, "spoilt"));
        assert!(checked.is_err(), "it is noticed");
    }
}
