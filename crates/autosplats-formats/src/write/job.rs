//! What a format is, and what every writer gets.

use std::{fs::File, io::BufWriter, path::Path};

use autosplats_cloud::{Clouds, Error, PointCloud, Progress, one_line};

/// A file format that can be written.
pub(super) struct Format {
    /// Name in messages and tables.
    pub(super) name: &'static str,
    /// Extensions of file names, in lower case and without the first dot.
    pub(super) extensions: &'static [&'static str],
    pub(super) write: fn(&Job<'_>, &mut BufWriter<&mut File>) -> Result<(), Error>,
}

/// Input of every writer.
pub(super) struct Job<'a> {
    pub(super) clouds: &'a dyn Clouds,
    pub(super) path: &'a Path,
    pub(super) progress: &'a dyn Progress,
}

/// A progress that reports nothing, since the writer does, but cancels.
pub(super) struct Quiet<'a>(pub(super) &'a dyn Progress);

impl Progress for Quiet<'_> {
    fn report(&self, _fraction: f32) {}

    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

impl Job<'_> {
    pub(super) fn tick(&self, fraction: f32) -> Result<(), Error> {
        self.progress.tick(fraction)
    }

    pub(super) fn io(&self, source: std::io::Error) -> Error {
        Error::Io { path: self.path.into(), source }
    }

    /// Notes what the format cannot hold.
    pub(super) fn note(&self, note: impl AsRef<str>) {
        self.progress.note(&one_line(note.as_ref()));
    }

    /// Passes on the clouds, of which there is at least one.
    pub(super) fn each(&self, take: &mut dyn FnMut(&PointCloud) -> Result<(), Error>) -> Result<(), Error> {
        let mut none = true;
        self.clouds.read(&Quiet(self.progress), &mut |cloud| {
            none = false;
            if self.progress.cancelled() { Err(Error::Cancelled) } else { take(cloud) }
        })?;
        if none { take(&PointCloud::default()) } else { Ok(()) }
    }
}
