//! Search: the k nearest screen points of each screen point, summed up in moments [Paper, §4, §5].
//!
//! The question is stated here without iterations, so that the answer depends on the screen points alone. The screen grid and
//! splat communication answer it; the kd-tree answers another, as the paper's rival does: its neighbours are all points of the
//! cloud, seen or not, it knows no gap, and its bound is its own. For point P with first search radius r̃₀ (§5.1) and the
//! distances d₁ ≤ d₂ ≤ … to the other screen points:
//!
//! - *outlier* (§5.3): P is discarded if d₁ > r̃₀·√max(k, 10)^e0, the radius after e0 expansions that met nothing; with
//!   adaptive rules, if d₁ is more than [`STEEP`] times that, or no more but a gap ends the neighbourhood;
//! - *gap* (§5.3): the first j with d₍ⱼ₊₁₎ > √λ·max(dⱼ, r̃₀) ends the neighbourhood: the circle's area grew by λ, from r̃₀
//!   on, without a new neighbour. P is *clamped* to κ = j neighbours, its k-radius is dⱼ; with adaptive rules
//!   d₂ > λ·d₁ is asked of a gap after one neighbour;
//! - otherwise the k-radius is d₍ₖ₎, the neighbourhood all points at that distance or nearer;
//! - *bound*: a search need not look further than the largest of the radii r̃₀·1.25ⁱ, i any whole number, whose sphere
//!   projects to a rectangle with at most [`MAX_CANDIDATES`] screen points. If no rule ended the neighbourhood and its k-th
//!   neighbour lies beyond, P keeps the neighbours within that radius and is counted as bounded. So a cloud of nothing but
//!   outliers costs a bounded time per point. An engine may go without the rectangle, and so without the bound, where it
//!   reads less than [`CROWDED`] screen points. Splat communication goes without it: what bounds it is the number of its
//!   iterations.

pub(crate) mod gpu;
pub(crate) mod kd_tree;
pub(crate) mod moments;
pub(crate) mod past;
pub(crate) mod screen_grid;
pub(crate) mod select;
pub(crate) mod splat_communication;
#[cfg(test)]
mod tests;

/// An implementation of the k-radius search.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum SearchEngine {
    /// Buckets of screen points read outwards from each point; exact, in one pass.
    #[default]
    ScreenGrid,
    /// The paper's own: points draw splats onto each other's pixels, on a GPU only. Slower, and exact for at least 99.9 % of
    /// the points.
    SplatCommunication,
    /// The paper's rival (Zhou et al. 2008): a kd-tree over all points of the cloud, built anew in each frame, and the
    /// k-radius of each of them. On a GPU only. Its neighbours are those in the cloud, seen or not; it knows no gaps.
    KdTree {
        /// Within it, in world units, a point's k neighbours must lie: those beyond are not found. Much too large a radius
        /// costs time, and exactness.
        first_radius: f32,
    },
}

/// Neighbourhoods that share a [`NeighborhoodBlock`].
pub(crate) const LANES: usize = 16;

/// Added to projected bounds in pixels, against the rounding of projected coordinates.
pub(crate) const MARGIN_PX: f32 = 0.02;
/// Screen points in the projection of the largest sphere that is searched.
pub(crate) const MAX_CANDIDATES: usize = 4096;
/// Screen points in a window from which on its points may meet the bound: densities do not rise eightfold in one step.
pub(crate) const CROWDED: usize = MAX_CANDIDATES / 8;
/// Step between the radii among which the bound is found.
pub(crate) const BOUND_STEP: f32 = 1.25;

/// One value per neighbourhood of a block.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Lanes(pub(crate) [f32; LANES]);

/// Sixteen neighbourhoods, side by side for SIMD. Sums are taken about the point itself, which is not counted.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub(crate) struct NeighborhoodBlock {
    /// Neighbours; 0 if the point is an outlier.
    pub(crate) count: Lanes,
    /// Distance to the furthest neighbour, world units.
    pub(crate) k_radius: Lanes,
    /// Σ(q - p), view space.
    pub(crate) offset: [Lanes; 3],
    /// Σ(q - p)(q - p)ᵀ: xx, xy, xz, yy, yz, zz.
    pub(crate) second: [Lanes; 6],
}

impl Default for Lanes {
    fn default() -> Self {
        Self([0.0; LANES])
    }
}

impl Default for NeighborhoodBlock {
    fn default() -> Self {
        let zero = Lanes::default();
        Self { count: zero, k_radius: zero, offset: [zero; 3], second: [zero; 6] }
    }
}

/// Neighbourhoods of a list of screen points, in that list's order.
#[derive(Debug, Default)]
pub(crate) struct Neighborhoods {
    /// Lanes of the last block beyond the end of the list hold nothing of use.
    pub(crate) blocks: Vec<NeighborhoodBlock>,
    pub(crate) counts: SearchCounts,
}

/// What became of the points searched for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct SearchCounts {
    pub(crate) outliers: usize,
    pub(crate) clamped: usize,
    pub(crate) bounded: usize,
}

impl std::ops::Add for SearchCounts {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            outliers: self.outliers + other.outliers,
            clamped: self.clamped + other.clamped,
            bounded: self.bounded + other.bounded,
        }
    }
}

/// How much further than the radius after e0 expansions the nearest neighbour may be, with adaptive rules, of a point that has all k.
/// Where a surface is steep, or others stand behind it, density is told too high and first search radii too short: with noise
/// such a surface lost most of its points. Outliers have gaps around them.
pub(crate) const STEEP: f32 = 1.2;

/// The question put to an engine.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SearchRules {
    pub(crate) k: u32,
    /// e0; `None` keeps points without neighbours.
    pub(crate) outlier_expansions: Option<u32>,
    /// λ; `None` bridges any gap.
    pub(crate) gap_factor: Option<f32>,
    /// Whether a gap after one neighbour has to be wider, so that strewn points have it no more often than one after two.
    pub(crate) adaptive: bool,
}

/// How a neighbourhood ends before its k-th neighbour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum EarlyEnd {
    /// No neighbour is near enough.
    Outlier,
    /// A gap follows this many neighbours.
    Gap(usize),
}

impl SearchRules {
    /// Radius within which a point must have a neighbour, but for [`STEEP`].
    #[inline(always)]
    pub(crate) fn outlier_radius(&self, initial_radius: f32) -> f32 {
        // Differs from the paper, whose expansion by √k would be none at k = 1, and discard surface below the usual k.
        let growth = self.k.max(10) as f32;
        self.outlier_expansions.map_or(f32::INFINITY, |e0| initial_radius * growth.powf(0.5 * e0 as f32))
    }

    /// How much further than its furthest neighbour a neighbourhood of so many may go without another.
    // Differs from the paper: of strewn points the second is more than √λ times as far as the first in one neighbourhood of λ.
    // The first search radius is to keep that from being a gap, but it is too short where a surface is steep, or the back of a
    // thing is seen through its front, in close-ups.
    fn gap_growth(&self, gap_factor: f32, neighbors: usize) -> f32 {
        if self.adaptive && neighbors == 1 { gap_factor } else { gap_factor.sqrt() }
    }

    /// Applies the rules to the squared distances, ascending and complete up to distance `known`.
    ///
    /// `None` says that no rule ends the neighbourhood within `known`.
    pub(crate) fn early_end(&self, squared: &[f32], initial_radius: f32, known: f32) -> Option<EarlyEnd> {
        let nearest = squared.first().map_or(known, |d| d.sqrt());
        let outlier_radius = self.outlier_radius(initial_radius);
        let is_lone = nearest > outlier_radius;
        if is_lone && (!self.adaptive || nearest > STEEP * outlier_radius) {
            return Some(EarlyEnd::Outlier);
        }
        let gap_factor = self.gap_factor?;
        let least_reach = gap_factor.sqrt() * initial_radius;
        for neighbors in 1..=squared.len().min(self.k as usize - 1) {
            let reach = least_reach.max(self.gap_growth(gap_factor, neighbors) * squared[neighbors - 1].sqrt());
            let next = squared.get(neighbors).map_or(known, |d| d.sqrt());
            if next > reach {
                return Some(if is_lone { EarlyEnd::Outlier } else { EarlyEnd::Gap(neighbors) });
            }
        }
        None
    }
}
