//! All nodes of a tree, level by level.

use autosplats_cloud::{Error, Key, Node, Progress, Tree};

/// A known node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    pub(super) key: Key,
    pub(super) points: u32,
    pub(super) bytes: u64,
}

/// The nodes for which `wants` is true, and whose parents are among them, in the order of their keys. Pages that tell
/// of them are loaded if there is a `loading` to follow that. The second result is the number of pages that are not.
pub(super) fn walk(
    tree: &dyn Tree,
    wants: impl Fn(Key) -> bool,
    loading: Option<&dyn Progress>,
) -> Result<(Vec<Found>, usize), Error> {
    let (mut all, mut pages) = (Vec::new(), 0);
    let mut level = vec![Key::ROOT];
    while !level.is_empty() {
        if let Some(progress) = loading {
            let unknown: Vec<Key> = level.iter().copied().filter(|&key| tree.node(key) == Node::Unknown).collect();
            tree.load_pages(&unknown, progress)?;
        }
        let mut next = Vec::new();
        level.sort_unstable();
        for &key in &level {
            match tree.node(key) {
                Node::Known { points, bytes } => {
                    all.push(Found { key, points, bytes });
                    next.extend(key.children().filter(|&child| wants(child) && tree.node(child) != Node::Absent));
                }
                Node::Unknown => pages += 1,
                Node::Absent => {}
            }
        }
        level = next;
    }
    Ok((all, pages))
}
