//! The description of a tree by its header and the pages of its hierarchy that are loaded.

use autosplats_cloud::{Tree, shown_number};

use super::walk::walk;
use crate::read::{Attribute, Description};

/// Describes a tree without reading points. Of the hierarchy it tells as much as is loaded: nodes and points by level.
#[must_use]
pub fn describe_tree(tree: &dyn Tree) -> Description {
    let info = tree.info();
    let mut details = info.details.clone();
    // Nothing is loaded, so nothing can fail.
    let (nodes, pages) = walk(tree, |_| true, None).unwrap_or_default();
    details.push(("spacing".into(), format!("{} at the root, half of it at each level below", short(info.spacing))));
    let more = match pages {
        0 => String::new(),
        1 => ", and those of 1 page that is not loaded".into(),
        pages => format!(", and those of {pages} pages that are not loaded"),
    };
    let bytes: u64 = nodes.iter().map(|node| node.bytes).sum();
    details.push(("nodes".into(), format!("{}, {bytes} bytes{more}", nodes.len())));
    for level in nodes.chunk_by(|a, b| a.key.level == b.key.level) {
        let points: u64 = level.iter().map(|node| u64::from(node.points)).sum();
        let (number, count) = (level[0].key.level, level.len());
        let nodes = if count == 1 { "node" } else { "nodes" };
        details.push((format!("level {number}"), format!("{points} points in {count} {nodes}")));
    }
    Description {
        format: info.format.clone(),
        points: Some(info.points),
        bounds: Some(info.bounds),
        attributes: info
            .attributes
            .iter()
            .map(|(name, stored)| Attribute { name: name.clone(), stored: stored.clone() })
            .collect(),
        crs: info.crs.clone(),
        resolution: info.resolution,
        details,
        notes: info.notes.clone(),
        ..Description::default()
    }
}

/// A length with five digits.
fn short(length: f64) -> String {
    format!("{length:.4e}").parse().map_or_else(|_| length.to_string(), shown_number)
}
