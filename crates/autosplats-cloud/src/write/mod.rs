//! Point clouds to files, one module per format.
//!
//! # How it works
//!
//! A file appears complete or not at all: it is written beside its place under another name, which is removed on
//! failure, and then renamed, replacing what was there. What a format cannot hold is told through
//! [`Progress::note`], once per kind of loss.

mod colors;
mod decimal;
mod e57;
mod las;
mod names;
mod pcd;
mod ply;
mod records;
mod xyz;

use std::{
    fs::File,
    io::BufWriter,
    path::{Path, PathBuf},
};

use crate::{Crs, Error, PointCloud, Progress, error::message, progress::tick};

/// A kind of file that is written.
struct Format {
    /// Name for messages and tables.
    name: &'static str,
    /// Extensions of the file's name, in lower case and without the first dot.
    extensions: &'static [&'static str],
    write: fn(&Job<'_>, &mut BufWriter<&mut File>) -> Result<(), Error>,
}

/// All formats; longer extensions go before shorter ones.
const FORMATS: &[Format] = &[ply::FORMAT, las::LAS, las::LAZ, pcd::FORMAT, e57::FORMAT, xyz::FORMAT];

/// Names and extensions of the formats that [`write()`] makes.
pub fn written_formats() -> impl Iterator<Item = (&'static str, &'static [&'static str])> {
    FORMATS.iter().map(|format| (format.name, format.extensions))
}

/// Bytes gathered before they go to the system.
const BUFFER: usize = 1 << 20;

/// What every writer is given.
struct Job<'a> {
    cloud: &'a PointCloud,
    path: &'a Path,
    progress: &'a dyn Progress,
}

impl Job<'_> {
    fn tick(&self, fraction: f32) -> Result<(), Error> {
        tick(self.progress, fraction)
    }

    fn io(&self, source: std::io::Error) -> Error {
        Error::Io { path: self.path.into(), source }
    }

    /// Tells the user what the format cannot hold.
    fn note(&self, note: impl AsRef<str>) {
        self.progress.note(&message(note.as_ref()));
    }
}

/// Tells of sensors and coordinate system, if the cloud has such, and of what else is lost, that a format does not hold
/// them.
fn note_left_out(job: &Job<'_>, format: &str, others: &[(bool, &str)]) {
    let cloud = job.cloud;
    let all = [
        (!cloud.scans().is_empty(), "where the sensors stood"),
        (*cloud.crs() != Crs::default(), "the coordinate system"),
    ];
    let losses: Vec<&str> = all.iter().chain(others).filter(|(lost, _)| *lost).map(|(_, what)| *what).collect();
    if !losses.is_empty() {
        job.note(format!("{format} does not hold {}", losses.join(", ")));
    }
}

/// Writes `cloud` in the format that the extension of `path` names; see [`written_formats`].
///
/// A cloud that was read [exactly](crate::ReadOptions::exact) loses nothing that the format can hold; what it cannot hold
/// is told by [`Progress::note`]. The file appears complete or not at all, and replaces what was there.
///
/// # Errors
/// [`Error::UnknownOutput`] for an extension that is not written, [`Error::Io`] if the file cannot be written,
/// [`Error::Unsupported`] if the format cannot hold such a cloud, [`Error::Cancelled`] if `progress` says so.
pub fn write(cloud: &PointCloud, path: &Path, progress: &dyn Progress) -> Result<(), Error> {
    let job = Job { cloud, path, progress };
    let format = format(path)?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".autosplats-").suffix(".tmp");
    // Temporary files are for their owner alone unless told otherwise; the result is a file like any.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder).map_err(|source| job.io(source))?;
    let mut writer = BufWriter::with_capacity(BUFFER, file.as_file_mut());
    (format.write)(&job, &mut writer)?;
    std::io::Write::flush(&mut writer).map_err(|source| job.io(source))?;
    drop(writer);
    job.tick(1.0)?;
    file.persist(path).map_err(|error| Error::Io { path: PathBuf::from(path), source: error.error })?;
    Ok(())
}

fn format(path: &Path) -> Result<&'static Format, Error> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    if name.ends_with(".copc.laz") {
        // The name promises an octree to programs that read parts of the file.
        let what = "COPC is not written; leave the '.copc' out of the name for plain LAZ";
        return Err(Error::Unsupported { path: path.into(), what: what.into() });
    }
    let ends = |extension: &&str| name.strip_suffix(extension).is_some_and(|stem| stem.ends_with('.'));
    let format = FORMATS.iter().find(|format| format.extensions.iter().any(ends));
    format.ok_or_else(|| Error::UnknownOutput { path: path.into() })
}

/// Whether [`write()`] knows a format for this name.
///
/// # Errors
/// [`Error::UnknownOutput`] if not.
pub fn check_writable(path: &Path) -> Result<(), Error> {
    format(path).map(|_| ())
}

/// The names of all formats, for a message.
pub(crate) fn format_names() -> String {
    let shown = |format: &Format| format!("{} (.{})", format.name, format.extensions.join(" ."));
    FORMATS.iter().map(shown).collect::<Vec<_>>().join(", ")
}
