//! What can go wrong between a disk and a [`PointCloud`](crate::PointCloud).

use std::path::PathBuf;

/// Everything that reading, writing or generating a cloud can fail with. Each message is one line.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An attribute has not exactly one value per point.
    #[error("{name}: {len} values for {points} points")]
    AttributeLength {
        /// Attribute name.
        name: String,
        /// Values given.
        len: usize,
        /// Points in the cloud.
        points: usize,
    },
    /// The operating system refused to open, read or write.
    #[error("{}: {source}", path.display())]
    Io {
        /// File concerned.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Neither the content nor the name of the file tells a format that is read.
    #[error("{}: unknown format; {} can be read", path.display(), crate::read::format_names())]
    UnknownFormat {
        /// File concerned.
        path: PathBuf,
    },
    /// The name of a file to write has no extension of a format that is written.
    #[error("{}: its name tells no format that is written; {} can be", path.display(), crate::write::format_names())]
    UnknownOutput {
        /// File concerned.
        path: PathBuf,
    },
    /// The file breaks the rules of its format.
    #[error("{}: {place}: {what}", path.display())]
    Malformed {
        /// File concerned.
        path: PathBuf,
        /// Line, byte or point at which it was noticed.
        place: String,
        /// What is wrong, and the remedy where one exists.
        what: String,
    },
    /// The file is in order but uses a part of its format that is not read.
    #[error("{}: {what}", path.display())]
    Unsupported {
        /// File concerned.
        path: PathBuf,
        /// What is not read, and the remedy where one exists.
        what: String,
    },
    /// The memory for a cloud could not be had.
    #[error("out of memory: {bytes} bytes for {what} are not free; thin the cloud or split it")]
    OutOfMemory {
        /// What the memory was for.
        what: String,
        /// Size of the request in bytes.
        bytes: usize,
    },
    /// A number that was given is out of its range.
    #[error("{name} {value}: it must be {rule}")]
    BadValue {
        /// What the number is.
        name: &'static str,
        /// The number.
        value: f64,
        /// What it should be.
        rule: &'static str,
    },
    /// A mesh has nothing that points could be strewn over.
    #[error("there is no surface to strew points over: no triangle has an area; take the points as they are")]
    NoSurface,
    /// No made-up scene has this name.
    #[error("no scene is called {given:?}; there are:{known}")]
    UnknownScene {
        /// Name asked for.
        given: String,
        /// The names there are, a line each.
        known: String,
    },
    /// A made-up scene cannot be had like this.
    #[error("scene {given:?}: {why}")]
    BadScene {
        /// What was asked for.
        given: String,
        /// What is wrong with it.
        why: String,
    },
    /// Nothing that could be played.
    #[error("{name}: {why}")]
    NoFrames {
        /// What was to be played.
        name: String,
        /// Why it cannot be.
        why: String,
    },
    /// An address of live points makes no sense, or nobody is there.
    #[error("{address}: {what}")]
    Remote {
        /// The address that was given.
        address: String,
        /// What is wrong with it, and the remedy.
        what: String,
    },
    /// [`Progress::cancelled`](crate::Progress::cancelled) asked to stop.
    #[error("cancelled")]
    Cancelled,
}

/// Letters of a message, which may have pieces of a file in it.
const MAX_MESSAGE: usize = 600;

/// A message that is no longer than a few lines and does nothing to a terminal.
pub(crate) fn message(text: &str) -> String {
    if text.len() <= MAX_MESSAGE && !text.contains(char::is_control) {
        return text.to_owned();
    }
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).take(MAX_MESSAGE).collect()
}
