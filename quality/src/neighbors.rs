//! Exact nearest neighbours in a whole cloud, and plane fits in `f64`.

use std::num::NonZero;

use autosplats::cloud::PointCloud;
use autosplats::cloud::glam::{DMat3, DVec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};

/// A cloud in a tree for searches of nearest neighbours.
#[derive(Debug)]
pub struct Neighbors {
    tree: ImmutableKdTree<f64, 3>,
    points: Vec<[f64; 3]>,
    origin: DVec3,
    k: NonZero<usize>,
}

impl Neighbors {
    /// Builds the tree of `cloud`, for searches of `k` neighbours. All points must be finite.
    pub fn new(cloud: &PointCloud, k: NonZero<usize>) -> Self {
        let points: Vec<_> = cloud.positions().iter().map(|point| point.map(f64::from)).collect();
        let tree = ImmutableKdTree::new_from_slice(&points).expect("a tree of finite points");
        Self { tree, points, origin: cloud.origin(), k }
    }

    /// Number of points in the cloud.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether the cloud has no points.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Position of point `index` in the world.
    pub fn position(&self, index: u32) -> DVec3 {
        self.origin + DVec3::from(self.points[index as usize])
    }

    /// Offsets of the k nearest points from a place in the world, in ascending order of length.
    pub fn around(&self, place: DVec3) -> Vec<DVec3> {
        self.offsets(place - self.origin, self.k)
    }

    fn offsets(&self, place: DVec3, count: NonZero<usize>) -> Vec<DVec3> {
        let nearest = self.tree.query(&place.to_array()).nearest_n::<SquaredEuclidean<f64>>(count).execute();
        nearest.iter().map(|point| DVec3::from(self.points[point.item as usize]) - place).collect()
    }

    /// Normal of the plane fitted to point `index` and its k nearest neighbours, of either sign.
    pub fn normal(&self, index: u32) -> DVec3 {
        self.normals(index, &[self.k.get()])[0]
    }

    /// Normals of planes fitted to these numbers of neighbours, in ascending order.
    pub fn normals(&self, index: u32, numbers: &[usize]) -> Vec<DVec3> {
        let most = numbers.last().copied().unwrap_or_default();
        // The point itself is among the points found.
        let offsets = self.offsets(self.points[index as usize].into(), NonZero::<usize>::MIN.saturating_add(most));
        let mut moments = Moments::default();
        let mut normals = Vec::with_capacity(numbers.len());
        for (i, &offset) in offsets.iter().enumerate() {
            moments.add(offset);
            if numbers.contains(&i) {
                normals.push(moments.normal());
            }
        }
        // A cloud with fewer points is one neighbourhood.
        normals.resize(numbers.len(), moments.normal());
        normals
    }
}

/// Sums over offsets from a place near the points.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    count: f64,
    sum: DVec3,
    squares: DVec3,
    /// Sums of y·z, z·x and x·y.
    mixed: DVec3,
}

impl Moments {
    fn add(&mut self, d: DVec3) {
        self.count += 1.0;
        self.sum += d;
        self.squares += d * d;
        self.mixed += DVec3::new(d.y * d.z, d.z * d.x, d.x * d.y);
    }

    /// Direction of the least spread: the eigenvector of the least eigenvalue of the offsets' covariance.
    ///
    /// The eigenvalue is a root of the characteristic polynomial in closed form. The eigenvector is orthogonal to the
    /// rows of the covariance less the eigenvalue times the identity.
    fn normal(&self) -> DVec3 {
        let mean = self.sum / self.count;
        let squares = self.squares - self.sum * mean;
        let m = self.mixed - DVec3::new(self.sum.y * mean.z, self.sum.z * mean.x, self.sum.x * mean.y);
        let covariance = DMat3::from_cols(
            DVec3::new(squares.x, m.z, m.y),
            DVec3::new(m.z, squares.y, m.x),
            DVec3::new(m.y, m.x, squares.z),
        );
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_of_a_noisy_plane() {
        let normal = DVec3::new(0.3, -0.5, 0.8).normalize();
        let [a, b] = [normal.any_orthonormal_vector(), normal.cross(normal.any_orthonormal_vector())];
        let grid = (0..25).map(|i| [f64::from(i % 5), f64::from(i / 5)]);
        let mut moments = Moments::default();
        // Points lie alternately above and below the plane, at the same distance.
        grid.for_each(|[x, y]| moments.add(a * x + b * y + normal * (0.1 * ((x + y) % 2.0 - 0.5))));
        let found = moments.normal();
        assert!((1.0 - found.dot(normal).abs()) < 1e-12, "{found} is not {normal}");
    }

    #[test]
    fn each_number_of_neighbors_has_its_own_plane() {
        // A small plane at right angles to z, and distant points that tilt the fit.
        let near = (0..25).map(|i| [(i % 5) as f32 * 0.1, (i / 5) as f32 * 0.1, 0.0]);
        let far = (0..25).map(|i| [10.0 + (i % 5) as f32, (i / 5) as f32, 5.0]);
        let cloud = PointCloud::new(DVec3::ZERO, near.chain(far).collect());
        let neighbors = Neighbors::new(&cloud, NonZero::new(8).expect("8"));
        let normals = neighbors.normals(12, &[8, 40]);
        assert!(normals[0].z.abs() > 1.0 - 1e-9 && normals[1].z.abs() < 0.99, "{normals:?}");
        assert_eq!(neighbors.normal(12), normals[0], "one number gives the same as several");
    }
}
