//! Files that are read in parts, as clouds one after another.

use std::path::Path;

use autosplats_cloud::{Clouds, Error, PointCloud, Progress};

use crate::read::Parts;

impl Clouds for Parts {
    fn name(&self) -> &Path {
        self.path()
    }

    fn points(&self) -> Option<u64> {
        Some(self.points() as u64)
    }

    fn read(
        &self,
        progress: &dyn Progress,
        take: &mut dyn FnMut(&PointCloud) -> Result<(), Error>,
    ) -> Result<(), Error> {
        self.read(progress, take)
    }
}
