//! Writers of point cloud files, one module per format.
//!
//! # How it works
//!
//! A file appears complete or not at all. It is written under a temporary name in the same folder, then renamed, which
//! replaces an existing file; on failure the temporary file is removed. What a format cannot hold is reported by
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

/// A file format that can be written.
struct Format {
    /// Name in messages and tables.
    name: &'static str,
    /// Extensions of file names, in lower case and without the first dot.
    extensions: &'static [&'static str],
    write: fn(&Job<'_>, &mut BufWriter<&mut File>) -> Result<(), Error>,
}

/// All formats; longer extensions precede shorter ones.
const FORMATS: &[Format] = &[ply::FORMAT, las::LAS, las::LAZ, pcd::FORMAT, e57::FORMAT, xyz::FORMAT];

/// Names and extensions of the formats that [`write()`] can write.
pub fn written_formats() -> impl Iterator<Item = (&'static str, &'static [&'static str])> {
    FORMATS.iter().map(|format| (format.name, format.extensions))
}

/// Size of the output buffer, in bytes.
const BUFFER: usize = 1 << 20;

/// Input of every writer.
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

    /// Notes what the format cannot hold.
    fn note(&self, note: impl AsRef<str>) {
        self.progress.note(&message(note.as_ref()));
    }
}

/// Notes that `format` cannot hold the sensors, the coordinate system and `others`, as far as the cloud has them.
fn note_left_out(job: &Job<'_>, format: &str, others: &[(bool, &str)]) {
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

/// Writes `cloud` in the format that the extension of `path` names; see [`written_formats`].
///
/// A cloud that was read [exactly](crate::ReadOptions::exact) keeps all digits that the format can hold. Losses are
/// reported by [`Progress::note`]. The file appears complete or not at all, and replaces an existing file.
///
/// # Errors
/// [`Error::UnknownOutput`] if no format has the extension, [`Error::Io`] if the file cannot be written,
/// [`Error::Unsupported`] if the format cannot hold such a cloud, and [`Error::Cancelled`] if `progress` says so.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{PointCloud, glam::DVec3, read, write};
///
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("points.ply");
/// let cloud = PointCloud::new(DVec3::ZERO, vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
/// write(&cloud, &path, &())?;
/// assert_eq!(read(&path, &())?.positions(), cloud.positions());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write(cloud: &PointCloud, path: &Path, progress: &dyn Progress) -> Result<(), Error> {
    let job = Job { cloud, path, progress };
    let format = format(path)?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".autosplats-").suffix(".tmp");
    // Temporary files are private by default; the result shall have usual permissions.
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
        // Programs that read parts of a file expect an octree in files of this name.
        let what = "COPC is not written; leave the '.copc' out of the name for plain LAZ";
        return Err(Error::Unsupported { path: path.into(), what: what.into() });
    }
    let ends = |extension: &&str| name.strip_suffix(extension).is_some_and(|stem| stem.ends_with('.'));
    let format = FORMATS.iter().find(|format| format.extensions.iter().any(ends));
    format.ok_or_else(|| Error::UnknownOutput { path: path.into() })
}

/// Checks that a format has the extension of this name.
///
/// # Errors
/// [`Error::UnknownOutput`] if none has.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::check_writable;
///
/// assert!(check_writable("points.laz".as_ref()).is_ok());
/// assert!(check_writable("points.doc".as_ref()).is_err());
/// ```
pub fn check_writable(path: &Path) -> Result<(), Error> {
    format(path).map(|_| ())
}

/// Names and extensions of all formats, for a message.
pub(crate) fn format_names() -> String {
    let shown = |format: &Format| format!("{} (.{})", format.name, format.extensions.join(" ."));
    FORMATS.iter().map(shown).collect::<Vec<_>>().join(", ")
}
