//! Points sampled on moving surfaces.

use std::sync::Arc;

use autosplats_cloud::{Contents, Error, PointCloud, Progress, SurfaceSamples};
use autosplats_scenes::Surface;

use super::frames::Frames;
use crate::Timeline;

/// Fixed seed, so that all frames have the same samples.
const SEED: u64 = 1;

/// `count` points on the surface of each frame.
pub(super) struct Sampled {
    frames: Arc<dyn Frames>,
    count: usize,
    /// The samples on the first frame's mesh, and that mesh.
    first: Option<(SurfaceSamples, Arc<Contents>)>,
}

impl Sampled {
    pub(super) fn new(frames: Arc<dyn Frames>, count: usize, progress: &dyn Progress) -> Result<Self, Error> {
        let first = match frames.surface(0, progress)? {
            Surface::Scene(_) => None,
            Surface::Mesh(mesh) => Some((SurfaceSamples::new(&mesh, count, SEED, progress)?, mesh)),
        };
        Ok(Self { frames, count, first })
    }

    fn on(&self, mesh: &Contents, progress: &dyn Progress) -> Result<PointCloud, Error> {
        match &self.first {
            Some((samples, first)) if samples.fits(mesh.cloud.len()) && first.triangles == mesh.triangles => {
                samples.on(&mesh.cloud, progress)
            }
            _ => SurfaceSamples::new(mesh, self.count, SEED, progress)?.on(&mesh.cloud, progress),
        }
    }
}

impl Frames for Sampled {
    fn timeline(&self) -> &Timeline {
        self.frames.timeline()
    }

    fn read(&self, frame: usize, progress: &dyn Progress) -> Result<Vec<Arc<PointCloud>>, Error> {
        Ok(vec![Arc::new(match self.frames.surface(frame, progress)? {
            Surface::Scene(scene) => scene.sample(self.count, progress)?,
            Surface::Mesh(mesh) => self.on(&mesh, progress)?,
        })])
    }

    fn surface(&self, frame: usize, progress: &dyn Progress) -> Result<Surface, Error> {
        self.frames.surface(frame, progress)
    }
}
