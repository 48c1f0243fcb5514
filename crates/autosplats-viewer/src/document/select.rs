//! Which points the next edit is about.

use super::{Bits, Document, Shown};

/// How what is pointed at changes what was selected before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum SelectMode {
    /// Selects these and nothing else.
    #[default]
    Replace,
    /// Selects these, too.
    Add,
    /// Selects these no longer.
    Subtract,
    /// Selects of those selected before only these.
    Intersect,
}

impl Document {
    /// Selects the shown points that `hits` says yes to, by their index. What is not shown is not hit.
    pub(crate) fn select(&mut self, shown: &Shown, hits: impl Fn(usize) -> bool + Sync, mode: SelectMode) {
        for layer in &mut self.layers {
            let part = shown.part(layer.id).filter(|_| !layer.incomplete);
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

    /// Selects all shown points and nothing else.
    pub(crate) fn select_all(&mut self, shown: &Shown) {
        self.select(shown, |_| true, SelectMode::Replace);
    }

    /// Selects nothing.
    pub(crate) fn select_none(&mut self) {
        for layer in &mut self.layers {
            layer.edits.selected = Bits::default();
        }
    }

    /// Selects the shown points that are not selected, and nothing else.
    pub(crate) fn select_inverse(&mut self, shown: &Shown) {
        let selected = shown.selected(self);
        self.select(shown, |index| !selected.get(index), SelectMode::Replace);
    }
}
