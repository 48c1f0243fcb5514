//! What both threads that read live points have in common.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
    time::SystemTime,
};

use autosplats_cloud::{Error, Progress};
use autosplats_formats::ReadOptions;

use super::mailbox::Mailbox;

/// Options of [`Live::bytes`](super::Live::bytes).
#[derive(Clone, Debug, PartialEq)]
pub struct LiveOptions {
    /// How to read a frame.
    pub read: ReadOptions,
    /// Maximum size of a frame in bytes. Larger frames are refused. Default 1 GiB.
    pub max_frame_bytes: usize,
    /// Whether every frame is read. If true, the writer waits until frames are taken. If false, the default, frames
    /// that nobody takes in time are dropped.
    pub all: bool,
}

impl Default for LiveOptions {
    fn default() -> Self {
        Self { read: ReadOptions::default(), max_frame_bytes: 1 << 30, all: false }
    }
}

/// Runs `work` and turns a panic into an error, so that no thread ends silently.
pub(super) fn guarded<T>(name: &Path, work: impl FnOnce() -> Result<T, Error>) -> Result<T, Error> {
    // Unwind safety: state left half done belongs to the failed frame, and no later frame uses it.
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let said = panic.downcast_ref::<&str>().map(|said| (*said).to_owned());
        let said = said.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_default();
        let what = format!("reading failed because of a bug in this program, please report it: {said}");
        Err(Error::unsupported(name, what))
    })
}

/// Current time in nanoseconds since 1970.
pub(super) fn now() -> i64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}

/// Cancels once the mailbox is abandoned, and passes notes to it.
pub(super) struct UntilAbandoned<'a>(pub(super) &'a Mailbox);

impl Progress for UntilAbandoned<'_> {
    fn report(&self, _: f32) {}

    fn cancelled(&self) -> bool {
        self.0.is_abandoned()
    }

    fn note(&self, note: &str) {
        self.0.note(note, false);
    }

    fn loss(&self, loss: &str) {
        self.0.note(loss, true);
    }
}
