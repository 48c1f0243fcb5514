//! Occlusion: the share of ambient light that the surface nearby blocks.
//!
//! # How it works
//! A pixel reads pairs of pixels on opposite sides, some near and some further away. The lines from the surface here to
//! the surface there enclose an angle. On a flat surface the angle is 180°, however it is slanted. In a crease, at the
//! foot of a step and between two things in front the angle is less, on a ridge more. A pair takes away light by the
//! square of the sine of half the missing angle. Noise bends the surface only a little, which the square makes
//! negligible. No normal is needed, so no wrong normal can do harm.
//!
//! What stands far in front of a surface darkens it less, without black halos. A rest of darkening still separates the
//! two. Emptiness does not occlude. [Bavoil, Sainz: *Image-Space Horizon-Based Ambient Occlusion*, 2008] searches for
//! horizons in a similar way.

use pulp::Simd;

use super::depths::Depths;
use crate::camera::View;
use crate::simd::F32s;

/// Pairs of pixels: angle of the line through them in 16ths of a half turn, distance from the middle, and weight.
/// Distances are in pixels of a picture [`PATTERN_HEIGHT_PX`] pixels high; weights add up to about 1.
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
const PATTERN_HEIGHT_PX: f32 = 900.0;
/// Least factor on the distances, for small pictures.
const MIN_PATTERN_SCALE: f32 = 0.34;
/// Steepest rise beside a pixel that counts in full, as height by distance. A steeper rise is further in front, and
/// counts for less.
pub(super) const MAX_FULL_RISE: f32 = 1.2;
/// Rise as which the furthest things in front still count.
pub(super) const FARTHEST_RISE: f32 = 0.4;
/// Least divisor of a rise, against division by zero.
pub(super) const MIN_RISE: f32 = 1e-3;
/// Darkening at strength 1: of tones, and of the points' own colours, which contain shadows already.
pub(super) const DARKENING: [f32; 2] = [4.5, 3.3];

/// A pair of opposite pixels: the step to the second one, and by its negative to the first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair {
    pub(super) step: [isize; 2],
    /// Inverse length of the step, per pixel.
    pub(super) inverse_px: f32,
    pub(super) part: f32,
}

/// The pairs for a picture of this height in pixels.
pub(super) fn pairs(height: u32) -> [Pair; PAIR_COUNT] {
    let scale = (height as f32 / PATTERN_HEIGHT_PX).max(MIN_PATTERN_SCALE);
    PAIRS.map(|(angle, distance_px, part)| {
        let (sin, cos) = (angle * std::f32::consts::PI / 16.0).sin_cos();
        let [dx, dy] = [cos, sin].map(|side| (side * distance_px * scale).round());
        Pair { step: [dx as isize, dy as isize], inverse_px: 1.0 / dx.hypot(dy), part }
    })
}

/// Largest distance of a pixel of the pairs along x or y, in pixels.
pub(super) fn reach(pairs: &[Pair]) -> usize {
    pairs.iter().flat_map(|pair| pair.step).map(isize::unsigned_abs).max().unwrap_or(0)
}

/// Writes the light left at each pixel of row `y`, 0 to 1. `left` is as long as the rows of `depths`; where no surface
/// is its values are meaningless.
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
        // Like the exponential for small values, for the cost of a division, and the same on every processor.
        let shadow = occlusion * strength;
        (one / (one + shadow + half * shadow * shadow)).store(left, vector);
    }
}

/// Rise of the surface towards the eye from a depth to one beside it, as height by distance, limited as above.
#[inline(always)]
fn rise<S: Simd>(simd: S, depth: F32s<S>, there: F32s<S>, scale: F32s<S>) -> F32s<S> {
    let splat = |value: f32| F32s::splat(simd, value);
    let rise = ((depth - there) * scale).max(splat(-MAX_FULL_RISE));
    rise.min((splat(MAX_FULL_RISE * MAX_FULL_RISE) / rise.max(splat(MIN_RISE))).max(splat(FARTHEST_RISE)))
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

    /// Light left at the pixels of row [`MIDDLE`]. `of` gives depths in pixel sizes behind a base, by the place
    /// relative to the picture's middle.
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
        // The pairs of a picture 900 pixels high.
        let pairs = pairs(PATTERN_HEIGHT_PX as u32);
        let mut depths = Depths::default();
        depths.fill(&layers, [0..SIZE as isize, 0..SIZE as isize], reach(&pairs) + 1);
        let mut left = vec![f32::NAN; SIZE.next_multiple_of(LANES)];
        light_left(&depths, MIDDLE as isize, &pairs, &view, DARKENING[0], &mut left);
        left.truncate(SIZE);
        // Values without a surface are meaningless.
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
                // A true plane: 1 / depth is linear in the picture.
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
        // Steps of a depth camera.
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
