//! Moving points and surfaces whose frames are all known: sequences of files, animated meshes, scenes.
//!
//! # How it works
//!
//! Each kind implements [`Frames`]: it has a timeline and can read any of its frames in any order. Derived kinds, such
//! as points sampled on a moving mesh, implement [`Frames`] too and ask another [`Frames`] for the surface of a frame.
//! [`Playback`] turns any of them into a [`Stream`](crate::Stream).

mod frames;
mod gltf;
mod playback;
mod sampled;
mod scanned;
mod sequence;
mod still;

use std::{path::Path, sync::Arc};

use autosplats_cloud::{Axes, Contents, Error, Progress};
use autosplats_formats::ReadOptions;
use autosplats_scenes::{Scanner, Scanners, Scene, Surface};

use self::frames::Frames;
pub use self::playback::Playback;
use crate::Timeline;

/// Number of points sampled on a scene to find its size.
const EXTENT_SAMPLES: usize = 20_000;

/// A movement known at all times. A [`Playback`] plays it.
///
/// ```
/// use std::time::Duration;
///
/// use autosplats_scenes::Scene;
/// use autosplats_sources::{Animation, Next, Stream as _};
///
/// let (scene, count) = Scene::parse("figure:2K")?;
/// let animation = Animation::scene(&scene, count, 5.0)?;
/// assert_eq!(animation.timeline().len(), 10);
/// let mut playback = animation.play();
/// playback.seek(4);
/// let Next::Update(update) = playback.next(Duration::ZERO, &())? else { panic!("no frame 4") };
/// assert_eq!((update.stamp, update.cloud.len()), (800_000_000, 2000));
/// # Ok::<(), autosplats_cloud::Error>(())
/// ```
#[derive(Clone)]
pub struct Animation {
    frames: Arc<dyn Frames>,
}

impl Animation {
    /// Plays the files of a folder, or the files that match a pattern like `scans/frame_*.ply`, at `fps` frames per
    /// second. Files may have any of the [formats](autosplats_formats::formats). They are sorted by the numbers in
    /// their names.
    ///
    /// Files that are not clouds are left out, with one note. So are files without a number in their name if others
    /// have one. A file without faces gets those of the first file if both have the same number of vertices.
    ///
    /// # Errors
    /// [`Error::NoFrames`] if no file is left, [`Error::Io`] and [`Error::BadValue`].
    pub fn sequence(name: &str, fps: f64, options: &ReadOptions, progress: &dyn Progress) -> Result<Self, Error> {
        Ok(Self { frames: Arc::new(sequence::Sequence::find(name, fps, options, progress)?) })
    }

    /// Plays the first animation of a glTF, `fps` frames per second. Morph targets and nodes move, skins do not.
    ///
    /// # Errors
    /// [`Error::NoFrames`] if nothing in the file moves, those of [`read`](autosplats_formats::read), and
    /// [`Error::BadValue`].
    pub fn gltf(path: &Path, fps: f64, progress: &dyn Progress) -> Result<Self, Error> {
        Ok(Self { frames: Arc::new(gltf::Gltf::open(path, fps, progress)?) })
    }

    /// Plays a built-in scene of `count` points: one period of its animation, or ten seconds of a static scene.
    ///
    /// # Errors
    /// [`Error::BadValue`] if `fps` is out of range.
    pub fn scene(scene: &Scene, count: usize, fps: f64) -> Result<Self, Error> {
        Ok(Self { frames: Arc::new(still::MovingScene::new(scene, count, fps)?) })
    }

    /// A single frame without movement, for instance as a target for scanners.
    pub fn still(contents: Contents) -> Self {
        Self { frames: Arc::new(still::Still::new(contents)) }
    }

    /// Replaces the points by `count` samples of the surface. They stay in place on a mesh while its faces are the
    /// same.
    ///
    /// # Errors
    /// [`Error::NoSurface`] if the first frame has no surface, those of reading it, and [`Error::OutOfMemory`].
    pub fn sampled(&self, count: usize, progress: &dyn Progress) -> Result<Self, Error> {
        Ok(Self { frames: Arc::new(sampled::Sampled::new(Arc::clone(&self.frames), count, progress)?) })
    }

    /// Replaces the points by scans of the surface, one channel per scanner. The same `seed` gives the same scans.
    ///
    /// # Errors
    /// [`Error::BadValue`] for invalid properties of a scanner, and [`Error::OutOfMemory`]. An animation without a
    /// surface fails only when it is played.
    pub fn scanned(&self, scanners: Vec<Scanner>, seed: u64) -> Result<Self, Error> {
        let scanners = Scanners::new(scanners, seed)?;
        Ok(Self { frames: Arc::new(scanned::Scanned::new(Arc::clone(&self.frames), scanners)) })
    }

    /// Places `count` scanners [around](Scanner::around) the first frame. Without known axes, Y is up, as in models.
    ///
    /// # Errors
    /// Those of reading the first frame, and [`Error::NoSurface`].
    pub fn scanners(&self, count: usize, progress: &dyn Progress) -> Result<Vec<Scanner>, Error> {
        let surface = self.frames.surface(0, progress)?;
        let cloud = match &surface {
            Surface::Scene(scene) => &scene.sample(EXTENT_SAMPLES, progress)?,
            Surface::Mesh(mesh) => &mesh.cloud,
        };
        let places = (0..cloud.len()).map(|index| cloud.world_position(index)).filter(|place| place.is_finite());
        let bounds = places.map(|place| [place; 2]).reduce(|[low, high], [a, b]| [low.min(a), high.max(b)]);
        let [low, high] = bounds.ok_or(Error::NoSurface)?;
        let up = cloud.axes().unwrap_or(Axes::YUp).up();
        Ok(Scanner::around(low, high, up, count))
    }

    /// The times of the frames.
    pub fn timeline(&self) -> &Timeline {
        self.frames.timeline()
    }

    /// Plays the animation from the first frame on.
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
