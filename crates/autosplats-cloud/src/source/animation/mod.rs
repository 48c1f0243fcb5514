//! Points and surfaces that move, all frames of which are known: sequences of files, animated meshes, scenes.
//!
//! # How it works
//!
//! Each kind is a [`Frames`]: it has a timeline and reads any of its frames, whichever came before. What is made of others,
//! as points strewn over a moving mesh, is one as well and asks for the surface of a frame. [`Playback`] turns any of them into
//! a [`Stream`](crate::Stream).

mod gltf;
mod playback;
mod sampled;
mod sequence;
mod still;

use std::{path::Path, sync::Arc};

use glam::DVec3;

pub use self::playback::Playback;
pub(crate) use self::sequence::{candidates, is_named_as_cloud, natural};
use super::scanner::{Scanned, Scanner};
use crate::{Axes, Contents, Error, PointCloud, Progress, ReadOptions, Scene, Timeline};

/// Points that tell how large a scene is.
const PLACED_BY: usize = 20_000;

/// Frames by their numbers.
pub(crate) trait Frames: Send + Sync {
    fn timeline(&self) -> &Timeline;

    /// Sensors, each of which has points of its own in every frame.
    fn channels(&self) -> usize {
        1
    }

    /// The points of a frame, of each channel.
    fn read(&self, frame: usize, progress: &dyn Progress) -> Result<Vec<Arc<PointCloud>>, Error>;

    /// What the points of a frame are on, if that is known.
    fn surface(&self, _frame: usize, _progress: &dyn Progress) -> Result<Surface, Error> {
        Err(Error::NoSurface)
    }
}

/// A surface at one moment.
pub(crate) enum Surface {
    Scene(Scene),
    Mesh(Arc<Contents>),
}

/// Something that moves and is known at all times: played by a [`Playback`].
#[derive(Clone)]
pub struct Animation {
    frames: Arc<dyn Frames>,
}

impl Animation {
    /// The files of a folder, or those that a pattern like `scans/frame_*.ply` stands for, of any
    /// [formats](crate::formats), `fps` of them a second, in the order of the numbers in their names.
    ///
    /// What is no cloud is left out, with one note: files of other kinds, and those without a number in their names if
    /// others have one. Files without faces are the first one's mesh if they have as many vertices.
    ///
    /// # Errors
    /// [`Error::NoFrames`] if no file is left, [`Error::Io`] and [`Error::BadValue`].
    pub fn sequence(name: &str, fps: f64, options: &ReadOptions, progress: &dyn Progress) -> Result<Self, Error> {
        Ok(Self { frames: Arc::new(sequence::Sequence::find(name, fps, options, progress)?) })
    }

    /// The first animation of a glTF, looked at `fps` times a second: morph targets and the places of nodes. Skeletons do
    /// not move.
    ///
    /// # Errors
    /// [`Error::NoFrames`] if nothing in it moves, those of [`read`](crate::read), and [`Error::BadValue`].
    pub fn gltf(path: &Path, fps: f64, progress: &dyn Progress) -> Result<Self, Error> {
        Ok(Self { frames: Arc::new(gltf::Gltf::open(path, fps, progress)?) })
    }

    /// A built-in scene of `count` points: one round of its animation, or ten seconds of one that stands still.
    ///
    /// # Errors
    /// [`Error::BadValue`] if `fps` is none.
    pub fn scene(scene: &Scene, count: usize, fps: f64) -> Result<Self, Error> {
        Ok(Self { frames: Arc::new(still::MovingScene::new(scene, count, fps)?) })
    }

    /// What does not move, for scanners to look at: a single frame.
    pub fn still(contents: Contents) -> Self {
        Self { frames: Arc::new(still::Still::new(contents)) }
    }

    /// `count` points strewn over the surface in place of a mesh's vertices or of a scene's own number. While the mesh has
    /// the same faces they stay at the same places on it.
    ///
    /// # Errors
    /// [`Error::NoSurface`] if the first frame has none, those of reading it, and [`Error::OutOfMemory`].
    pub fn sampled(&self, count: usize, progress: &dyn Progress) -> Result<Self, Error> {
        Ok(Self { frames: Arc::new(sampled::Sampled::new(Arc::clone(&self.frames), count, progress)?) })
    }

    /// What `scanners` see of the surface, each on a channel of its own. The same `seed` gives the same points.
    ///
    /// # Errors
    /// [`Error::BadValue`] for what a scanner cannot be, and [`Error::OutOfMemory`]. What has no surface fails when it is
    /// played.
    pub fn scanned(&self, scanners: Vec<Scanner>, seed: u64) -> Result<Self, Error> {
        Ok(Self { frames: Arc::new(Scanned::new(Arc::clone(&self.frames), scanners, seed)?) })
    }

    /// `count` scanners [around](Scanner::around) its first frame. Where nothing says what is up, Y is, as in models.
    ///
    /// # Errors
    /// Those of reading the first frame, and [`Error::NoSurface`].
    pub fn scanners(&self, count: usize, progress: &dyn Progress) -> Result<Vec<Scanner>, Error> {
        let surface = self.frames.surface(0, progress)?;
        let cloud = match &surface {
            Surface::Scene(scene) => &still::sample(scene, PLACED_BY, progress)?,
            Surface::Mesh(mesh) => &mesh.cloud,
        };
        let places = (0..cloud.len()).map(|index| cloud.world_position(index)).filter(|place| place.is_finite());
        let bounds = places.map(|place| [place; 2]).reduce(|[low, high], [a, b]| [low.min(a), high.max(b)]);
        let [low, high] = bounds.ok_or(Error::NoSurface)?;
        let up = match cloud.axes() {
            Some(Axes::ZUp) => DVec3::Z,
            Some(Axes::YUp) | None => DVec3::Y,
            Some(Axes::Camera) => DVec3::NEG_Y,
        };
        Ok(Scanner::around(low, high, up, count))
    }

    /// When its frames happen.
    pub fn timeline(&self) -> &Timeline {
        self.frames.timeline()
    }

    /// Plays it from the first frame on.
    pub fn play(&self) -> Playback {
        Playback::new(Arc::clone(&self.frames))
    }
}

impl std::fmt::Debug for Animation {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (frames, channels) = (self.frames.timeline().len(), self.frames.channels());
        write!(formatter, "Animation {{ frames: {frames}, channels: {channels} }}")
    }
}
