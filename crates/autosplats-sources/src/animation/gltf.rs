//! Animated glTF files.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use autosplats_cloud::{Bytes, Contents, Error, PointCloud, Progress, check_memory};
use autosplats_formats::{gltf_animation, read_gltf_at};
use autosplats_scenes::Surface;

use super::frames::Frames;
use crate::Timeline;

/// Largest number of frames of an animation. Files that claim more are likely damaged.
const MAX_FRAMES: f64 = 1e6;

/// The first animation of a glTF, sampled at equal time steps.
pub(super) struct Gltf {
    path: PathBuf,
    /// Content of the file, kept in memory so that all frames come from one version of it.
    bytes: Vec<u8>,
    timeline: Timeline,
}

impl Gltf {
    pub(super) fn open(path: &Path, fps: f64, progress: &dyn Progress) -> Result<Self, Error> {
        let file = Bytes::open(path)?;
        check_memory("the content of the file", file.len() as u64)?;
        let bytes = file.to_vec();
        let bytes = file.checked(Ok(bytes))?;
        let no_frames = |why: &str| Error::NoFrames { name: path.display().to_string(), why: why.into() };
        let Some((seconds, animations)) = gltf_animation(path, &bytes)? else {
            return Err(no_frames("it has no animation"));
        };
        if animations > 1 {
            progress.note(&format!("the first of {animations} animations is played"));
        }
        Timeline::even(0, fps)?;
        let frames = (seconds * fps).round().max(1.0);
        if !(frames <= MAX_FRAMES) {
            return Err(no_frames(&format!("its animation of {seconds} s has more than {MAX_FRAMES} frames")));
        }
        let timeline = Timeline::even(frames as usize, fps)?;
        Ok(Self { path: path.into(), bytes, timeline })
    }

    fn mesh(&self, frame: usize, progress: &dyn Progress) -> Result<Contents, Error> {
        let stamp = self.timeline.stamps().get(frame).copied().unwrap_or_default();
        read_gltf_at(&self.path, &self.bytes, stamp as f64 / 1e9, progress)
    }
}

impl Frames for Gltf {
    fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    fn read(&self, frame: usize, progress: &dyn Progress) -> Result<Vec<Arc<PointCloud>>, Error> {
        Ok(vec![Arc::new(self.mesh(frame, progress)?.cloud)])
    }

    fn surface(&self, frame: usize, progress: &dyn Progress) -> Result<Surface, Error> {
        Ok(Surface::Mesh(Arc::new(self.mesh(frame, progress)?)))
    }
}
