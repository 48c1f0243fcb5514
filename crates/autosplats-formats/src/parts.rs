//! Files that are read in parts, as inputs of an octree.

use std::path::Path;

use autosplats_cloud::{Error, PointCloud, Progress};

use crate::{read::Parts, write::Clouds};

impl Clouds for Parts {
    fn name(&self) -> &Path {
        self.path()
    }

    fn read(
        &self,
        progress: &dyn Progress,
        take: &(dyn Fn(&PointCloud) -> Result<(), Error> + Sync),
    ) -> Result<(), Error> {
        self.read(progress, &mut |cloud| take(cloud))
    }
}
