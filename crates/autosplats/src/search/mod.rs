//! Search: the k nearest screen points of each screen point, summed up in moments [Paper, §4, §5].
//!
//! The rules below have no iterations, so that the result depends on the screen points alone. The screen grid and
//! splat communication follow these rules. The kd-tree, the paper's baseline, answers another question. Its neighbours
//! are all points of the cloud, visible or not; it has no gap rule, and its bound is its own.
//!
//! A near point (`project/near.rs`) has its neighbours among the points of sparse cells around the eye; no rule ends
//! its neighbourhood. For any other point P let r̃₀ be the first search radius (§5.1) and d₁ ≤ d₂ ≤ … the distances to
//! the other screen points:
//!
//! - *Outlier* (§5.3): P is discarded if d₁ > r̃₀·√max(k, 10)^e0, the radius after e0 expansions without a neighbour.
//!   With lenient rules P is discarded if d₁ is more than [`OUTLIER_RADIUS_SLACK`] times that radius, or if d₁ exceeds
//!   that radius and a gap ends the neighbourhood.
//! - *Gap* (§5.3): the first j with d₍ⱼ₊₁₎ > √λ·max(dⱼ, r̃₀) ends the neighbourhood. The area of the circle has then
//!   grown by λ, from r̃₀ on, without a new neighbour. P is *clamped* to κ = j neighbours, and its k-radius is dⱼ.
//!   With lenient rules a gap after one neighbour needs d₂ > λ·d₁.
//! - Otherwise the k-radius is d₍ₖ₎, and the neighbourhood is all points at that distance or nearer.
//! - *Bound*: a search ends at the largest radius r̃₀·1.25ⁱ, for whole i, whose sphere projects to a rectangle with at
//!   most [`MAX_CANDIDATES`] screen points. If no rule ends the neighbourhood and the k-th neighbour lies beyond, P
//!   keeps the neighbours within that radius and counts as *bounded*. The bound limits the time per point, even in a
//!   cloud of outliers only. An engine that reads at most [`MIN_CROWDED_CANDIDATES`] points may skip the bound, which
//!   then lies further out, as density does not rise eightfold in a step. Before it returns a k-th neighbour, it checks
//!   that the next step holds at most [`MAX_CANDIDATES`] points. Splat communication limits its iterations instead.

pub(crate) mod engine;
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
///
/// # Examples
///
/// ```
/// use autosplats::{Renderer, SearchEngine, Settings};
///
/// let mut settings = Settings::default();
/// settings.reconstruction.engine = SearchEngine::SplatCommunication;
/// assert!(Renderer::new().check(&settings).is_err(), "this engine needs a GPU");
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum SearchEngine {
    /// Reads buckets of screen points outwards from each point. Exact, in one pass.
    #[default]
    ScreenGrid,
    /// The paper's engine: points splat distances onto each other's pixels, in iterations. Runs on a GPU only. Slower
    /// than the screen grid; exact for at least 99.9 % of the points. This form splats in compute shaders, as cards for
    /// data centres hardly rasterise; it finds what the raster form finds.
    SplatCommunication,
    /// [`SplatCommunication`](Self::SplatCommunication) as the paper has it: splats are drawn by the raster pipeline
    /// and blended. Needs `FLOAT32_BLENDABLE`.
    SplatCommunicationRaster,
    /// The paper's baseline (Zhou et al. 2008): a kd-tree over all points of the cloud, rebuilt in each frame. Runs on
    /// a GPU only. Neighbours are points of the cloud, visible or not, and gaps do not end a neighbourhood.
    KdTree {
        /// Radius in world units within which a point's k neighbours must lie; further neighbours are not found. A
        /// much too large radius costs time and exactness.
        first_radius: f32,
    },
}

impl SearchEngine {
    /// Whether the engine finds all neighbours, or leaves one point in a thousand unfinished.
    pub(crate) fn is_exact(self) -> bool {
        !matches!(self, Self::SplatCommunication | Self::SplatCommunicationRaster)
    }
}

/// Number of neighbourhoods in a [`NeighborhoodBlock`].
pub(crate) const LANES: usize = 16;

/// Margin in pixels around projected bounds, against the rounding of projected coordinates.
pub(crate) const MARGIN_PX: f32 = 0.02;
/// Most screen points in the projection of the largest sphere that is searched.
pub(crate) const MAX_CANDIDATES: usize = 4096;
/// Screen points in a window from which on its points may meet the bound: density does not rise eightfold in a step.
pub(crate) const MIN_CROWDED_CANDIDATES: usize = MAX_CANDIDATES / 8;
/// Ratio of successive radii among which the bound is chosen.
pub(crate) const BOUND_STEP: f32 = 1.25;

/// One value per neighbourhood of a block.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Lanes(pub(crate) [f32; LANES]);

/// Sixteen neighbourhoods, side by side for SIMD. Sums are taken about the point itself, which is not counted.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct NeighborhoodBlock {
    /// Number of neighbours; 0 if the point is an outlier.
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

/// Neighbourhoods of a list of screen points, in the order of the list.
#[derive(Debug, Default)]
pub(crate) struct Neighborhoods {
    /// Blocks of sixteen. Lanes of the last block beyond the end of the list are undefined.
    pub(crate) blocks: Vec<NeighborhoodBlock>,
    pub(crate) counts: SearchCounts,
}

/// Numbers of points whose search ended early, by reason. Reasons overlap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct SearchCounts {
    pub(crate) outliers: usize,
    pub(crate) clamped: usize,
    /// Each bounded point also counts as clamped, or as an outlier if it has no neighbour.
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

/// Factor on the outlier radius up to which lenient rules keep a point that has k neighbours without a gap. On a
/// steep surface, or in front of another surface, density is overestimated and first search radii are too short. With
/// noise, such a surface would lose most of its points. Outliers have gaps around them.
pub(crate) const OUTLIER_RADIUS_SLACK: f32 = 1.2;

/// Rules that define the neighbourhoods; an engine implements them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SearchRules {
    pub(crate) k: u32,
    /// Number of expansions e0 after which a point without a neighbour is an outlier; `None` keeps such points.
    pub(crate) outlier_expansions: Option<u32>,
    /// Gap factor λ; `None` bridges any gap.
    pub(crate) gap_factor: Option<f32>,
    /// Whether a gap after one neighbour must be wider, and whether [`OUTLIER_RADIUS_SLACK`] applies. Random samples
    /// then have that gap no more often than a gap after two neighbours.
    pub(crate) lenient: bool,
}

/// Rule that ends a neighbourhood before its k-th neighbour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum EarlyEnd {
    /// The nearest neighbour is too far.
    Outlier,
    /// A gap follows this many neighbours.
    Gap(usize),
}

impl SearchRules {
    /// Outlier radius in world units: a point needs a neighbour within, apart from [`OUTLIER_RADIUS_SLACK`].
    #[inline(always)]
    pub(crate) fn outlier_radius(&self, initial_radius: f32) -> f32 {
        // Differs from the paper: an expansion by √k is none at k = 1, and would discard surfaces below the usual k.
        let growth = self.k.max(10) as f32;
        self.outlier_expansions.map_or(f32::INFINITY, |e0| initial_radius * growth.powf(0.5 * e0 as f32))
    }

    /// Largest ratio between the next neighbour's distance and the furthest of `neighbors` neighbours that is no gap.
    // Differs from the paper: of random samples, the second neighbour is more than √λ times as far as the first in one
    // neighbourhood of λ. The first search radius should prevent such gaps. It is too short where a surface is steep,
    // or where a close-up shows the back of an object through its front.
    fn gap_growth(&self, gap_factor: f32, neighbors: usize) -> f32 {
        if self.lenient && neighbors == 1 { gap_factor } else { gap_factor.sqrt() }
    }

    /// Applies the rules to squared distances in ascending order, complete up to distance `known`. `None` means that
    /// no rule ends the neighbourhood within `known`.
    pub(crate) fn early_end(&self, squared: &[f32], initial_radius: f32, known: f32) -> Option<EarlyEnd> {
        let nearest = squared.first().map_or(known, |d| d.sqrt());
        let outlier_radius = self.outlier_radius(initial_radius);
        let is_lone = nearest > outlier_radius;
        if is_lone && (!self.lenient || nearest > OUTLIER_RADIUS_SLACK * outlier_radius) {
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
