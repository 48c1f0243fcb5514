//! Occlusion: how much of the light that comes from all around is kept away by the surface nearby.
//!
//! # How it works
//! A pixel looks at pairs of pixels on opposite sides of it, some near and some further off. The lines from the surface
//! here to the surface there enclose an angle: 180° on a flat surface however it is slanted, less in a crease, at the foot
//! of a step and between two things that stand before it, more on a ridge. What the angle falls short by is what the pair
//! takes away, as the square of the sine of half of it: noise bends the surface by little, which the square makes next to
//! nothing. No normal is needed, so none can be wrong.
//!
//! What stands far before a surface darkens it less and less, down to a rest that still tells the two apart: no black
//! halos. Where nothing is, nothing occludes. [Bavoil, Sainz: *Image-Space Horizon-Based Ambient Occlusion*, 2008] looks
//! for horizons in the same manner.

use pulp::Simd;

use super::depths::Depths;
use crate::camera::View;
use crate::simd::F32s;

/// Pairs of pixels: the angle of the line through them in 16ths of a half turn, their distance from the middle in pixels
/// of a picture [`HEIGHT`] pixels high, and their part in the whole.
const PAIRS: [(f32, f32, f32); PAIR_COUNT] = [
    (0.0, 3.0, 0.07),
    (8.0, 3.0, 0.07),
    (2.0, 7.0, 0.10),
    (6.0, 7.0, 0.10),
    (10.0, 7.0, 0.10),
    (14.0, 7.0, 0.10),
    (0.0, 18.0, 0.115),
    (4.0, 18.0, 0.115),
    (8.0, 18.0, 0.115),
    (12.0, 18.0, 0.115),
];
pub(super) const PAIR_COUNT: usize = 10;
const HEIGHT: f32 = 900.0;
/// Least factor on the distances, for small pictures.
const LEAST_SCALE: f32 = 0.34;
/// The steepest that something rises beside a pixel, as height by distance: what rises more is further before it, and
/// counts for less.
pub(super) const STEEPEST: f32 = 1.2;
/// What the furthest counts for, as such a rise.
pub(super) const FURTHEST: f32 = 0.4;
/// What a rise is divided by at least: below it nothing is far.
pub(super) const LEAST_RISE: f32 = 1e-3;
/// Darkening at strength 1: of one tone, and of the points' own colours, which show shadows themselves.
pub(super) const DARKENING: [f32; 2] = [4.5, 3.0];

/// One pair: the step to the second pixel, from which the first lies opposite.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair {
    pub(super) step: [isize; 2],
    /// One by the length of the step.
    pub(super) inverse_px: f32,
    pub(super) part: f32,
}

/// The pairs for a picture so many pixels high.
pub(super) fn pairs(height: u32) -> [Pair; PAIR_COUNT] {
    let scale = (height as f32 / HEIGHT).max(LEAST_SCALE);
    PAIRS.map(|(angle, distance_px, part)| {
        let (sin, cos) = (angle * std::f32::consts::PI / 16.0).sin_cos();
        let [dx, dy] = [cos, sin].map(|side| (side * distance_px * scale).round());
        Pair { step: [dx as isize, dy as isize], inverse_px: 1.0 / dx.hypot(dy), part }
    })
}

/// How far the furthest pixel of a pair is, in x or y.
pub(super) fn reach(pairs: &[Pair]) -> usize {
    pairs.iter().flat_map(|pair| pair.step).map(isize::unsigned_abs).max().unwrap_or(0)
}

/// Finds for row `y` of a picture how much light is left at each pixel, 0 to 1. `left` is as long as the rows of `depths`;
/// where no surface is it gets anything.
#[pulp::with_simd(light_left = pulp::Arch::new())]
#[inline(always)]
pub(super) fn light_left_simd<'a, S: Simd>(
    simd: S,
    depths: &'a Depths,
    y: isize,
    pairs: &'a [Pair],
    view: &'a View,
    strength: f32,
    left: &'a mut [f32],
) {
    let splat = |value: f32| F32s::splat(simd, value);
    let [one, half, zero, nothing] = [1.0, 0.5, 0.0, f32::INFINITY].map(splat);
    let focal = splat(view.focal_px);
    let strength = splat(strength);
    let here = depths.row(0, y);
    for vector in 0..left.len() / S::F32_LANES {
        let depth = F32s::load(simd, here, vector);
        if !depth.less(nothing).any() {
            continue;
        }
        let pixels_per_unit = if view.perspective { focal / depth } else { focal };
        let mut occlusion = zero;
        for pair in pairs {
            let [dx, dy] = pair.step;
            let scale = pixels_per_unit * splat(pair.inverse_px);
            let a = rise(simd, depth, F32s::load(simd, depths.row(dx, y + dy), vector), scale);
            let b = rise(simd, depth, F32s::load(simd, depths.row(-dx, y - dy), vector), scale);
            // Cosine of the angle by which the two rise together.
            let cos = (one - a * b) / ((one + a * a) * (one + b * b)).sqrt();
            occlusion += zero.less(a + b).keep((one - cos) * half * splat(pair.part));
        }
        // Falls like the exponential at first, costs a division, and is the same on every processor.
        let shadow = occlusion * strength;
        (one / (one + shadow + half * shadow * shadow)).store(left, vector);
    }
}

/// How steeply the surface rises towards the eye, from a depth to one beside it.
#[inline(always)]
fn rise<S: Simd>(simd: S, depth: F32s<S>, there: F32s<S>, scale: F32s<S>) -> F32s<S> {
    let splat = |value: f32| F32s::splat(simd, value);
    let rise = ((depth - there) * scale).max(splat(-STEEPEST));
    rise.min((splat(STEEPEST * STEEPEST) / rise.max(splat(LEAST_RISE))).max(splat(FURTHEST)))
}
