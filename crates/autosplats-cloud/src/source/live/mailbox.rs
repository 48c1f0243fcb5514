//! Where one thread leaves updates and another takes them: there is room for one of each channel.

use std::{
    collections::BTreeMap,
    sync::{Condvar, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use crate::{Error, Next, Progress, Statistics, Update};

/// Time between two looks at whether to stop waiting.
const LOOK: Duration = Duration::from_millis(20);

/// The newest update of each channel.
pub(super) struct Mailbox {
    /// Whether what nobody has taken yet stays until somebody does.
    all: bool,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    updates: BTreeMap<usize, Update>,
    /// What was refused last, until somebody has heard of it.
    refusal: Option<Error>,
    statistics: Statistics,
    /// Bytes of files that have come, whole or not.
    received: u64,
    ended: bool,
    abandoned: bool,
}

impl Mailbox {
    /// An empty one, in which what comes takes the place of what nobody has taken yet, or waits until `all` of that is taken.
    pub(super) fn new(all: bool) -> Self {
        Self { all, state: Mutex::default(), changed: Condvar::new() }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The state, where all are taken once `is_taken` says so or nothing will be taken any more.
    fn state_once(&self, is_taken: impl Fn(&State) -> bool) -> MutexGuard<'_, State> {
        let mut state = self.state();
        while self.all && !state.abandoned && !is_taken(&state) {
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        state
    }

    /// Leaves an update in place of the one before of its channel.
    pub(super) fn put(&self, update: Update) {
        let mut state = self.state_once(|state| !state.updates.contains_key(&update.channel));
        let replaced = state.updates.insert(update.channel, update).is_some();
        state.statistics.dropped += u64::from(replaced);
        self.changed.notify_all();
    }

    /// Counts updates that came and were passed over.
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

    /// Nothing will be put any more.
    pub(super) fn end(&self) {
        self.state().ended = true;
        self.changed.notify_all();
    }

    /// Nothing will be taken any more.
    pub(super) fn abandon(&self) {
        self.state().abandoned = true;
        self.changed.notify_all();
    }

    pub(super) fn is_abandoned(&self) -> bool {
        self.state().abandoned
    }

    /// Takes an update, waiting for it if there is none.
    pub(super) fn take(&self, patience: Duration, progress: &dyn Progress) -> Result<Next, Error> {
        let start = Instant::now();
        let mut state = self.state();
        loop {
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
            let waited = self.changed.wait_timeout(state, left.min(LOOK));
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Counts bytes that have come of a file.
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
