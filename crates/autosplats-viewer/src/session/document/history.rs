//! Undo, redo, and which edits are unsaved.

use std::collections::{HashMap, HashSet, VecDeque};
use std::sync::Arc;

use autosplats::cloud::PointCloud;

use super::{Document, LayerId, layer::LayerChanges};

/// A document with its past and its undone versions, the nearest last in each list.
///
/// When there are too many old documents, or they take too much memory beyond that of the present one, the furthest are
/// dropped first.
#[derive(Clone, Debug)]
pub(crate) struct History {
    current: Document,
    past: VecDeque<Step>,
    future: VecDeque<Step>,
    /// The changes of each layer when it was last saved. A layer without an entry compares with how it was opened.
    saved: HashMap<LayerId, LayerChanges>,
    most_steps: usize,
    most_bytes: usize,
}

/// An edit, and the document on the other side of it.
#[derive(Clone, Debug)]
struct Step {
    label: String,
    document: Document,
}

/// Number of old documents kept.
const MOST_STEPS: usize = 200;

/// Memory of old documents beyond that of the present one, bytes.
const MOST_BYTES: usize = 1 << 30;

impl Default for History {
    fn default() -> Self {
        Self::with_limits(MOST_STEPS, MOST_BYTES)
    }
}

impl History {
    /// An empty document whose history has these limits.
    pub(crate) fn with_limits(most_steps: usize, most_bytes: usize) -> Self {
        Self {
            current: Document::default(),
            past: VecDeque::new(),
            future: VecDeque::new(),
            saved: HashMap::new(),
            most_steps,
            most_bytes,
        }
    }

    pub(crate) fn current(&self) -> &Document {
        &self.current
    }

    /// Replaces the document as an undo step. `label` says what was done.
    pub(crate) fn record(&mut self, label: impl Into<String>, document: Document) {
        let old = std::mem::replace(&mut self.current, document);
        self.past.push_back(Step { label: label.into(), document: old });
        self.future.clear();
        self.forget();
    }

    /// Replaces the document without an undo step.
    pub(crate) fn replace(&mut self, document: Document) {
        self.current = document;
        self.forget();
    }

    /// Applies `change` to the document and all its past and undone versions. It is for changes that undo must not
    /// revert, as the reading of a file.
    pub(crate) fn everywhere<T>(&mut self, change: impl Fn(&mut Document) -> T) {
        let steps = self.past.iter_mut().chain(&mut self.future).map(|step| &mut step.document);
        steps.chain([&mut self.current]).for_each(|document| {
            change(document);
        });
    }

    /// Replaces the points of a layer in all versions. Edits of single points are dropped everywhere, as the new points
    /// may be different ones.
    pub(crate) fn reload(&mut self, id: LayerId, cloud: &Arc<PointCloud>) {
        self.everywhere(|document| document.reload(id, cloud));
        self.saved.remove(&id);
    }

    /// Undoes the last step and returns its label.
    pub(crate) fn undo(&mut self) -> Option<String> {
        let Step { label, document } = self.past.pop_back()?;
        let undone = std::mem::replace(&mut self.current, document);
        self.future.push_back(Step { label: label.clone(), document: undone });
        self.forget();
        Some(label)
    }

    /// Redoes the step that was undone last and returns its label.
    pub(crate) fn redo(&mut self) -> Option<String> {
        let Step { label, document } = self.future.pop_back()?;
        let undone = std::mem::replace(&mut self.current, document);
        self.past.push_back(Step { label: label.clone(), document: undone });
        self.forget();
        Some(label)
    }

    /// Label of the step that undo would revert.
    pub(crate) fn undo_label(&self) -> Option<&str> {
        self.past.back().map(|step| &*step.label)
    }

    /// Label of the step that redo would repeat.
    pub(crate) fn redo_label(&self) -> Option<&str> {
        self.future.back().map(|step| &*step.label)
    }

    /// Memory of old documents beyond that of the present one, bytes.
    pub(crate) fn old_bytes(&self) -> usize {
        let mut known: HashSet<usize> = self.current.memory().map(|(place, _)| place).collect();
        let old = self.past.iter().chain(&self.future).flat_map(|step| step.document.memory());
        old.filter(|(place, _)| known.insert(*place)).map(|(_, bytes)| bytes).sum()
    }

    /// Whether a layer is in the document, or in a version that undo or redo would restore.
    pub(crate) fn holds(&self, id: LayerId) -> bool {
        let steps = self.past.iter().chain(&self.future).map(|step| &step.document);
        steps.chain([&self.current]).any(|document| document.layer(id).is_some())
    }

    fn forget(&mut self) {
        // The newest step is always kept: it may be a mistake that has just been made.
        while self.past.len() + self.future.len() > 1
            && (self.past.len() + self.future.len() > self.most_steps || self.old_bytes() > self.most_bytes)
        {
            let far = if self.past.len() >= self.future.len() { &mut self.past } else { &mut self.future };
            if far.pop_front().is_none() {
                return;
            }
        }
    }

    /// Whether a layer was placed, or points of it deleted or moved, since it was opened or last saved.
    pub(crate) fn is_unsaved(&self, id: LayerId) -> bool {
        self.current.layer(id).is_some_and(|layer| {
            let changes = layer.changes();
            self.saved.get(&id).map_or_else(|| changes != layer.no_changes(), |saved| changes != *saved)
        })
    }

    /// The layers with unsaved edits.
    pub(crate) fn unsaved(&self) -> impl Iterator<Item = LayerId> + '_ {
        self.current.layers.iter().map(|layer| layer.id).filter(|&id| self.is_unsaved(id))
    }

    /// Whether leaving would lose edits. Selection, visibility, colours and names do not count. Neither do removed
    /// layers, as the user is asked before removal.
    pub(crate) fn is_changed_since_saved(&self) -> bool {
        self.unsaved().next().is_some()
    }

    /// Marks a layer as saved in its state in `document`, which was the present one when writing began.
    pub(crate) fn mark_saved(&mut self, document: &Document, id: LayerId) {
        if let Some(layer) = document.layer(id) {
            self.saved.insert(id, layer.changes());
        }
    }
}

impl Document {
    /// Address and size in bytes of each part that documents may share.
    fn memory(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.layers.iter().flat_map(|layer| {
            let edits = &layer.edits;
            let sets = [&edits.selected, &edits.hidden, &edits.deleted].into_iter();
            let sets = sets.chain(edits.moves.iter().map(|(points, _)| points)).filter_map(|bits| bits.memory());
            sets.chain([(Arc::as_ptr(&layer.cloud).addr(), layer.cloud.byte_len())])
        })
    }
}

/// A label with a number of points: "Delete 1,234 points".
pub(crate) fn label(verb: &str, points: usize) -> String {
    format!("{verb} {} point{}", grouped(points), if points == 1 { "" } else { "s" })
}

/// A number with commas: "1,234".
pub(crate) fn grouped(number: usize) -> String {
    let digits = number.to_string();
    let mut grouped = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            grouped.push(',');
        }
        grouped.push(digit);
    }
    grouped
}
