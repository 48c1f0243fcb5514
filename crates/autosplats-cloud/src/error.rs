//! Errors of reading, writing and generating clouds.

use std::path::{Path, PathBuf};

use crate::ErrorKind;

/// Errors of reading, writing, playing or generating a cloud. Each message is one line.
///
/// All crates of points share this type, since most errors pass through several of them.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::Error;
///
/// let error = Error::malformed("scan.ply".as_ref(), "line 3", "'abc' is not a number");
/// assert!(matches!(error, Error::Malformed { .. }));
/// assert_eq!(error.to_string(), "scan.ply: line 3: 'abc' is not a number");
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An attribute does not have exactly one value per point.
    #[error("{name}: {len} values for {points} points")]
    AttributeLength {
        /// Name of the attribute.
        name: String,
        /// Number of values given.
        len: usize,
        /// Number of points in the cloud.
        points: usize,
    },
    /// The operating system refused to open, read or write a file.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// Neither the content nor the name of a file identifies a format that can be read.
    #[error("{}: unknown format; {} can be read", path.display(), known)]
    UnknownFormat {
        /// The file.
        path: PathBuf,
        /// Names of the formats that can be read.
        known: String,
    },
    /// The extension of an output file names no format that can be written.
    #[error("{}: unknown output format; {} can be written", path.display(), known)]
    UnknownOutput {
        /// The file.
        path: PathBuf,
        /// Names and extensions of the formats that can be written.
        known: String,
    },
    /// A file breaks the rules of its format.
    #[error("{}: {place}: {what}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Line, byte or point where the fault was noticed.
        place: String,
        /// The fault, and the remedy if there is one.
        what: String,
    },
    /// A valid file uses a part of its format that cannot be read.
    #[error("{}: {what}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// The unsupported part, and the remedy if there is one.
        what: String,
    },
    /// Not enough memory is free.
    #[error("out of memory: {bytes} bytes for {what} are not free; thin the cloud or split it")]
    OutOfMemory {
        /// Purpose of the memory.
        what: String,
        /// Size of the request in bytes.
        bytes: usize,
    },
    /// A number is out of its range.
    #[error("{name} {value}: it must be {rule}")]
    BadValue {
        /// Name of the number.
        name: &'static str,
        /// The number.
        value: f64,
        /// The allowed range.
        rule: &'static str,
    },
    /// A word of a [`PointFilter`](crate::PointFilter) means nothing.
    #[error("'{word}' {why}")]
    BadFilter {
        /// The word.
        word: String,
        /// Fault of the word.
        why: String,
    },
    /// A [`PointFilter`](crate::PointFilter) keeps none of the points of a file.
    #[error("{}: --keep {filter} leaves none of its {points} points{there}", path.display())]
    NothingKept {
        /// The file.
        path: PathBuf,
        /// Text of the filter.
        filter: String,
        /// Number of points in the file.
        points: usize,
        /// What the points are instead, as the end of the sentence.
        there: String,
    },
    /// A mesh has no triangle with an area, so there is no surface to sample.
    #[error("there is no surface to sample: no triangle has an area; use the points as they are")]
    NoSurface,
    /// No generated scene has this name.
    #[error("no scene is called {given:?}; there are:{known}")]
    UnknownScene {
        /// Name asked for.
        given: String,
        /// Known names, one per line.
        known: String,
    },
    /// A generated scene was asked for with wrong parameters.
    #[error("scene {given:?}: {why}")]
    BadScene {
        /// Text of the request.
        given: String,
        /// Fault of the request.
        why: String,
    },
    /// A source has no frames to play.
    #[error("{name}: {why}")]
    NoFrames {
        /// Name of the source.
        name: String,
        /// Why there are no frames.
        why: String,
    },
    /// The address of a live source is invalid, or nobody answers there.
    #[error("{address}: {what}")]
    Remote {
        /// The address.
        address: String,
        /// The fault, and the remedy.
        what: String,
    },
    /// [`Progress::cancelled`](crate::Progress::cancelled) returned true.
    #[error("cancelled")]
    Cancelled,
}

impl Error {
    /// [`Error::Malformed`], with `what` as [one line](one_line).
    pub fn malformed(path: &Path, place: impl Into<String>, what: impl AsRef<str>) -> Self {
        Self::Malformed { path: path.into(), place: place.into(), what: one_line(what.as_ref()) }
    }

    /// [`Error::Unsupported`], with `what` as [one line](one_line).
    pub fn unsupported(path: &Path, what: impl AsRef<str>) -> Self {
        Self::Unsupported { path: path.into(), what: one_line(what.as_ref()) }
    }

    /// The kind of this error.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::Io { source, .. } => source.into(),
            Self::UnknownOutput { .. }
            | Self::BadValue { .. }
            | Self::BadFilter { .. }
            | Self::UnknownScene { .. }
            | Self::BadScene { .. } => ErrorKind::Argument,
            Self::AttributeLength { .. }
            | Self::Malformed { .. }
            | Self::NothingKept { .. }
            | Self::NoSurface
            | Self::NoFrames { .. } => ErrorKind::Data,
            Self::UnknownFormat { .. } | Self::Unsupported { .. } => ErrorKind::Unsupported,
            Self::Remote { .. } => ErrorKind::Io,
            Self::OutOfMemory { .. } => ErrorKind::Memory,
            Self::Cancelled => ErrorKind::Cancelled,
        }
    }
}

/// Longest error message, in characters; messages may quote parts of a file.
const MAX_MESSAGE: usize = 600;

/// A message cut to a few hundred characters, without control characters, which could act on a terminal.
pub fn one_line(text: &str) -> String {
    if text.len() <= MAX_MESSAGE && !text.contains(char::is_control) {
        return text.to_owned();
    }
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).take(MAX_MESSAGE).collect()
}

/// A piece of a file for a message: at most 40 bytes, without characters that act on a terminal.
pub fn excerpt(bytes: &[u8]) -> String {
    printable(&String::from_utf8_lossy(&bytes[..bytes.len().min(40)]))
}

/// Text of a file for a message: characters that act on a terminal or cannot be seen are escaped, quotes are not.
pub fn printable(text: &str) -> String {
    let mut printable = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '\'' | '"' => printable.push(c),
            _ => printable.extend(c.escape_debug()),
        }
    }
    printable
}

/// A number for a message, with at most a dozen digits before or behind the point.
pub fn shown_number(value: f64) -> String {
    let plain = value == 0.0 || !value.is_finite() || (1e-9..1e12).contains(&value.abs());
    if plain { value.to_string() } else { format!("{value:e}") }
}
