//! Reports progress from several threads without ever falling.

use std::sync::{Mutex, PoisonError};

use autosplats_cloud::Progress;

use crate::Error;

/// Reports to one [`Progress`] from any thread.
pub(super) struct Ticker<'a> {
    progress: &'a dyn Progress,
    reported: Mutex<f32>,
}

impl<'a> Ticker<'a> {
    pub(super) fn new(progress: &'a dyn Progress) -> Self {
        Self { progress, reported: Mutex::new(f32::NEG_INFINITY) }
    }

    /// Reports `fraction` unless more was reported already. Fails if the caller cancels.
    pub(super) fn tick(&self, fraction: f32) -> Result<(), Error> {
        if self.progress.cancelled() {
            return Err(Error::Cancelled);
        }
        let mut reported = self.reported.lock().unwrap_or_else(PoisonError::into_inner);
        if fraction > *reported {
            *reported = fraction;
            self.progress.report(fraction);
        }
        Ok(())
    }
}
