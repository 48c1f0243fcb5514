//! The open document and its changes: with an undo step, without one, and to the whole history.

use std::collections::HashMap;
use std::sync::Arc;

use autosplats::cloud::PointCloud;

use crate::app::App;
use crate::document::{Counts, Document, LayerId, label};

/// Counts that panels show, for one version of the document.
#[derive(Default)]
pub(crate) struct CachedCounts {
    version: u64,
    /// Points of all layers.
    pub(crate) all: Counts,
    /// Points of each layer.
    pub(crate) layers: HashMap<LayerId, Counts>,
    /// Bytes of all points.
    pub(crate) bytes: usize,
    /// Bytes that the undo history holds in addition.
    pub(crate) old_bytes: usize,
}

impl App {
    pub(crate) fn document(&self) -> &Document {
        self.session.history.current()
    }

    /// Version of the document; every change increases it.
    pub(crate) fn version(&self) -> u64 {
        self.session.version
    }

    /// Point counts of the document and of each layer. They are computed only after a change, and not during a drag.
    pub(crate) fn counts(&mut self) -> &CachedCounts {
        if self.session.counted.version != self.session.version && !self.ui.tools.gizmo.is_busy() {
            let document = self.document();
            self.session.counted = CachedCounts {
                version: self.session.version,
                all: document.counts(),
                layers: document.layers.iter().map(|layer| (layer.id, document.counts_of(layer))).collect(),
                bytes: document.layers.iter().map(|layer| layer.cloud.byte_len()).sum(),
                old_bytes: self.session.history.old_bytes(),
            };
        }
        &self.session.counted
    }

    /// Changes the document as an undo step.
    pub(crate) fn edit(&mut self, label: impl Into<String>, edit: impl FnOnce(&mut Document)) {
        let mut document = self.document().clone();
        edit(&mut document);
        self.session.history.record(label, document);
        self.session.version += 1;
    }

    /// Changes points as an undo step. `edit` returns the number of points that it changed; with 0 there is no step.
    pub(crate) fn edit_points(&mut self, verb: &str, edit: impl FnOnce(&mut Document) -> usize) {
        let mut document = self.document().clone();
        let points = edit(&mut document);
        if points > 0 {
            self.session.history.record(label(verb, points), document);
            self.session.version += 1;
        }
    }

    /// Changes the document without an undo step.
    pub(crate) fn change<T>(&mut self, change: impl FnOnce(&mut Document) -> T) -> T {
        let mut document = self.document().clone();
        let result = change(&mut document);
        self.session.history.replace(document);
        self.session.version += 1;
        result
    }

    /// Changes the document and its whole history, for changes that undo must keep: files that come and go, and
    /// visibility.
    pub(crate) fn settle(&mut self, change: impl Fn(&mut Document)) {
        self.session.history.everywhere(change);
        self.session.version += 1;
    }

    /// Replaces the points of a layer.
    pub(crate) fn fill(&mut self, id: LayerId, cloud: &Arc<PointCloud>) {
        self.session.history.reload(id, cloud);
        self.session.version += 1;
    }

    /// Undoes the last edit and returns its label.
    pub(crate) fn undo(&mut self) -> Option<String> {
        self.session.version += 1;
        self.session.history.undo()
    }

    /// Redoes the edit that was undone last and returns its label.
    pub(crate) fn redo(&mut self) -> Option<String> {
        self.session.version += 1;
        self.session.history.redo()
    }
}
