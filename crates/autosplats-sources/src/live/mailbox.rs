//! Passes updates from one thread to another, with room for one update per channel.

use std::{
    collections::BTreeMap,
    sync::{Condvar, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use autosplats_cloud::{Error, Progress};

use crate::{Next, Statistics, Update};

/// Time between two checks for cancellation.
const CHECK_INTERVAL: Duration = Duration::from_millis(20);

/// Most different notes of a stream.
const MAX_NOTES: usize = 20;

/// The newest update of each channel.
pub(super) struct Mailbox {
    /// Whether an update stays until it is taken. Otherwise a newer one replaces it.
    all: bool,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    updates: BTreeMap<usize, Update>,
    /// The last refusal that no caller has seen yet.
    refusal: Option<Error>,
    statistics: Statistics,
    /// Different notes of the readers, and whether they are of losses.
    notes: Vec<(String, bool)>,
    /// Number of notes that a caller has seen.
    told: usize,
    /// Bytes of files received, complete or not.
    received: u64,
    ended: bool,
    abandoned: bool,
}

impl Mailbox {
    /// Creates an empty mailbox. With `all`, writers wait until earlier updates are taken; otherwise they replace them.
    pub(super) fn new(all: bool) -> Self {
        Self { all, state: Mutex::default(), changed: Condvar::new() }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Locks the state. With `all`, first waits until `is_taken` holds or the mailbox is abandoned.
    fn state_once(&self, is_taken: impl Fn(&State) -> bool) -> MutexGuard<'_, State> {
        let mut state = self.state();
        while self.all && !state.abandoned && !is_taken(&state) {
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        state
    }

    /// Stores an update, which replaces an earlier one of its channel.
    pub(super) fn put(&self, update: Update) {
        let mut state = self.state_once(|state| !state.updates.contains_key(&update.channel));
        let replaced = state.updates.insert(update.channel, update).is_some();
        state.statistics.dropped += u64::from(replaced);
        self.changed.notify_all();
    }

    /// Counts updates that arrived and were skipped.
    pub(super) fn drop_updates(&self, updates: u64) {
        self.state().statistics.dropped += updates;
    }

    pub(super) fn refuse(&self, error: Error) {
        let mut state = self.state_once(|state| state.refusal.is_none());
        state.statistics.refused += 1;
        state.statistics.last_refusal = Some(error.to_string());
        state.refusal = Some(error);
        self.changed.notify_all();
    }

    /// Passes on what a reader noted, once.
    pub(super) fn note(&self, note: &str, is_loss: bool) {
        let notes = &mut self.state().notes;
        if notes.len() < MAX_NOTES && notes.iter().all(|(known, _)| known != note) {
            notes.push((note.into(), is_loss));
        }
    }

    /// Marks the end: no more updates are put.
    pub(super) fn end(&self) {
        self.state().ended = true;
        self.changed.notify_all();
    }

    /// Marks the mailbox as abandoned: no more updates are taken.
    pub(super) fn abandon(&self) {
        self.state().abandoned = true;
        self.changed.notify_all();
    }

    pub(super) fn is_abandoned(&self) -> bool {
        self.state().abandoned
    }

    /// Takes an update, and waits up to `patience` if there is none.
    pub(super) fn take(&self, patience: Duration, progress: &dyn Progress) -> Result<Next, Error> {
        let start = Instant::now();
        let mut state = self.state();
        loop {
            for (note, is_loss) in &state.notes[state.told..] {
                if *is_loss { progress.loss(note) } else { progress.note(note) }
            }
            state.told = state.notes.len();
            if let Some(refusal) = state.refusal.take() {
                self.changed.notify_all();
                return Err(refusal);
            }
            if let Some((_, update)) = state.updates.pop_first() {
                state.statistics.taken += 1;
                self.changed.notify_all();
                return Ok(Next::Update(update));
            }
            if state.ended {
                return Ok(Next::End);
            }
            let left = patience.saturating_sub(start.elapsed());
            if left.is_zero() {
                return Ok(Next::Nothing);
            }
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            let waited = self.changed.wait_timeout(state, left.min(CHECK_INTERVAL));
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Counts received bytes of a file.
    pub(super) fn receive(&self, bytes: usize) {
        self.state().received += bytes as u64;
    }

    pub(super) fn received(&self) -> u64 {
        self.state().received
    }

    pub(super) fn statistics(&self) -> Statistics {
        self.state().statistics.clone()
    }
}
