//! Decoded nodes.

use std::cmp::Reverse;
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use autosplats::cloud::{Key, PointCloud};

use crate::session::document::OpenTree;

/// Decoded nodes of octrees. Those that are needed stay; of others, the most recently needed.
#[derive(Debug, Default)]
pub(super) struct Store {
    /// The octrees, whose addresses identify them.
    trees: Vec<Arc<OpenTree>>,
    nodes: HashMap<(usize, Key), Stored>,
    bytes: usize,
    /// Number of choices so far.
    choices: u64,
    /// The field that nodes have in addition to colours.
    field: Option<String>,
}

#[derive(Debug)]
struct Stored {
    cloud: Arc<PointCloud>,
    /// The last choice that needed the node.
    used: u64,
}

/// What identifies an octree while the store holds it.
pub(super) fn id_of(open: &Arc<OpenTree>) -> usize {
    Arc::as_ptr(open).addr()
}

impl Store {
    /// Keeps the nodes of these octrees only. Nodes without the wanted field are dropped.
    pub(super) fn prepare<'a>(&mut self, trees: impl Iterator<Item = &'a Arc<OpenTree>>, field: Option<&str>) {
        let trees: Vec<_> = trees.map(Arc::clone).collect();
        // Colours are there with any field.
        if field.is_some() && field != self.field.as_deref() {
            self.field = field.map(str::to_owned);
            (self.nodes, self.bytes) = (HashMap::new(), 0);
            self.trees.clear();
        }
        let open: HashSet<usize> = trees.iter().map(id_of).collect();
        self.nodes.retain(|(tree, _), _| open.contains(tree));
        self.bytes = self.nodes.values().map(|node| node.cloud.byte_len()).sum();
        let new: Vec<_> = trees.iter().filter(|tree| !self.trees.iter().any(|own| Arc::ptr_eq(own, tree))).collect();
        if self.field.is_none() {
            for tree in new {
                tree.first.iter().for_each(|(key, cloud)| self.insert(tree, *key, Arc::clone(cloud)));
            }
        }
        self.trees = trees;
    }

    /// The field that nodes have in addition to colours.
    pub(super) fn field(&self) -> Option<&str> {
        self.field.as_deref()
    }

    /// Begins a choice.
    pub(super) fn choose(&mut self) {
        self.choices += 1;
    }

    /// Notes that the choice needs a node. Returns whether it is there.
    pub(super) fn need(&mut self, tree: &Arc<OpenTree>, key: Key) -> bool {
        let node = self.nodes.get_mut(&(id_of(tree), key));
        node.map(|node| node.used = self.choices).is_some()
    }

    /// Adds a node that the choice needs.
    pub(super) fn insert(&mut self, tree: &Arc<OpenTree>, key: Key, cloud: Arc<PointCloud>) {
        self.bytes += cloud.byte_len();
        let before = self.nodes.insert((id_of(tree), key), Stored { cloud, used: self.choices });
        self.bytes -= before.map_or(0, |node| node.cloud.byte_len());
    }

    pub(super) fn get(&self, tree: &Arc<OpenTree>, key: Key) -> Option<&Arc<PointCloud>> {
        self.nodes.get(&(id_of(tree), key)).map(|node| &node.cloud)
    }

    /// Drops nodes that the choice does not need until there are at most `limit` bytes: the least recently needed
    /// first, among these the finest.
    pub(super) fn trim(&mut self, limit: usize) {
        if self.bytes <= limit {
            return;
        }
        let idle = self.nodes.iter().filter(|(_, node)| node.used < self.choices);
        let mut idle: Vec<_> = idle.map(|(&(tree, key), node)| (node.used, Reverse(key), tree)).collect();
        idle.sort_unstable();
        for (_, Reverse(key), tree) in idle {
            if self.bytes <= limit {
                return;
            }
            let node = self.nodes.remove(&(tree, key));
            self.bytes -= node.map_or(0, |node| node.cloud.byte_len());
        }
    }
}
