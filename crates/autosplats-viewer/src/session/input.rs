//! Something to open, and how it is shown.

use std::path::{Path, PathBuf};

use autosplats::cloud::Error;
use autosplats::cloud::glam::DMat4;
use autosplats_formats::ReadOptions;
use autosplats_sources::{PlayOptions, Source};

/// Something to open.
#[derive(Clone, Debug)]
pub struct Input {
    /// Name in the list of inputs.
    pub name: String,
    /// Where the points come from.
    pub source: Source,
    /// How to read the input.
    pub options: ReadOptions,
    /// How to play the input.
    pub play: PlayOptions,
    /// Whether the input is played though its source may be static.
    pub played: bool,
    /// From the input's own to world coordinates.
    pub world_from_input: DMat4,
}

impl Input {
    /// Parses a name: a scene, a file or an address, with default options and the identity as its pose.
    ///
    /// # Errors
    /// [`Error::UnknownScene`] and [`Error::BadScene`].
    pub fn parse(name: &str) -> Result<Self, Error> {
        let source = Source::parse(name)?;
        let name = source.short_name().unwrap_or_else(|| name.into());
        Ok(Self::usual(name, source))
    }

    /// A file that was dropped or chosen in a dialog.
    pub(crate) fn file(path: PathBuf) -> Self {
        let name = path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into());
        let source = Source::parse(&path.display().to_string()).unwrap_or(Source::File(path));
        Self::usual(name, source)
    }

    /// An input with default options and the identity as its pose.
    fn usual(name: String, source: Source) -> Self {
        let (options, play) = (ReadOptions::default(), PlayOptions::default());
        Self { name, source, options, play, played: false, world_from_input: DMat4::IDENTITY }
    }

    /// Name of the source, as a user could type it.
    pub(crate) fn source_name(&self) -> String {
        let absolute = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.into()).display().to_string();
        match &self.source {
            Source::File(path) | Source::Recording(path) => absolute(path),
            Source::Sequence(name) => absolute(Path::new(name)),
            Source::Remote(address) => address.clone(),
            Source::Scene(..) | Source::StandardInput => self.name.clone(),
        }
    }

    /// Whether the points change over time.
    pub(crate) fn moves(&self) -> bool {
        self.played || self.source.moves()
    }
}

/// How an input is shown once it has points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Appearance {
    pub(crate) visible: bool,
    /// One colour for all points; `None` shows their own colours.
    pub(crate) tint: Option<[u8; 3]>,
}

impl Default for Appearance {
    fn default() -> Self {
        Self { visible: true, tint: None }
    }
}
