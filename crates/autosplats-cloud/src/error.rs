//! What can go wrong between a disk and a [`PointCloud`](crate::PointCloud).

use std::path::PathBuf;

/// Everything that reading, writing or generating a cloud can fail with.
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
    /// The caller asked to stop.
    #[error("cancelled")]
    Cancelled,
}
