//! One input of a document and what was done to it.

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

use super::{Bits, shown::bounds};

/// Tells a layer from all others of this process; clones of a layer, as undo keeps them, have the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct LayerId(u64);

/// One input: a cloud as it was read, where it stands and what was done to its points.
#[derive(Clone, Debug)]
pub(crate) struct Layer {
    /// Which one it is.
    pub(crate) id: LayerId,
    /// Name for people.
    pub(crate) name: String,
    /// The file it was read from.
    pub(crate) path: Option<PathBuf>,
    /// The points as read, with [all digits](autosplats::cloud::ReadOptions::exact); never changed.
    pub(crate) cloud: Arc<PointCloud>,
    /// Whether it is shown.
    pub(crate) visible: bool,
    /// Whether more points are still to come. Its points can be seen, but not selected or edited, as they are not the file's.
    pub(crate) incomplete: bool,
    /// One colour for all its points instead of their own.
    pub(crate) tint: Option<[u8; 3]>,
    /// Where it stands: maps its own coordinates, in metres where the file has degrees, to world coordinates, after the
    /// [moves](Edits::moves).
    pub(crate) pose: DMat4,
    /// What was done to single points.
    pub(crate) edits: Edits,
    /// The pose it was opened with, which is no edit.
    pub(crate) opened_at: DMat4,
    /// The map that makes metres of the file's degrees.
    pub(super) local: Option<LocalMetres>,
}

/// What was done to single points of a layer.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Edits {
    /// Points that the next edit is about.
    pub(crate) selected: Bits,
    /// Points that are not shown but still there.
    pub(crate) hidden: Bits,
    /// Points that are no longer there.
    pub(crate) deleted: Bits,
    /// Points that were moved, in order: maps of the layer's own coordinates, in metres where the file has degrees.
    pub(crate) moves: Vec<(Bits, DMat4)>,
}

/// What was done to a layer that its file does not know.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Changes {
    pose: DMat4,
    deleted: Bits,
    moves: Vec<(Bits, DMat4)>,
}

/// Numbers of points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    /// All points of the file.
    pub(crate) points: usize,
    /// Those that an edit would be about now.
    pub(crate) selected: usize,
    /// Those hidden, but not deleted.
    pub(crate) hidden: usize,
    /// Those deleted.
    pub(crate) deleted: usize,
}

impl Layer {
    /// A layer that shows all of `cloud`. For one in degrees, the map to metres is found here, from all its points.
    pub(crate) fn new(name: impl Into<String>, path: Option<PathBuf>, cloud: Arc<PointCloud>) -> Self {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        Self {
            id: LayerId(NEXT.fetch_add(1, Ordering::Relaxed)),
            name: name.into(),
            path,
            local: cloud.local_metres(None),
            cloud,
            visible: true,
            incomplete: false,
            tint: None,
            pose: DMat4::IDENTITY,
            edits: Edits::default(),
            opened_at: DMat4::IDENTITY,
        }
    }

    /// States where it stands when it is opened, which does not count as an edit.
    #[must_use]
    pub(crate) fn opened_at(mut self, pose: DMat4) -> Self {
        (self.pose, self.opened_at) = (pose, pose);
        self
    }

    /// What the file says a point's coordinates are.
    ///
    /// # Panics
    /// If there is no such point.
    pub(crate) fn file_position(&self, point: usize) -> DVec3 {
        self.cloud.world_position(point)
    }

    /// World coordinates of a point, with all that was done to it.
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
        // Infinities stay as they are where nothing is to be done.
        if self.pose == DMat4::IDENTITY { place } else { self.pose.transform_point3(place) }
    }

    /// The least box along the axes of the world that has all its points in it.
    pub(crate) fn bounds(&self) -> Option<[DVec3; 2]> {
        bounds(self.cloud.len(), |point| self.has(point).then(|| self.position(point)))
    }

    /// Whether a point is neither hidden nor deleted.
    pub(super) fn has(&self, point: usize) -> bool {
        !self.edits.hidden.get(point) && !self.edits.deleted.get(point)
    }

    /// What was done to it that its file does not know.
    pub(super) fn changes(&self) -> Changes {
        let Edits { deleted, moves, .. } = &self.edits;
        Changes { pose: self.pose, deleted: deleted.clone(), moves: moves.clone() }
    }

    /// The changes of a layer that is as it was opened.
    pub(super) fn no_changes(&self) -> Changes {
        Changes { pose: self.opened_at, deleted: Bits::default(), moves: Vec::new() }
    }

    /// Whether the same points would be shown at the same places in the same colours.
    pub(super) fn looks_like(&self, other: &Self) -> bool {
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
