//! Quantisation of coordinates: integers count steps from an offset.

use autosplats_cloud::{Error, Unit};
use glam::DVec3;
use rayon::prelude::*;

use super::{super::Job, plan::finite, shape::Survey};

/// Largest number of steps from the offset, slightly less than 32 bits hold.
const MAX_STEPS: f64 = 2_147_483_600.0;

/// Step as a fraction of the cloud's size, if the cloud states no resolution; rounded down to a power of ten.
const STEP_PER_SIZE: f64 = 1e-6;
/// Coarsest step in the cloud's unit, if the cloud states no resolution.
const COARSEST_STEP: f64 = 1e-3;
/// Coarsest step in degrees, about a millimetre.
const COARSEST_STEP_DEGREES: f64 = 1e-8;
/// Finest step, if the cloud states no resolution.
const FINEST_STEP: f64 = 1e-12;

/// Distance of a coordinate from its integer, in steps, above which a loss is noted. `f32` causes smaller ones.
const MAX_UNNOTED_STEPS: f64 = 0.25;

/// Number of points tried as the offset, if no round offset fits.
const OFFSET_CANDIDATES: usize = 5;

/// A coordinate is `offset + integer * scale`.
pub(super) struct Grid {
    pub(super) scale: DVec3,
    pub(super) offset: DVec3,
}

impl Grid {
    /// Finds the grid for all points, and notes its losses.
    pub(super) fn of(job: &Job<'_>, survey: &Survey) -> Result<Self, Error> {
        let (known, count) = (survey.resolution, survey.points);
        if count == 0 {
            return Ok(Self { scale: known.unwrap_or(DVec3::splat(COARSEST_STEP)), offset: DVec3::ZERO });
        }
        let [low, high] = survey.bounds;
        let wished = known.unwrap_or_else(|| {
            let fine = |size: f64, coarsest: f64| {
                let part = if size > 0.0 { 10_f64.powf((size * STEP_PER_SIZE).log10().floor()) } else { coarsest };
                part.clamp(FINEST_STEP, coarsest)
            };
            let size = high - low;
            if survey.crs.unit == Some(Unit::Degree) {
                let step = fine(size.truncate().max_element(), COARSEST_STEP_DEGREES);
                DVec3::new(step, step, fine(size.z, COARSEST_STEP))
            } else {
                DVec3::splat(fine(size.max_element(), COARSEST_STEP))
            }
        });
        let scale = DVec3::from_array([0, 1, 2].map(|axis| fitting(wished[axis], high[axis] - low[axis])));
        if scale != wished {
            check_spread(job, count, scale)?;
        }
        let mut offset = DVec3::from_array([0, 1, 2].map(|axis| round_offset(low[axis], high[axis], scale[axis])));
        if survey.steps == Some(scale) {
            // All coordinates are multiples of the step, and so is the offset.
            return Ok(Self { scale, offset });
        }
        let (mut miss, mut sums) = off(job, scale, offset)?;
        let tried: Vec<usize> =
            (0..OFFSET_CANDIDATES).map(|sample| (count - 1) * sample / (OFFSET_CANDIDATES - 1)).collect();
        let mut places = Vec::new();
        if known.is_some() && miss.max_element() > MAX_UNNOTED_STEPS {
            places = places_of(job, &tried)?;
        }
        for place in places {
            if miss.max_element() <= MAX_UNNOTED_STEPS {
                break;
            }
            // The original offset is no multiple of its scale. Any point that was not moved since can serve as offset.
            let steps = ((DVec3::midpoint(low, high) - place) / scale).round();
            let near = DVec3::from_array([0, 1, 2].map(|axis| {
                let reached = (low[axis] - place[axis]).abs().max((high[axis] - place[axis]).abs());
                if reached <= MAX_STEPS * scale[axis] { place[axis] } else { place[axis] + steps[axis] * scale[axis] }
            }));
            let (most, others) = off(job, scale, near)?;
            for axis in 0..3 {
                // The sum over all points decides, so that moved points do not displace the others.
                if others[axis] < sums[axis] {
                    (offset[axis], miss[axis], sums[axis]) = (near[axis], most[axis], others[axis]);
                }
            }
        }
        if miss.max_element() > MAX_UNNOTED_STEPS {
            let DVec3 { x, y, z } = scale;
            let steps = if x == y && y == z { x.to_string() } else { format!("{x}, {y} and {z}") };
            job.note(format!("coordinates are rounded to steps of {steps}"));
        }
        Ok(Self { scale, offset })
    }
}

/// Distances of the points from their integers along each axis: the greatest, and the sum in thousandths.
fn off(job: &Job<'_>, scale: DVec3, offset: DVec3) -> Result<(DVec3, [u64; 3]), Error> {
    let none = (DVec3::ZERO, [0; 3]);
    let join = |(most, sums): (DVec3, [u64; 3]), (other, others): (DVec3, [u64; 3])| {
        (most.max(other), [0, 1, 2].map(|axis| sums[axis] + others[axis]))
    };
    let mut all = none;
    job.each(&mut |cloud| {
        let miss = |i: usize| {
            let place = cloud.world_position(i);
            if !place.is_finite() {
                return none;
            }
            let steps = (place - offset) / scale;
            let miss = (steps - steps.round()).abs();
            (miss, miss.to_array().map(|miss| (miss * 1000.0) as u64))
        };
        all = join(all, (0..cloud.len()).into_par_iter().map(miss).reduce(|| none, join));
        Ok(())
    })?;
    Ok(all)
}

/// The positions of some of the finite points; `wanted` has their numbers, which do not fall.
fn places_of(job: &Job<'_>, wanted: &[usize]) -> Result<Vec<DVec3>, Error> {
    let mut places = Vec::with_capacity(wanted.len());
    let mut before = 0;
    job.each(&mut |cloud| {
        let kept = finite(cloud);
        let here = kept.as_ref().map_or(cloud.len(), Vec::len);
        while let Some(&number) = wanted.get(places.len()).filter(|&&number| number < before + here) {
            let index = kept.as_ref().map_or(number - before, |kept| kept[number - before]);
            places.push(cloud.world_position(index));
        }
        before += here;
        Ok(())
    })?;
    Ok(places)
}

/// The wished step times the least power of ten with which 32 bits cover `size`.
fn fitting(wished: f64, size: f64) -> f64 {
    let mut step = wished;
    while size > 2.0 * MAX_STEPS * step {
        step *= 10.0;
    }
    step
}

/// Zero if the integers reach from there, otherwise a place in the middle, a whole number if that is a multiple of
/// `step`.
fn round_offset(low: f64, high: f64, step: f64) -> f64 {
    if low.abs().max(high.abs()) <= MAX_STEPS * step {
        return 0.0;
    }
    let middle = f64::midpoint(low, high);
    let whole = middle.round();
    let steps = whole / step;
    let reached = (low - whole).abs().max((high - whole).abs()) <= MAX_STEPS * step;
    if reached && (steps - steps.round()).abs() < 1e-3 { whole } else { (middle / step).round() * step }
}

/// Fails if a few points are so far away that the step would be too coarse for all others.
fn check_spread(job: &Job<'_>, count: usize, scale: DVec3) -> Result<(), Error> {
    let wanted: Vec<usize> = (0..count).step_by(count.div_ceil(1024).max(1)).collect();
    let sample = places_of(job, &wanted)?;
    let spread = |axis: usize| {
        let mut values: Vec<f64> = sample.iter().map(|point| point[axis]).collect();
        values.sort_by(f64::total_cmp);
        values[values.len() * 9 / 10] - values[values.len() / 10]
    };
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let spread = spread(axis);
        if spread > 0.0 && scale[axis] > spread / 1000.0 {
            let what = format!(
                "some points are so far away that 32 bits would round all points to steps of {} in {name}; crop the cloud \
                 first, or write PLY",
                scale[axis]
            );
            return Err(Error::Unsupported { path: job.path.into(), what });
        }
    }
    Ok(())
}
