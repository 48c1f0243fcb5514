//! The integers that coordinates become: steps of a scale from an offset.

use glam::DVec3;
use rayon::prelude::*;

use super::super::Job;
use crate::{Error, Unit};

/// Steps that 32 bits hold to either side, a little less.
const REACH: f64 = 2_147_483_600.0;

/// Steps without a finer wish: a millionth of the cloud, but a millimetre or, in degrees, as much at most.
const PART: f64 = 1e-6;
const STEP: f64 = 1e-3;
const STEP_DEGREES: f64 = 1e-8;
const FINEST: f64 = 1e-12;

/// A part of a step by which coordinates may miss their integer, as those do that went through `f32`.
const SLACK: f64 = 0.25;

/// Points that are asked where the integers lie, if they do not lie at round places.
const SAMPLES: usize = 5;

/// Coordinates are `offset + integer * scale`.
pub(super) struct Grid {
    pub(super) scale: DVec3,
    pub(super) offset: DVec3,
}

impl Grid {
    /// Finds the grid for `count` points, and notes what it loses.
    pub(super) fn of(job: &Job<'_>, count: usize, world: impl Fn(usize) -> DVec3 + Sync) -> Result<Self, Error> {
        let cloud = job.cloud;
        let known = cloud.resolution().filter(|step| step.is_finite() && step.cmpgt(DVec3::ZERO).all());
        if count == 0 {
            return Ok(Self { scale: known.unwrap_or(DVec3::splat(STEP)), offset: DVec3::ZERO });
        }
        let none = || [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let [low, high] =
            (0..count).into_par_iter().map(|i| [world(i); 2]).reduce(none, |[a, b], [c, d]| [a.min(c), b.max(d)]);
        let wished = known.unwrap_or_else(|| {
            let fine = |size: f64, coarsest: f64| {
                let part = if size > 0.0 { 10_f64.powf((size * PART).log10().floor()) } else { coarsest };
                part.clamp(FINEST, coarsest)
            };
            let size = high - low;
            if cloud.crs().unit == Some(Unit::Degree) {
                let step = fine(size.truncate().max_element(), STEP_DEGREES);
                DVec3::new(step, step, fine(size.z, STEP))
            } else {
                DVec3::splat(fine(size.max_element(), STEP))
            }
        });
        let scale = DVec3::from_array([0, 1, 2].map(|axis| fitting(wished[axis], high[axis] - low[axis])));
        if scale != wished {
            check_spread(job, count, &world, scale)?;
        }

        // How far points are from their integers along each axis: at most, and altogether in thousandths.
        let off = |offset: DVec3| {
            let miss = |i: usize| {
                let steps = (world(i) - offset) / scale;
                let miss = (steps - steps.round()).abs();
                (miss, miss.to_array().map(|miss| (miss * 1000.0) as u64))
            };
            let join = |(most, sums): (DVec3, [u64; 3]), (other, others): (DVec3, [u64; 3])| {
                (most.max(other), [0, 1, 2].map(|axis| sums[axis] + others[axis]))
            };
            (0..count).into_par_iter().map(miss).reduce(|| (DVec3::ZERO, [0; 3]), join)
        };
        let mut offset = DVec3::from_array([0, 1, 2].map(|axis| round_offset(low[axis], high[axis], scale[axis])));
        let (mut miss, mut sums) = off(offset);
        for sample in (0..SAMPLES).map(|sample| (count - 1) * sample / (SAMPLES - 1)) {
            if known.is_none() || miss.max_element() <= SLACK {
                break;
            }
            // The file's offset was no multiple of its scale: any of its points will do that was not moved since.
            let place = world(sample);
            let steps = ((DVec3::midpoint(low, high) - place) / scale).round();
            let near = DVec3::from_array([0, 1, 2].map(|axis| {
                let reached = (low[axis] - place[axis]).abs().max((high[axis] - place[axis]).abs());
                if reached <= REACH * scale[axis] { place[axis] } else { place[axis] + steps[axis] * scale[axis] }
            }));
            let (most, others) = off(near);
            for axis in 0..3 {
                // By all points, so that those which were moved do not take the others off their places.
                if others[axis] < sums[axis] {
                    (offset[axis], miss[axis], sums[axis]) = (near[axis], most[axis], others[axis]);
                }
            }
        }
        if miss.max_element() > SLACK {
            let DVec3 { x, y, z } = scale;
            let steps = if x == y && y == z { x.to_string() } else { format!("{x}, {y} and {z}") };
            job.note(format!("coordinates are rounded to steps of {steps}"));
        }
        Ok(Self { scale, offset })
    }
}

/// The step wished for, or that times a power of ten that lets 32 bits reach over `size`.
fn fitting(wished: f64, size: f64) -> f64 {
    let mut step = wished;
    while size > 2.0 * REACH * step {
        step *= 10.0;
    }
    step
}

/// Zero if integers reach from there, else a place in the middle: a whole number if that is a number of steps.
fn round_offset(low: f64, high: f64, step: f64) -> f64 {
    if low.abs().max(high.abs()) <= REACH * step {
        return 0.0;
    }
    let middle = f64::midpoint(low, high);
    let whole = middle.round();
    let steps = whole / step;
    let reached = (low - whole).abs().max((high - whole).abs()) <= REACH * step;
    if reached && (steps - steps.round()).abs() < 1e-3 { whole } else { (middle / step).round() * step }
}

/// Refuses a cloud in which a few points are so far away that the steps would be too long for all others.
fn check_spread(job: &Job<'_>, count: usize, world: impl Fn(usize) -> DVec3, scale: DVec3) -> Result<(), Error> {
    let sample: Vec<DVec3> = (0..count).step_by(count.div_ceil(1024).max(1)).map(world).collect();
    let spread = |axis: usize| {
        let mut values: Vec<f64> = sample.iter().map(|point| point[axis]).collect();
        values.sort_by(f64::total_cmp);
        values[values.len() * 9 / 10] - values[values.len() / 10]
    };
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let spread = spread(axis);
        if spread > 0.0 && scale[axis] > spread / 1000.0 {
            let what = format!(
                "some points are so far away that 32 bits would leave steps of {} in {name} for all of them; leave them \
                 out first, or write PLY",
                scale[axis]
            );
            return Err(Error::Unsupported { path: job.path.into(), what });
        }
    }
    Ok(())
}
