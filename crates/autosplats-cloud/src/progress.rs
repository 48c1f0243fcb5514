//! How a caller follows and stops long work.

use crate::{Error, PointCloud};

/// Told how far reading or writing has come and what was noticed, and asked whether to go on.
///
/// `()` implements it: nothing is reported and nothing is cancelled.
pub trait Progress: Sync {
    /// Called now and then with the part of the work that is done, 0 to 1, never falling.
    fn report(&self, fraction: f32);

    /// Whether to stop; asked many times a second. The work then ends with [`Error::Cancelled`].
    fn cancelled(&self) -> bool {
        false
    }

    /// Called with what the user should know though it is no error: what was dropped, guessed or cannot be kept. One
    /// line, without the file's name.
    fn note(&self, _note: &str) {}

    /// Whether [`chunk`](Self::chunk) is to be called.
    fn wants_chunks(&self) -> bool {
        false
    }

    /// Called with points as they are read, in the file's order, about a million at a time, so that they can be shown
    /// before the file ends.
    ///
    /// Chunks are a preview: each has its own origin, colours are scaled by the chunk alone, and points without a return
    /// are still there. The vertices of OBJ, STL and glTF come without their attributes and when all of them are known;
    /// depth images, each of which is one picture, come only whole. The cloud that reading returns in the end is the
    /// result.
    fn chunk(&self, _points: PointCloud) {}
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

/// A part of some work, which reports for itself from 0 to 1.
pub(crate) struct Part<'a> {
    pub(crate) whole: &'a dyn Progress,
    pub(crate) start: f32,
    pub(crate) len: f32,
}

impl Progress for Part<'_> {
    fn report(&self, fraction: f32) {
        self.whole.report(self.start + self.len * fraction);
    }

    fn cancelled(&self) -> bool {
        self.whole.cancelled()
    }

    fn note(&self, note: &str) {
        self.whole.note(note);
    }
}
