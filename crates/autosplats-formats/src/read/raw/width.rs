//! How many numbers a point has, told by the numbers themselves.
//!
//! # How it works
//!
//! Numbers of one column are alike, and alike from point to point if the points are in order. The mean difference of
//! numbers that are `width` apart is therefore least for the true width. Differences are those of ranks, so that
//! neither units nor outliers count. A number and a NaN differ as numbers do on average at most.
//!
//! Every other point may be nearer than the next one, since lasers of a sensor fire in turn. Twice a width is therefore
//! taken only if the columns of every other point have other numbers.

use super::SIZE;

/// Numbers that a point may have.
const WIDTHS: std::ops::RangeInclusive<usize> = 3..=8;

/// A multiple of all widths.
const ALL_WIDTHS: usize = 840;

/// Runs of numbers that are sampled, and their length.
const RUNS: usize = 8;
const RUN_LEN: usize = 9 * ALL_WIDTHS;

/// Difference in rank between a number and a NaN.
const NAN_DIFFERENCE: f64 = 0.5;

/// Share by which a difference has to be less than another, and the same in units of 1/√n for n pairs, about four
/// standard deviations of the mean of random differences.
const CLEAR_SHARE: f64 = 0.03;
const CLEAR_NOISE: f64 = 1.2;

/// Mean difference in rank of two columns, smallest with smallest to largest with largest, from which on they hold
/// other values; and the same in units of 1/√n for n values.
const OTHER_VALUES: f32 = 0.04;
const OTHER_NOISE: f32 = 0.5;

/// Places at which two columns are compared.
const QUANTILES: usize = 256;

/// Rank of a NaN among others.
const NAN_RANK: f32 = 1.5;

/// What the numbers tell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Width {
    /// Points of so many numbers fill the file.
    Known(usize),
    /// The points have so many numbers, but the file ends inside one.
    Unfinished(usize),
    /// Points of any of these widths fill the file.
    Unknown(Vec<usize>),
}

impl Width {
    pub(super) fn of(bytes: &[u8]) -> Self {
        let runs = ranked(bytes);
        let pairs: usize = runs.iter().map(Vec::len).sum();
        let found: Vec<(usize, f64)> = WIDTHS.map(|width| (width, difference(&runs, width))).collect();
        let (best, least) = found.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, 0.0));
        let slack = CLEAR_SHARE * least + CLEAR_NOISE / (pairs.max(1) as f64).sqrt();
        let single =
            |width: usize| if width.is_multiple_of(2) && same_values(&runs, width / 2) { width / 2 } else { width };
        let fills = |width: usize| bytes.len().is_multiple_of(SIZE * width);
        let mut likely: Vec<usize> =
            found.iter().filter(|(_, other)| other - least <= slack).map(|&(width, _)| single(width)).collect();
        if !likely.contains(&single(best)) {
            likely.push(single(best));
        }
        likely.sort_unstable();
        likely.dedup();
        if let &[width] = likely.as_slice() {
            return if fills(width) { Self::Known(width) } else { Self::Unfinished(width) };
        }
        likely.retain(|&width| fills(width));
        match likely.as_slice() {
            &[width] => Self::Known(width),
            _ => Self::Unknown(likely),
        }
    }
}

/// The ranks of sampled numbers among all of them, 0 to 1, in runs whose starts are multiples of every width. NaN stays
/// NaN.
fn ranked(bytes: &[u8]) -> Vec<Vec<f32>> {
    let numbers = bytes.chunks_exact(SIZE);
    let count = numbers.len();
    let step = (count.saturating_sub(RUN_LEN) / (RUNS - 1) / ALL_WIDTHS * ALL_WIDTHS).max(RUN_LEN);
    let value = |raw: &[u8]| f32::from_le_bytes([raw[0], raw[1], raw[2], raw[3]]);
    let mut runs: Vec<Vec<f32>> = (0..count.min(RUNS * step))
        .step_by(step)
        .map(|start| bytes[SIZE * start..].chunks_exact(SIZE).take(RUN_LEN).map(value).collect())
        .collect();
    let mut sorted: Vec<f32> = runs.iter().flatten().copied().filter(|value| !value.is_nan()).collect();
    sorted.sort_unstable_by(f32::total_cmp);
    for value in runs.iter_mut().flatten().filter(|value| !value.is_nan()) {
        let below = sorted.partition_point(|other| other < value);
        let upto = sorted.partition_point(|other| other <= value);
        *value = (below + upto) as f32 / (2 * sorted.len()) as f32;
    }
    runs
}

/// Mean difference in rank of numbers that are `width` apart.
fn difference(runs: &[Vec<f32>], width: usize) -> f64 {
    let pairs = || runs.iter().flat_map(|run| run.iter().zip(run.get(width..).unwrap_or_default()));
    let sum: f64 = pairs()
        .map(|(a, b)| match [a.is_nan(), b.is_nan()] {
            [false, false] => f64::from((a - b).abs()),
            [true, true] => 0.0,
            _ => NAN_DIFFERENCE,
        })
        .sum();
    sum / pairs().count().max(1) as f64
}

/// Whether every other point of `width` numbers has values like the others, in all columns but one: two lasers may
/// stand at different angles.
fn same_values(runs: &[Vec<f32>], width: usize) -> bool {
    let differ = |column: &usize| {
        let sorted = |first: usize| {
            let column = runs.iter().flat_map(|run| run.iter().skip(first).step_by(2 * width));
            let mut values: Vec<f32> = column.map(|rank| if rank.is_nan() { NAN_RANK } else { *rank }).collect();
            values.sort_unstable_by(f32::total_cmp);
            values
        };
        let [even, odd] = [sorted(*column), sorted(column + width)];
        let quantile =
            |values: &[f32], part: usize| values.get(values.len() * part / QUANTILES).copied().unwrap_or(0.0);
        let sum: f32 = (0..QUANTILES).map(|part| (quantile(&even, part) - quantile(&odd, part)).abs()).sum();
        sum > QUANTILES as f32 * (OTHER_VALUES + OTHER_NOISE / (even.len().max(1) as f32).sqrt())
    };
    WIDTHS.contains(&width) && (0..width).filter(differ).count() <= 1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bytes(count: usize, width: usize, value: impl Fn(usize, usize) -> f32) -> Vec<u8> {
        (0..count * width).flat_map(|i| value(i / width, i % width).to_le_bytes()).collect()
    }

    #[test]
    fn lasers_that_fire_in_turn_make_no_wide_points() {
        // Two lasers: every other point is nearer than the next.
        let turn = |point: usize, column: usize| {
            let angle = (point / 2) as f32 * 0.01;
            [
                9.0 * angle.cos(),
                9.0 * angle.sin(),
                if point.is_multiple_of(2) { -1.0 } else { -1.02 },
                0.1 + 0.01 * angle,
            ][column]
        };
        assert_eq!(Width::of(&bytes(3000, 4, turn)), Width::Known(4), "in turn");
    }

    #[test]
    fn nothing_is_told_of_numbers_without_columns() {
        let mut state = 1_u32;
        let mut noise: Vec<u8> = Vec::new();
        for _ in 0..3 * 4 * 5 * 400 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            noise.extend(((state >> 8) as f32 / (1 << 24) as f32).to_le_bytes());
        }
        assert!(matches!(Width::of(&noise), Width::Unknown(widths) if widths.len() > 2), "a cube of random points");
        assert_eq!(Width::of(&noise[..4 * 21 * 11]), Width::Unknown(vec![3, 7]), "what divides the file");
        assert_eq!(Width::of(&noise[..4 * 7 * 101]), Width::Known(7), "the only width that does");
    }

    #[test]
    fn a_file_may_end_inside_a_point() {
        let row = |point: usize, column: usize| (point as f32 * 0.01) + 100.0 * column as f32;
        let whole = bytes(500, 5, row);
        assert_eq!(Width::of(&whole), Width::Known(5), "whole");
        assert_eq!(Width::of(&whole[..whole.len() - 12]), Width::Unfinished(5), "cut");
    }
}
