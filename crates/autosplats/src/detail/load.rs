//! Loading nodes: their bytes are read on one thread, and decoded on all.

use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::scope;

use autosplats_cloud::{ErrorKind, Node, NodeKey, PointCloud, Progress, Wanted};
use glam::DMat4;
use rayon::prelude::*;

use super::PlacedTree;
use crate::Error;

/// Bytes that are read at a time.
const BATCH_BYTES: u64 = 4 << 20;
/// Batches that wait for being decoded.
const QUEUED_BATCHES: usize = 2;

/// A loaded node.
#[derive(Debug)]
pub struct NodePoints {
    /// Which node.
    pub node: NodeKey,
    /// Its points; none if it is damaged.
    pub cloud: PointCloud,
    /// Why the node cannot be decoded.
    pub damage: Option<String>,
}

/// Nodes and their stored bytes.
type Batch = (Vec<NodeKey>, Vec<Vec<u8>>);

/// Loads `nodes` and hands each to `take`, in the order given. A node that cannot be decoded has no points.
///
/// # Errors
/// Those of reading, and those of `take`; nothing is loaded after an error. [`Error::Cancelled`] if `progress` says so.
pub fn load_nodes(
    trees: &[PlacedTree],
    nodes: &[NodeKey],
    wanted: &Wanted,
    progress: &dyn Progress,
    mut take: impl FnMut(NodePoints) -> Result<(), Error>,
) -> Result<(), Error> {
    let (queue, batches) = sync_channel::<Result<Batch, Error>>(QUEUED_BATCHES);
    scope(|scope| {
        scope.spawn(move || fetch(trees, nodes, progress, &queue));
        let mut done = 0;
        for batch in batches {
            let (keys, stored) = batch?;
            done += keys.len();
            let decoded: Vec<_> = keys
                .into_par_iter()
                .zip(stored)
                .map(|(node, bytes)| decode(&trees[node.tree as usize], node, &bytes, wanted))
                .collect();
            for points in decoded {
                take(points?)?;
            }
            progress.tick(done as f32 / nodes.len() as f32)?;
        }
        Ok(())
    })
}

/// Reads batch after batch, until one fails or nobody takes them any more.
fn fetch(trees: &[PlacedTree], nodes: &[NodeKey], progress: &dyn Progress, queue: &SyncSender<Result<Batch, Error>>) {
    let mut rest = nodes;
    while let Some(first) = rest.first() {
        let tree = &trees[first.tree as usize].tree;
        let mut bytes = 0;
        let fits = |node: &&NodeKey| {
            bytes += match tree.node(node.key) {
                Node::Known { bytes, .. } => bytes,
                Node::Absent | Node::Unknown => 0,
            };
            node.tree == first.tree && bytes <= BATCH_BYTES
        };
        let count = rest.iter().take_while(fits).count().max(1);
        let (now, later) = rest.split_at(count);
        rest = later;
        let keys: Vec<_> = now.iter().map(|node| node.key).collect();
        let stored = tree.fetch(&keys, progress).map_err(Error::from);
        let failed = stored.is_err();
        if queue.send(stored.map(|stored| (now.to_vec(), stored))).is_err() || failed {
            return;
        }
    }
}

/// Decodes a node and moves it to its place.
fn decode(placed: &PlacedTree, node: NodeKey, bytes: &[u8], wanted: &Wanted) -> Result<NodePoints, Error> {
    match placed.tree.decode(node.key, bytes, wanted) {
        Ok(cloud) if placed.world_from_tree == DMat4::IDENTITY => Ok(NodePoints { node, cloud, damage: None }),
        Ok(cloud) => {
            let cloud = PointCloud::merge(vec![(cloud, placed.world_from_tree)]);
            Ok(NodePoints { node, cloud, damage: None })
        }
        Err(error) if error.kind() == ErrorKind::Data => {
            let cloud = PointCloud::default();
            Ok(NodePoints { node, cloud, damage: Some(error.to_string()) })
        }
        Err(error) => Err(error.into()),
    }
}
