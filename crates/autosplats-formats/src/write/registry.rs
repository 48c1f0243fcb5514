//! All formats, and writing a cloud in the one that the name of a file asks for.

use std::path::Path;

use autosplats_cloud::{Clouds, Error, Held, Output, PointCloud, Progress, write_whole};

use super::{
    copc, e57,
    job::{Format, Job},
    las, pcd, ply, xyz,
};

/// All formats; longer extensions precede shorter ones.
const FORMATS: &[Format] = &[copc::FORMAT, ply::FORMAT, las::LAS, las::LAZ, pcd::FORMAT, e57::FORMAT, xyz::FORMAT];

/// Names and extensions of the formats that [`write()`] can write.
pub fn written_formats() -> impl Iterator<Item = (&'static str, &'static [&'static str])> {
    FORMATS.iter().map(|format| (format.name, format.extensions))
}

/// Writes `cloud` in the format that the extension of the output's path names; see [`written_formats`]. Returns the
/// size of the file in bytes.
///
/// A cloud that was read [exactly](crate::ReadOptions::exact) keeps all digits that the format can hold. Losses are
/// reported by [`Progress::note`]. The file appears complete or not at all, and replaces an existing file, unless the
/// [`Output`] says otherwise.
///
/// # Errors
/// [`Error::UnknownOutput`] if no format has the extension, [`Error::Io`] if the file cannot be written,
/// [`Error::Unsupported`] if the format cannot hold such a cloud, and [`Error::Cancelled`] if `progress` says so.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{PointCloud, glam::DVec3};
/// use autosplats_formats::{read, write};
///
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("points.ply");
/// let cloud = PointCloud::new(DVec3::ZERO, vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
/// write(&cloud, &path, &())?;
/// assert_eq!(read(&path, &())?.positions(), cloud.positions());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write<'a>(cloud: &PointCloud, output: impl Into<Output<'a>>, progress: &dyn Progress) -> Result<u64, Error> {
    let output = output.into();
    write_clouds(&Held { name: output.path, cloud }, output, progress)
}

/// Like [`write()`], of points that come in parts. They are read two to seven times, and memory needs to hold only a
/// part of them. The file has the same bytes as if all came at once.
///
/// # Errors
/// Those of [`write()`] and of reading; [`Error::Unsupported`] for parts of unlike fields.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{Held, PointCloud, glam::DVec3};
/// use autosplats_formats::{read, write_clouds};
///
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("points.laz");
/// let cloud = PointCloud::new(DVec3::ZERO, vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
/// write_clouds(&Held { name: "memory".as_ref(), cloud: &cloud }, &path, &())?;
/// assert_eq!(read(&path, &())?.len(), 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_clouds<'a>(
    clouds: &dyn Clouds,
    output: impl Into<Output<'a>>,
    progress: &dyn Progress,
) -> Result<u64, Error> {
    let output = output.into();
    let job = Job { clouds, path: output.path, progress };
    let format = format(output.path)?;
    write_whole(
        output,
        |source| job.io(source),
        |file| {
            (format.write)(&job, file)?;
            job.tick(1.0)
        },
    )
}

fn format(path: &Path) -> Result<&'static Format, Error> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let ends = |extension: &&str| name.strip_suffix(extension).is_some_and(|stem| stem.ends_with('.'));
    let format = FORMATS.iter().find(|format| format.extensions.iter().any(ends));
    format.ok_or_else(|| Error::UnknownOutput { path: path.into(), known: format_names() })
}

/// Checks that a format has the extension of this name.
///
/// # Errors
/// [`Error::UnknownOutput`] if none has.
///
/// # Examples
///
/// ```
/// use autosplats_formats::check_writable;
///
/// assert!(check_writable("points.laz".as_ref()).is_ok());
/// assert!(check_writable("points.doc".as_ref()).is_err());
/// ```
pub fn check_writable(path: &Path) -> Result<(), Error> {
    format(path).map(|_| ())
}

/// Names and extensions of all formats, for a message.
fn format_names() -> String {
    let shown = |format: &Format| format!("{} (.{})", format.name, format.extensions.join(" ."));
    FORMATS.iter().map(shown).collect::<Vec<_>>().join(", ")
}
