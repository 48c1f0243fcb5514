//! The known part of a hierarchy: nodes, and pages that are not loaded.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::{PoisonError, RwLock};

use autosplats_cloud::{Key, Node};

/// What a page of a hierarchy states of a key. Offsets and sizes are 0 where a format has none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Entry {
    Node {
        points: u32,
        offset: u64,
        bytes: u32,
    },
    /// A page of its own tells of the key and of what is below.
    Page {
        offset: u64,
        bytes: u32,
    },
}

/// All entries that are known. Every node but the root has a known parent.
#[derive(Debug)]
pub(super) struct Directory(RwLock<HashMap<Key, Entry>>);

impl Directory {
    /// Knows nothing but the page of the root.
    pub(super) fn new(root: Entry) -> Self {
        Self(RwLock::new(HashMap::from([(Key::ROOT, root)])))
    }

    pub(super) fn entry(&self, key: Key) -> Option<Entry> {
        self.0.read().unwrap_or_else(PoisonError::into_inner).get(&key).copied()
    }

    pub(super) fn node(&self, key: Key) -> Node {
        match self.nearest(key) {
            Some((at, Entry::Node { points, bytes, .. })) if at == key => Node::Known { points, bytes: bytes.into() },
            Some((_, Entry::Page { .. })) => Node::Unknown,
            _ => Node::Absent,
        }
    }

    /// The pages that are to be loaded to know the next of `keys`, each once, with their places.
    pub(super) fn pages(&self, keys: &[Key]) -> Vec<(Key, Range<u64>)> {
        let page = |&key: &Key| match self.nearest(key) {
            Some((page, Entry::Page { offset, bytes })) => Some((page, offset..offset + u64::from(bytes))),
            _ => None,
        };
        let mut pages: Vec<_> = keys.iter().filter_map(page).collect();
        pages.sort_unstable_by_key(|&(key, _)| key);
        pages.dedup();
        pages
    }

    /// The entry of the key, or of the deepest known node above.
    fn nearest(&self, key: Key) -> Option<(Key, Entry)> {
        let entries = self.0.read().unwrap_or_else(PoisonError::into_inner);
        let mut at = Some(key);
        while let Some(key) = at {
            if let Some(entry) = entries.get(&key) {
                return Some((key, *entry));
            }
            at = key.parent();
        }
        None
    }

    /// Replaces the entry of a page by what the page states. A page that another thread has loaded changes nothing.
    ///
    /// Fails with one line if the page does not tell of its own key, or tells of a key twice, of one elsewhere, or of
    /// one without a parent.
    pub(super) fn load(&self, page: Key, mut list: Vec<(Key, Entry)>) -> Result<(), String> {
        list.sort_unstable_by_key(|&(key, _)| key);
        if let Some(twice) = list.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            return Err(format!("it tells of node {} twice", twice[0].0));
        }
        if !matches!(list.first(), Some((first, Entry::Node { .. })) if *first == page) {
            return Err("it does not tell of its own node".into());
        }
        for (key, _) in &list[1..] {
            let parent = key.parent().and_then(|parent| list.binary_search_by_key(&parent, |&(key, _)| key).ok());
            if !parent.is_some_and(|parent| matches!(list[parent].1, Entry::Node { .. })) {
                return Err(format!("node {key} has no parent there"));
            }
        }
        let mut entries = self.0.write().unwrap_or_else(PoisonError::into_inner);
        if let Some(Entry::Page { .. }) = entries.get(&page) {
            entries.extend(list);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NODE: Entry = Entry::Node { points: 1, offset: 2, bytes: 3 };
    const PAGE: Entry = Entry::Page { offset: 4, bytes: 5 };

    fn key(level: u32, at: [u32; 3]) -> Key {
        Key::new(level, at).expect("inside")
    }

    #[test]
    fn what_is_not_loaded_is_unknown() {
        let directory = Directory::new(PAGE);
        let (near, far, below) = (key(1, [0; 3]), key(1, [1, 0, 0]), key(3, [4, 1, 1]));
        assert_eq!([Key::ROOT, below].map(|key| directory.node(key)), [Node::Unknown; 2]);
        directory.load(Key::ROOT, vec![(far, PAGE), (Key::ROOT, NODE), (near, NODE)]).expect("a page");
        assert_eq!(directory.node(Key::ROOT), Node::Known { points: 1, bytes: 3 });
        assert_eq!([far, below].map(|key| directory.node(key)), [Node::Unknown; 2]);
        assert_eq!([key(1, [0, 1, 0]), key(2, [0; 3])].map(|key| directory.node(key)), [Node::Absent; 2]);
        assert_eq!(directory.nearest(below), Some((far, PAGE)));
        directory.load(far, vec![(far, NODE)]).expect("a page");
        assert_eq!(directory.node(below), Node::Absent);
        directory.load(far, vec![(far, NODE), (key(2, [2, 0, 0]), NODE)]).expect("loaded already");
        assert_eq!(directory.node(key(2, [2, 0, 0])), Node::Absent, "the first one counts");
    }

    #[test]
    fn a_page_that_contradicts_itself_changes_nothing() {
        let (child, far) = (key(1, [1, 0, 0]), key(2, [0; 3]));
        for (list, words) in [
            (vec![], "its own node"),
            (vec![(child, NODE)], "its own node"),
            (vec![(Key::ROOT, PAGE)], "its own node"),
            (vec![(Key::ROOT, NODE), (child, NODE), (child, PAGE)], "node 1-1-0-0 twice"),
            (vec![(Key::ROOT, NODE), (child, NODE), (far, NODE)], "node 2-0-0-0 has no parent"),
            (vec![(Key::ROOT, NODE), (child, PAGE), (key(2, [2, 0, 0]), NODE)], "node 2-2-0-0 has no parent"),
        ] {
            let directory = Directory::new(PAGE);
            let told = directory.load(Key::ROOT, list).expect_err("it is wrong");
            assert!(told.contains(words), "{told}");
            assert_eq!(directory.node(Key::ROOT), Node::Unknown);
        }
    }
}
