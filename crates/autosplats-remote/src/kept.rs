//! What was fetched, kept in memory for the next time.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use quick_cache::sync::{Cache, DefaultLifecycle};
use quick_cache::{DefaultHashBuilder, OptionsBuilder, Weighter};

/// Number of entries that room is made for first.
const USUAL_ENTRIES: usize = 1024;

/// Bytes of an entry besides its own.
const OVERHEAD: u64 = 128;

/// A bounded cache of the bytes of files.
pub(crate) struct Kept {
    bytes: Cache<(u64, Part), Arc<[u8]>, Weight>,
    owners: AtomicU64,
}

/// What an entry is of its owner.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Part {
    /// From this byte up to that one.
    Range(u64, u64),
    /// The file of this name.
    Named(String),
}

#[derive(Clone)]
struct Weight;

impl Weighter<(u64, Part), Arc<[u8]>> for Weight {
    fn weight(&self, _: &(u64, Part), bytes: &Arc<[u8]>) -> u64 {
        bytes.len() as u64 + OVERHEAD
    }
}

impl Kept {
    /// A cache of at most `most` bytes.
    pub(crate) fn new(most: u64) -> Self {
        // One shard, so that large entries fit.
        let options = OptionsBuilder::new()
            .shards(1)
            .estimated_items_capacity(USUAL_ENTRIES)
            .weight_capacity(most)
            .build()
            .expect("all that it asks for is given");
        let bytes = Cache::with_options(options, Weight, DefaultHashBuilder::default(), DefaultLifecycle::default());
        Self { bytes, owners: AtomicU64::new(0) }
    }

    /// A number for a file or folder, under which its bytes are kept.
    pub(crate) fn owner(&self) -> u64 {
        self.owners.fetch_add(1, Ordering::Relaxed)
    }

    pub(crate) fn get(&self, owner: u64, part: Part) -> Option<Vec<u8>> {
        self.bytes.get(&(owner, part)).map(|bytes| bytes.to_vec())
    }

    /// Keeps a copy of bytes, unless they would push out most of the others.
    pub(crate) fn insert(&self, owner: u64, part: Part, bytes: &[u8]) {
        if bytes.len() as u64 <= self.bytes.capacity() / 4 {
            self.bytes.insert((owner, part), bytes.into());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cache_is_bounded() {
        let kept = Kept::new(100_000);
        let (owner, other) = (kept.owner(), kept.owner());
        let part = |at: u64| Part::Range(at, at + 10_000);
        for at in 0..1000 {
            kept.insert(owner, part(at), &[at as u8; 10_000]);
            assert!(kept.bytes.weight() <= 100_000, "{} bytes", kept.bytes.weight());
        }
        let bytes = |at: &u64| kept.get(owner, part(*at)).is_some_and(|bytes| bytes == [*at as u8; 10_000]);
        let there: Vec<u64> = (0..1000).filter(bytes).collect();
        assert!((5..=9).contains(&there.len()), "{there:?}");
        assert!(there.iter().all(|at| kept.get(other, part(*at)).is_none()), "those of another file");
        for (len, fits) in [(25_001, false), (24_000, true)] {
            kept.insert(owner, Part::Named("a".into()), &vec![0; len]);
            assert_eq!(kept.get(owner, Part::Named("a".into())).is_some(), fits, "{len} bytes");
        }
    }
}
