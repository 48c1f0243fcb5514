//! Alignment of the timelines of several inputs on one common clock.
//!
//! Recordings made at the same time, for instance of several robots, are aligned by their stamps. Others start at once.

use std::time::Duration;

/// Start of each input after the start of its group: the inputs whose recording times overlap, directly or through
/// others. `None` for an input that overlaps with no other and starts with the clock.
///
/// `spans` are the [clock spans](crate::Source::clock_span), in nanoseconds; `None` for inputs without a shared clock.
///
/// ```
/// use std::time::Duration;
///
/// use autosplats_sources::beginnings;
///
/// let seconds = |first: i64, last: i64| Some([first, last].map(|second| second * 1_000_000_000));
/// let spans = [seconds(100, 110), seconds(105, 120), seconds(900, 950)];
/// let [first, second] = [0, 5].map(Duration::from_secs);
/// assert_eq!(beginnings(&spans), [Some(first), Some(second), None]);
/// ```
pub fn beginnings(spans: &[Option<[i64; 2]>]) -> Vec<Option<Duration>> {
    let mut order: Vec<(usize, [i64; 2])> =
        spans.iter().enumerate().filter_map(|(number, span)| Some((number, (*span)?))).collect();
    order.sort_by_key(|&(number, [first, _])| (first, number));
    let mut beginnings = vec![None; spans.len()];
    // Every member of a group except the first overlaps with an earlier member.
    for group in groups(&order) {
        if let [(_, [begin, _]), _, ..] = *group {
            for &(number, [first, _]) in group {
                beginnings[number] = Some(Duration::from_nanos(first.abs_diff(begin)));
            }
        }
    }
    beginnings
}

/// Splits spans, sorted by first stamp, into groups without any time in common.
fn groups(mut order: &[(usize, [i64; 2])]) -> impl Iterator<Item = &[(usize, [i64; 2])]> {
    std::iter::from_fn(move || {
        let mut end = order.first()?.1[1];
        let len = 1 + order[1..]
            .iter()
            .take_while(|(_, [first, last])| {
                let together = *first <= end;
                end = end.max(*last);
                together
            })
            .count();
        let (group, rest) = order.split_at(len);
        order = rest;
        Some(group)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seconds(beginnings: Vec<Option<Duration>>) -> Vec<Option<f64>> {
        beginnings.into_iter().map(|beginning| beginning.map(|beginning| beginning.as_secs_f64())).collect()
    }

    #[test]
    fn what_was_recorded_at_once_is_shown_at_once() {
        let at = |first: i64, last: i64| Some([first * 1_000_000_000, last * 1_000_000_000]);
        let spans = [at(105, 120), None, at(100, 110), at(500, 510), at(118, 130)];
        // The last span overlaps with the first only, and the first overlaps with the third.
        assert_eq!(seconds(beginnings(&spans)), [Some(5.0), None, Some(0.0), None, Some(18.0)]);
        assert_eq!(
            seconds(beginnings(&[at(0, 9), at(10, 20)])),
            [None, None],
            "one after the other: at their beginnings"
        );
        assert_eq!(
            seconds(beginnings(&[at(0, 10), at(10, 20)])),
            [Some(0.0), Some(10.0)],
            "a moment in common is enough"
        );
        assert_eq!(seconds(beginnings(&[at(0, 30), at(1, 2), at(20, 40)])), [0.0, 1.0, 20.0].map(Some), "one within");
        assert_eq!(beginnings(&[]), []);
    }

    #[test]
    fn stamps_may_be_anything() {
        let all = Some([i64::MIN, i64::MAX]);
        let late = Some([i64::MAX, i64::MAX]);
        assert_eq!(beginnings(&[late, all]), [Some(Duration::from_nanos(u64::MAX)), Some(Duration::ZERO)]);
    }
}
