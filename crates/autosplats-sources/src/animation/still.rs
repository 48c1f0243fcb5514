//! Scenes over time, and clouds and meshes that do not move.

use std::sync::{Arc, OnceLock};

use autosplats_cloud::{Contents, Error, PointCloud, Progress};
use autosplats_scenes::{Scene, Surface};

use super::frames::Frames;
use crate::Timeline;

/// Length of the timeline of a static scene, in seconds.
const STATIC_SECONDS: f64 = 10.0;

/// A built-in scene.
pub(super) struct MovingScene {
    scene: Scene,
    count: usize,
    timeline: Timeline,
    /// The points, cached if the scene is static.
    still: OnceLock<Arc<PointCloud>>,
}

impl MovingScene {
    pub(super) fn new(scene: &Scene, count: usize, fps: f64) -> Result<Self, Error> {
        let seconds = if scene.is_animated() { Scene::PERIOD } else { STATIC_SECONDS };
        let frames = (seconds * fps).round().max(1.0) as usize;
        // Rejects an invalid rate before frames are counted.
        Timeline::even(0, fps)?;
        let timeline = Timeline::even(frames, frames as f64 / seconds)?;
        Ok(Self { scene: scene.clone(), count, timeline, still: OnceLock::new() })
    }

    fn at(&self, frame: usize) -> Scene {
        if !self.scene.is_animated() {
            // Clones share the prepared data.
            self.scene.prepare();
            return self.scene.clone();
        }
        let stamp = self.timeline.stamps().get(frame).copied().unwrap_or_default();
        self.scene.at(self.scene.seconds() + stamp as f64 / 1e9)
    }
}

impl Frames for MovingScene {
    fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    fn read(&self, frame: usize, progress: &dyn Progress) -> Result<Vec<Arc<PointCloud>>, Error> {
        if let Some(cloud) = self.still.get() {
            return Ok(vec![Arc::clone(cloud)]);
        }
        let cloud = Arc::new(self.at(frame).sample(self.count, progress)?);
        if !self.scene.is_animated() {
            // Another thread may have stored its result first; both results are the same.
            return Ok(vec![self.still.get_or_init(|| cloud).clone()]);
        }
        Ok(vec![cloud])
    }

    fn surface(&self, frame: usize, _: &dyn Progress) -> Result<Surface, Error> {
        Ok(Surface::Scene(self.at(frame)))
    }
}

/// A cloud or a mesh that does not move.
pub(super) struct Still {
    contents: Arc<Contents>,
    timeline: Timeline,
}

impl Still {
    pub(super) fn new(contents: Contents) -> Self {
        Self { contents: Arc::new(contents), timeline: Timeline::new(vec![0]) }
    }
}

impl Frames for Still {
    fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    fn read(&self, _: usize, _: &dyn Progress) -> Result<Vec<Arc<PointCloud>>, Error> {
        Ok(vec![Arc::new(self.contents.cloud.clone())])
    }

    fn surface(&self, _: usize, _: &dyn Progress) -> Result<Surface, Error> {
        Ok(Surface::Mesh(Arc::clone(&self.contents)))
    }
}
