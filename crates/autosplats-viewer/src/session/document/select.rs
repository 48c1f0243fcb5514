//! The selection: the points that the next edit changes.

use super::{Bits, Document, ShownCloud};

/// How new hits change the selection.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum SelectMode {
    /// Selects exactly the hits.
    #[default]
    Replace,
    /// Adds the hits.
    Add,
    /// Removes the hits.
    Subtract,
    /// Keeps only the selected points that are hit.
    Intersect,
}

impl Document {
    /// Changes the selection by the shown points whose index `hits` accepts. Points that are not shown are not hit.
    pub(crate) fn select(&mut self, shown: &ShownCloud, hits: impl Fn(usize) -> bool + Sync, mode: SelectMode) {
        for layer in &mut self.layers {
            let part = shown.part(layer.id).filter(|_| layer.is_editable());
            let hit = part.map(|part| part.bits(layer.cloud.len(), &hits)).unwrap_or_default();
            let selected = &mut layer.edits.selected;
            *selected = match mode {
                SelectMode::Replace => hit,
                SelectMode::Add => selected.or(&hit),
                SelectMode::Subtract => selected.without(&hit),
                SelectMode::Intersect => selected.without(&selected.without(&hit)),
            };
        }
    }

    /// Selects exactly the shown points.
    pub(crate) fn select_all(&mut self, shown: &ShownCloud) {
        self.select(shown, |_| true, SelectMode::Replace);
    }

    pub(crate) fn select_none(&mut self) {
        for layer in &mut self.layers {
            layer.edits.selected = Bits::default();
        }
    }

    /// Selects exactly the shown points that are not selected.
    pub(crate) fn select_inverse(&mut self, shown: &ShownCloud) {
        let selected = shown.selected(self);
        self.select(shown, |index| !selected.get(index), SelectMode::Replace);
    }
}
