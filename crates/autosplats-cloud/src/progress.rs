//! How a caller follows and cancels long work.

use std::path::Path;

use crate::{Error, PointCloud, one_line};

/// Receives the progress and the notes of reading or writing, and may cancel the work.
///
/// `()` implements the trait: it reports nothing and never cancels.
///
/// # Examples
///
/// ```
/// use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
///
/// use autosplats_cloud::{Error, PointCloud, Progress, glam::DVec3};
///
/// struct Terminal {
///     stop: AtomicBool,
/// }
///
/// impl Progress for Terminal {
///     fn report(&self, fraction: f32) {
///         eprint!("\r{:3.0} %", 100.0 * fraction);
///     }
///
///     fn cancelled(&self) -> bool {
///         self.stop.load(Relaxed)
///     }
///
///     fn note(&self, note: &str) {
///         eprintln!("note: {note}");
///     }
/// }
///
/// let terminal = Terminal { stop: AtomicBool::new(false) };
/// let mut cloud = PointCloud::new(DVec3::ZERO, vec![[0.0; 3]; 9]);
/// cloud.thin_by_voxel(1.0, &terminal)?;
/// assert_eq!(cloud.len(), 1);
/// terminal.stop.store(true, Relaxed);
/// assert!(matches!(cloud.thin_by_voxel(1.0, &terminal), Err(Error::Cancelled)));
/// # Ok::<(), Error>(())
/// ```
pub trait Progress: Sync {
    /// Called now and then with the finished fraction of the work, 0 to 1, which never falls.
    fn report(&self, fraction: f32);

    /// Whether to stop; asked many times a second. Cancelled work ends with [`Error::Cancelled`].
    fn cancelled(&self) -> bool {
        false
    }

    /// Reports `fraction`, unless the work is cancelled.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    fn tick(&self, fraction: f32) -> Result<(), Error> {
        if self.cancelled() {
            return Err(Error::Cancelled);
        }
        self.report(fraction);
        Ok(())
    }

    /// Called with a note for the user that is no error: what was dropped, guessed or cannot be kept. A note is one
    /// line, without the file's name.
    fn note(&self, _note: &str) {}

    /// Called with a note on what the input should have and has lost, because it is cut off or damaged. By default a
    /// [note](Self::note) like others.
    fn loss(&self, loss: &str) {
        self.note(loss);
    }

    /// Whether [`chunk`](Self::chunk) shall be called.
    fn wants_chunks(&self) -> bool {
        false
    }

    /// Called with points while the file is read, in the file's order, about a million at a time.
    ///
    /// Chunks are a preview. Each has its own origin, colours scaled by that chunk alone, and still contains points
    /// without a return. The vertices of OBJ, STL and glTF come without attributes, once all of them are known. Depth
    /// images have no chunks. The cloud that reading returns is the result.
    fn chunk(&self, _points: PointCloud) {}
}

impl Progress for () {
    fn report(&self, _fraction: f32) {}
}

/// Tells what an input has lost, because it is cut off or damaged: as a [loss](Progress::loss), or as an error if only
/// whole inputs are taken.
///
/// # Errors
/// [`Error::Malformed`] at `place`, if `whole`.
pub fn tell_loss(path: &Path, place: &str, loss: &str, whole: bool, progress: &dyn Progress) -> Result<(), Error> {
    if whole {
        return Err(Error::malformed(path, place, format!("{loss}; --salvage takes what is left")));
    }
    progress.loss(&one_line(loss));
    Ok(())
}

/// Progress of one step of the work: maps the step's 0 to 1 to a range of the whole. Passes no chunks on.
pub struct Part<'a> {
    /// Progress of the whole work.
    pub whole: &'a dyn Progress,
    /// Fraction of the whole at which the step begins.
    pub start: f32,
    /// Fraction of the whole that the step takes.
    pub len: f32,
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

    fn loss(&self, loss: &str) {
        self.whole.loss(loss);
    }
}
