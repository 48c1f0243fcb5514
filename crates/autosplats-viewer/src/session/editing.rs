//! The open document and its changes: with an undo step, without one, and to the whole history.

use std::collections::HashMap;
use std::sync::Arc;

use autosplats::cloud::PointCloud;

use crate::session::document::label;
use crate::session::{ClipBox, Counts, Document, LayerId, Session};

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

impl Session {
    pub(crate) fn document(&self) -> &Document {
        self.history.current()
    }

    /// Counts the points again, if the document has changed and no change to it is unfinished.
    pub(crate) fn count(&mut self) {
        if self.counted.version != self.version && self.clip_before.is_none() {
            let document = self.document();
            self.counted = CachedCounts {
                version: self.version,
                all: document.counts(),
                layers: document.layers.iter().map(|layer| (layer.id, document.counts_of(layer))).collect(),
                bytes: document.layers.iter().map(|layer| layer.cloud.byte_len()).sum(),
                old_bytes: self.history.old_bytes(),
            };
        }
    }

    /// Point counts of the document and of each layer, as of the last [`count`](Self::count).
    pub(crate) fn counts(&self) -> &CachedCounts {
        &self.counted
    }

    /// Changes the document as an undo step.
    pub(crate) fn edit<T>(&mut self, label: impl Into<String>, edit: impl FnOnce(&mut Document) -> T) {
        let mut document = self.document().clone();
        edit(&mut document);
        self.history.record(label, document);
        self.version += 1;
    }

    /// Changes points as an undo step. `edit` returns the number of points that it changed; with 0 there is no step.
    pub(crate) fn edit_points(&mut self, verb: &str, edit: impl FnOnce(&mut Document) -> usize) {
        let mut document = self.document().clone();
        let points = edit(&mut document);
        if points > 0 {
            self.history.record(label(verb, points), document);
            self.version += 1;
        }
    }

    /// Changes the document without an undo step.
    pub(crate) fn change<T>(&mut self, change: impl FnOnce(&mut Document) -> T) -> T {
        let mut document = self.document().clone();
        let result = change(&mut document);
        self.history.replace(document);
        self.version += 1;
        result
    }

    /// Changes the document and its whole history, for changes that undo must keep: files that come and go, and
    /// visibility.
    pub(crate) fn settle<T>(&mut self, change: impl Fn(&mut Document) -> T) {
        self.history.everywhere(change);
        self.version += 1;
    }

    /// Replaces the points of a layer.
    pub(crate) fn fill(&mut self, id: LayerId, cloud: &Arc<PointCloud>) {
        self.history.reload(id, cloud);
        self.version += 1;
    }

    /// Undoes the last edit and returns its label.
    pub(crate) fn undo(&mut self) -> Option<String> {
        self.version += 1;
        self.history.undo()
    }

    /// Redoes the edit that was undone last and returns its label.
    pub(crate) fn redo(&mut self) -> Option<String> {
        self.version += 1;
        self.history.redo()
    }

    /// Sets the clipping box, until [`settle_clip`](Self::settle_clip) makes an undo step of it.
    pub(crate) fn preview_clip(&mut self, clip: Option<ClipBox>) {
        let before = self.document().clip;
        if clip != before {
            self.clip_before.get_or_insert(before);
            self.change(|document| document.clip = clip);
        }
    }

    /// Whether a change to the clipping box is no undo step yet.
    pub(crate) fn is_clip_unsettled(&self) -> bool {
        self.clip_before.is_some()
    }

    /// Combines all changes to the clipping box since the last call into one undo step.
    pub(crate) fn settle_clip(&mut self) {
        let Some(before) = self.clip_before.take() else { return };
        let clip = self.document().clip;
        if clip == before {
            return;
        }
        self.change(|document| document.clip = before);
        self.edit("Clipping box", |document| document.clip = clip);
    }

    /// Switches the clipping box on or off. Without one, a box around everything is created. Returns whether the box
    /// is on; `None` if there are no points to clip.
    pub(crate) fn switch_clip(&mut self) -> Option<bool> {
        let clip = match self.document().clip {
            Some(clip) => ClipBox { enabled: !clip.enabled, ..clip },
            None => self.document().whole_bounds().map(|[min, max]| ClipBox::new(min, max))?,
        };
        self.preview_clip(Some(clip));
        self.settle_clip();
        Some(clip.enabled)
    }
}
