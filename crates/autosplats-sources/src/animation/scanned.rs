//! Scans of moving surfaces, one channel per scanner.

use std::sync::Arc;

use autosplats_cloud::{Error, PointCloud, Progress};
use autosplats_scenes::{Scanners, Surface};

use super::frames::Frames;
use crate::Timeline;

/// What scanners see of the surface of each frame.
pub(super) struct Scanned {
    frames: Arc<dyn Frames>,
    scanners: Scanners,
}

impl Scanned {
    pub(super) fn new(frames: Arc<dyn Frames>, scanners: Scanners) -> Self {
        Self { frames, scanners }
    }
}

impl Frames for Scanned {
    fn timeline(&self) -> &Timeline {
        self.frames.timeline()
    }

    fn channels(&self) -> usize {
        self.scanners.len()
    }

    fn read(&self, frame: usize, progress: &dyn Progress) -> Result<Vec<Arc<PointCloud>>, Error> {
        self.scanners.scan(self.frames.surface(frame, progress)?, frame, progress)
    }

    fn surface(&self, frame: usize, progress: &dyn Progress) -> Result<Surface, Error> {
        self.frames.surface(frame, progress)
    }
}
