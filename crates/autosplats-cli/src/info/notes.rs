//! Notes that reading an input leaves for its report.

use std::sync::{Mutex, PoisonError};

use autosplats_cloud::Progress;

use crate::progress::Bar;

/// Passes progress to the terminal and collects notes for the report.
pub(super) struct NoteCollector<'a> {
    bar: &'a Bar,
    notes: Mutex<Vec<String>>,
}

impl Progress for NoteCollector<'_> {
    fn report(&self, fraction: f32) {
        self.bar.report(fraction);
    }

    fn cancelled(&self) -> bool {
        self.bar.cancelled()
    }

    fn note(&self, note: &str) {
        self.notes.lock().unwrap_or_else(PoisonError::into_inner).push(note.into());
    }
}

impl<'a> NoteCollector<'a> {
    pub(super) fn new(bar: &'a Bar) -> Self {
        Self { bar, notes: Mutex::default() }
    }

    /// The notes so far.
    pub(super) fn notes(self) -> Vec<String> {
        self.notes.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}
