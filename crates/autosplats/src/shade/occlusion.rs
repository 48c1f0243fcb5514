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
pub(super) const DARKENING: [f32; 2] = [4.5, 3.3];

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

#[cfg(test)]
mod tests {
    use super::super::depths::LANES;
    use super::*;
    use crate::camera::{Camera, Projection};
    use crate::splat::GBuffer;
    use crate::test_clouds::Random;
    use glam::DVec3;

    const SIZE: usize = 60;
    const MIDDLE: usize = SIZE / 2;

    /// The light left at the pixels of row [`MIDDLE`], of depths in pixel sizes beyond a base, by the pixel's place from
    /// the middle of the picture.
    fn left(of: impl FnMut(f32, f32) -> f32) -> Vec<f32> {
        left_under(Projection::OrthographicHeight(SIZE as f64), of)
    }

    fn left_under(projection: Projection, mut of: impl FnMut(f32, f32) -> f32) -> Vec<f32> {
        let camera = Camera { eye: DVec3::ZERO, look_at: DVec3::Z, up: DVec3::NEG_Y, projection };
        let view = camera.view(DVec3::ZERO, [SIZE as u32; 2]).expect("a view");
        let side = SIZE as u32;
        let mut layers = GBuffer::new(side, side);
        for pixel in 0..SIZE * SIZE {
            let [x, y] = [pixel % SIZE, pixel / SIZE];
            let at = layers.index(x, y);
            layers.depth[at] = 1000.0 + of(x as f32 - MIDDLE as f32, y as f32 - MIDDLE as f32);
        }
        // As in a picture 900 pixels high.
        let pairs = pairs(HEIGHT as u32);
        let mut depths = Depths::default();
        depths.fill(&layers, 0, SIZE, reach(&pairs) + 1);
        let mut left = vec![f32::NAN; SIZE.next_multiple_of(LANES)];
        light_left(&depths, MIDDLE as isize, &pairs, &view, DARKENING[0], &mut left);
        left.truncate(SIZE);
        // Where no surface is, anything may stand.
        for (x, left) in left.iter_mut().enumerate() {
            if layers.depth[layers.index(x, MIDDLE)] == f32::INFINITY {
                *left = 1.0;
            }
        }
        left
    }

    fn least(left: &[f32]) -> f32 {
        left.iter().copied().fold(1.0, f32::min)
    }

    #[test]
    fn planes_keep_their_light_however_they_lie() {
        for [a, b] in [[0.0, 0.0], [1.0, 0.0], [0.0, -2.0], [0.7, 0.7], [5.0, 3.0]] {
            let plane = left(|x, y| a * x + b * y);
            assert!(least(&plane) > 0.999, "slopes {a} and {b}: {}", least(&plane));
            let perspective = Projection::PerspectiveFovDeg(40.0);
            let pixel = 1000.0 * 2.0 * 20f32.to_radians().tan() / SIZE as f32;
            let plane = left_under(perspective, |x, y| {
                // The true plane: 1 / depth is linear in the picture.
                let tilt = (a * x + b * y) * pixel / 1000.0;
                if tilt < 0.5 { 1000.0 / (1.0 - tilt) - 1000.0 } else { f32::INFINITY }
            });
            assert!(least(&plane) > 0.999, "slopes {a} and {b}, seen in perspective: {}", least(&plane));
        }
    }

    #[test]
    fn noise_keeps_nearly_all_light() {
        let mut random = Random::new(8);
        let noisy = left(|x, _| 0.5 * x + 0.5 * random.signed());
        assert!(least(&noisy) > 0.9, "noise of half a pixel: {}", least(&noisy));
        // A depth camera's steps.
        let stairs = left(|x, _| (x / 12.0).round() * 1.5);
        assert!(least(&stairs) > 0.9, "steps of 1.5 pixels: {}", least(&stairs));
    }

    #[test]
    fn creases_and_steps_are_darker_and_ridges_are_not() {
        let crease = left(|x, _| -x.abs());
        assert!(crease[MIDDLE] < 0.6, "in a crease of 90°: {}", crease[MIDDLE]);
        assert!(
            crease[MIDDLE] < crease[MIDDLE - 10] && crease[MIDDLE - 10] < crease[MIDDLE - 25],
            "darkest at the bottom"
        );
        let ridge = left(|x, _| x.abs());
        assert!(ridge[MIDDLE] > 0.999, "on a ridge: {}", ridge[MIDDLE]);
        let step = left(|x, _| if x < 0.0 { -15.0 } else { 0.0 });
        assert!(
            step[MIDDLE] < 0.8 && step[MIDDLE - 1] > 0.999,
            "at the foot of a step: {}, on it: {}",
            step[MIDDLE],
            step[MIDDLE - 1]
        );
    }

    #[test]
    fn what_is_far_before_a_surface_leaves_no_black_border() {
        let before = |height: f32| left(|x, _| if x < 0.0 { -height } else { 0.0 })[MIDDLE];
        let (near, far) = (before(20.0), before(900.0));
        assert!(near < far, "20 pixels: {near}, 900 pixels: {far}");
        assert!(far > 0.8 && far < 0.99, "what is far before is told apart, and no more: {far}");
    }

    #[test]
    fn gaps_and_borders_do_not_darken() {
        let mut random = Random::new(4);
        let gaps = left(|_, _| if random.unit() < 0.2 { f32::INFINITY } else { 0.0 });
        assert!(least(&gaps) > 0.999, "a plane with gaps: {}", least(&gaps));
    }
}
