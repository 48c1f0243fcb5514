//! Choosing nodes.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use autosplats_cloud::{Key, Node, NodeKey, Progress, SLOT_POINTS};
use glam::{DMat4, DVec3};

use super::{Detail, PlacedTree};
use crate::Error;
use crate::camera::{Camera, Lens, PICTURE_SIDE_PER_MARGIN, Projection};

/// The nodes of a picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Choice {
    /// The nodes, in the order of their keys.
    pub nodes: Vec<NodeKey>,
    /// The same nodes, those that show most first. Fewer [points](Detail::max_points) choose a beginning of them.
    pub by_need: Vec<NodeKey>,
    /// Number of points of these nodes.
    pub points: u64,
    /// Largest distance on the screen, in pixels, between points to which finer ones exist. It exceeds
    /// [`Detail::spacing_px`] if a limit forbids more.
    pub spacing_px: f64,
    /// Nodes whose page of the hierarchy is not loaded. The choice is final only if there are none.
    pub unknown: Vec<NodeKey>,
}

/// A node that may be chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Candidate {
    /// Distance between the points of the parent, in pixels, where the node is nearest to the eye.
    spacing_px: f64,
    node: NodeKey,
}

impl Eq for Candidate {}

impl Ord for Candidate {
    /// Candidates with coarser parents come first, then those with smaller keys.
    fn cmp(&self, other: &Self) -> Ordering {
        self.spacing_px.total_cmp(&other.spacing_px).then_with(|| other.node.cmp(&self.node))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Chooses the nodes for a picture of `size` pixels, as far as the hierarchy is loaded.
///
/// # Errors
/// [`Error::Camera`] if the camera is invalid, [`Error::Setting`] if the detail is.
pub fn choose(trees: &[PlacedTree], camera: &Camera, size: [u32; 2], detail: &Detail) -> Result<Choice, Error> {
    if !(detail.spacing_px > 0.0 && detail.spacing_px.is_finite()) {
        let (name, value, range) = ("spacing_px", detail.spacing_px.to_string(), "a number of pixels above 0");
        return Err(Error::Setting { name, value, range });
    }
    let eyes: Vec<Eye> = trees.iter().map(|placed| Eye::new(placed, camera, size)).collect::<Result<_, _>>()?;
    let mut heap = BinaryHeap::new();
    for (tree, eye) in eyes.iter().enumerate() {
        let node = NodeKey { key: Key::ROOT, tree: tree as u32 };
        if eye.spacing_px(Key::ROOT, 1.0).is_some() {
            heap.push(Candidate { spacing_px: f64::INFINITY, node });
        }
    }
    let mut choice = Choice::default();
    let mut slots = 0;
    while let Some(Candidate { spacing_px, node }) = heap.pop() {
        let (tree, eye) = (&trees[node.tree as usize].tree, &eyes[node.tree as usize]);
        if spacing_px <= detail.spacing_px {
            choice.spacing_px = spacing_px;
            break;
        }
        let points = match tree.node(node.key) {
            Node::Absent => continue,
            Node::Unknown => {
                choice.unknown.push(node);
                continue;
            }
            Node::Known { points, .. } => u64::from(points),
        };
        let more = points.div_ceil(SLOT_POINTS as u64);
        let is_too_much = choice.points + points > detail.max_points as u64 || slots + more > detail.max_slots as u64;
        // Something has to be shown.
        if is_too_much && choice.points > 0 {
            choice.spacing_px = spacing_px;
            break;
        }
        slots += more;
        choice.points += points;
        choice.by_need.push(node);
        let spacing = tree.info().spacing / f64::from(1u32 << node.key.level);
        for key in node.key.children() {
            // A place without a node is no finer level that is missing.
            if tree.node(key) != Node::Absent
                && let Some(spacing_px) = eye.spacing_px(key, spacing)
            {
                heap.push(Candidate { spacing_px, node: NodeKey { key, tree: node.tree } });
            }
        }
    }
    choice.nodes.clone_from(&choice.by_need);
    choice.nodes.sort_unstable();
    choice.unknown.sort_unstable();
    Ok(choice)
}

/// Chooses the nodes for a picture of `size` pixels, and loads the pages of the hierarchy that are needed for it.
///
/// # Errors
/// Those of [`choose`], and those of reading.
pub fn choose_loading(
    trees: &[PlacedTree],
    camera: &Camera,
    size: [u32; 2],
    detail: &Detail,
    progress: &dyn Progress,
) -> Result<Choice, Error> {
    loop {
        let choice = choose(trees, camera, size, detail)?;
        if choice.unknown.is_empty() {
            return Ok(choice);
        }
        for (index, placed) in trees.iter().enumerate() {
            let pages = choice.unknown.iter().filter(|node| node.tree as usize == index);
            let keys: Vec<Key> = pages.map(|node| node.key).collect();
            placed.tree.load_pages(&keys, progress)?;
        }
    }
}

/// The part of space that a picture and its margin show, in the coordinates of a tree.
#[derive(Debug)]
struct Eye {
    lens: Lens,
    /// Corners of the root's cube.
    cube: [DVec3; 2],
    /// Planes around what is seen: normals that point inward, and the least distance along them.
    planes: [(DVec3, f64); 5],
    forward: DVec3,
    /// Least depth of a point that is seen, per distance from the eye.
    depth_per_distance: f64,
}

impl Eye {
    fn new(placed: &PlacedTree, camera: &Camera, size: [u32; 2]) -> Result<Self, Error> {
        let camera = in_tree(camera, placed.world_from_tree);
        let lens = camera.lens(size)?;
        let [right, down, forward] = camera.axes()?;
        let margin = f64::from(size[0].min(size[1]).div_ceil(PICTURE_SIDE_PER_MARGIN));
        // The screen on both sides of the optical axis, as multiples of depth or in world units.
        let pixel = [lens.pixel_size(1.0) / lens.stretch, lens.pixel_size(1.0)];
        let sides = |axis: usize| {
            let middle = lens.middle[axis];
            [middle + margin, f64::from(size[axis]) - middle + margin].map(|side| side * pixel[axis])
        };
        let ([left, right_side], [above, below]) = (sides(0), sides(1));
        let [across, along] = [left.max(right_side), above.max(below)];
        let perspective = lens.perspective;
        let side = |axis: DVec3, half: f64| {
            if perspective { (axis + half * forward, 0.0) } else { (axis, -half) }
        };
        Ok(Self {
            lens,
            cube: placed.tree.info().cube,
            planes: [
                side(right, left),
                side(-right, right_side),
                side(down, above),
                side(-down, below),
                (forward, 0.0),
            ],
            forward,
            depth_per_distance: (1.0 + across * across + along * along).sqrt().recip(),
        })
    }

    /// Distance in pixels between points that are `spacing` apart, where the cube of `key` is nearest; `None` if no
    /// part of the cube is on the screen.
    fn spacing_px(&self, key: Key, spacing: f64) -> Option<f64> {
        let [low, high] = key.cube(self.cube);
        let eye = self.lens.eye;
        let (middle, half) = (0.5 * (low + high) - eye, 0.5 * (high - low));
        let reach = |normal: DVec3| normal.abs().dot(half);
        if self.planes.iter().any(|&(normal, least)| normal.dot(middle) + reach(normal) < least) {
            return None;
        }
        let distance = (middle.abs() - half).max(DVec3::ZERO).length();
        let depth = (self.forward.dot(middle) - reach(self.forward)).max(distance * self.depth_per_distance);
        Some(spacing / self.lens.pixel_size(depth.max(self.lens.near)))
    }
}

/// The camera in the coordinates of a tree.
fn in_tree(camera: &Camera, world_from_tree: DMat4) -> Camera {
    let tree_from_world = world_from_tree.inverse();
    let scale = tree_from_world.x_axis.truncate().length();
    Camera {
        eye: tree_from_world.transform_point3(camera.eye),
        look_at: tree_from_world.transform_point3(camera.look_at),
        up: tree_from_world.transform_vector3(camera.up),
        projection: match camera.projection {
            Projection::OrthographicHeight(height) => Projection::OrthographicHeight(height * scale),
            perspective => perspective,
        },
    }
}
