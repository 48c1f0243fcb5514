//! Pages of the hierarchy: the list of nodes in pieces, so that a viewer reads only what it needs.
//!
//! # How it works
//!
//! A page takes whole levels of its subtree from the top, as many as fit. The subtrees below have pages of their own. A
//! file of few nodes has one page.

use super::key::Place;

/// Most entries of a page.
const MOST: usize = 4096;

/// Bytes of an entry.
const ENTRY: usize = 32;

/// A node in the file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    pub(super) place: Place,
    pub(super) points: i32,
    pub(super) offset: u64,
    pub(super) bytes: i32,
}

/// Place and size of the hierarchy's first page.
#[derive(Clone, Copy, Default)]
pub(super) struct RootPage {
    pub(super) offset: u64,
    pub(super) bytes: u64,
}

/// The pages one after another, the first of which is at byte `at` of the file; and place and size of the root's page.
pub(super) fn pages(entries: &mut [Entry], at: u64) -> (Vec<u8>, RootPage) {
    // By level, and along the curve within a level: the descendants of a node are a range of each level.
    entries.sort_by_key(|entry| (entry.place.level, entry.place.code));
    let mut pages = Vec::new();
    let root = page(entries, Place::ROOT, at, &mut pages);
    (pages, root)
}

/// The entries of a level below a node.
fn below(entries: &[Entry], place: Place, level: u32) -> &[Entry] {
    let shift = 3 * (level - place.level);
    let order = |entry: &Entry| (entry.place.level, entry.place.code >> shift);
    let start = entries.partition_point(|entry| entry.place.level < level || order(entry) < (level, place.code));
    let len = entries[start..].partition_point(|entry| order(entry) == (level, place.code));
    &entries[start..start + len]
}

/// Adds the page of a node's subtree behind those of the subtrees below.
fn page(entries: &[Entry], place: Place, at: u64, pages: &mut Vec<u8>) -> RootPage {
    let mut own: Vec<Entry> = Vec::new();
    let mut level = place.level;
    loop {
        let next = below(entries, place, level);
        if next.is_empty() {
            break;
        }
        let more = below(entries, place, level + 1);
        // Nodes of the last level may be names of pages instead.
        if level > place.level && own.len() + next.len() + more.len() > MOST && !more.is_empty() {
            for &node in next {
                let has_more = !below(entries, node.place, level + 1).is_empty();
                own.push(if has_more {
                    let RootPage { offset, bytes } = page(entries, node.place, at, pages);
                    Entry { points: -1, offset, bytes: bytes as i32, ..node }
                } else {
                    node
                });
            }
            break;
        }
        own.extend(next);
        level += 1;
    }
    let offset = at + pages.len() as u64;
    for Entry { place, points, offset, bytes } in &own {
        let key = place.key();
        let numbers = [key.level, key.x, key.y, key.z].map(|number| number as i32);
        pages.extend(numbers.into_iter().flat_map(i32::to_le_bytes));
        pages.extend(offset.to_le_bytes());
        pages.extend([*bytes, *points].into_iter().flat_map(i32::to_le_bytes));
    }
    RootPage { offset, bytes: (own.len() * ENTRY) as u64 }
}
