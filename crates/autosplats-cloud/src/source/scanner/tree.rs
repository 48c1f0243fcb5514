//! Triangles in boxes, to be hit by rays.
//!
//! The boxes are those of the `bvh` crate. Its own walks go through all boxes that a ray meets; this one begins with the nearer
//! ones and leaves out what is behind the nearest triangle so far.

use bvh::{
    aabb::{Aabb, Bounded},
    bounding_hierarchy::{BHShape, BoundingHierarchy as _},
    bvh::{Bvh, BvhNode},
};
use glam::{DVec3, Vec3A};
use nalgebra::Point3;

use crate::{Contents, Error, memory::check_memory};

/// Bytes of a triangle, its box and its part of the tree, while it is made.
const BYTES_PER_TRIANGLE: u64 = 400;

/// Part of their size by which boxes are widened, so that rounding to `f32` loses no triangle.
const SLACK: f32 = 1e-5;

/// Marks what is a triangle and not a pair of boxes.
const LEAF: u32 = 1 << 31;

/// Boxes to be looked into, each with the distance to it.
pub(super) type Waiting = Vec<(f32, u32)>;

/// The triangles that have an area.
pub(super) struct Tree {
    nodes: Vec<[Child; 2]>,
    root: u32,
    triangles: Vec<Triangle>,
}

/// One of the two boxes that a box has in it.
#[derive(Clone, Copy)]
struct Child {
    low: Vec3A,
    high: Vec3A,
    /// Its pair of boxes, or its triangle.
    index: u32,
}

struct Triangle {
    corners: [u32; 3],
    places: [DVec3; 3],
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy)]
pub(super) struct Crossing {
    pub(super) distance: f64,
    pub(super) corners: [u32; 3],
    /// Weights of the second and the third corner.
    pub(super) weights: [f64; 2],
}

impl Tree {
    pub(super) fn new(mesh: &Contents) -> Result<Self, Error> {
        check_memory("the triangles that scanners see", mesh.triangles.len() as u64 * BYTES_PER_TRIANGLE)?;
        let positions = mesh.cloud.positions();
        let sound = |&corners: &[u32; 3]| {
            let [a, b, c] = corners.map(|corner| positions.get(corner as usize).copied());
            let places = [a?, b?, c?].map(|position| DVec3::from(position.map(f64::from)));
            let [a, b, c] = places;
            let area = (b - a).cross(c - a).length();
            (area > 0.0 && area.is_finite()).then_some(Triangle { corners, places })
        };
        let triangles: Vec<Triangle> = mesh.triangles.iter().filter_map(sound).take(LEAF as usize).collect();
        if triangles.is_empty() {
            return Err(Error::NoSurface);
        }
        let mut boxes: Vec<Boxed> = triangles.iter().map(Boxed::new).collect();
        let tree = Bvh::build_par(&mut boxes);
        let child = |bounds: Aabb<f32, 3>, index: usize| {
            let [low, high] = [bounds.min, bounds.max].map(|corner| Vec3A::new(corner.x, corner.y, corner.z));
            let slack = SLACK * low.abs().max(high.abs()).max_element();
            Child { low: low - slack, high: high + slack, index: index_of(&tree, index) }
        };
        let node = |node: &BvhNode<f32, 3>| match *node {
            BvhNode::Node { child_l_index, child_l_aabb, child_r_index, child_r_aabb, .. } => {
                [child(child_l_aabb, child_l_index), child(child_r_aabb, child_r_index)]
            }
            // Nothing leads here.
            BvhNode::Leaf { .. } => [Child { low: Vec3A::INFINITY, high: Vec3A::NEG_INFINITY, index: 0 }; 2],
        };
        Ok(Self { nodes: tree.nodes.iter().map(node).collect(), root: index_of(&tree, 0), triangles })
    }

    /// First place where a ray meets a triangle, from either side of it. What was `waiting` is forgotten; its memory serves
    /// the next ray again.
    pub(super) fn trace(&self, origin: DVec3, direction: DVec3, waiting: &mut Waiting) -> Option<Crossing> {
        // Next to nothing in place of nothing: it has an inverse, and 0 times that is 0.
        let along = direction.as_vec3().to_array().map(|step| if step.abs() < 1e-30 { 1e-30 } else { step });
        let (start, inverse) = (Vec3A::from(origin.as_vec3()), Vec3A::from(along).recip());
        // How far it is to a box: beyond everything if it is not met.
        let distance = |child: &Child| {
            let (a, b) = ((child.low - start) * inverse, (child.high - start) * inverse);
            let (enter, leave) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
            if enter <= leave { enter } else { f32::INFINITY }
        };
        let mut nearest: Option<(Crossing, u32)> = None;
        let mut limit = f32::MAX;
        waiting.clear();
        waiting.push((0.0, self.root));
        while let Some((enter, index)) = waiting.pop() {
            if enter > limit {
                continue;
            }
            if index & LEAF != 0 {
                let index = index & !LEAF;
                let triangle = &self.triangles[index as usize];
                let Some((distance, weights)) = triangle.hit(origin, direction) else { continue };
                // An edge belongs to two triangles: the first of equals, whatever the order of the walk.
                if nearest.is_none_or(|(crossing, first)| (distance, index) < (crossing.distance, first)) {
                    nearest = Some((Crossing { distance, corners: triangle.corners, weights }, index));
                    limit = distance as f32 * (1.0 + SLACK);
                }
                continue;
            }
            let [left, right] = &self.nodes[index as usize];
            let mut both = [(distance(left), left.index), (distance(right), right.index)];
            if both[0].0 < both[1].0 {
                both.swap(0, 1);
            }
            waiting.extend(both.into_iter().filter(|(enter, _)| *enter <= limit));
        }
        nearest.map(|(crossing, _)| crossing)
    }
}

/// The index of a node, or of the triangle that it is.
fn index_of(tree: &Bvh<f32, 3>, node: usize) -> u32 {
    match tree.nodes[node] {
        BvhNode::Leaf { shape_index, .. } => shape_index as u32 | LEAF,
        BvhNode::Node { .. } => node as u32,
    }
}

impl Triangle {
    /// Distance along the ray, and the weights of the second and the third corner.
    fn hit(&self, origin: DVec3, direction: DVec3) -> Option<(f64, [f64; 2])> {
        let [a, b, c] = self.places;
        let (ab, ac, to_origin) = (b - a, c - a, origin - a);
        let across = direction.cross(ac);
        let determinant = ab.dot(across);
        let beside = to_origin.cross(ab);
        let [second, third, distance] =
            [to_origin.dot(across), direction.dot(beside), ac.dot(beside)].map(|part| part / determinant);
        // Written so that values that are no numbers miss; the slack closes the seams between triangles.
        let slack = 1e-9;
        let is_hit = second >= -slack && third >= -slack && second + third <= 1.0 + slack && distance > 0.0;
        is_hit.then_some((distance, [second, third]))
    }
}

/// What the tree is made of.
struct Boxed {
    bounds: Aabb<f32, 3>,
    /// Where the tree has it.
    node: usize,
}

impl Boxed {
    fn new(triangle: &Triangle) -> Self {
        let [a, b, c] = triangle.places.map(|place| place.as_vec3());
        let point = |at: glam::Vec3| Point3::new(at.x, at.y, at.z);
        Self { bounds: Aabb::with_bounds(point(a.min(b).min(c)), point(a.max(b).max(c))), node: 0 }
    }
}

impl Bounded<f32, 3> for Boxed {
    fn aabb(&self) -> Aabb<f32, 3> {
        self.bounds
    }
}

impl BHShape<f32, 3> for Boxed {
    fn set_bh_node_index(&mut self, index: usize) {
        self.node = index;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PointCloud, sample::Random};

    #[test]
    fn rays_meet_the_triangle_that_a_look_at_all_of_them_finds() -> Result<(), Error> {
        let mut random = Random::new(1, 0);
        let mut place = |size: f64| DVec3::new(random.unit(), random.unit(), random.unit()) * size;
        let positions: Vec<[f32; 3]> = (0..300)
            .flat_map(|_| {
                let at = place(10.0);
                [at, at + place(2.0), at + place(2.0)]
            })
            .map(|p| p.as_vec3().to_array())
            .collect();
        let triangles = (0..300).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).chain([[0, 0, 1], [1, 2, 5000]]).collect();
        let tree = Tree::new(&Contents { cloud: PointCloud::new(DVec3::ZERO, positions), triangles })?;
        assert_eq!(tree.triangles.len(), 300, "those without area, or without corners, are left out");
        let (mut waiting, mut hits) = (Vec::new(), 0);
        for number in 0..2000 {
            let origin = place(14.0) - 2.0;
            // Some along an axis, in which there is no way in the others.
            let direction = if number % 10 == 0 { DVec3::AXES[number % 3] } else { (place(10.0) - origin).normalize() };
            let all = tree.triangles.iter().filter_map(|triangle| triangle.hit(origin, direction));
            let nearest = all.map(|(distance, _)| distance).min_by(f64::total_cmp);
            let found = tree.trace(origin, direction, &mut waiting).map(|crossing| crossing.distance);
            assert_eq!(found, nearest, "ray {number}");
            hits += usize::from(found.is_some());
        }
        assert!(hits > 500 && hits < 1900, "{hits} rays met something");
        Ok(())
    }

    #[test]
    fn a_mesh_without_area_is_none() {
        let cloud = PointCloud::new(DVec3::ZERO, vec![[0.0; 3], [1.0; 3], [2.0; 3], [f32::NAN; 3]]);
        for triangles in [vec![], vec![[0, 1, 2], [0, 1, 3], [0, 0, 0]]] {
            let mesh = Contents { cloud: cloud.clone(), triangles };
            assert!(matches!(Tree::new(&mesh), Err(Error::NoSurface)), "{:?}", mesh.triangles);
        }
    }
}
