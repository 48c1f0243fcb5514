//! Layers of octrees, of which what the view needs is in memory.

use std::{ops::Range, sync::Arc};

use autosplats::cloud::{Axes, FieldValues, Key, PointCloud, Tree, Wanted};
use autosplats_formats::ReadOptions;

/// An octree, and how its points are read.
#[derive(Debug)]
pub(crate) struct OpenTree {
    pub(crate) tree: Arc<dyn Tree>,
    /// How the input is read, for points that are read again.
    pub(crate) options: ReadOptions,
    /// Colours of which points are shown, about which origin. The field that colours show comes in addition.
    pub(crate) wanted: Wanted,
    /// Points that stand for all: the coarsest.
    pub(crate) sample: Arc<PointCloud>,
    /// The coarsest nodes, in the order of their keys.
    pub(crate) first: Vec<(Key, Arc<PointCloud>)>,
    /// The up axis, as stated or guessed.
    pub(crate) axes: Axes,
}

impl OpenTree {
    /// The cloud of some nodes, in the order of their keys, with the ranks of the nodes and the `field` that colours
    /// show. What all nodes lack is zero.
    pub(crate) fn cloud<'a>(
        self: &Arc<Self>,
        nodes: impl Iterator<Item = (Key, usize, &'a PointCloud)> + Clone,
        field: Option<&str>,
    ) -> (LayerTree, Arc<PointCloud>) {
        let mut first = 0;
        let list = nodes.clone().map(|(key, rank, cloud)| {
            let node = LoadedNode { key, first, rank };
            first += cloud.len();
            node
        });
        let list = list.collect();
        let mut cloud = PointCloud::joined(nodes.map(|(_, _, cloud)| cloud));
        let (info, len) = (self.tree.info(), cloud.len());
        if len == 0 {
            cloud = PointCloud::new(self.wanted.origin.unwrap_or_default(), Vec::new()).with_crs(info.crs.clone());
        }
        let fits = "one value for each point";
        if info.colors && cloud.colors().is_none() {
            cloud = cloud.with_colors(vec![[0; 3]; len]).expect(fits);
        }
        let lacking = |name: &&String| cloud.field(name).is_none() && Some(&***name) == field;
        if let Some(name) = info.fields.iter().find(lacking) {
            cloud = cloud.with_field(name, FieldValues::U8(vec![0; len])).expect(fits);
        }
        (
            LayerTree { open: Arc::clone(self), nodes: list, field: field.map(str::to_owned) },
            Arc::new(cloud.with_axes(self.axes)),
        )
    }

    /// The cloud of the coarsest nodes.
    pub(crate) fn coarsest(self: &Arc<Self>) -> (LayerTree, Arc<PointCloud>) {
        let nodes = self.first.iter().enumerate();
        self.cloud(nodes.map(|(rank, (key, cloud))| (*key, rank, &**cloud)), None)
    }
}

/// A node whose points are in the cloud of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LoadedNode {
    pub(crate) key: Key,
    /// Index of its first point in the cloud.
    pub(crate) first: usize,
    /// Place among the nodes, those that show most first.
    pub(crate) rank: usize,
}

/// The octree of a layer, and the nodes that the layer's cloud is made of.
#[derive(Clone, Debug)]
pub(crate) struct LayerTree {
    pub(crate) open: Arc<OpenTree>,
    /// In the order of their points.
    pub(crate) nodes: Arc<[LoadedNode]>,
    /// The field that the nodes have in addition to colours.
    pub(crate) field: Option<String>,
}

impl LayerTree {
    /// Node of the point at an index of the cloud, and the point's index among those of the node that are shown.
    pub(crate) fn place_of(&self, point: usize) -> Option<(Key, usize)> {
        let node = self.nodes[..self.nodes.partition_point(|node| node.first <= point)].last()?;
        Some((node.key, point - node.first))
    }

    /// The points of the nodes that show most, ascending: at most `most` of the `len` points, but at least one node.
    pub(super) fn leading(&self, len: usize, most: usize) -> Vec<Range<usize>> {
        let ends = self.nodes.iter().skip(1).map(|node| node.first).chain([len]);
        let mut nodes: Vec<_> = self.nodes.iter().zip(ends).map(|(node, end)| (node.rank, node.first..end)).collect();
        nodes.sort_unstable_by_key(|(rank, _)| *rank);
        let mut total = 0;
        let fits = |(_, points): &(usize, Range<usize>)| {
            let before = total;
            total += points.len();
            total <= most || before == 0
        };
        let mut leading: Vec<_> = nodes.into_iter().take_while(fits).map(|(_, points)| points).collect();
        leading.sort_unstable_by_key(|points| points.start);
        leading
    }
}
