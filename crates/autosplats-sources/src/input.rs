//! An input: a source, and all that a user states about it.

use std::path::{Path, PathBuf};

use autosplats_cloud::Error;
use autosplats_formats::ReadOptions;
use glam::DMat4;

use crate::{PlayOptions, Source, source::is_gltf};

/// A source of points, how it is read and played, and its pose in the world.
///
/// # Examples
///
/// ```
/// use autosplats_sources::{Input, PlayOptions};
///
/// let input = Input::parse("models/horse.glb")?;
/// assert_eq!(input.name, "horse.glb");
/// assert!(!input.moves());
/// let sampled = PlayOptions { sample: Some(10_000), ..PlayOptions::default() };
/// assert!(Input { play: sampled, ..input }.moves());
/// # Ok::<(), autosplats_cloud::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Input {
    /// Name for people.
    pub name: String,
    /// Where the points come from.
    pub source: Source,
    /// How to read the input.
    pub options: ReadOptions,
    /// How to play the input.
    pub play: PlayOptions,
    /// From the input's own to world coordinates.
    pub world_from_input: DMat4,
}

impl Input {
    /// An input with default options and the identity as its pose.
    #[must_use]
    pub fn new(name: String, source: Source) -> Self {
        let (options, play) = (ReadOptions::default(), PlayOptions::default());
        Self { name, source, options, play, world_from_input: DMat4::IDENTITY }
    }

    /// Parses the name of a [source](Source::parse). The input is called by the last part of the name.
    ///
    /// # Errors
    /// [`Error::UnknownScene`] and [`Error::BadScene`].
    pub fn parse(name: &str) -> Result<Self, Error> {
        let source = Source::parse(name)?;
        let name = source.short_name().unwrap_or_else(|| name.into());
        Ok(Self::new(name, source))
    }

    /// A file, whatever its name looks like.
    #[must_use]
    pub fn file(path: PathBuf) -> Self {
        let name = path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into());
        let source = Source::parse(&path.display().to_string()).unwrap_or(Source::File(path));
        Self::new(name, source)
    }

    /// Name of the source, as a user could type it.
    #[must_use]
    pub fn source_name(&self) -> String {
        let absolute = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.into()).display().to_string();
        match &self.source {
            Source::File(path) | Source::Recording(path) => absolute(path),
            Source::Sequence(name) => absolute(Path::new(name)),
            Source::Remote(address) | Source::Address(address) => address.clone(),
            Source::Scene(..) | Source::StandardInput => self.name.clone(),
        }
    }

    /// Whether the points change over time: by themselves, or because the options ask to play a scene or a glTF file.
    /// Samples and scans are played too.
    #[must_use]
    pub fn moves(&self) -> bool {
        let PlayOptions { fps, sample, scanners, .. } = &self.play;
        let is_animated = || match &self.source {
            Source::Scene(..) => true,
            Source::File(path) => is_gltf(path),
            _ => false,
        };
        self.source.moves() || sample.is_some() || scanners.is_some() || fps.is_some() && is_animated()
    }
}
