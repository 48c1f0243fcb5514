//! The noise level: how far points scatter about the surface.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use pulp::Simd;
use rayon::prelude::*;

use super::cells::Cells;
use super::quadric::{Gathered, LEAST_CLUSTERS};
use super::rules::first_radius;
use super::sheets::SHEET_LEVELS;
use super::{SCALES, STEP};
use crate::camera::View;
use crate::fit::Surfel;
use crate::project::DensityGrid;

/// Expected number of sampled surfels; with no more surfels than this, nearly all are sampled.
pub(crate) const NOISE_SAMPLE_COUNT: usize = 1024;
/// Largest number of sampled surfels. The number varies by chance, by about forty.
pub(crate) const MOST_SAMPLED: usize = NOISE_SAMPLE_COUNT + NOISE_SAMPLE_COUNT / 2;
/// Least ratio of the median k-radius of the sample's sparsest third to that of its densest third at which growth of
/// noise is estimated. Growth counts more the larger the ratio. Random points reach 1.2 by chance, very noisy ones 1.7.
pub(super) const MIN_K_RADIUS_CONTRAST: f32 = 1.7;
/// Multiple of [`MIN_K_RADIUS_CONTRAST`] from which growth counts in full.
pub(super) const FULL_K_RADIUS_CONTRAST: f32 = 1.3;
/// Power of the k-radius up to which growth is that of structure.
pub(super) const STRUCTURE_GROWTH_POWER: f32 = 0.8;
/// Range of powers above [`STRUCTURE_GROWTH_POWER`] over which growth goes from structure to noise alone.
pub(super) const GROWTH_POWER_RAMP: f32 = 0.4;
/// Noise grows up to twice the k-radius that one in this many sampled points exceeds; outliers may be further apart.
pub(super) const GROWTH_END_DIVISOR: usize = 8;
/// Shift of the cells of [`hash_place`], in cells. Points often lie at round numbers, where rounding would decide on
/// the cell; thirds are no binary fractions.
pub(super) const CELL_SHIFT: f32 = 1.0 / 3.0;
/// Surfels per task when scatter is measured.
const TASK: usize = 32;
/// Surfels per task when the sample is picked.
const PICK_TASK: usize = 4096;
/// Fewest balls of a scale, with enough points to fit, that give an estimate.
pub(super) const LEAST_SAMPLE: usize = 64;
/// One in this many sampled points has to find a ball with enough points, or the scale gives no estimate.
pub(super) const MIN_BALL_SHARE_DIVISOR: usize = 5;
/// Scatter, in ball radii, below which a ball is thin. Points that fill a ball scatter by 0.4.
pub(super) const THIN_SCATTER_RADII: f32 = 0.15;
/// Scatter, in ball radii, below which scatter is rounding and counts as 0; which ball has more is chance.
pub(super) const ROUNDING_SCATTER_RADII: f32 = 1e-3;
/// Least share of thin balls at which a scale gives the noise level. Other balls may hold structure finer than the
/// ball.
pub(super) const THIN_SHARE: f32 = 0.3;
/// Largest rise of the thin share at the next scale. With a larger rise, noise fills the other balls and the thin ones
/// are thin by chance. The rule does not apply to the last scale, nor to shares that cannot rise by so much.
pub(super) const MAX_THIN_SHARE_RISE: f32 = 0.27;
/// Quantile of thin balls' scatter that is the noise level. Larger scatter is structure finer than the ball.
pub(super) const NOISE_QUANTILE: f32 = 0.33;
/// Ratio of scatter between successive scales below which a ball is *steady*: that of structure grows, noise's does
/// not.
pub(super) const MAX_STEADY_RATIO: f32 = 1.3;
/// Fewest thin balls with a next ball that give a steady share.
pub(super) const LEAST_PAIRS: usize = 32;
/// Steady shares between which scatter goes from structure to noise. Applies to the first [`STEADY_SCALES`] scales.
pub(super) const NOISE_SHARES: [f32; 2] = [0.1, 0.2];
/// Steady shares between which the quantile goes from [`NOISE_QUANTILE`] to [`UNEVEN_NOISE_QUANTILE`]. Noise that
/// differs from place to place is as steady, as with misaligned scans: their offset is across the surface here and
/// along it there.
pub(super) const UNEVEN_NOISE_SHARES: [f32; 2] = [0.55, 0.7];
/// Quantile where noise may differ from place to place. Uniform noise is as steady and is biased less low by this
/// quantile.
pub(super) const UNEVEN_NOISE_QUANTILE: f32 = 0.67;
/// Steady shares between which the estimate goes from possible structure to certain noise.
pub(super) const CERTAIN_NOISE_SHARES: [f32; 2] = [0.3, 0.45];
/// Number of scales for which steadiness is checked. Larger balls are wide against cells: slabs cut the noise in some
/// and not in others, so uniform noise has two scatters.
pub(super) const STEADY_SCALES: usize = 2;

/// Noise level, in k-radii, above which sheets use the coarser level of cells. Balls are large then, and a quarter of
/// the fits is as good; with less noise the fits would be worse.
pub(super) const THICK_NOISE: f32 = 0.4;

/// Statistics of a frame's surfels, laid out as in `shared/noise.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct FrameStatistics {
    pub(crate) noise: Noise,
    /// Median k-radius, world units; 0 if there are too few surfels.
    pub(crate) k_radius: f32,
    /// Level of the cells that have sheets.
    pub(crate) sheet_level: u32,
}

/// Standard deviation of points from their surface. It may grow with the k-radius: distant points are sparser and
/// noisier.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Noise {
    /// Noise level at k-radii of [`most`](Self::most) and beyond, world units.
    pub(crate) level: f32,
    /// Power of the k-radius that the noise grows with, 0 to 2. 0 is uniform noise; depth cameras have up to 2.
    pub(crate) power: f32,
    /// K-radius up to which the noise grows, world units; 0 for uniform noise.
    pub(crate) most: f32,
    /// Certainty that this is noise and not structure, 0 to 1.
    pub(crate) sure: f32,
}

impl Noise {
    /// No noise.
    pub(crate) const NONE: Self = Self { level: 0.0, power: 0.0, most: 0.0, sure: 0.0 };

    /// Noise level of points with a `k_radius` above 0, world units.
    #[inline(always)]
    pub(crate) fn at(&self, k_radius: f32) -> f32 {
        if self.power == 0.0 { self.level } else { self.level * (k_radius / self.most).min(1.0).powf(self.power) }
    }

    /// Estimates the noise from a sample sorted by k-radius, densest first.
    fn of(sample: &[Sampled]) -> Self {
        let [dense, sparse] = ends(sample);
        let all = scatter_level(sample, None);
        // Of the whole sample, as the thirds may take their levels from different scales.
        let steady: [_; STEADY_SCALES] = std::array::from_fn(|scale| steady_share(sample, scale));
        // The share of the largest checked balls, as more of them are thin.
        let told = (0..SCALES).find(|&scale| gives_noise(sample, scale));
        let share =
            told.and_then(|scale| steady[..=scale.min(STEADY_SCALES - 1)].iter().rev().copied().flatten().next());
        let sure = share.map_or(0.0, |share| between(CERTAIN_NOISE_SHARES, share));
        let by_steady = if all > 0.0 { scatter_level(sample, Some(steady)) / all } else { 1.0 };
        let third = dense.len();
        if third > 0
            && let [small, large] = [dense, sparse].map(|part| part[third / 2].surfel.k_radius)
            && large > MIN_K_RADIUS_CONTRAST * small
        {
            let [least, most] = [dense, sparse].map(|part| scatter_level(part, None));
            if least > 0.0 && most > least {
                let growth = (most / least).ln() / (large / small).ln();
                // Little growth is chance, or a different kind of object where points are sparse.
                let much = ((growth - STRUCTURE_GROWTH_POWER) * (1.0 / GROWTH_POWER_RAMP)).clamp(0.0, 1.0);
                let apart =
                    ((large / (MIN_K_RADIUS_CONTRAST * small) - 1.0) * (1.0 / (FULL_K_RADIUS_CONTRAST - 1.0))).min(1.0);
                let grows = much * apart;
                if grows > 0.0 {
                    let power = grows * growth.min(2.0);
                    // Through the geometric mean of both thirds, blended with the level of all where growth is
                    // uncertain.
                    let both = least.sqrt() * most.sqrt();
                    let middle = if all > 0.0 { all.powf(1.0 - grows) * both.powf(grows) } else { both };
                    let beyond = 2.0 * sample[sample.len() - 1 - sample.len() / GROWTH_END_DIVISOR].surfel.k_radius;
                    let level = by_steady * middle * (beyond / (small.sqrt() * large.sqrt())).powf(power);
                    return Self { level, power, most: beyond, sure };
                }
            }
        }
        Self { level: by_steady * all, power: 0.0, most: 0.0, sure }
    }
}

/// Measures a frame's statistics on a sample of `surfels`.
pub(crate) fn measure(
    surfels: &[Surfel],
    cells: &Cells,
    density: &DensityGrid,
    view: &View,
    k: u32,
) -> FrameStatistics {
    let of = |surfel: Surfel| {
        let radius = first_radius(&surfel, density, view, k);
        Sampled { surfel, radius, scatter: [None; SCALES] }
    };
    let below = picked_below(surfels.len());
    let eye = view.eye_parts();
    // A dropped point has no ball; cells lack the neighbours of near points.
    let is_picked = |surfel: &&Surfel| {
        !surfel.is_dropped() && !surfel.is_near() && hash_place(surfel.center.into(), eye, view) < below
    };
    let mut sample: Vec<Sampled> =
        surfels.par_iter().with_min_len(PICK_TASK).filter(is_picked).copied().map(of).collect();
    sample.truncate(MOST_SAMPLED);
    sample.sort_by(|a, b| a.surfel.k_radius.total_cmp(&b.surfel.k_radius));
    for scale in 0..SCALES {
        sample.par_chunks_mut(TASK).for_each_init(Gathered::default, |gathered, sample| {
            measure_scatter(sample, scale, &Task { cells, view }, gathered);
        });
        // A scale is judged with the next one. The loop ends when all parts have a level, mostly after two scales.
        let [dense, sparse] = ends(&sample);
        if [dense, sparse, &sample].iter().all(|part| (0..scale).any(|scale| gives_noise(part, scale))) {
            break;
        }
    }
    let noise = Noise::of(&sample);
    let middle = sample.get(sample.len() / 2).map_or(0.0, |middle| middle.surfel.k_radius);
    let k_radius = if sample.len() < LEAST_SAMPLE { 0.0 } else { middle };
    let sheet_level = SHEET_LEVELS[usize::from(noise.at(middle) > THICK_NOISE * k_radius)] as u32;
    FrameStatistics { noise, k_radius, sheet_level }
}

/// Limit of the [`hash_place`] of a point below which a surfel is sampled, for a number of surfels.
fn picked_below(surfels: usize) -> u32 {
    (u32::MAX / surfels.max(NOISE_SAMPLE_COUNT) as u32).saturating_mul(NOISE_SAMPLE_COUNT as u32)
}

/// Hashes a place in view space, the same for all places in a cell of the world: a cube half a pixel to a pixel wide
/// there, which has one or two points. So the sample does not depend on the order of points, and is nearly
/// the same from frame to frame. The eye is that of [`View::eye_parts`].
#[inline(always)]
fn hash_place(place: Vec3, [high, low]: [Vec3; 2], view: &View) -> u32 {
    // Cells per unit of length: a power of two, so that the first part of the eye is divided exactly.
    let pixel = view.pixel_size(place.z).to_bits();
    let cells = f32::from_bits(0x7f00_0000_u32.wrapping_sub(pixel & 0x7f80_0000));
    let whole = (high * cells).floor();
    let part = (high * cells - whole) + low * cells + view.to_world(place) * cells + CELL_SHIFT;
    let number = |whole: f32, part: f32| {
        let low_bits = whole - (whole * 0.5_f32.powi(32)).round_ties_even() * 2.0_f32.powi(32);
        (low_bits as i32).wrapping_add(part.floor() as i32) as u32
    };
    let [x, y, z] = [0, 1, 2].map(|axis| number(whole[axis], part[axis]));
    mix(mix(mix(x) ^ y) ^ z)
}

/// Hashes a number to another one, one to one [finalizer of MurmurHash3].
fn mix(number: u32) -> u32 {
    let number = (number ^ (number >> 16)).wrapping_mul(0x85eb_ca6b);
    let number = (number ^ (number >> 13)).wrapping_mul(0xc2b2_ae35);
    number ^ (number >> 16)
}

/// Input that all sampled surfels share.
#[derive(Clone, Copy)]
struct Task<'a> {
    cells: &'a Cells,
    view: &'a View,
}

/// The densest and the sparsest third of a sample.
fn ends(sample: &[Sampled]) -> [&[Sampled]; 2] {
    let third = sample.len() / 3;
    [&sample[..third], &sample[sample.len() - third..]]
}

/// A surfel of the sample.
#[derive(Clone, Copy, Debug)]
struct Sampled {
    surfel: Surfel,
    /// Radius of the ball measured last, world units.
    radius: f32,
    /// Scatter at each scale; `None` for balls that hold too little to fit.
    scatter: [Option<Scatter>; SCALES],
}

#[pulp::with_simd(measure_scatter = pulp::Arch::new())]
#[inline(always)]
fn measure_scatter_with<'a, S: Simd>(
    simd: S,
    sample: &'a mut [Sampled],
    scale: usize,
    task: &'a Task<'a>,
    gathered: &'a mut Gathered,
) {
    for Sampled { surfel, radius, scatter, .. } in sample {
        *radius *= STEP;
        if gathered.read(simd, task.cells, surfel.center, *radius, task.view) >= LEAST_CLUSTERS {
            let plane = gathered.plane(simd);
            let distance = gathered.quadric(simd, *radius, plane.axis, plane.curvature()).scatter;
            let distance = if distance < ROUNDING_SCATTER_RADII * *radius { 0.0 } else { distance };
            scatter[scale] = Some(Scatter { distance, thin: distance < THIN_SCATTER_RADII * *radius });
        }
    }
}

/// Residual of a ball's quadric.
#[derive(Clone, Copy, Debug)]
struct Scatter {
    /// Standard deviation, world units.
    distance: f32,
    thin: bool,
}

/// Noise level of a part of a sample with about the same density; 0 if the part is too small. With the `steady` shares
/// of the first scales, the level is reduced for structure and raised for noise that differs from place to place.
fn scatter_level(sample: &[Sampled], steady: Option<[Option<f32>; STEADY_SCALES]>) -> f32 {
    let mut before: Option<f32> = None;
    let (mut least_growth, mut plateau) = (f32::INFINITY, 0.0);
    for scale in 0..SCALES {
        if gives_noise(sample, scale) {
            let mut thin: Vec<f32> =
                found(sample, scale).filter(|found| found.thin).map(|found| found.distance).collect();
            let Some(steady) = steady else { return quantile(&mut thin, NOISE_QUANTILE) };
            // Where there is structure as well, noise is steady in the smaller balls.
            let most = steady.get(..=scale).and_then(|known| known.iter().flatten().copied().reduce(f32::max));
            let is_noise = most.map_or(1.0, |share| between(NOISE_SHARES, share));
            // At the second scale uniform noise has two scatters as well.
            let differs = steady[0].filter(|_| scale == 0).map_or(0.0, |share| between(UNEVEN_NOISE_SHARES, share));
            return is_noise * quantile(&mut thin, NOISE_QUANTILE + differs * (UNEVEN_NOISE_QUANTILE - NOISE_QUANTILE));
        }
        // No scale is thin. Where scatter grows least to the next scale it is noise; elsewhere points fill the ball or
        // are structure.
        let mut all: Vec<f32> = found(sample, scale).map(|found| found.distance).collect();
        if !is_enough(all.len(), sample) {
            before = None;
            continue;
        }
        let now = quantile(&mut all, NOISE_QUANTILE);
        if let Some(before) = before
            && now < least_growth * before
        {
            (least_growth, plateau) = (now / before, before);
        }
        before = Some(now);
    }
    plateau
}

/// Scatters of the balls of one scale.
fn found(sample: &[Sampled], scale: usize) -> impl Iterator<Item = Scatter> {
    sample.iter().filter_map(move |sampled| sampled.scatter[scale])
}

fn is_enough(found: usize, sample: &[Sampled]) -> bool {
    found >= LEAST_SAMPLE.max(sample.len() / MIN_BALL_SHARE_DIVISOR)
}

/// Whether enough balls of a scale are thin for the scale to give the noise level.
fn gives_noise(sample: &[Sampled], scale: usize) -> bool {
    let thin_share = |scale: usize| {
        let count = found(sample, scale).count();
        let thin = found(sample, scale).filter(|found| found.thin).count();
        is_enough(count, sample).then(|| thin as f32 / count as f32)
    };
    let Some(own) = thin_share(scale) else { return false };
    let rises = || scale + 1 < SCALES && thin_share(scale + 1).is_none_or(|next| next > own + MAX_THIN_SHARE_RISE);
    own >= THIN_SHARE && (own >= 1.0 - MAX_THIN_SHARE_RISE || !rises())
}

/// Share of a scale's thin balls that are steady; `None` if too few balls are thin.
fn steady_share(sample: &[Sampled], scale: usize) -> Option<f32> {
    let (mut pairs, mut steady) = (0, 0);
    for sampled in sample {
        if let [Some(own), Some(next)] = [scale, scale + 1].map(|scale| sampled.scatter[scale])
            && own.thin
            && own.distance > 0.0
        {
            pairs += 1;
            steady += usize::from(next.distance < MAX_STEADY_RATIO * own.distance);
        }
    }
    (pairs >= LEAST_PAIRS).then(|| steady as f32 / pairs as f32)
}

/// Place of `value` between `from` and `to`, clamped to 0 to 1.
fn between([from, to]: [f32; 2], value: f32) -> f32 {
    ((value - from) * (1.0 / (to - from))).clamp(0.0, 1.0)
}

fn quantile(values: &mut [f32], share: f32) -> f32 {
    let at = (share * values.len() as f32) as usize;
    *values.select_nth_unstable_by(at, f32::total_cmp).1
}

#[cfg(test)]
mod tests;
