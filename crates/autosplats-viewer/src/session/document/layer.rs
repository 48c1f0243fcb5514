//! A layer: one input of a document and its edits.

use std::{
    path::PathBuf,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
};

use autosplats::cloud::{
    LocalMetres, PointCloud,
    glam::{DMat4, DVec3},
};

use super::{
    Bits, LayerTree,
    bounds::{bounds, placed_box},
};

/// Identifies a layer in this process. Clones of a layer, as undo keeps them, have the same id.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct LayerId(u64);

/// One input: a cloud as it was read, its pose and the edits of its points.
#[derive(Clone, Debug)]
pub(crate) struct Layer {
    pub(crate) id: LayerId,
    /// Name shown to the user.
    pub(crate) name: String,
    /// The file that the points were read from.
    pub(crate) path: Option<PathBuf>,
    /// The points as read, with [all digits](autosplats_formats::ReadOptions::exact). They never change, except those
    /// of an octree, which have the digits of the picture.
    pub(crate) cloud: Arc<PointCloud>,
    /// The octree of which the cloud holds what the view needs.
    pub(crate) tree: Option<LayerTree>,
    pub(crate) visible: bool,
    /// Whether points are still to come or to change. Incomplete points can be seen, but not selected or edited.
    pub(crate) incomplete: bool,
    /// One colour for all points; `None` shows their own colours.
    pub(crate) tint: Option<[u8; 3]>,
    /// Maps the layer's own coordinates to world coordinates, after the [moves](Edits::moves). The own coordinates of a
    /// file in degrees are in metres.
    pub(crate) pose: DMat4,
    /// Edits of single points.
    pub(crate) edits: Edits,
    /// The pose when the layer was opened, which is no edit.
    pub(crate) opened_at: DMat4,
    /// Converts a file's degrees to metres.
    pub(super) local: Option<LocalMetres>,
}

/// Edits of single points of a layer.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Edits {
    pub(crate) selected: Bits,
    /// Points that exist but are not shown.
    pub(crate) hidden: Bits,
    /// Points that no longer exist.
    pub(crate) deleted: Bits,
    /// Moved points and their maps, in order. The maps are in the layer's own coordinates, in metres for a file in
    /// degrees.
    pub(crate) moves: Vec<(Bits, DMat4)>,
}

/// The changes to a layer that its file does not have.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LayerChanges {
    pose: DMat4,
    deleted: Bits,
    moves: Vec<(Bits, DMat4)>,
}

/// Numbers of points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    /// All points of the file.
    pub(crate) points: usize,
    /// Points that an edit would change.
    pub(crate) selected: usize,
    /// Points that are hidden, but not deleted.
    pub(crate) hidden: usize,
    pub(crate) deleted: usize,
}

impl Layer {
    /// A layer that shows all of `cloud`. For a cloud in degrees, its conversion to metres is computed from all points.
    pub(crate) fn new(name: impl Into<String>, path: Option<PathBuf>, cloud: Arc<PointCloud>) -> Self {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        Self {
            id: LayerId(NEXT.fetch_add(1, Ordering::Relaxed)),
            name: name.into(),
            path,
            local: cloud.local_metres(None),
            cloud,
            tree: None,
            visible: true,
            incomplete: false,
            tint: None,
            pose: DMat4::IDENTITY,
            edits: Edits::default(),
            opened_at: DMat4::IDENTITY,
        }
    }

    /// Sets the pose with which the layer is opened, which is no edit.
    #[must_use]
    pub(crate) fn opened_at(mut self, pose: DMat4) -> Self {
        (self.pose, self.opened_at) = (pose, pose);
        self
    }

    /// Coordinates of a point in the file.
    ///
    /// # Panics
    /// If there is no such point.
    pub(crate) fn file_position(&self, point: usize) -> DVec3 {
        self.cloud.world_position(point)
    }

    /// World coordinates of a point, with all edits.
    ///
    /// # Panics
    /// If there is no such point.
    pub(crate) fn position(&self, point: usize) -> DVec3 {
        let file = self.file_position(point);
        let mut place = self.local.map_or(file, |local| local.metres(file));
        for (points, matrix) in &self.edits.moves {
            if points.get(point) {
                place = matrix.transform_point3(place);
            }
        }
        // The identity is skipped, since it would turn infinities into NaN.
        if self.pose == DMat4::IDENTITY { place } else { self.pose.transform_point3(place) }
    }

    /// Bounds of the points that are neither hidden nor deleted, world coordinates.
    pub(crate) fn bounds(&self) -> Option<[DVec3; 2]> {
        self.tree_bounds().or_else(|| self.loaded_bounds())
    }

    fn loaded_bounds(&self) -> Option<[DVec3; 2]> {
        bounds(self.cloud.len(), |point| self.has(point).then(|| self.position(point)))
    }

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

    /// Whether a point is neither hidden nor deleted.
    pub(super) fn has(&self, point: usize) -> bool {
        !self.edits.hidden.get(point) && !self.edits.deleted.get(point)
    }

    /// The changes that the layer's file does not have.
    pub(super) fn changes(&self) -> LayerChanges {
        let Edits { deleted, moves, .. } = &self.edits;
        LayerChanges { pose: self.pose, deleted: deleted.clone(), moves: moves.clone() }
    }

    /// The changes of a layer in the state in which it was opened.
    pub(super) fn no_changes(&self) -> LayerChanges {
        LayerChanges { pose: self.opened_at, deleted: Bits::default(), moves: Vec::new() }
    }

    /// Whether both layers show the same points at the same places in the same colours.
    pub(super) fn shows_same(&self, other: &Self) -> bool {
        let Self { id, cloud, tint, pose, edits, local, .. } = self;
        *id == other.id
            && Arc::ptr_eq(cloud, &other.cloud)
            && *tint == other.tint
            && *pose == other.pose
            && *local == other.local
            && edits.hidden == other.edits.hidden
            && edits.deleted == other.edits.deleted
            && edits.moves == other.edits.moves
    }
}
