//! Squared distances and moments of sixteen points over a shared list of candidates.

use pulp::Simd;

use super::select::vectors;
use super::{LANES, Lanes, NeighborhoodBlock};
use crate::simd::F32s;

/// Computes the squared distances from each candidate to each of the sixteen points.
#[inline(always)]
pub(crate) fn squared_distances<S: Simd>(
    simd: S,
    position: &[Lanes; 3],
    candidates: &[[f32; 3]],
    squared: &mut Vec<Lanes>,
) {
    // Every entry is overwritten below.
    squared.resize(candidates.len(), Lanes::default());
    for vector in 0..vectors::<S>() {
        let [x, y, z] = [0, 1, 2].map(|axis: usize| F32s::load(simd, &position[axis].0, vector));
        for (out, &[qx, qy, qz]) in squared.iter_mut().zip(candidates) {
            let dx = F32s::splat(simd, qx) - x;
            let dy = F32s::splat(simd, qy) - y;
            let dz = F32s::splat(simd, qz) - z;
            (dx * dx + dy * dy + dz * dz).store(&mut out.0, vector);
        }
    }
}

/// Sums the candidates up to the squared distance `threshold`, for each lane in `done`.
#[inline(always)]
pub(crate) fn sum_moments<S: Simd>(
    simd: S,
    position: &[Lanes; 3],
    threshold: &Lanes,
    candidates: &[[f32; 3]],
    squared: &[Lanes],
    done: &[bool; LANES],
    out: &mut NeighborhoodBlock,
) {
    let one = F32s::splat(simd, 1.0);
    for vector in 0..vectors::<S>() {
        let [x, y, z] = [0, 1, 2].map(|axis: usize| F32s::load(simd, &position[axis].0, vector));
        let threshold = F32s::load(simd, &threshold.0, vector);
        // The point itself adds to the count only.
        let mut count = F32s::splat(simd, -1.0);
        let mut offset = [F32s::splat(simd, 0.0); 3];
        let mut second = [F32s::splat(simd, 0.0); 6];
        for (squared, &[qx, qy, qz]) in squared.iter().zip(candidates) {
            let within = F32s::load(simd, &squared.0, vector).at_most(threshold);
            let dx = within.keep(F32s::splat(simd, qx) - x);
            let dy = within.keep(F32s::splat(simd, qy) - y);
            let dz = within.keep(F32s::splat(simd, qz) - z);
            count += within.keep(one);
            offset[0] += dx;
            offset[1] += dy;
            offset[2] += dz;
            second[0] += dx * dx;
            second[1] += dx * dy;
            second[2] += dx * dz;
            second[3] += dy * dy;
            second[4] += dy * dz;
            second[5] += dz * dz;
        }
        let sums = [count, threshold.sqrt()].into_iter().chain(offset).chain(second);
        let outs = [&mut out.count, &mut out.k_radius].into_iter().chain(&mut out.offset).chain(&mut out.second);
        for (out, sum) in outs.zip(sums) {
            let mut lanes = Lanes::default();
            sum.store(&mut lanes.0, vector);
            for lane in vector * S::F32_LANES..(vector + 1) * S::F32_LANES {
                out.0[lane] = if done[lane] { lanes.0[lane] } else { out.0[lane] };
            }
        }
    }
}
