//! Selection: the k-th smallest of many numbers for sixteen points at once, by counting.

use pulp::Simd;

use crate::search::{LANES, Lanes};
use crate::simd::F32s;

/// Candidates counted at a time, each into its own sum: additions to one sum would wait for each other.
pub(crate) const CANDIDATE_GROUP: usize = 4;
/// Most candidates beyond the k-th below an accepted threshold. The k-th is then found in a list of the largest
/// distances below the threshold.
const MAX_SURPLUS_CANDIDATES: usize = 3;
/// Most moves of a threshold; then the interval's upper end is taken. Every other move halves the interval of floats,
/// so that this number always suffices.
const MAX_THRESHOLD_MOVES: usize = 80;

/// Number of SIMD vectors in sixteen lanes.
pub(crate) const fn vectors<S: Simd>() -> usize {
    LANES / S::F32_LANES
}

/// Moves the threshold of each lane in `group` to its k-th smallest squared distance, the point itself not counted. On
/// entry `threshold` holds first guesses. There must be more than `k` candidates.
#[inline(always)]
pub(crate) fn kth_smallest<S: Simd>(simd: S, squared: &[Lanes], k: u32, group: &[bool; LANES], threshold: &mut Lanes) {
    // The point itself is among the candidates, at distance 0.
    let target = (k + 1) as f32;
    let mut low = [0f32; LANES];
    let mut high = [f32::INFINITY; LANES];
    let mut low_count = [1f32; LANES];
    let mut high_count = [f32::INFINITY; LANES];
    let mut at = *threshold;
    let mut open = *group;
    let mut surplus = [0; LANES];
    for step in 0..MAX_THRESHOLD_MOVES {
        let count = count_below(simd, squared, &at);
        let mut any_open = false;
        for lane in 0..LANES {
            if !open[lane] {
                continue;
            }
            let [t, n] = [at.0[lane], count.0[lane]];
            if (n >= target) & (n <= target + MAX_SURPLUS_CANDIDATES as f32) {
                open[lane] = false;
                surplus[lane] = (n - target) as usize;
                continue;
            }
            if n < target {
                (low[lane], low_count[lane]) = (t, n);
            } else {
                (high[lane], high_count[lane]) = (t, n);
            }
            let [below, above] = [low[lane], high[lane]];
            let [below_bits, above_bits] = [below.to_bits(), above.to_bits()];
            if above_bits - below_bits <= 1 {
                // Several candidates at the same distance all belong.
                at.0[lane] = above;
                open[lane] = false;
                continue;
            }
            any_open = true;
            // On a surface the count grows with the area, hence the squared distance. Odd steps bisect, for other
            // shapes.
            let next = if above == f32::INFINITY {
                t * (target / n * 1.1).clamp(1.2, 4.0)
            } else if step < 4 || step % 2 == 0 {
                let share = (target - 0.5 - low_count[lane]) / (high_count[lane] - low_count[lane]);
                below + (above - below) * share
            } else {
                f32::from_bits(below_bits + (above_bits - below_bits) / 2)
            };
            let inner = f32::from_bits(below_bits + 1)..=f32::from_bits(above_bits - 1);
            at.0[lane] = next.clamp(*inner.start(), *inner.end());
        }
        if !any_open {
            break;
        }
    }
    let largest: [Lanes; MAX_SURPLUS_CANDIDATES + 1] = largest_below(simd, squared, &at);
    for lane in (0..LANES).filter(|&lane| group[lane]) {
        threshold.0[lane] = largest[surplus[lane]].0[lane];
    }
}

/// Number of candidates at or below each lane's threshold.
#[inline(always)]
fn count_below<S: Simd>(simd: S, squared: &[Lanes], threshold: &Lanes) -> Lanes {
    let mut count = Lanes::default();
    let one = F32s::splat(simd, 1.0);
    for vector in 0..vectors::<S>() {
        let threshold = F32s::load(simd, &threshold.0, vector);
        let mut sums = [F32s::splat(simd, 0.0); CANDIDATE_GROUP];
        for group in squared.chunks_exact(CANDIDATE_GROUP) {
            for (sum, candidate) in sums.iter_mut().zip(group) {
                *sum += F32s::load(simd, &candidate.0, vector).at_most(threshold).keep(one);
            }
        }
        let [a, b, c, d] = sums;
        ((a + b) + (c + d)).store(&mut count.0, vector);
    }
    count
}

/// The N largest squared distances at or below each lane's threshold, descending.
#[inline(always)]
pub(crate) fn largest_below<S: Simd, const N: usize>(simd: S, squared: &[Lanes], threshold: &Lanes) -> [Lanes; N] {
    let mut largest = [Lanes::default(); N];
    for vector in 0..vectors::<S>() {
        let threshold = F32s::load(simd, &threshold.0, vector);
        let mut list = [F32s::splat(simd, 0.0); N];
        for candidate in squared {
            let d = F32s::load(simd, &candidate.0, vector);
            let mut sinking = d.at_most(threshold).keep(d);
            for entry in &mut list {
                let above = entry.max(sinking);
                sinking = entry.min(sinking);
                *entry = above;
            }
        }
        for (largest, entry) in largest.iter_mut().zip(list) {
            entry.store(&mut largest.0, vector);
        }
    }
    largest
}
