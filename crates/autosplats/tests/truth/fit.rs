//! The reference for normals: plane fits on the exact nearest neighbours in the whole cloud, in `f64`.

use std::num::NonZero;

use autosplats::cloud::PointCloud;
use autosplats::cloud::glam::{DMat3, DVec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};

/// A cloud that can be asked for the nearest neighbours of any place.
pub(crate) struct Neighbors {
    tree: ImmutableKdTree<f64, 3>,
    points: Vec<[f64; 3]>,
    origin: DVec3,
    k: NonZero<usize>,
}

impl Neighbors {
    pub(crate) fn new(cloud: &PointCloud, k: NonZero<usize>) -> Self {
        let points: Vec<_> = cloud.positions().iter().map(|point| point.map(f64::from)).collect();
        let tree = ImmutableKdTree::new_from_slice(&points).expect("a tree of finite points");
        Self { tree, points, origin: cloud.origin(), k }
    }

    pub(crate) fn k(&self) -> f64 {
        self.k.get() as f64
    }

    /// Radius of the ball about a place in the world that holds k points.
    pub(crate) fn k_radius(&self, place: DVec3) -> f64 {
        let place = (place - self.origin).to_array();
        let nearest = self.tree.query(&place).nearest_n::<SquaredEuclidean<f64>>(self.k).execute();
        nearest.iter().fold(0.0, |radius: f64, point| radius.max(point.distance)).sqrt()
    }

    /// Normal of the plane through point `index` and its k nearest neighbours, of either sign.
    pub(crate) fn normal(&self, index: u32) -> DVec3 {
        let center = &self.points[index as usize];
        // The point itself is among those found.
        let nearest = self.tree.query(center).nearest_n::<SquaredEuclidean<f64>>(self.k.saturating_add(1)).execute();
        let offsets = nearest.iter().map(|point| DVec3::from(self.points[point.item as usize]) - DVec3::from(*center));
        plane_normal(&offsets.collect::<Vec<_>>())
    }
}

/// Direction in which `points` spread the least: the eigenvector of the least eigenvalue of their covariance.
///
/// The eigenvalue is a root of the characteristic polynomial in closed form, its vector is orthogonal to the rows of the
/// matrix less that value.
fn plane_normal(points: &[DVec3]) -> DVec3 {
    let count = points.len() as f64;
    let mean = points.iter().sum::<DVec3>() / count;
    let outer = |d: DVec3| DMat3::from_cols(d * d.x, d * d.y, d * d.z);
    let covariance = points.iter().fold(DMat3::ZERO, |sum, &point| sum + outer(point - mean));
    let trace = |m: DMat3| m.x_axis.x + m.y_axis.y + m.z_axis.z;
    let third = trace(covariance) / 3.0;
    let deviation = covariance - DMat3::IDENTITY * third;
    let scale = (trace(deviation * deviation) / 6.0).sqrt();
    if !(scale > 0.0) {
        return DVec3::Z;
    }
    let angle = ((deviation * (1.0 / scale)).determinant() / 2.0).clamp(-1.0, 1.0).acos() / 3.0;
    let least = third + 2.0 * scale * (angle + std::f64::consts::TAU / 3.0).cos();
    let rest = covariance - DMat3::IDENTITY * least;
    let normals = [rest.x_axis.cross(rest.y_axis), rest.y_axis.cross(rest.z_axis), rest.z_axis.cross(rest.x_axis)];
    let longest = normals.into_iter().max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    longest.unwrap_or_default().normalize_or(DVec3::Z)
}

#[test]
fn plane_normal_is_normal_to_a_noisy_plane() {
    let normal = DVec3::new(0.3, -0.5, 0.8).normalize();
    let [a, b] = [normal.any_orthonormal_vector(), normal.cross(normal.any_orthonormal_vector())];
    let grid = (0..25).map(|i| [f64::from(i % 5), f64::from(i / 5)]);
    // Every other point is as far above the plane as the others are below.
    let points: Vec<_> = grid.map(|[x, y]| a * x + b * y + normal * (0.1 * ((x + y) % 2.0 - 0.5))).collect();
    let found = plane_normal(&points);
    assert!((1.0 - found.dot(normal).abs()) < 1e-12, "{found} is not {normal}");
}
