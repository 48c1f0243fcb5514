//! Which requests fetch many ranges.

use std::ops::Range;

/// Bytes between two ranges that cost less than a request of their own.
const GAP: u64 = 64 << 10;

/// Most bytes of a request.
const MOST: u64 = 4 << 20;

/// A part of a file to request, and which of the wanted ranges it serves.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Span {
    pub(crate) part: Range<u64>,
    pub(crate) serves: Vec<usize>,
}

/// The requests for those of `ranges` that `wanted` names, in the order of the file. Empty ranges need none.
pub(crate) fn spans(ranges: &[Range<u64>], mut wanted: Vec<usize>) -> Vec<Span> {
    wanted.sort_by_key(|&at| (ranges[at].start, ranges[at].end));
    let mut spans: Vec<Span> = Vec::new();
    for at in wanted {
        let range = &ranges[at];
        if let Some(Span { part, serves }) = spans.last_mut() {
            let end = part.end.max(range.end);
            if range.start >= part.start && range.start <= part.end.saturating_add(GAP) && end - part.start <= MOST {
                part.end = end;
                serves.push(at);
                continue;
            }
        }
        let mut start = range.start;
        while start < range.end {
            let end = range.end.min(start.saturating_add(MOST));
            spans.push(Span { part: start..end, serves: vec![at] });
            start = end;
        }
    }
    spans
}

impl Span {
    /// Copies the bytes of this span into those ranges that it serves.
    pub(crate) fn deliver(&self, bytes: &[u8], ranges: &[Range<u64>], into: &mut [Vec<u8>]) {
        for &at in &self.serves {
            let range = &ranges[at];
            let (start, end) = (range.start.max(self.part.start), range.end.min(self.part.end));
            if start < end {
                let from = (start - self.part.start) as usize..(end - self.part.start) as usize;
                let to = (start - range.start) as usize..(end - range.start) as usize;
                into[at][to].copy_from_slice(&bytes[from]);
            }
        }
    }
}

#[cfg(test)]
#[allow(clippy::single_range_in_vec_init, reason = "requests are ranges, not what is in them")]
mod tests {
    use super::*;
    use autosplats_cloud::Random;

    #[test]
    fn near_ranges_are_fetched_together() {
        let (k, m) = (1 << 10, 1 << 20);
        let parts = |ranges: &[Range<u64>]| -> Vec<Range<u64>> {
            spans(ranges, (0..ranges.len()).collect()).into_iter().map(|span| span.part).collect()
        };
        assert_eq!(parts(&[100 * k..101 * k, 0..10, 20 * k..30 * k]), [0..30 * k, 100 * k..101 * k]);
        assert_eq!(parts(&[0..10, 64 * k + 10..64 * k + 20]), [0..64 * k + 20], "a gap of 64 KB");
        assert_eq!(parts(&[0..10, 64 * k + 11..64 * k + 20]).len(), 2, "and one byte more");
        assert_eq!(parts(&[0..9 * m]), [0..4 * m, 4 * m..8 * m, 8 * m..9 * m], "large ranges are cut");
        assert_eq!(parts(&[0..3 * m, 3 * m..5 * m]), [0..3 * m, 3 * m..5 * m], "at most 4 MB");
        assert_eq!(parts(&[5..5, 7..7]), [0..0; 0], "empty ranges");
        assert_eq!(parts(&[0..10, 0..10, 5..8]), [0..10], "the same bytes");
    }

    #[test]
    fn every_range_gets_its_bytes() {
        let mut random = Random::new(7, 0);
        let file: Vec<u8> = (0..20 << 20).map(|at: u32| (at >> 8) as u8 ^ at as u8).collect();
        for _ in 0..20 {
            let ranges: Vec<Range<u64>> = (0..30)
                .map(|_| {
                    let most = [10, 100 << 10, 6 << 20][random.below(3)];
                    let start = random.below(file.len()) as u64;
                    start..(start + random.below(most) as u64).min(file.len() as u64)
                })
                .collect();
            let mut into: Vec<Vec<u8>> =
                ranges.iter().map(|range| vec![0; (range.end - range.start) as usize]).collect();
            for span in spans(&ranges, (0..ranges.len()).collect()) {
                assert!(span.part.end - span.part.start <= MOST, "{:?}", span.part);
                let bytes = &file[span.part.start as usize..span.part.end as usize];
                span.deliver(bytes, &ranges, &mut into);
            }
            for (range, bytes) in ranges.iter().zip(&into) {
                assert!(file[range.start as usize..range.end as usize] == bytes[..], "{range:?}");
            }
        }
    }
}
