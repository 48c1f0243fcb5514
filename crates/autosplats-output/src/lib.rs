//! Pictures as PNG or JPEG, their layers as OpenEXR, and successive pictures as numbered files or as a film made by
//! ffmpeg.
//!
//! ```no_run
//! use autosplats_output::{Film, Target};
//!
//! # fn pictures() -> Vec<autosplats::Image> { Vec::new() }
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! if let Target::Film(path) = Target::new("turn.mp4".as_ref())? {
//!     let mut film = Film::begin(&path, [1280, 720], 25.0)?;
//!     for picture in pictures() {
//!         film.add(&picture)?;
//!     }
//!     film.finish()?;
//! }
//! # Ok(())
//! # }
//! ```

#![warn(clippy::print_stderr, clippy::print_stdout, reason = "they panic where the stream cannot be written")]

mod exr;
mod film;
mod picture;
mod target;

pub use exr::write_exr;
pub use film::{Film, abandon_films, has_ffmpeg};
pub use picture::{PictureFormat, write_picture, write_png};
pub use target::{Frames, Target, has_number};

use std::path::PathBuf;

use autosplats::cloud::ErrorKind;

/// Errors of making pictures and films.
///
/// # Examples
///
/// ```
/// use autosplats_output::Target;
///
/// let Err(error) = Target::new("turn.gif".as_ref()) else { panic!("a GIF is no film") };
/// assert!(error.to_string().starts_with("turn.gif: "));
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A name that is unsuitable for pictures and films.
    #[error("{}: {why}", path.display())]
    Name {
        /// The name.
        path: PathBuf,
        /// What is wrong with the name.
        why: String,
    },
    /// A file cannot be written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// ffmpeg does not start. The value is the system's error.
    #[error("films need ffmpeg, which does not start ({0}); install it, or write pictures as name_%05d.png")]
    NoFfmpeg(std::io::Error),
    /// ffmpeg failed. The value is its last message.
    #[error("ffmpeg: {0}")]
    Ffmpeg(String),
}

impl Error {
    /// The kind of this error.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::Name { .. } => ErrorKind::Argument,
            Self::Io { source, .. } => source.into(),
            Self::NoFfmpeg(_) => ErrorKind::Unsupported,
            Self::Ffmpeg(_) => ErrorKind::Io,
        }
    }
}
