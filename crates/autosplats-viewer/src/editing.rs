//! What is open, and how it is changed: so that it can be undone, so that it cannot, and so that it outlasts undo.

use std::collections::HashMap;
use std::sync::Arc;

use autosplats::cloud::PointCloud;

use crate::app::App;
use crate::document::{Counts, Document, LayerId, label};

/// What panels say of the document, as of a version of it.
#[derive(Default)]
pub(crate) struct Counted {
    version: u64,
    /// Points of all layers.
    pub(crate) all: Counts,
    /// Points of each layer.
    pub(crate) layers: HashMap<LayerId, Counts>,
    /// Bytes of all points.
    pub(crate) bytes: usize,
    /// Bytes that undo keeps besides.
    pub(crate) old_bytes: usize,
}

impl App {
    /// What is open.
    pub(crate) fn document(&self) -> &Document {
        self.history.current()
    }

    /// Grows with each change of the document.
    pub(crate) fn version(&self) -> u64 {
        self.version
    }

    /// Numbers of points of all that is open, and of each layer; counted anew only after changes, and after drags.
    pub(crate) fn counts(&mut self) -> &Counted {
        if self.counted.version != self.version && !self.tools.gizmo.is_busy() {
            let document = self.document();
            self.counted = Counted {
                version: self.version,
                all: document.counts(),
                layers: document.layers.iter().map(|layer| (layer.id, document.counts_of(layer))).collect(),
                bytes: document.layers.iter().map(|layer| layer.cloud.byte_len()).sum(),
                old_bytes: self.history.old_bytes(),
            };
        }
        &self.counted
    }

    /// Changes the document in a way that can be undone.
    pub(crate) fn edit(&mut self, label: impl Into<String>, edit: impl FnOnce(&mut Document)) {
        let mut document = self.document().clone();
        edit(&mut document);
        self.history.record(label, document);
        self.version += 1;
    }

    /// Changes points in a way that can be undone; `edit` says how many it reached.
    pub(crate) fn edit_points(&mut self, verb: &str, edit: impl FnOnce(&mut Document) -> usize) {
        let mut document = self.document().clone();
        let points = edit(&mut document);
        if points > 0 {
            self.history.record(label(verb, points), document);
            self.version += 1;
        }
    }

    /// Changes the document in a way that is not worth undoing.
    pub(crate) fn change<T>(&mut self, change: impl FnOnce(&mut Document) -> T) -> T {
        let mut document = self.document().clone();
        let result = change(&mut document);
        self.history.replace(document);
        self.version += 1;
        result
    }

    /// Changes the document in a way that outlasts undo: files come and go, inputs are shown or not.
    pub(crate) fn settle(&mut self, change: impl Fn(&mut Document)) {
        self.history.everywhere(change);
        self.version += 1;
    }

    /// Gives a layer other points.
    pub(crate) fn fill(&mut self, id: LayerId, cloud: &Arc<PointCloud>) {
        self.history.reload(id, cloud);
        self.version += 1;
    }

    /// Takes back the last edit; says which it was.
    pub(crate) fn undo(&mut self) -> Option<String> {
        self.version += 1;
        self.history.undo()
    }

    /// Does again what was taken back last; says what.
    pub(crate) fn redo(&mut self) -> Option<String> {
        self.version += 1;
        self.history.redo()
    }
}
