//! Frames that are all known.

use std::sync::Arc;

use autosplats_cloud::{Error, PointCloud, Progress};
use autosplats_scenes::Surface;

use crate::Timeline;

/// Random access to the frames of an animation.
pub(crate) trait Frames: Send + Sync {
    fn timeline(&self) -> &Timeline;

    /// Number of sensors, each with its own points in every frame.
    fn channels(&self) -> usize {
        1
    }

    /// The points of a frame, one cloud per channel.
    fn read(&self, frame: usize, progress: &dyn Progress) -> Result<Vec<Arc<PointCloud>>, Error>;

    /// The surface under the points of a frame, if known.
    fn surface(&self, _frame: usize, _progress: &dyn Progress) -> Result<Surface, Error> {
        Err(Error::NoSurface)
    }
}
