//! Statistics of the values of one attribute.

use std::ops::Range;

use autosplats_cloud::{FieldValues, PointCloud, class_name};
use rayon::prelude::*;
use serde::Serialize;

/// Most bins of a histogram.
const MAX_BINS: usize = 32;

/// Range of whole values up to which each value is counted.
const MAX_COUNTED_RANGE: f64 = 65536.0;

/// Most distinct values that are listed.
const MAX_LISTED_VALUES: usize = 32;

/// Points per partial sum. Partial sums are added in order, so that results do not depend on the threads.
const BLOCK_POINTS: usize = 1 << 16;

/// Source of the values.
#[derive(Clone, Copy, Debug)]
pub(super) enum Values<'a> {
    Axis(&'a PointCloud, usize),
    Channel(&'a [[u8; 3]], usize),
    Field(&'a FieldValues),
}

/// Statistics of an attribute's values; empty if the values were not read.
#[derive(Debug, Default, PartialEq, Serialize)]
pub(super) struct Statistics {
    pub(super) min: Option<f64>,
    pub(super) max: Option<f64>,
    pub(super) mean: Option<f64>,
    pub(super) not_finite: Option<u64>,
    pub(super) distinct: Option<usize>,
    pub(super) values: Vec<Counted>,
    pub(super) histogram: Option<Histogram>,
}

/// A value and the number of points with it.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Counted {
    pub(super) value: f64,
    pub(super) count: u64,
    pub(super) name: Option<&'static str>,
}

/// Counts of values between successive edges. The last bin includes its upper edge.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Histogram {
    pub(super) edges: Vec<f64>,
    pub(super) counts: Vec<u64>,
}

/// Sums over the finite values of some points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Summary {
    min: f64,
    max: f64,
    sum: f64,
    count: u64,
    whole: bool,
    /// Number of values, finite or not.
    len: u64,
}

impl Summary {
    pub(super) const NONE: Self =
        Self { min: f64::INFINITY, max: f64::NEG_INFINITY, sum: 0.0, count: 0, whole: true, len: 0 };

    pub(super) fn and(self, other: Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
            sum: self.sum + other.sum,
            count: self.count + other.count,
            whole: self.whole && other.whole,
            len: self.len + other.len,
        }
    }

    /// How values with this summary are counted; `None` if there are none, or if their range exceeds all numbers.
    pub(super) fn bins(&self) -> Option<Bins> {
        let range = self.max - self.min;
        if self.count == 0 || !range.is_finite() {
            return None;
        }
        let each = self.whole && range < MAX_COUNTED_RANGE;
        let count = if each { range as usize + 1 } else { MAX_BINS };
        Some(Bins { min: self.min, range, each, counts: vec![0; count] })
    }
}

/// Numbers of values in equal bins: of each whole value, or of parts of the range.
#[derive(Clone, Debug)]
pub(super) struct Bins {
    min: f64,
    range: f64,
    each: bool,
    counts: Vec<u64>,
}

impl Bins {
    /// Counts more values.
    pub(super) fn add(&mut self, values: Values<'_>) {
        let (min, range) = (self.min, self.range);
        let counts = if self.each {
            values.count(self.counts.len(), |value| (value - min) as usize)
        } else {
            values.count(MAX_BINS, |value| ((value - min) / range * MAX_BINS as f64) as usize)
        };
        self.counts.iter_mut().zip(counts).for_each(|(count, more)| *count += more);
    }
}

impl Values<'_> {
    fn len(self) -> usize {
        match self {
            Self::Axis(cloud, _) => cloud.len(),
            Self::Channel(colors, _) => colors.len(),
            Self::Field(values) => values.len(),
        }
    }

    /// Calls `visit` with each finite value of some points.
    fn each(self, points: Range<usize>, mut visit: impl FnMut(f64)) {
        let mut finite = |value: f64| {
            if value.is_finite() {
                visit(value);
            }
        };
        macro_rules! all {
            ($values:expr) => {
                $values[points].iter().for_each(|&value| finite(value as f64))
            };
        }
        #[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one of the types is f64 itself")]
        match self {
            Self::Axis(cloud, axis) => points.for_each(|i| finite(cloud.world_position(i)[axis])),
            Self::Channel(colors, channel) => colors[points].iter().for_each(|color| finite(color[channel] as f64)),
            Self::Field(FieldValues::U8(values)) => all!(values),
            Self::Field(FieldValues::I8(values)) => all!(values),
            Self::Field(FieldValues::U16(values)) => all!(values),
            Self::Field(FieldValues::I16(values)) => all!(values),
            Self::Field(FieldValues::U32(values)) => all!(values),
            Self::Field(FieldValues::I32(values)) => all!(values),
            Self::Field(FieldValues::U64(values)) => all!(values),
            Self::Field(FieldValues::I64(values)) => all!(values),
            Self::Field(FieldValues::F32(values)) => all!(values),
            Self::Field(FieldValues::F64(values)) => all!(values),
        }
    }

    fn blocks(self) -> impl IndexedParallelIterator<Item = Range<usize>> {
        let len = self.len();
        (0..len.div_ceil(BLOCK_POINTS))
            .into_par_iter()
            .map(move |block| block * BLOCK_POINTS..((block + 1) * BLOCK_POINTS).min(len))
    }

    pub(super) fn summary(self) -> Summary {
        let blocks: Vec<Summary> = self
            .blocks()
            .map(|points| {
                let mut all = Summary { len: points.len() as u64, ..Summary::NONE };
                self.each(points, |value| {
                    all.min = all.min.min(value);
                    all.max = all.max.max(value);
                    all.sum += value;
                    all.count += 1;
                    all.whole &= value.fract() == 0.0;
                });
                all
            })
            .collect();
        blocks.into_iter().fold(Summary::NONE, Summary::and)
    }

    /// Counts the values of each of `bins`.
    fn count(self, bins: usize, bin: impl Fn(f64) -> usize + Sync) -> Vec<u64> {
        let add = |mut counts: Vec<u64>, more: Vec<u64>| {
            counts.iter_mut().zip(more).for_each(|(count, more)| *count += more);
            counts
        };
        let counted = |mut counts: Vec<u64>, points: Range<usize>| {
            self.each(points, |value| counts[bin(value).min(bins - 1)] += 1);
            counts
        };
        self.blocks().fold(|| vec![0; bins], counted).reduce(|| vec![0; bins], add)
    }
}

impl Statistics {
    /// The statistics of values with this summary, and of their counts. `classes` marks the values as point classes.
    pub(super) fn new(summary: &Summary, bins: Option<Bins>, classes: bool) -> Self {
        let Summary { min, max, sum, count, len, .. } = *summary;
        let not_finite = Some(len - count);
        let Some(Bins { range, each, counts, .. }) = bins else {
            return Self { not_finite, ..Self::default() };
        };
        let mut statistics = Self {
            min: Some(min),
            max: Some(max),
            // Rounding must not move the mean out of the range.
            mean: Some((sum / count as f64).clamp(min, max)).filter(|mean| mean.is_finite()),
            not_finite,
            ..Self::default()
        };
        if each {
            let distinct = counts.iter().filter(|count| **count > 0).count();
            statistics.distinct = Some(distinct);
            if classes || distinct <= MAX_LISTED_VALUES {
                let listed = counts.iter().enumerate().filter(|(_, count)| **count > 0);
                let name = |value: f64| classes.then(|| class_name(value)).flatten();
                statistics.values = listed
                    .map(|(offset, &count)| {
                        let value = min + offset as f64;
                        Counted { value, count, name: name(value) }
                    })
                    .collect();
            }
            let width = counts.len().div_ceil(MAX_BINS);
            let counts: Vec<u64> = counts.chunks(width).map(|bin| bin.iter().sum()).collect();
            let edges = (0..=counts.len()).map(|edge| min + (edge * width) as f64).collect();
            statistics.histogram = Some(Histogram { edges, counts });
        } else {
            let edges = (0..=MAX_BINS)
                .map(|edge| if edge == MAX_BINS { max } else { min + range * edge as f64 / MAX_BINS as f64 });
            statistics.histogram = Some(Histogram { edges: edges.collect(), counts });
        }
        statistics
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(values: Values<'_>, classes: bool) -> Statistics {
        let summary = values.summary();
        let mut bins = summary.bins();
        bins.iter_mut().for_each(|bins| bins.add(values));
        Statistics::new(&summary, bins, classes)
    }

    #[test]
    fn whole_numbers_are_counted_each() {
        let classes = FieldValues::U8(vec![2, 2, 6, 2, 65]);
        let found = of(Values::Field(&classes), true);
        assert_eq!([found.min, found.max, found.mean], [Some(2.0), Some(65.0), Some(15.4)], "least, greatest, mean");
        assert_eq!(found.distinct, Some(3), "three classes");
        let listed: Vec<_> = found.values.iter().map(|v| (v.value, v.count, v.name.unwrap_or_default())).collect();
        assert_eq!(listed, [(2.0, 3, "ground"), (6.0, 1, "building"), (65.0, 1, "user-defined")], "with names");
        let histogram = found.histogram.expect("there are values");
        assert_eq!(histogram.edges[..3], [2.0, 4.0, 6.0], "bins of whole numbers hold equally many");
        assert_eq!((histogram.counts.len(), histogram.counts[2]), (32, 1), "two to a bin");
    }

    #[test]
    fn floats_are_binned() {
        let values: Vec<f32> = (0..200_000).map(|i| (i % 64) as f32 / 64.0).chain([f32::NAN, f32::INFINITY]).collect();
        let found = of(Values::Field(&FieldValues::F32(values)), false);
        assert_eq!((found.not_finite, found.max), (Some(2), Some(63.0 / 64.0)), "what is no number is left out");
        let histogram = found.histogram.expect("there are values");
        assert_eq!((histogram.edges.len(), histogram.counts.len()), (33, 32), "edges around bins");
        assert_eq!(histogram.counts.iter().sum::<u64>(), 200_000, "every finite value is in one");
        assert_eq!(histogram.counts[31], 200_000 / 64 * 2, "the greatest value is in the last");
    }

    #[test]
    fn nothing_and_extremes() {
        let of = |values: Vec<f64>| of(Values::Field(&FieldValues::F64(values)), false);
        assert_eq!(of(vec![]), Statistics { not_finite: Some(0), ..Statistics::default() }, "no points");
        assert_eq!(of(vec![f64::NAN]).min, None, "no number");
        assert_eq!(of(vec![f64::MAX, f64::MIN]).histogram, None, "a range beyond all numbers");
        let one = of(vec![0.5; 3]);
        assert_eq!((one.mean, one.histogram.map(|h| h.counts.iter().sum())), (Some(0.5), Some(3_u64)), "all equal");
    }
}
