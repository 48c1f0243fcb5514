//! What a format is, and what every writer gets.

use std::{fs::File, io::BufWriter, path::Path};

use autosplats_cloud::{Crs, Error, PointCloud, Progress, one_line};

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
    pub(super) cloud: &'a PointCloud,
    pub(super) path: &'a Path,
    pub(super) progress: &'a dyn Progress,
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
}

/// Notes that `format` cannot hold the sensors, the coordinate system and `others`, as far as the cloud has them.
pub(super) fn note_left_out(job: &Job<'_>, format: &str, others: &[(bool, &str)]) {
    let cloud = job.cloud;
    let all = [
        (!cloud.scans().is_empty(), "the poses of the sensors"),
        (*cloud.crs() != Crs::default(), "the coordinate system"),
    ];
    let losses: Vec<&str> = all.iter().chain(others).filter(|(lost, _)| *lost).map(|(_, what)| *what).collect();
    if !losses.is_empty() {
        job.note(format!("{format} does not hold {}", losses.join(", ")));
    }
}
