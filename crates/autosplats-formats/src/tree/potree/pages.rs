//! Pages of `hierarchy.bin`: 22 bytes for each node, level by level from the page's own node on.

use std::collections::VecDeque;

use autosplats_cloud::Key;

use crate::{
    read::las::MAX_RATIO,
    tree::{
        directory::Entry,
        paged::{Page, Parsed},
    },
};

/// Bytes of an entry.
pub(super) const ENTRY: usize = 22;

/// Kind of an entry: its node and what is below are on a page of their own.
const PROXY: u8 = 2;

/// What entries may name.
#[derive(Debug)]
pub(super) struct Limits {
    /// Bytes of the file of nodes.
    pub(super) data: u64,
    /// Bytes of a point, if nodes are not compressed.
    pub(super) record: Option<usize>,
}

/// The entries of a page of a file of `size` bytes.
pub(super) fn entries(key: Key, page: &[u8], limits: &Limits, size: u64) -> Parsed {
    let (raw, _) = page.as_chunks::<ENTRY>();
    let mut list = Vec::with_capacity(raw.len());
    let mut ahead = VecDeque::from([key]);
    for (index, raw) in raw.iter().enumerate() {
        let fail = |what: String| (index * ENTRY, what);
        let Some(key) = ahead.pop_front() else {
            return Err(fail("it has more nodes than its nodes have children; build the tree again".into()));
        };
        let entry = entry(key, raw, limits, size).map_err(fail)?;
        if let Entry::Node { .. } = entry {
            ahead.extend(children(key, raw[1]).map_err(fail)?);
        }
        list.push((key, entry));
    }
    match ahead.front() {
        Some(key) => Err((page.len(), format!("node {key} is missing; copy the file again"))),
        None => Ok(list),
    }
}

/// The children of a node by their bits, of which z has the lowest.
fn children(key: Key, mask: u8) -> Result<Vec<Key>, String> {
    let child = |octant: u32| {
        let at = [2 * key.x + (octant >> 2), 2 * key.y + (octant >> 1 & 1), 2 * key.z + (octant & 1)];
        let deep = || format!("node {key} has children; at most {} levels are read", Key::MAX_LEVEL);
        Key::new(key.level + 1, at).ok_or_else(deep)
    };
    (0..8).filter(|octant| mask >> octant & 1 == 1).map(child).collect()
}

fn entry(key: Key, raw: &[u8; ENTRY], limits: &Limits, size: u64) -> Result<Entry, String> {
    let long = |at: usize| raw[at..at + 8].iter().rev().fold(0, |sum: u64, &byte| sum << 8 | u64::from(byte));
    let points = u32::from_le_bytes([raw[2], raw[3], raw[4], raw[5]]);
    let (offset, bytes) = (long(6), long(14));
    let short = || u32::try_from(bytes).map_err(|_| format!("node {key} has {bytes} bytes; build the tree again"));
    if raw[0] == PROXY {
        Page { offset, bytes }.check(size, ENTRY)?;
        return Ok(Entry::Page { offset, bytes: short()? });
    }
    // Some converters count the points below inner nodes that have none themselves.
    if points == 0 || bytes == 0 {
        return Ok(Entry::Node { points: 0, offset: 0, bytes: 0 });
    }
    if offset.checked_add(bytes).is_none_or(|end| end > limits.data) {
        let end = limits.data;
        return Err(format!(
            "the {bytes} bytes of node {key} at byte {offset} are not among the {end} of the points; copy the tree again"
        ));
    }
    let fits = match limits.record {
        Some(record) => u64::from(points) * record as u64 == bytes,
        None => u64::from(points) <= MAX_RATIO as u64 * bytes,
    };
    if !fits {
        return Err(format!("{points} points of node {key} cannot be in {bytes} bytes; build the tree again"));
    }
    Ok(Entry::Node { points, offset, bytes: short()? })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn raw(kind: u8, mask: u8, points: u32, offset: u64, bytes: u64) -> Vec<u8> {
        let numbers = [offset, bytes].map(u64::to_le_bytes);
        [&[kind, mask][..], &points.to_le_bytes(), numbers.as_flattened()].concat()
    }

    #[test]
    fn nodes_follow_level_by_level() {
        let limits = Limits { data: 1000, record: Some(10) };
        let page =
            [raw(0, 0b1000_0001, 3, 0, 30), raw(1, 0, 2, 30, 20), raw(0, 0b10, 9, 0, 0), raw(PROXY, 0xff, 7, 44, 22)];
        let key = |level, at| Key::new(level, at).expect("inside");
        let node = |points, offset, bytes| Entry::Node { points, offset, bytes };
        let list = entries(Key::ROOT, &page.concat(), &limits, 66).expect("sound");
        let expected = [
            (Key::ROOT, node(3, 0, 30)),
            (key(1, [0, 0, 0]), node(2, 30, 20)),
            (key(1, [1, 1, 1]), node(0, 0, 0)),
            (key(2, [2, 2, 3]), Entry::Page { offset: 44, bytes: 22 }),
        ];
        assert_eq!(list, expected);
    }

    #[test]
    fn pages_that_cannot_be_are_refused() {
        let limits = Limits { data: 1000, record: Some(10) };
        let deepest = Key::new(Key::MAX_LEVEL, [0; 3]).expect("inside");
        for (key, page, at, words) in [
            (Key::ROOT, vec![raw(0, 1, 1, 0, 10)], 22, "node 1-0-0-0 is missing"),
            (Key::ROOT, vec![raw(0, 0, 1, 0, 10), raw(1, 0, 1, 0, 10)], 22, "more nodes"),
            (Key::ROOT, vec![raw(0, 0, 1, 995, 10)], 0, "are not among the 1000"),
            (Key::ROOT, vec![raw(0, 0, 1, u64::MAX, 10)], 0, "are not among the 1000"),
            (Key::ROOT, vec![raw(0, 0, 2, 0, 10)], 0, "2 points of node 0-0-0-0 cannot be in 10 bytes"),
            (Key::ROOT, vec![raw(0, 1, 0, 0, 0), raw(PROXY, 0, 0, 60, 22)], 22, "beyond the end"),
            (Key::ROOT, vec![raw(0, 1, 0, 0, 0), raw(PROXY, 0, 0, 0, 21)], 22, "not made of entries"),
            (deepest, vec![raw(0, 1, 1, 0, 10)], 0, "at most 30 levels"),
        ] {
            let (found, what) = entries(key, &page.concat(), &limits, 66).expect_err(words);
            assert!(found == at && what.contains(words), "{found}: {what} should contain {words}");
        }
    }
}
