//! How a caller follows and stops long work.

use crate::Error;

/// Told how far reading or writing has come, and asked whether to go on.
///
/// `()` implements it: nothing is reported and nothing is cancelled.
pub trait Progress: Sync {
    /// Called now and then with the part of the work that is done, 0 to 1, never falling.
    fn report(&self, fraction: f32);

    /// Whether to stop; asked many times a second. The work then ends with [`Error::Cancelled`].
    fn cancelled(&self) -> bool {
        false
    }
}

impl Progress for () {
    fn report(&self, _fraction: f32) {}
}

/// Reports `fraction` and stops if the caller wants that.
pub(crate) fn tick(progress: &dyn Progress, fraction: f32) -> Result<(), Error> {
    if progress.cancelled() {
        return Err(Error::Cancelled);
    }
    progress.report(fraction);
    Ok(())
}
