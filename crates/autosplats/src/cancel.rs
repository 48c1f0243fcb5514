//! Giving up a frame from inside its stages.

use std::sync::atomic::{AtomicBool, Ordering};

use autosplats_cloud::Progress;

use crate::Error;

/// Asks the caller of a frame whether to go on.
///
/// Stages ask once per task, which takes a few milliseconds at most. They skip the remaining tasks of a frame that is
/// given up, so their results are incomplete, and nothing may read these.
pub(crate) struct Cancel<'a> {
    go_on: &'a (dyn Fn() -> bool + Sync),
    is_given_up: AtomicBool,
}

/// Never gives up.
pub(crate) static NEVER: Cancel<'static> = Cancel::new(&|| true);

impl<'a> Cancel<'a> {
    pub(crate) const fn new(go_on: &'a (dyn Fn() -> bool + Sync)) -> Self {
        Self { go_on, is_given_up: AtomicBool::new(false) }
    }

    /// Whether the frame is given up. The caller is not asked again once it has said so.
    pub(crate) fn is_given_up(&self) -> bool {
        if self.is_given_up.load(Ordering::Relaxed) {
            return true;
        }
        let is_given_up = !(self.go_on)();
        if is_given_up {
            self.is_given_up.store(true, Ordering::Relaxed);
        }
        is_given_up
    }

    /// # Errors
    /// [`Error::Cancelled`] if the frame is given up.
    pub(crate) fn check(&self) -> Result<(), Error> {
        if self.is_given_up() { Err(Error::Cancelled) } else { Ok(()) }
    }
}

impl Progress for Cancel<'_> {
    fn report(&self, _fraction: f32) {}

    fn cancelled(&self) -> bool {
        self.is_given_up()
    }
}
