//! Points that are no part of the surface that their neighbours are.
// Differs from the paper: it takes any neighbour within the radius of e0 expansions, 31 first search radii at k = 10, as a
// sign of surface, so that a point in the air before a dense scan grows a disc as wide as its distance.

/// A point whose neighbours' mean is further from it than this part of the k-radius has them all on one side and close
/// together: they are a surface elsewhere, and the point an outlier. At a straight edge the part is 0.42, at a square corner
/// 0.6, at the end of a line 0.55.
pub(super) const LOPSIDED: f32 = 0.75;
/// The same of a point that is far sparser than what is around it on the screen,
pub(super) const LOPSIDED_SPARSE: f32 = 0.66;
/// which it is if its k-radius is so many first search radii.
pub(super) const FAR_SPARSER: f32 = 3.0;
/// Fewer neighbours than this are too often on one side by chance.
pub(super) const LOPSIDED_COUNT: f32 = 6.0;

/// A point that is further from the plane through its neighbours than this part of the k-radius stands beside their surface,
pub(super) const BESIDE: f32 = 0.25;
/// if that is flat: they scatter about it by less than the distance, squared, over this. At the tip of a cone it is 8, at a
/// cube's corner 7; of strewn tips one in a hundred goes. So does a single step of coordinates on a grid.
pub(super) const FLAT: f32 = 50.0;

/// A point with fewer neighbours than this before a gap is of a surface only where others are not much denser,
pub(super) const FEW: f32 = 4.0;
/// as they are if the k-radius is so many first search radii.
pub(super) const SPARSER: f32 = 1.3;

/// In a picture of fewer points than this there is nothing to compare with, and so few in all are no surface.
pub(crate) const HANDFUL: usize = 64;

/// The neighbours of a point, in k-radii.
#[derive(Clone, Copy, Debug)]
pub(super) struct Around {
    pub(super) count: f32,
    /// From the point to their mean.
    pub(super) mean: [f32; 3],
    /// Unit normal of the plane through the point and them.
    pub(super) normal: [f32; 3],
    /// Variance of the point and them along it.
    pub(super) variance: f32,
}

impl Around {
    /// Whether the point is no part of their surface, where `k` were looked for. Its k-radius is `sparser` first search radii,
    /// which few points are asked; `None` if there is nothing to compare with.
    #[inline(always)]
    pub(super) fn is_alone(&self, sparser: Option<impl Fn() -> f32>, k: u32) -> bool {
        let &Self { count, mean, normal, variance } = self;
        let is_sparser = |than: f32| sparser.as_ref().is_some_and(|sparser| sparser() > than);
        if count < LOPSIDED_COUNT {
            return count < FEW.min(k as f32) && is_sparser(SPARSER);
        }
        let dot = |v: [f32; 3]| mean[0] * v[0] + mean[1] * v[1] + mean[2] * v[2];
        let off = dot(mean);
        if off > LOPSIDED_SPARSE * LOPSIDED_SPARSE && (off > LOPSIDED * LOPSIDED || is_sparser(FAR_SPARSER)) {
            return true;
        }
        let beside = dot(normal) * dot(normal);
        // Without the point itself.
        let all = count + 1.0;
        let scatter = (variance - count * beside / (all * all)) * (all / count);
        sparser.is_some() && beside > BESIDE * BESIDE && beside > FLAT * scatter
    }
}
