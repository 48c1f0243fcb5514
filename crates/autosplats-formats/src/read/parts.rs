//! Files that are read in parts.

use std::path::Path;

use autosplats_cloud::{Clouds, Error, PointCloud, Progress};

use super::{ReadOptions, las::LasParts};

/// A file whose points are passed on in parts, in memory for a few of them.
pub struct Parts(LasParts);

/// Opens a file to read it in parts.
///
/// # Errors
/// Those of [`read_with`](crate::read_with).
pub fn open_parts(path: &Path, options: &ReadOptions, progress: &dyn Progress) -> Result<Option<Parts>, Error> {
    Ok(LasParts::open(path, options, progress)?.map(Parts))
}

impl Clouds for Parts {
    fn name(&self) -> &Path {
        self.0.name()
    }

    fn points(&self) -> Option<u64> {
        self.0.points()
    }

    fn read(
        &self,
        progress: &dyn Progress,
        take: &mut dyn FnMut(&PointCloud) -> Result<(), Error>,
    ) -> Result<(), Error> {
        self.0.read(progress, take)
    }
}
