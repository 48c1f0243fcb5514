use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::{Arc, Mutex};

use autosplats_cloud::{
    Crs, Error as CloudError, Key, Node, NodeKey, PointCloud, Progress, Traffic, Tree, TreeInfo, Wanted,
};
use glam::{DMat4, DVec3};

use super::*;
use crate::{Camera, Error, Projection, Renderer, Settings};

/// Most points of a leaf.
const LEAF_POINTS: usize = 500;
/// Cells along an edge of a node.
const CELLS: f64 = 16.0;
/// Levels per page of the hierarchy.
const PAGE_LEVELS: u32 = 2;

/// A tree in memory, whose node holds one point per cell that no node above holds, as COPC files do.
#[derive(Debug)]
struct MemoryTree {
    info: TreeInfo,
    nodes: BTreeMap<Key, Vec<u32>>,
    cloud: PointCloud,
    /// Levels that tell of the nodes below.
    loaded: Mutex<BTreeSet<u32>>,
    damaged: Option<Key>,
}

impl MemoryTree {
    fn new(cloud: PointCloud) -> Self {
        let side = 4.0;
        let cube = [DVec3::splat(-0.5 * side), DVec3::splat(0.5 * side)];
        let mut nodes = BTreeMap::new();
        fill(&mut nodes, &cloud, cube, Key::ROOT, (0..cloud.len() as u32).collect());
        let info = TreeInfo {
            format: "memory".into(),
            attributes: Vec::new(),
            details: Vec::new(),
            points: cloud.len() as u64,
            cube,
            bounds: cube,
            spacing: side / CELLS,
            colors: false,
            fields: Vec::new(),
            axes: None,
            crs: Crs::default(),
            resolution: None,
            notes: Vec::new(),
        };
        Self { info, nodes, cloud, loaded: Mutex::new(BTreeSet::from([0])), damaged: None }
    }
}

/// Fills the node `key` and those below with `points`.
fn fill(nodes: &mut BTreeMap<Key, Vec<u32>>, cloud: &PointCloud, cube: [DVec3; 2], key: Key, points: Vec<u32>) {
    let [low, high] = key.cube(cube);
    let mut below: BTreeMap<Key, Vec<u32>> = BTreeMap::new();
    let mut own = Vec::new();
    let mut cells = BTreeSet::new();
    for point in points.iter().copied() {
        let place = (cloud.world_position(point as usize) - low) / (high - low);
        let cell = (place * CELLS).floor().to_array().map(|cell| cell as i64);
        if points.len() <= LEAF_POINTS || cells.insert(cell) {
            own.push(point);
        } else {
            let octant = place.cmpge(DVec3::splat(0.5)).bitmask() as usize;
            below.entry(key.children().nth(octant).expect("an octant")).or_default().push(point);
        }
    }
    nodes.insert(key, own);
    for (key, points) in below {
        fill(nodes, cloud, cube, key, points);
    }
}

impl Tree for MemoryTree {
    fn name(&self) -> &Path {
        Path::new("memory")
    }

    fn info(&self) -> &TreeInfo {
        &self.info
    }

    fn node(&self, key: Key) -> Node {
        let page = key.level / PAGE_LEVELS;
        let Some(points) = self.nodes.get(&key) else { return Node::Absent };
        if !self.loaded.lock().expect("no panic").contains(&page) {
            return Node::Unknown;
        }
        Node::Known { points: points.len() as u32, bytes: 4 * points.len() as u64 }
    }

    fn load_pages(&self, keys: &[Key], _: &dyn Progress) -> Result<(), CloudError> {
        self.loaded.lock().expect("no panic").extend(keys.iter().map(|key| key.level / PAGE_LEVELS));
        Ok(())
    }

    fn fetch(&self, keys: &[Key], progress: &dyn Progress) -> Result<Vec<Vec<u8>>, CloudError> {
        progress.tick(0.0)?;
        Ok(keys.iter().map(|key| bytemuck::cast_slice(&self.nodes[key]).to_vec()).collect())
    }

    fn decode(&self, key: Key, bytes: &[u8], _: &Wanted) -> Result<PointCloud, CloudError> {
        if self.damaged == Some(key) {
            return Err(CloudError::malformed(self.name(), format!("node {key:?}"), "it is damaged"));
        }
        let points: Vec<u32> = bytes.chunks_exact(4).map(bytemuck::pod_read_unaligned).collect();
        let positions = points.iter().map(|&point| self.cloud.positions()[point as usize]);
        Ok(PointCloud::new(self.cloud.origin(), positions.collect()))
    }

    fn point_bytes(&self, _: &Wanted) -> usize {
        12
    }

    fn take_notes(&self) -> Vec<String> {
        Vec::new()
    }

    fn traffic(&self) -> Traffic {
        Traffic::default()
    }
}

fn sphere(points: usize) -> PointCloud {
    PointCloud::new(DVec3::ZERO, crate::test_clouds::sphere(points))
}

fn placed(tree: MemoryTree) -> PlacedTree {
    PlacedTree { tree: Arc::new(tree), world_from_tree: DMat4::IDENTITY }
}

fn camera(distance: f64) -> Camera {
    Camera {
        eye: DVec3::new(0.3, -distance, 0.2),
        look_at: DVec3::ZERO,
        up: DVec3::Z,
        projection: Projection::PerspectiveFovDeg(40.0),
    }
}

fn detail(spacing_px: f64) -> Detail {
    Detail { spacing_px, ..Detail::default() }
}

/// The smallest depth of the places of a node that a picture and its margin show, sampled; `None` if it shows none.
fn sampled_depth(tree: &MemoryTree, key: Key, camera: &Camera, size: [u32; 2]) -> Option<f64> {
    const STEPS: u32 = 24;
    let [low, high] = key.cube(tree.info.cube);
    let lens = camera.lens(size).expect("a lens");
    let margin = f64::from(size[0].min(size[1]).div_ceil(12));
    let steps = (0..STEPS.pow(3))
        .map(|i| DVec3::new((i % STEPS).into(), (i / STEPS % STEPS).into(), (i / STEPS / STEPS).into()));
    steps
        .filter_map(|step| {
            let (pixel, depth) = lens.to_pixel(low + (high - low) * step / f64::from(STEPS - 1))?;
            let inside = |at: f64, side: u32| (-margin..=f64::from(side) + margin).contains(&at);
            (inside(pixel.x, size[0]) && inside(pixel.y, size[1])).then_some(depth)
        })
        .min_by(f64::total_cmp)
}

#[test]
fn nodes_are_as_fine_as_asked_for_and_no_finer() {
    let tree = MemoryTree::new(sphere(200_000));
    let trees = [placed(MemoryTree::new(sphere(200_000)))];
    let size = [300, 200];
    for (distance, projection) in [
        (5.0, Projection::PerspectiveFovDeg(40.0)),
        (1.3, Projection::PerspectiveFovDeg(60.0)),
        (0.1, Projection::PerspectiveFovDeg(90.0)),
        (3.0, Projection::OrthographicHeight(2.5)),
    ] {
        let camera = Camera { projection, ..camera(distance) };
        let lens = camera.lens(size).expect("a lens");
        let choice = choose_loading(&trees, &camera, size, &detail(2.0), &()).expect("a choice");
        let chosen: BTreeSet<Key> = choice.nodes.iter().map(|node| node.key).collect();
        assert!(choice.spacing_px <= 2.0 && choice.unknown.is_empty(), "{choice:?}");
        let (mut taken, mut left) = (0, 0);
        for &key in tree.nodes.keys() {
            let Some(parent) = key.parent() else { continue };
            let spacing = tree.info.spacing / f64::from(1u32 << parent.level);
            let Some(depth) = sampled_depth(&tree, key, &camera, size) else { continue };
            let wanted = spacing / lens.pixel_size(depth) > 2.0;
            if wanted {
                assert!(chosen.contains(&key), "{key:?} at {distance} is needed");
                taken += 1;
            } else if !chosen.contains(&key) {
                left += 1;
            }
        }
        assert!(taken > 5 && left > 5, "at {distance}: {taken} nodes are needed, {left} are not");
        // Bounds are conservative, but not by much.
        assert!(choice.nodes.len() < 2 * taken + 20, "{} nodes for {taken} at {distance}", choice.nodes.len());
        for key in chosen {
            assert!(key.parent().is_none_or(|parent| choice.nodes.iter().any(|node| node.key == parent)), "{key:?}");
        }
    }
}

#[test]
fn a_budget_leaves_out_the_finest_everywhere() {
    let trees = [placed(MemoryTree::new(sphere(200_000)))];
    let (camera, size) = (camera(3.0), [600, 400]);
    let all = choose_loading(&trees, &camera, size, &detail(0.5), &()).expect("a choice");
    let mut before = Choice::default();
    for max_points in [1, 3000, 10_000, 30_000, 100_000] {
        let limited = Detail { max_points, ..detail(0.5) };
        let choice = choose_loading(&trees, &camera, size, &limited, &()).expect("a choice");
        assert!(choice.points <= max_points as u64 || choice.nodes.len() == 1, "{max_points}: {}", choice.points);
        assert!(choice.points < all.points && choice.spacing_px > 0.5, "{max_points} is not enough");
        // What fewer points show, more points show too; and they are what that spacing alone asks for.
        assert!(before.nodes.iter().all(|node| choice.nodes.contains(node)), "more points, more nodes");
        assert!(choice.by_need.starts_with(&before.by_need), "in one order");
        if choice.nodes.len() > 1 {
            let same = choose_loading(&trees, &camera, size, &detail(choice.spacing_px), &()).expect("a choice");
            assert!(same.nodes.iter().all(|node| choice.nodes.contains(node)), "no finer node was preferred");
        }
        before = choice;
    }
}

#[test]
fn a_choice_does_not_depend_on_what_is_loaded() {
    let (camera, size) = (camera(2.0), [600, 400]);
    let limited = Detail { max_points: 40_000, ..detail(0.7) };
    let fresh = [placed(MemoryTree::new(sphere(100_000)))];
    let first = choose(&fresh, &camera, size, &limited).expect("a choice");
    assert!(!first.unknown.is_empty(), "pages are missing at first");
    let known = MemoryTree::new(sphere(100_000));
    known.loaded.lock().expect("no panic").extend(0..30);
    let known = choose(&[placed(known)], &camera, size, &limited).expect("a choice");
    assert_eq!(choose_loading(&fresh, &camera, size, &limited, &()).expect("a choice"), known);
}

#[test]
fn a_pose_moves_what_is_chosen_and_what_is_loaded() {
    let (size, cloud) = ([300, 200], sphere(50_000));
    let pose = DMat4::from_scale_rotation_translation(
        DVec3::splat(2.0),
        glam::DQuat::from_rotation_z(0.7),
        DVec3::new(5e5, 4e6, 100.0),
    );
    for projection in [Projection::PerspectiveFovDeg(40.0), Projection::OrthographicHeight(0.9)] {
        let camera = Camera { projection, ..camera(1.6) };
        let moved = Camera {
            eye: pose.transform_point3(camera.eye),
            look_at: pose.transform_point3(camera.look_at),
            up: pose.transform_vector3(camera.up),
            projection: match projection {
                Projection::OrthographicHeight(height) => Projection::OrthographicHeight(2.0 * height),
                perspective => perspective,
            },
        };
        let trees = [placed(MemoryTree::new(cloud.clone()))];
        let moved_trees = [PlacedTree { world_from_tree: pose, ..placed(MemoryTree::new(cloud.clone())) }];
        let here = choose_loading(&trees, &camera, size, &detail(1.0), &()).expect("a choice");
        let there = choose_loading(&moved_trees, &moved, size, &detail(1.0), &()).expect("a choice");
        assert_eq!(here.nodes, there.nodes);
        assert!(here.nodes.len() > 20, "{}", here.nodes.len());
        let load = |trees: &[PlacedTree]| {
            let mut places = Vec::new();
            load_nodes(trees, &here.nodes, &Wanted::default(), &(), |points| {
                places.extend((0..points.cloud.len()).map(|index| points.cloud.world_position(index)));
                Ok(())
            })
            .expect("nodes");
            places
        };
        let (here, there) = (load(&trees), load(&moved_trees));
        assert_eq!(here.len(), there.len());
        // Moved positions are rounded to `f32` about the node.
        let same = |(a, b): (&DVec3, &DVec3)| pose.transform_point3(*a).abs_diff_eq(*b, 1e-5);
        assert!(here.iter().zip(&there).all(same), "each point is moved");
    }
}

#[test]
fn nodes_come_in_order_whole_and_once() {
    let cloud = sphere(60_000);
    let mut tree = MemoryTree::new(cloud.clone());
    tree.loaded.lock().expect("no panic").extend(0..30);
    let nodes: Vec<NodeKey> = tree.nodes.keys().map(|&key| key.into()).collect();
    assert!(nodes.len() > 100, "{}", nodes.len());
    tree.damaged = Some(nodes[7].key);
    let lost = tree.nodes[&nodes[7].key].len();
    let trees = [placed(tree)];
    let (mut order, mut points, mut damaged) = (Vec::new(), BTreeSet::new(), Vec::new());
    load_nodes(&trees, &nodes, &Wanted::default(), &(), |loaded| {
        order.push(loaded.node);
        points.extend(loaded.cloud.positions().iter().map(|position| position.map(f32::to_bits)));
        damaged.extend(loaded.damage.map(|damage| (loaded.node, damage)));
        Ok(())
    })
    .expect("nodes");
    assert_eq!(order, nodes);
    assert_eq!(points.len(), cloud.len() - lost, "each point once, but those of the damaged node");
    assert!(
        matches!(&*damaged, [(node, damage)] if *node == nodes[7] && damage.contains("it is damaged")),
        "{damaged:?}"
    );
}

#[test]
fn loading_ends_at_once() {
    struct Stop;
    impl Progress for Stop {
        fn report(&self, _: f32) {}
        fn cancelled(&self) -> bool {
            true
        }
    }
    let tree = MemoryTree::new(sphere(10_000));
    let nodes: Vec<NodeKey> = tree.nodes.keys().map(|&key| key.into()).collect();
    let trees = [placed(tree)];
    let wanted = Wanted::default();
    assert!(matches!(load_nodes(&trees, &nodes, &wanted, &Stop, |_| Ok(())), Err(Error::Cancelled)), "as asked");
    let mut taken = 0;
    let full = load_nodes(&trees, &nodes, &wanted, &(), |_| {
        taken += 1;
        if taken < 3 { Ok(()) } else { Err(Error::TooManyPoints(3)) }
    });
    assert!(matches!(full, Err(Error::TooManyPoints(3))) && taken == 3, "{full:?} after {taken}");
    assert!(load_nodes(&trees, &[], &wanted, &(), |_| Ok(())).is_ok(), "nothing to do");
    let wrong = Detail { spacing_px: f64::NAN, ..Detail::default() };
    assert!(matches!(choose(&trees, &camera(2.0), [9, 9], &wrong), Err(Error::Setting { .. })), "no number");
}

fn scene(tree: MemoryTree, memory: u64) -> TreeScene {
    TreeScene::open(vec![placed(tree)], Wanted::default(), memory, 10_000_000, &()).expect("a scene")
}

#[test]
fn a_picture_does_not_depend_on_the_pictures_before() {
    let size = [160, 120];
    let views = [camera(3.0), camera(1.4), Camera { eye: DVec3::new(2.0, 0.5, 1.0), ..camera(3.0) }];
    let wanted = Detail { spacing_px: 1.5, ..Detail::default() };
    // Memory for a part of the points: nodes have to leave.
    let memory = 12 * 600_000;
    let picture = |scene: &mut TreeScene, camera: &Camera| {
        let shown = scene.show(camera, size, &wanted, &()).expect("points");
        assert_eq!(scene.points().chosen_points() as u64, shown.points, "all that is chosen is there");
        let mut renderer = Renderer::new();
        let frame = renderer.render(scene.points(), camera, size, &Settings::default()).expect("a picture");
        (shown.nodes, shown.points, frame.image.pixels.clone())
    };
    let mut flown = scene(MemoryTree::new(sphere(300_000)), memory);
    for number in [0, 1, 2, 1, 0, 2] {
        let mut fresh = scene(MemoryTree::new(sphere(300_000)), memory);
        let (camera, all) = (&views[number], picture(&mut flown, &views[number]));
        assert!(picture(&mut fresh, camera) == all, "view {number} differs after others");
        assert!(all.0 > 10, "{} nodes", all.0);
    }
    let again = flown.show(&views[2], size, &wanted, &()).expect("points");
    assert_eq!(again.loaded, 0, "what is there is not loaded again");
}

#[test]
fn memory_limits_what_is_chosen() {
    let detail = Detail { spacing_px: 0.3, ..Detail::default() };
    let mut before = f64::INFINITY;
    for memory in [12 * 200_000, 12 * 600_000, 12 * 30_000_000] {
        let mut scene = scene(MemoryTree::new(sphere(200_000)), memory);
        let shown = scene.show(&camera(2.0), [600, 400], &detail, &()).expect("points");
        assert!(scene.points().capacity() as u64 * 12 <= memory, "the pool keeps to {memory} bytes");
        assert!(shown.spacing_px < before, "more memory shows more: {} pixels after {before}", shown.spacing_px);
        before = shown.spacing_px;
    }
    assert!(before <= 0.3, "enough is enough: {before}");
}

#[test]
fn damage_is_told_and_the_rest_is_shown() {
    let mut tree = MemoryTree::new(sphere(50_000));
    let key = *tree.nodes.keys().find(|key| key.level == 2).expect("a node");
    let lost = tree.nodes[&key].len() as u64;
    tree.damaged = Some(key);
    let mut scene = scene(tree, 12 * 30_000_000);
    let all = Camera { projection: Projection::OrthographicHeight(8.0), ..camera(5.0) };
    let shown = scene.show(&all, [3000, 3000], &detail(0.01), &()).expect("points");
    assert_eq!(shown.damaged, [1, lost]);
    assert!(shown.damage.as_ref().is_some_and(|damage| damage.contains("it is damaged")), "{shown:?}");
    assert_eq!(scene.points().chosen_points(), 50_000 - lost as usize);
    let mut tight = TreeScene::open(vec![placed(MemoryTree::new(sphere(50_000)))], Wanted::default(), 100, 1000, &())
        .expect("the sample needs no room");
    let none = tight.show(&all, [30, 30], &detail(1.0), &());
    assert!(matches!(none, Err(Error::Reading(_))), "not even the root fits: {none:?}");
    let empty = MemoryTree::new(PointCloud::new(DVec3::ZERO, Vec::new()));
    let opened = TreeScene::open(vec![placed(empty)], Wanted::default(), 1 << 20, 1000, &());
    assert!(matches!(opened, Err(Error::NothingVisible(_))), "no points");
}
