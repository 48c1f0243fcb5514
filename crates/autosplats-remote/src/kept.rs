//! What was fetched, kept in memory for the next time.

use std::hash::Hash;
use std::sync::Arc;

use quick_cache::sync::{Cache, DefaultLifecycle};
use quick_cache::{DefaultHashBuilder, OptionsBuilder, Weighter};

/// Number of entries that room is made for first.
const USUAL_ENTRIES: usize = 1024;

/// Bytes of an entry besides its own.
const OVERHEAD: u64 = 128;

/// A bounded cache of bytes.
pub(crate) struct Kept<K>(Cache<K, Arc<[u8]>, Bytes>);

#[derive(Clone)]
struct Bytes;

impl<K> Weighter<K, Arc<[u8]>> for Bytes {
    fn weight(&self, _: &K, bytes: &Arc<[u8]>) -> u64 {
        bytes.len() as u64 + OVERHEAD
    }
}

impl<K: Eq + Hash + Clone> Kept<K> {
    /// A cache of at most `most` bytes.
    pub(crate) fn new(most: u64) -> Self {
        // One shard, so that an entry may take all of the room.
        let options = OptionsBuilder::new()
            .shards(1)
            .estimated_items_capacity(USUAL_ENTRIES)
            .weight_capacity(most)
            .build()
            .expect("all that it asks for is given");
        Self(Cache::with_options(options, Bytes, DefaultHashBuilder::default(), DefaultLifecycle::default()))
    }

    pub(crate) fn get(&self, key: &K) -> Option<Vec<u8>> {
        self.0.get(key).map(|bytes| bytes.to_vec())
    }

    pub(crate) fn insert(&self, key: K, bytes: &[u8]) {
        self.0.insert(key, bytes.into());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cache_is_bounded() {
        let kept = Kept::new(100_000);
        for at in 0..1000 {
            kept.insert(at, &[at as u8; 10_000]);
            assert!(kept.0.weight() <= 100_000, "{} bytes", kept.0.weight());
        }
        let there = (0..1000).filter(|at| kept.get(at).is_some_and(|bytes| bytes == [*at as u8; 10_000])).count();
        assert!((5..=9).contains(&there), "{there} entries");
        kept.insert(1, &[0; 200_000]);
        assert!(kept.get(&1).is_none_or(|bytes| bytes.len() == 10_000), "what is larger than all of it is not kept");
        let none = Kept::new(0);
        none.insert(1, &[1]);
        assert_eq!(none.get(&1), None, "no room at all");
    }
}
