//! How far points scatter about the surface.

use pulp::Simd;
use rayon::prelude::*;

use super::cells::Cells;
use super::cpu::first_radius;
use super::quadric::{Gathered, LEAST_CLUSTERS};
use super::sheets::SHEET_LEVELS;
use super::{SCALES, STEP};
use crate::camera::View;
use crate::fit::Surfel;
use crate::project::DensityGrid;

/// Surfels looked at, about; nearly all if there are no more.
pub(crate) const SAMPLE: usize = 1024;
/// And at most: they are as many as chance has it, give or take thirty.
pub(crate) const MOST_SAMPLED: usize = SAMPLE + SAMPLE / 2;
/// The densest and the sparsest third of a sample tell how noise grows with the k-radius if the median k-radius is larger in the
/// one than in the other by this factor, and the more, the further apart they are: points evenly strewn are 1.2 apart by chance,
/// very noisy ones 1.7.
pub(super) const APART: f32 = 1.7;
/// All of the growth counts from so many times [`APART`] on.
pub(super) const FAR_APART: f32 = 1.3;
/// Growth with less than this power of the k-radius is that of structure,
pub(super) const GROWTH: f32 = 0.8;
/// and with more than that by this, of noise alone.
pub(super) const GROWTH_SURE: f32 = 0.4;
/// Noise grows up to twice the k-radius that one of this many of the sample exceeds: strewn points may be as far apart as
/// they like.
pub(super) const BEYOND: usize = 8;
/// Surfels per task.
const TASK: usize = 32;
/// And where they are only picked.
const PICK_TASK: usize = 4096;
/// Fewer that find anything in a ball say nothing.
pub(super) const LEAST_SAMPLE: usize = 64;
/// So does less than one of this many.
pub(super) const LEAST_SHARE: usize = 5;
/// A surface is thin in a ball if points scatter less than this part of the radius: of points that fill it, it is 0.4.
pub(super) const THIN: f32 = 0.15;
/// Less than this part of the radius is none: rounding leaves as much, and which ball has more of it is chance.
pub(super) const ROUNDING: f32 = 1e-3;
/// A scale tells the noise if this share of the sample finds a thin surface: the others may be of structure too small for it.
pub(super) const THIN_SHARE: f32 = 0.3;
/// But if the next scale's share is larger by more than this, noise fills others, and those thin are so by chance. Where it
/// could not be larger by more, or there is no next scale, that does not count.
pub(super) const RISE: f32 = 0.27;
/// The noise is this quantile of what is found: more scatter is structure too small for the ball.
pub(super) const QUANTILE: f32 = 0.33;
/// But scatter of structure grows from ball to ball, and noise's does not: it is *steady* where the next ball scatters less than so
/// many times as much.
pub(super) const STEADY: f32 = 1.3;
/// Fewer thin balls say nothing of that.
pub(super) const LEAST_PAIRS: usize = 32;
/// Up to the first of these shares of steady balls there is structure and no noise, from the second on there is. Where the first
/// scales tell nothing of noise, larger ones are not asked this.
pub(super) const NOISE_SHARES: [f32; 2] = [0.1, 0.2];
/// Above the first of these, noise begins to differ from place to place, as where two scans do not fit and the way from one to the
/// other is across the surface in one place and along it in the next,
pub(super) const DIFFERS_SHARES: [f32; 2] = [0.55, 0.7];
/// and at the second it is this quantile. Noise alone is as steady; it leans less low by that.
pub(super) const QUANTILE_DIFFERS: f32 = 0.67;
/// Up to the first of these shares of steady balls it may be structure after all, from the second on it is noise for sure.
pub(super) const SURE_SHARES: [f32; 2] = [0.3, 0.45];
/// Scales that this is known of. Balls after these and the next are so wide against cells that noise of one thickness has two
/// scatters, as slabs cut it or not.
pub(super) const STEADY_SCALES: usize = 2;

/// Noise that is more than this part of the k-radius needs balls so large that twice as large cells do for sheets: fits are a
/// quarter as many then, and as good. With less noise they are 5 to 15 % worse.
pub(super) const THICK_NOISE: f32 = 0.4;

/// What a frame's surfels have in common.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Usual {
    pub(crate) noise: Noise,
    /// Median k-radius, world units; 0 if there are too few surfels.
    pub(crate) k_radius: f32,
    /// Which level of cells has sheets.
    pub(crate) sheet_level: usize,
}

/// Standard deviation of points from their surface, which may grow with the k-radius: what a scanner measures far away is
/// sparser and has more noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Noise {
    /// At [`most`](Self::most) and beyond, world units.
    pub(crate) level: f32,
    /// It goes with this power of the k-radius: 0 if it is the same everywhere; up to 2, as of depth cameras.
    pub(crate) power: f32,
    /// K-radius up to which its growth was seen, world units.
    pub(crate) most: f32,
    /// How sure it is that this is noise and no structure: 0 to 1.
    pub(crate) sure: f32,
}

impl Noise {
    /// Of points that have none.
    pub(crate) const NONE: Self = Self { level: 0.0, power: 0.0, most: 0.0, sure: 0.0 };

    /// Of points with a k-radius above 0.
    #[inline(always)]
    pub(crate) fn at(&self, k_radius: f32) -> f32 {
        if self.power == 0.0 { self.level } else { self.level * (k_radius / self.most).min(1.0).powf(self.power) }
    }

    /// From a sample, densest first.
    fn of(sample: &[Sampled]) -> Self {
        let [dense, sparse] = ends(sample);
        let all = scatter_level(sample, None);
        // Of all, as the ends need not be told by the same scale.
        let steady: [_; STEADY_SCALES] = std::array::from_fn(|scale| steady_share(sample, scale));
        // Told by the largest balls that are asked, as more of those are thin.
        let told = (0..SCALES).find(|&scale| tells_noise(sample, scale));
        let share =
            told.and_then(|scale| steady[..=scale.min(STEADY_SCALES - 1)].iter().rev().copied().flatten().next());
        let sure = share.map_or(0.0, |share| between(SURE_SHARES, share));
        let by_steady = if all > 0.0 { scatter_level(sample, Some(steady)) / all } else { 1.0 };
        let third = dense.len();
        if third > 0
            && let [small, large] = [dense, sparse].map(|part| part[third / 2].surfel.k_radius)
            && large > APART * small
        {
            let [least, most] = [dense, sparse].map(|part| scatter_level(part, None));
            if least > 0.0 && most > least {
                let growth = (most / least).ln() / (large / small).ln();
                // Little growth is chance, or other things where points are sparse.
                let much = ((growth - GROWTH) * (1.0 / GROWTH_SURE)).clamp(0.0, 1.0);
                let apart = ((large / (APART * small) - 1.0) * (1.0 / (FAR_APART - 1.0))).min(1.0);
                let grows = much * apart;
                if grows > 0.0 {
                    let power = grows * growth.min(2.0);
                    // Through the middle of the two, coming from what all say together.
                    let both = least.sqrt() * most.sqrt();
                    let middle = if all > 0.0 { all.powf(1.0 - grows) * both.powf(grows) } else { both };
                    let beyond = 2.0 * sample[sample.len() - 1 - sample.len() / BEYOND].surfel.k_radius;
                    let level = by_steady * middle * (beyond / (small.sqrt() * large.sqrt())).powf(power);
                    return Self { level, power, most: beyond, sure };
                }
            }
        }
        Self { level: by_steady * all, power: 0.0, most: 0.0, sure }
    }
}

/// Measures what is usual in a frame on a sample of `surfels`.
pub(crate) fn measure(surfels: &[Surfel], cells: &Cells, density: &DensityGrid, view: &View, k: u32) -> Usual {
    let of = |surfel: Surfel| {
        let radius = first_radius(&surfel, density, view, k);
        Sampled { surfel, radius, scatter: [None; SCALES] }
    };
    let below = picked_below(surfels.len());
    // A discarded point has no ball.
    let is_picked = |surfel: &&Surfel| surfel.radius > 0.0 && scrambled(surfel.source) < below;
    let mut sample: Vec<Sampled> =
        surfels.par_iter().with_min_len(PICK_TASK).filter(is_picked).copied().map(of).collect();
    sample.truncate(MOST_SAMPLED);
    sample.sort_by(|a, b| a.surfel.k_radius.total_cmp(&b.surfel.k_radius));
    for scale in 0..SCALES {
        sample.par_chunks_mut(TASK).for_each_init(Gathered::default, |gathered, sample| {
            measure_scatter(sample, scale, &Task { cells, view }, gathered);
        });
        // What balls larger than the next would say is not asked for then; most frames need the first two.
        let [dense, sparse] = ends(&sample);
        if [dense, sparse, &sample].iter().all(|part| (0..scale).any(|scale| tells_noise(part, scale))) {
            break;
        }
    }
    let noise = Noise::of(&sample);
    let middle = sample.get(sample.len() / 2).map_or(0.0, |middle| middle.surfel.k_radius);
    let k_radius = if sample.len() < LEAST_SAMPLE { 0.0 } else { middle };
    let sheet_level = SHEET_LEVELS[usize::from(noise.at(middle) > THICK_NOISE * k_radius)];
    Usual { noise, k_radius, sheet_level }
}

/// Of so many surfels those are in the sample whose points' numbers, [`scrambled`], are below this. So nearly the same surfels, as
/// those of the next frame are, give nearly the same sample. Picked by their places in the list, one surfel more changed all of
/// it, and with it the noise by up to a fifth.
fn picked_below(surfels: usize) -> u32 {
    (u32::MAX / surfels.max(SAMPLE) as u32).saturating_mul(SAMPLE as u32)
}

/// Another number for each number, in no order [MurmurHash3's finish].
fn scrambled(number: u32) -> u32 {
    let number = (number ^ (number >> 16)).wrapping_mul(0x85eb_ca6b);
    let number = (number ^ (number >> 13)).wrapping_mul(0xc2b2_ae35);
    number ^ (number >> 16)
}

/// What all surfels of a sample share.
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
    /// Of the ball before the next.
    radius: f32,
    /// In each ball that holds enough to fit.
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
            let distance = if distance < ROUNDING * *radius { 0.0 } else { distance };
            scatter[scale] = Some(Scatter { distance, thin: distance < THIN * *radius });
        }
    }
}

/// What is left of the quadric of a ball.
#[derive(Clone, Copy, Debug)]
struct Scatter {
    /// Standard deviation, world units.
    distance: f32,
    thin: bool,
}

/// The noise of a part of a sample whose points are about as dense; 0 if the part is too small to tell. By the steady shares of
/// each of the first scales, where they are asked.
fn scatter_level(sample: &[Sampled], steady: Option<[Option<f32>; STEADY_SCALES]>) -> f32 {
    let mut before: Option<f32> = None;
    let (mut least_growth, mut plateau) = (f32::INFINITY, 0.0);
    for scale in 0..SCALES {
        if tells_noise(sample, scale) {
            let mut thin: Vec<f32> =
                found(sample, scale).filter(|found| found.thin).map(|found| found.distance).collect();
            let Some(steady) = steady else { return quantile(&mut thin, QUANTILE) };
            // Where there is structure as well, noise is steady in the smaller balls.
            let most = steady.get(..=scale).and_then(|known| known.iter().flatten().copied().reduce(f32::max));
            let is_noise = most.map_or(1.0, |share| between(NOISE_SHARES, share));
            // At the second scale, noise as thick everywhere has two scatters as well.
            let differs = steady[0].filter(|_| scale == 0).map_or(0.0, |share| between(DIFFERS_SHARES, share));
            return is_noise * quantile(&mut thin, QUANTILE + differs * (QUANTILE_DIFFERS - QUANTILE));
        }
        // Thicker than every ball: where the scatter grows least with the ball it is noise, elsewhere that of points that
        // fill the ball or of structure.
        let mut all: Vec<f32> = found(sample, scale).map(|found| found.distance).collect();
        if !is_enough(all.len(), sample) {
            before = None;
            continue;
        }
        let now = quantile(&mut all, QUANTILE);
        if let Some(before) = before
            && now < least_growth * before
        {
            (least_growth, plateau) = (now / before, before);
        }
        before = Some(now);
    }
    plateau
}

/// What the balls of a scale found.
fn found(sample: &[Sampled], scale: usize) -> impl Iterator<Item = Scatter> {
    sample.iter().filter_map(move |sampled| sampled.scatter[scale])
}

fn is_enough(found: usize, sample: &[Sampled]) -> bool {
    found >= LEAST_SAMPLE.max(sample.len() / LEAST_SHARE)
}

/// Whether so many balls of a scale found a thin surface that they tell the noise.
fn tells_noise(sample: &[Sampled], scale: usize) -> bool {
    let thin_share = |scale: usize| {
        let count = found(sample, scale).count();
        let thin = found(sample, scale).filter(|found| found.thin).count();
        is_enough(count, sample).then(|| thin as f32 / count as f32)
    };
    let Some(own) = thin_share(scale) else { return false };
    let rises = || scale + 1 < SCALES && thin_share(scale + 1).is_none_or(|next| next > own + RISE);
    own >= THIN_SHARE && (own >= 1.0 - RISE || !rises())
}

/// Share of a scale's thin balls that are steady, if there are enough.
fn steady_share(sample: &[Sampled], scale: usize) -> Option<f32> {
    let (mut pairs, mut steady) = (0, 0);
    for sampled in sample {
        if let [Some(own), Some(next)] = [scale, scale + 1].map(|scale| sampled.scatter[scale])
            && own.thin
            && own.distance > 0.0
        {
            pairs += 1;
            steady += usize::from(next.distance < STEADY * own.distance);
        }
    }
    (pairs >= LEAST_PAIRS).then(|| steady as f32 / pairs as f32)
}

/// How far a value is from the first to the second, 0 to 1.
fn between([from, to]: [f32; 2], value: f32) -> f32 {
    ((value - from) * (1.0 / (to - from))).clamp(0.0, 1.0)
}

fn quantile(values: &mut [f32], share: f32) -> f32 {
    let at = (share * values.len() as f32) as usize;
    *values.select_nth_unstable_by(at, f32::total_cmp).1
}
