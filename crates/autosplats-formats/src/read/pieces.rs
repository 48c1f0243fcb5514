//! Points in pieces: what a format's reader gives if it can read a file so.

use autosplats_cloud::{Crs, Error, PointCloud};

use super::{Job, opened::Reader};

/// A file whose points are passed on in pieces, after what all of them tell is settled.
pub(super) trait Pieces: Send + Sync {
    /// Passes on all points, in the file's order. Previews and notes are not given.
    ///
    /// # Errors
    /// Those of `take` and of reading.
    fn read(
        &self,
        job: &Job<'_>,
        file: &Reader<'_>,
        take: &mut dyn FnMut(PointCloud, Option<usize>) -> Result<(), Error>,
    ) -> Result<(), Error>;
}

/// Points in pieces, and what is known of all of them.
pub(super) struct Opening {
    pub(super) pieces: Box<dyn Pieces>,
    /// All points.
    pub(super) seen: Seen,
    /// The points of each scan. Each piece is of one scan, or of none.
    pub(super) scans: Vec<Seen>,
    pub(super) crs: Crs,
}

/// Numbers of points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Seen {
    pub(super) points: usize,
    /// Those at (0, 0, 0).
    pub(super) at_zero: usize,
}
