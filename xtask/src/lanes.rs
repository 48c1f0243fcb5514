//! Several things at a time.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

/// Runs `run` on all items, `lanes` at a time, begun in order. Returns the results in the order of the items.
pub(crate) fn in_lanes<'a, T: Sync, R: Send>(lanes: usize, items: &'a [T], run: impl Fn(&'a T) -> R + Sync) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let results = Mutex::new(Vec::new());
    thread::scope(|scope| {
        for _ in 0..lanes {
            scope.spawn(|| {
                loop {
                    let at = next.fetch_add(1, Ordering::Relaxed);
                    let Some(item) = items.get(at) else { return };
                    let result = run(item);
                    results.lock().expect("no lane panics").push((at, result));
                }
            });
        }
    });
    let mut results = results.into_inner().expect("no lane panics");
    results.sort_by_key(|(at, _)| *at);
    results.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_in_order() {
        let items: Vec<usize> = (0..100).collect();
        assert_eq!(in_lanes(3, &items, |item| item * 2), (0..200).step_by(2).collect::<Vec<_>>(), "whatever the lane");
        assert_eq!(in_lanes(3, &[], |item: &usize| *item), [0; 0], "of nothing");
    }
}
