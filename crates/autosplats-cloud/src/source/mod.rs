//! Where clouds come from.

pub mod point_cloud2;
pub(crate) mod recording;
#[cfg(feature = "zenoh")]
pub mod remote;
pub(crate) mod scene;
pub(crate) mod stream;
pub(crate) mod wire;

use std::path::{Path, PathBuf};

use crate::{Error, PointCloud, Progress, ReadOptions, Scene, read_with};

/// What begins the name of a generated scene.
const SCENE_PREFIX: &str = "scene:";
/// Bytes that a generated point takes: position and colour.
const BYTES_PER_GENERATED_POINT: u64 = 16;

/// Something that a cloud is read from.
#[derive(Clone, Debug)]
pub enum Source {
    /// A file of any of the [formats](crate::formats).
    File(PathBuf),
    /// A generated scene of so many points.
    Scene(Scene, usize),
}

impl Source {
    /// What a name means: `scene:NAME[:COUNT][@SECONDS]`, or else a file, which need not exist.
    ///
    /// # Errors
    /// [`Error::UnknownScene`] and [`Error::BadScene`].
    pub fn parse(name: &str) -> Result<Self, Error> {
        if name.starts_with(SCENE_PREFIX) {
            let (scene, count) = Scene::parse(name)?;
            Ok(Self::Scene(scene, count))
        } else {
            Ok(Self::File(name.into()))
        }
    }

    /// The file, if it is one.
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::File(path) => Some(path),
            Self::Scene(..) => None,
        }
    }

    /// Bytes that will be taken at least, as far as that is known without a look at it.
    pub fn least_bytes(&self) -> u64 {
        match self {
            Self::File(_) => 0,
            Self::Scene(_, count) => *count as u64 * BYTES_PER_GENERATED_POINT,
        }
    }

    /// Reads or generates the cloud.
    ///
    /// # Errors
    /// Those of [`read`](crate::read) or of [`Scene::sample`].
    pub fn read(&self, options: &ReadOptions, progress: &dyn Progress) -> Result<PointCloud, Error> {
        match self {
            Self::File(path) => read_with(path, options, progress),
            Self::Scene(scene, count) => scene.sample(*count, &|done| {
                progress.report(done);
                !progress.cancelled()
            }),
        }
    }
}
