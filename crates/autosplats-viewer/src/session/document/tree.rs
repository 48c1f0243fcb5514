//! Layers of octrees, of which what the view needs is in memory.

use std::{ops::Range, sync::Arc};

use autosplats::cloud::{
    Axes, FieldValues, Key, PointCloud, Tree, Wanted,
    glam::{DMat4, DQuat, DVec3},
};
use autosplats_formats::{Part, ReadOptions};

use super::{ClipBox, Document, Layer, LayerId};

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

impl Layer {
    /// Whether points can be selected and changed: all are there, and all are in memory.
    pub(crate) fn is_editable(&self) -> bool {
        !self.incomplete && self.tree.is_none()
    }

    /// The layer with points that stand for all, whatever of an octree is in memory.
    pub(super) fn as_sampled(&self) -> Self {
        let mut layer = self.clone();
        if let Some(tree) = layer.tree.take() {
            layer.cloud = Arc::clone(&tree.open.sample);
        }
        layer
    }

    /// Box around all points of an octree, world coordinates, as the file states.
    pub(super) fn tree_bounds(&self) -> Option<[DVec3; 2]> {
        let info = self.tree.as_ref()?.open.tree.info();
        Some(placed_box(info.bounds, &self.pose))
    }
}

impl Document {
    /// Makes a layer one of an octree. Its points are replaced, and edits of single points dropped.
    pub(crate) fn set_tree(&mut self, id: LayerId, tree: &LayerTree, cloud: &Arc<PointCloud>) {
        self.reload(id, cloud);
        self.layers.iter_mut().filter(|layer| layer.id == id).for_each(|layer| layer.tree = Some(tree.clone()));
    }

    /// Shows other nodes of an octree. Nothing changes if the layer shows another octree.
    pub(crate) fn show_nodes(&mut self, id: LayerId, shown: &LayerTree, cloud: &Arc<PointCloud>) {
        let same = |layer: &&mut Layer| {
            layer.id == id && layer.tree.as_ref().is_some_and(|tree| Arc::ptr_eq(&tree.open, &shown.open))
        };
        for layer in self.layers.iter_mut().filter(same) {
            layer.cloud = Arc::clone(cloud);
            layer.tree = Some(shown.clone());
        }
    }

    /// The visible layers of octrees.
    pub(crate) fn trees(&self) -> impl Iterator<Item = (&Layer, &LayerTree)> {
        self.layers.iter().filter(|layer| layer.visible).filter_map(|layer| Some((layer, layer.tree.as_ref()?)))
    }
}

/// The part of an octree that a box in the world needs. The points of a box that is turned or posed have to be tested
/// once more.
pub(super) fn part_in(clip: Option<&ClipBox>, pose: &DMat4) -> Part {
    let bounds = clip.map(|clip| {
        if clip.rotation == DQuat::IDENTITY && *pose == DMat4::IDENTITY {
            return [clip.min, clip.max];
        }
        let tree_from_world = pose.inverse();
        let [low, high] = box_of(clip.corners().map(|corner| tree_from_world.transform_point3(corner)));
        let slack = 1e-12 * low.abs().max(high.abs());
        [low - slack, high + slack]
    });
    Part { bounds, ..Part::default() }
}

fn placed_box([low, high]: [DVec3; 2], matrix: &DMat4) -> [DVec3; 2] {
    let corner = |at: usize| {
        let pick = |axis: usize| if at >> axis & 1 == 0 { low[axis] } else { high[axis] };
        matrix.transform_point3(DVec3::new(pick(0), pick(1), pick(2)))
    };
    box_of(std::array::from_fn(corner))
}

fn box_of(corners: [DVec3; 8]) -> [DVec3; 2] {
    let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    corners.into_iter().fold(none, |[low, high], corner| [low.min(corner), high.max(corner)])
}
