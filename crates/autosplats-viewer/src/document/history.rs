//! Undoing and doing again, and what is not saved yet.

use std::collections::{HashMap, HashSet, VecDeque};
use std::sync::Arc;

use autosplats::cloud::PointCloud;

use super::{Document, LayerId, layer::Changes};

/// A document with those it was before, newest last, and those that were undone.
///
/// Old documents are forgotten, those furthest away first, when there are too many of them or when they take too much
/// memory that the present one does not need.
#[derive(Clone, Debug)]
pub(crate) struct History {
    current: Document,
    past: VecDeque<Step>,
    future: VecDeque<Step>,
    /// What each layer's changes were when it was last written; as it was opened, if it never was.
    saved: HashMap<LayerId, Changes>,
    most_steps: usize,
    most_bytes: usize,
}

/// What was done, and the document on the other side of it.
#[derive(Clone, Debug)]
struct Step {
    label: String,
    document: Document,
}

/// Documents kept.
const MOST_STEPS: usize = 200;

/// Bytes that old documents may take beyond the present one.
const MOST_BYTES: usize = 1 << 30;

impl Default for History {
    fn default() -> Self {
        Self::with_limits(MOST_STEPS, MOST_BYTES)
    }
}

impl History {
    /// An empty document that keeps so many old ones and so many bytes for them.
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

    /// The document as it is.
    pub(crate) fn current(&self) -> &Document {
        &self.current
    }

    /// Puts a document in the place of the present one, which can be had back. `label` says what was done to it.
    pub(crate) fn record(&mut self, label: impl Into<String>, document: Document) {
        let old = std::mem::replace(&mut self.current, document);
        self.past.push_back(Step { label: label.into(), document: old });
        self.future.clear();
        self.forget();
    }

    /// Puts a document in the place of the present one without a step, for what nobody would undo.
    pub(crate) fn replace(&mut self, document: Document) {
        self.current = document;
        self.forget();
    }

    /// Changes the document and all it was and would be again: for what is no step, as a file that has been read, and has to
    /// outlast undoing those that are.
    pub(crate) fn everywhere(&mut self, change: impl Fn(&mut Document)) {
        let steps = self.past.iter_mut().chain(&mut self.future).map(|step| &mut step.document);
        steps.chain([&mut self.current]).for_each(change);
    }

    /// Gives a layer the points that its file has now; what was done to single points, ever, is forgotten, as they may be
    /// others.
    pub(crate) fn reload(&mut self, id: LayerId, cloud: &Arc<PointCloud>) {
        self.everywhere(|document| document.reload(id, cloud));
        self.saved.remove(&id);
    }

    /// Takes back the last step; says which.
    pub(crate) fn undo(&mut self) -> Option<String> {
        let Step { label, document } = self.past.pop_back()?;
        let undone = std::mem::replace(&mut self.current, document);
        self.future.push_back(Step { label: label.clone(), document: undone });
        self.forget();
        Some(label)
    }

    /// Does again what was undone last; says what.
    pub(crate) fn redo(&mut self) -> Option<String> {
        let Step { label, document } = self.future.pop_back()?;
        let undone = std::mem::replace(&mut self.current, document);
        self.past.push_back(Step { label: label.clone(), document: undone });
        self.forget();
        Some(label)
    }

    /// What undoing would take back.
    pub(crate) fn undo_label(&self) -> Option<&str> {
        self.past.back().map(|step| &*step.label)
    }

    /// What would be done again.
    pub(crate) fn redo_label(&self) -> Option<&str> {
        self.future.back().map(|step| &*step.label)
    }

    /// Bytes that old documents take and the present one does not need.
    pub(crate) fn old_bytes(&self) -> usize {
        let mut known: HashSet<usize> = self.current.memory().map(|(place, _)| place).collect();
        let old = self.past.iter().chain(&self.future).flat_map(|step| step.document.memory());
        old.filter(|(place, _)| known.insert(*place)).map(|(_, bytes)| bytes).sum()
    }

    /// Whether a layer is in the document, or would be again by undoing or doing again.
    pub(crate) fn holds(&self, id: LayerId) -> bool {
        let steps = self.past.iter().chain(&self.future).map(|step| &step.document);
        steps.chain([&self.current]).any(|document| document.layer(id).is_some())
    }

    fn forget(&mut self) {
        // The newest step is kept whatever it takes: it has just been done, and may have been a mistake.
        while self.past.len() + self.future.len() > 1
            && (self.past.len() + self.future.len() > self.most_steps || self.old_bytes() > self.most_bytes)
        {
            let far = if self.past.len() >= self.future.len() { &mut self.past } else { &mut self.future };
            if far.pop_front().is_none() {
                return;
            }
        }
    }

    /// Whether points of a layer were deleted or moved, or the layer was, since it was opened or last saved.
    pub(crate) fn is_unsaved(&self, id: LayerId) -> bool {
        self.current.layer(id).is_some_and(|layer| {
            let changes = layer.changes();
            self.saved.get(&id).map_or_else(|| changes != layer.no_changes(), |saved| changes != *saved)
        })
    }

    /// The layers that have edits which are in no file.
    pub(crate) fn unsaved(&self) -> impl Iterator<Item = LayerId> + '_ {
        self.current.layers.iter().map(|layer| layer.id).filter(|&id| self.is_unsaved(id))
    }

    /// Whether anything would be lost by leaving. Selecting, hiding, colours and names are nothing that is lost; a layer
    /// that was removed was to be asked about then.
    pub(crate) fn is_changed_since_saved(&self) -> bool {
        self.unsaved().next().is_some()
    }

    /// States that a file has a layer as it is in `document`, which was the present one when writing began.
    pub(crate) fn mark_saved(&mut self, document: &Document, id: LayerId) {
        if let Some(layer) = document.layer(id) {
            self.saved.insert(id, layer.changes());
        }
    }
}

impl Document {
    /// All that is shared with other documents: where it lies in memory, and how many bytes it takes.
    fn memory(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.layers.iter().flat_map(|layer| {
            let edits = &layer.edits;
            let sets = [&edits.selected, &edits.hidden, &edits.deleted].into_iter();
            let sets = sets.chain(edits.moves.iter().map(|(points, _)| points)).filter_map(|bits| bits.memory());
            sets.chain([(Arc::as_ptr(&layer.cloud).addr(), layer.cloud.byte_len())])
        })
    }
}

/// What was done to how many points, as a label: "Delete 1,234 points".
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
