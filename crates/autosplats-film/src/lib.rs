//! Pictures that follow each other: numbered files, or a film that ffmpeg makes of them.
//!
//! ```no_run
//! use autosplats_film::{Film, Target};
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

mod film;
mod target;

pub use film::{Film, has_ffmpeg};
pub use target::{Frames, Target, has_number};

use std::path::PathBuf;

/// Why there is no film.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A name that tells neither pictures nor a film.
    #[error("{}: {why}", path.display())]
    Name {
        /// What was given.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// The system refused to write.
    #[error("{}: {source}", path.display())]
    Io {
        /// File concerned.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// ffmpeg cannot be started.
    #[error("ffmpeg does not start ({0}), which makes films; install it, or have pictures written as name_%05d.png")]
    NoFfmpeg(std::io::Error),
    /// ffmpeg ended before the film did.
    #[error("ffmpeg: {0}")]
    Ffmpeg(String),
}
