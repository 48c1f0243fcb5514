//! Rules that drop a point that does not belong to the surface of its neighbours. See docs/decisions/0010-outliers.md.
// Differs from the paper: the paper takes any neighbour within the radius of e0 expansions as a sign of surface, 31
// first search radii with k = 10. A point in front of a dense scan would grow a disc as wide as its distance.

/// Distance to the mean of the neighbours, in k-radii, above which a point is an outlier: the neighbours lie together
/// on one side, on a surface elsewhere. The distance is 0.42 at a straight edge, 0.6 at a square corner, 0.55 at a
/// line's end.
pub(super) const MAX_MEAN_OFFSET_K_RADII: f32 = 0.75;
/// Like `MAX_MEAN_OFFSET_K_RADII`, in k-radii, for a point that is far sparser than its surroundings on the screen.
pub(super) const MAX_SPARSE_MEAN_OFFSET_K_RADII: f32 = 0.66;
/// K-radius, in first search radii, above which a point is far sparser than its surroundings.
pub(super) const SPARSE_FIRST_RADII: f32 = 3.0;
/// Fewest neighbours whose mean and plane are compared with the point: fewer are too often on one side by chance.
pub(super) const MIN_COMPARED_NEIGHBORS: f32 = 6.0;

/// Distance from the plane through the neighbours, in k-radii, above which a point stands beside a flat surface.
pub(super) const MAX_PLANE_OFFSET_K_RADII: f32 = 0.25;
/// Least ratio of the squared distance from the plane to the neighbours' variance about the plane, for a surface to
/// count as flat. The ratio is 8 at the tip of a cone and 7 at a cube's corner; few random samples of a tip exceed the
/// limit. A single step of coordinates on a grid exceeds the limit too.
pub(super) const MIN_FLAT_OFFSET_RATIO: f32 = 50.0;

/// Number of neighbours before a gap below which a point is dropped if its surroundings are denser.
pub(super) const FEW_NEIGHBORS: f32 = 4.0;
/// K-radius, in first search radii, above which the surroundings of a point with few neighbours are denser.
pub(super) const FEW_NEIGHBORS_FIRST_RADII: f32 = 1.3;

/// Largest surface variation around a point near the eye. No density tells such points from outliers. Neighbours that
/// happen to fill space have three times this variation.
pub(super) const MAX_NEAR_VARIATION: f32 = 0.05;

/// Number of screen points below which there is nothing to compare with, and a cloud is no surface.
pub(crate) const MIN_SURFACE_POINTS: usize = 64;

/// The neighbours of a point, in units of the k-radius.
#[derive(Clone, Copy, Debug)]
pub(super) struct NeighborStatistics {
    pub(super) count: f32,
    /// Offset from the point to the mean of the neighbours.
    pub(super) mean: [f32; 3],
    /// Unit normal of the plane through the point and its neighbours.
    pub(super) normal: [f32; 3],
    /// Variance of the point and its neighbours along the normal.
    pub(super) variance: f32,
}

impl NeighborStatistics {
    /// Whether the point is no part of its neighbours' surface, with `k` neighbours asked for. `sparser` computes the
    /// k-radius in first search radii, which few points need; `None` if there is nothing to compare with.
    #[inline(always)]
    pub(super) fn is_outlier(&self, sparser: Option<impl Fn() -> f32>, k: u32) -> bool {
        let &Self { count, mean, normal, variance } = self;
        let is_sparser = |than: f32| sparser.as_ref().is_some_and(|sparser| sparser() > than);
        if count < MIN_COMPARED_NEIGHBORS {
            return count < FEW_NEIGHBORS.min(k as f32) && is_sparser(FEW_NEIGHBORS_FIRST_RADII);
        }
        let dot = |v: [f32; 3]| mean[0] * v[0] + mean[1] * v[1] + mean[2] * v[2];
        let off = dot(mean);
        if off > MAX_SPARSE_MEAN_OFFSET_K_RADII * MAX_SPARSE_MEAN_OFFSET_K_RADII
            && (off > MAX_MEAN_OFFSET_K_RADII * MAX_MEAN_OFFSET_K_RADII || is_sparser(SPARSE_FIRST_RADII))
        {
            return true;
        }
        let beside = dot(normal) * dot(normal);
        // Variance of the neighbours without the point itself.
        let all = count + 1.0;
        let scatter = (variance - count * beside / (all * all)) * (all / count);
        sparser.is_some()
            && beside > MAX_PLANE_OFFSET_K_RADII * MAX_PLANE_OFFSET_K_RADII
            && beside > MIN_FLAT_OFFSET_RATIO * scatter
    }
}
