//! Triangle meshes as exact surfaces: reading, subdivision and ray intersection.

use std::collections::HashMap;
use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use autosplats::cloud::glam::DVec3;
use autosplats::cloud::{Contents, PointCloud};
use autosplats_formats::{ReadOptions, read_mesh};
use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::{BHShape, BoundingHierarchy as _};
use bvh::bvh::Bvh;
use bvh::ray::Ray;
use nalgebra::{Point3, Vector3};

/// The intersection of a ray with a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance from the ray's origin.
    pub distance: f64,
    /// Unit normal, of either sign.
    pub normal: DVec3,
}

/// A closed or open surface of triangles. Normals are interpolated between corners.
#[derive(Debug)]
pub struct Mesh {
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    normals: Vec<DVec3>,
    tree: Bvh<f64, 3>,
    boxes: Vec<TriangleBox>,
}

impl Mesh {
    /// Reads the mesh in `path` and smooths it by `levels` Loop subdivisions. Each cuts a triangle into four.
    ///
    /// # Errors
    /// The file cannot be read or has no triangles.
    pub fn read(path: &Path, levels: usize) -> Result<Self> {
        let contents = read_mesh(path, &ReadOptions::default(), &()).with_context(|| path.display().to_string())?;
        ensure!(!contents.triangles.is_empty(), "{}: no triangles", path.display());
        let cloud = &contents.cloud;
        let mut vertices: Vec<DVec3> = (0..cloud.len()).map(|i| cloud.world_position(i)).collect();
        let mut triangles = contents.triangles;
        for _ in 0..levels {
            (vertices, triangles) = subdivide(&vertices, &triangles);
        }
        Ok(Self::new(vertices, triangles))
    }

    /// A sphere about the origin with bumps of two sizes. It has 20·4^`levels` triangles.
    pub fn bumpy_sphere(levels: usize) -> Self {
        let (mut vertices, mut triangles) = icosahedron();
        for _ in 0..levels {
            (vertices, triangles) = subdivide(&vertices, &triangles);
            vertices.iter_mut().for_each(|vertex| *vertex = vertex.normalize());
        }
        let bump = |d: &DVec3| {
            let large = (5.0 * d.x + 1.0).sin() * (6.0 * d.y).sin() * (4.0 * d.z + 2.0).cos();
            let small = (17.0 * d.x).sin() * (19.0 * d.y + 1.0).sin() * (15.0 * d.z + 2.0).sin();
            *d * (1.0 + 0.12 * large + 0.02 * small)
        };
        Self::new(vertices.iter().map(bump).collect(), triangles)
    }

    fn new(vertices: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Self {
        let mut normals = vec![DVec3::ZERO; vertices.len()];
        for triangle in &triangles {
            let [a, b, c] = triangle.map(|corner| vertices[corner as usize]);
            // The length is twice the triangle's area, so that large triangles have more weight.
            let normal = (b - a).cross(c - a);
            triangle.iter().for_each(|&corner| normals[corner as usize] += normal);
        }
        normals.iter_mut().for_each(|normal| *normal = normal.normalize_or_zero());
        let bounds = |(index, triangle): (usize, &[u32; 3])| {
            let corners = triangle.map(|corner| vertices[corner as usize]);
            let [low, high] = [corners[0].min(corners[1]).min(corners[2]), corners[0].max(corners[1]).max(corners[2])];
            TriangleBox { bounds: Aabb::with_bounds(point(low), point(high)), triangle: index, node: 0 }
        };
        let mut boxes: Vec<_> = triangles.iter().enumerate().map(bounds).collect();
        let tree = Bvh::build_par(&mut boxes);
        Self { vertices, triangles, normals, tree, boxes }
    }

    /// Corners and triangles, for sampling.
    pub fn contents(&self) -> Contents {
        let positions = self.vertices.iter().map(|vertex| vertex.as_vec3().to_array()).collect();
        Contents { cloud: PointCloud::new(DVec3::ZERO, positions), triangles: self.triangles.clone() }
    }

    /// The first intersection of a ray with the surface, from either side.
    pub fn trace(&self, origin: DVec3, direction: DVec3) -> Option<Hit> {
        let ray = Ray::new(point(origin), Vector3::new(direction.x, direction.y, direction.z));
        let mut nearest: Option<(f64, usize, [f64; 2])> = None;
        for &TriangleBox { triangle: index, .. } in self.tree.traverse_iterator(&ray, &self.boxes) {
            let corners = self.triangles[index].map(|corner| self.vertices[corner as usize]);
            let Some((distance, weights)) = intersect(corners, origin, direction) else { continue };
            // Two triangles share an edge. Of equal distances the lower index wins, in any order of traversal.
            if nearest.is_none_or(|(least, first, _)| (distance, index) < (least, first)) {
                nearest = Some((distance, index, weights));
            }
        }
        let (distance, index, [second, third]) = nearest?;
        let [a, b, c] = self.triangles[index].map(|corner| self.normals[corner as usize]);
        let normal = (a * (1.0 - second - third) + b * second + c * third).normalize_or(-direction);
        Some(Hit { distance, normal })
    }
}

/// A triangle in the tree of boxes.
#[derive(Debug)]
struct TriangleBox {
    bounds: Aabb<f64, 3>,
    triangle: usize,
    /// Index of the tree's node.
    node: usize,
}

impl Bounded<f64, 3> for TriangleBox {
    fn aabb(&self) -> Aabb<f64, 3> {
        self.bounds
    }
}

impl BHShape<f64, 3> for TriangleBox {
    fn set_bh_node_index(&mut self, index: usize) {
        self.node = index;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

fn point(at: DVec3) -> Point3<f64> {
    Point3::new(at.x, at.y, at.z)
}

/// Intersection of a ray with a triangle, from either side: the distance, and the weights of the second and third
/// corner.
fn intersect([a, b, c]: [DVec3; 3], origin: DVec3, direction: DVec3) -> Option<(f64, [f64; 2])> {
    let (ab, ac, to_origin) = (b - a, c - a, origin - a);
    let across = direction.cross(ac);
    let determinant = ab.dot(across);
    if determinant == 0.0 {
        return None;
    }
    let second = to_origin.dot(across) / determinant;
    let beside = to_origin.cross(ab);
    let third = direction.dot(beside) / determinant;
    let distance = ac.dot(beside) / determinant;
    // NaN misses. The slack closes seams between triangles.
    let slack = 1e-9;
    let is_hit = second >= -slack && third >= -slack && second + third <= 1.0 + slack && distance > 0.0;
    is_hit.then_some((distance, [second, third]))
}

/// An edge, with sums over its triangles.
struct Edge {
    ends: [u32; 2],
    /// Number of triangles at the edge.
    count: u32,
    /// Sum of the corners opposite to the edge.
    across: DVec3,
}

/// One step of Loop subdivision. Edges of one triangle, or of more than two, stay sharp.
fn subdivide(vertices: &[DVec3], triangles: &[[u32; 3]]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    // Edges keep the order of the triangles, so that sums do not depend on the map's order.
    let mut edges: Vec<Edge> = Vec::new();
    let mut found: HashMap<[u32; 2], u32> = HashMap::new();
    let mut sides = Vec::with_capacity(triangles.len());
    for &[a, b, c] in triangles {
        sides.push([[a, b, c], [b, c, a], [c, a, b]].map(|[from, to, across]| {
            let ends = [from.min(to), from.max(to)];
            let index = *found.entry(ends).or_insert_with(|| {
                edges.push(Edge { ends, count: 0, across: DVec3::ZERO });
                edges.len() as u32 - 1
            });
            let edge = &mut edges[index as usize];
            edge.count += 1;
            edge.across += vertices[across as usize];
            index
        }));
    }
    let mut around = vec![(DVec3::ZERO, 0_u32, DVec3::ZERO, 0_u32); vertices.len()];
    for &Edge { ends, count, .. } in &edges {
        for [at, other] in [ends, [ends[1], ends[0]]] {
            let (all, alls, sharp, sharps) = &mut around[at as usize];
            *all += vertices[other as usize];
            *alls += 1;
            if count != 2 {
                *sharp += vertices[other as usize];
                *sharps += 1;
            }
        }
    }
    let moved = vertices.iter().zip(&around).map(|(&vertex, &(all, alls, sharp, sharps))| match (alls, sharps) {
        (_, 2) => vertex * 0.75 + sharp * 0.125,
        (3.., 0) => {
            let share = if alls == 3 { 3.0 / 16.0 } else { 3.0 / (8.0 * f64::from(alls)) };
            vertex * (1.0 - share * f64::from(alls)) + all * share
        }
        _ => vertex,
    });
    let middle = |edge: &Edge| {
        let sum: DVec3 = edge.ends.iter().map(|&end| vertices[end as usize]).sum();
        if edge.count == 2 { sum * 0.375 + edge.across * 0.125 } else { sum * 0.5 }
    };
    let finer = moved.chain(edges.iter().map(middle)).collect();
    let first = vertices.len() as u32;
    let cut = |(&[a, b, c], &side): (&[u32; 3], &[u32; 3])| {
        let [ab, bc, ca] = side.map(|edge| first + edge);
        [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
    };
    (finer, triangles.iter().zip(&sides).flat_map(cut).collect())
}

fn icosahedron() -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
    let rectangle = [[1.0, golden], [-1.0, golden], [1.0, -golden], [-1.0, -golden]];
    let corners = rectangle.iter().flat_map(|&[a, b]| [[0.0, a, b], [a, b, 0.0], [b, 0.0, a]]);
    let vertices: Vec<DVec3> = corners.map(|corner| DVec3::from(corner).normalize()).collect();
    let count = vertices.len() as u32;
    let is_edge = |a: u32, b: u32| (vertices[a as usize] - vertices[b as usize]).length() < 1.1;
    let mut triangles = Vec::new();
    for (a, b, c) in (0..count).flat_map(|a| (a + 1..count).flat_map(move |b| (b + 1..count).map(move |c| (a, b, c)))) {
        if is_edge(a, b) && is_edge(b, c) && is_edge(c, a) {
            let [p, q, r] = [a, b, c].map(|corner| vertices[corner as usize]);
            let outward = (q - p).cross(r - p).dot(p) > 0.0;
            triangles.push(if outward { [a, b, c] } else { [a, c, b] });
        }
    }
    (vertices, triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_meet_a_fine_sphere_where_they_meet_a_sphere() {
        let (mut vertices, mut triangles) = icosahedron();
        assert_eq!(triangles.len(), 20, "an icosahedron");
        for _ in 0..5 {
            (vertices, triangles) = subdivide(&vertices, &triangles);
            vertices.iter_mut().for_each(|vertex| *vertex = vertex.normalize());
        }
        assert_eq!(triangles.len(), 20 << 10, "each step cuts a triangle into four");
        let mesh = Mesh::new(vertices, triangles);
        for i in 0..200 {
            let [x, y] = [f64::from(i % 20) * 0.09 - 0.85, f64::from(i / 20) * 0.1 - 0.5];
            let hit = mesh.trace(DVec3::new(x, y, -3.0), DVec3::Z);
            let inside = 1.0 - x * x - y * y;
            if inside < 0.01 {
                continue;
            }
            let hit = hit.expect("a ray through the sphere hits");
            let exact = DVec3::new(x, y, -inside.sqrt());
            assert!((hit.distance - (3.0 + exact.z)).abs() < 0.003, "{} at {exact}", hit.distance);
            assert!(hit.normal.dot(exact) > 0.9999, "{} at {exact}", hit.normal);
        }
        assert_eq!(mesh.trace(DVec3::new(2.0, 0.0, -3.0), DVec3::Z), None, "a ray beside the sphere misses");
    }

    #[test]
    fn subdivision_keeps_a_plane_and_its_border() {
        let grid = (0..9).map(|i| DVec3::new(f64::from(i % 3), f64::from(i / 3), 0.0)).collect::<Vec<_>>();
        let cell = |i: u32| [[i, i + 1, i + 4], [i, i + 4, i + 3]];
        let triangles: Vec<_> = [0, 1, 3, 4].into_iter().flat_map(cell).collect();
        let (vertices, finer) = subdivide(&grid, &triangles);
        assert_eq!(finer.len(), 4 * triangles.len(), "four triangles for each");
        assert!(
            vertices.iter().all(|v| v.z == 0.0 && v.min_element() >= 0.0 && v.max_element() <= 2.0),
            "the plane stays plane"
        );
        assert!(vertices.contains(&DVec3::new(0.5, 0.0, 0.0)), "a border edge is cut in its middle");
    }
}
