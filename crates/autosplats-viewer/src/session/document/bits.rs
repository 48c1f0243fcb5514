//! Sets of points, one bit per point. Clones share memory until changed.

use std::sync::Arc;

use rayon::prelude::*;

/// Smallest number of words per parallel task.
const MIN_WORDS_PER_TASK: usize = 1 << 10;

/// A set of points of one cloud, by index. Clones share their memory; the empty set has none.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bits(Option<Arc<[u64]>>);

impl Bits {
    /// The points below `len` for which `has` returns true.
    pub(crate) fn from_fn(len: usize, has: impl Fn(usize) -> bool + Sync) -> Self {
        Self::from_words(len, |word| {
            let points = word * 64..len.min(word * 64 + 64);
            points.rev().fold(0, |bits, point| bits << 1 | u64::from(has(point)))
        })
    }

    /// A set of points below `len` by its words. A word holds 64 points, the first in the lowest bit.
    pub(super) fn from_words(len: usize, word: impl Fn(usize) -> u64 + Sync) -> Self {
        let words: Vec<u64> =
            (0..len.div_ceil(64)).into_par_iter().with_min_len(MIN_WORDS_PER_TASK).map(&word).collect();
        if words.iter().all(|&word| word == 0) { Self(None) } else { Self(Some(words.into())) }
    }

    /// The words, 64 points each. Points beyond the last word are not in the set.
    pub(super) fn words(&self) -> &[u64] {
        self.0.as_deref().unwrap_or_default()
    }

    /// Word `index`, 0 beyond the last word.
    pub(super) fn word(&self, index: usize) -> u64 {
        self.words().get(index).copied().unwrap_or(0)
    }

    #[inline(always)]
    pub(crate) fn get(&self, point: usize) -> bool {
        self.words().get(point / 64).is_some_and(|word| word >> (point % 64) & 1 == 1)
    }

    pub(crate) fn count(&self) -> usize {
        self.words().par_iter().with_min_len(MIN_WORDS_PER_TASK).map(|word| word.count_ones() as usize).sum()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_none()
    }

    /// Points in either set.
    #[must_use]
    pub(crate) fn or(&self, other: &Self) -> Self {
        if other.is_empty() {
            return self.clone();
        }
        if self.is_empty() {
            return other.clone();
        }
        self.combine(other, |a, b| a | b)
    }

    /// Points of this set that are not in `other`.
    #[must_use]
    pub(crate) fn without(&self, other: &Self) -> Self {
        if self.is_empty() || other.is_empty() { self.clone() } else { self.combine(other, |a, b| a & !b) }
    }

    fn combine(&self, other: &Self, rule: impl Fn(u64, u64) -> u64 + Sync) -> Self {
        let words = self.words().len().max(other.words().len());
        Self::from_words(words * 64, |index| rule(self.word(index), other.word(index)))
    }

    /// Address and size in bytes of the set's memory, if it has any.
    pub(super) fn memory(&self) -> Option<(usize, usize)> {
        self.0.as_ref().map(|words| (words.as_ptr().addr(), size_of_val(&**words)))
    }
}

/// Sets are equal if they have the same points; trailing empty words do not count. The comparison is fast if they share
/// their memory.
impl PartialEq for Bits {
    fn eq(&self, other: &Self) -> bool {
        let shared = match (&self.0, &other.0) {
            (Some(own), Some(others)) => Arc::ptr_eq(own, others),
            (None, None) => true,
            _ => return false,
        };
        let longest = self.words().len().max(other.words().len());
        shared || (0..longest).all(|index| self.word(index) == other.word(index))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(bits: &Bits) -> Vec<usize> {
        (0..bits.words().len() * 64).filter(|&point| bits.get(point)).collect()
    }

    fn set(len: usize, step: usize) -> Bits {
        Bits::from_fn(len, |point| point.is_multiple_of(step))
    }

    #[test]
    fn sets_hold_what_was_put_in() {
        for len in [0, 1, 63, 64, 65, 1000, 100_000] {
            for step in [1, 2, 7, 64, 1000] {
                let bits = set(len, step);
                let expected: Vec<usize> = (0..len).step_by(step).collect();
                assert_eq!(points(&bits), expected, "every {step}th of {len}");
                assert_eq!(bits.count(), expected.len(), "counted");
                assert_eq!(bits.is_empty(), expected.is_empty(), "known to be empty or not");
                assert!((0..len + 200).all(|point| bits.get(point) == expected.binary_search(&point).is_ok()), "asked");
            }
        }
    }

    #[test]
    fn sets_are_joined_and_cut() {
        for [len, other] in [[1000, 1000], [1000, 100], [100, 1000], [1000, 0], [0, 1000]] {
            let (a, b) = (set(len, 2), set(other, 3));
            let either: Vec<usize> = (0..1000).filter(|&point| a.get(point) || b.get(point)).collect();
            assert_eq!(points(&a.or(&b)), either, "either");
            let first: Vec<usize> = (0..1000).filter(|&point| a.get(point) && !b.get(point)).collect();
            assert_eq!(points(&a.without(&b)), first, "the first alone");
            assert!(a.without(&a).memory().is_none(), "nothing left takes no memory");
        }
    }

    #[test]
    fn equal_sets_are_equal() {
        assert_eq!(set(1000, 5), set(1000, 5), "by their points");
        assert_eq!(set(1, 1), set(1000, 1000), "whatever their length");
        assert_ne!(set(1000, 5), set(1000, 6), "and by nothing else");
        assert_ne!(set(1000, 5), Bits::default(), "none are not some");
    }
}
