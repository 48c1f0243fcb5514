//! All formats, and reading a file in whichever it has.

use std::path::{Path, PathBuf};

use autosplats_cloud::{Bytes, Contents, Error, LeftOut, PointCloud, Progress};

use super::{
    choose, depth_image,
    describe::Description,
    e57, gltf, grid,
    job::{Format, Job},
    las, obj, off,
    options::ReadOptions,
    pcd, ply, ptx, raw, sensor, stl, units,
    unpack::{Unpacked, without_gz},
    xyz,
};

/// All formats, in order of precedence: by content first, then by extension. Longer extensions precede shorter ones.
const FORMATS: &[&Format] = &[
    &las::FORMAT,
    &ply::FORMAT,
    &pcd::FORMAT,
    &e57::FORMAT,
    &gltf::FORMAT,
    &off::FORMAT,
    &obj::FORMAT,
    &depth_image::FORMAT,
    &raw::FORMAT,
    &ptx::FORMAT,
    &grid::FORMAT,
    &xyz::FORMAT,
    // STL is recognised only by a number that fits the file's size, so it comes last.
    &stl::FORMAT,
];

/// Formats of meshes, in which a point at (0, 0, 0) is an ordinary point.
const MODELS: &[&Format] = &[&gltf::FORMAT, &off::FORMAT, &obj::FORMAT, &stl::FORMAT];

/// Names and extensions of the formats that [`read`] understands.
///
/// # Examples
///
/// ```
/// use autosplats_formats::formats;
///
/// assert!(formats().any(|(_, extensions)| extensions.contains(&"e57")));
/// ```
pub fn formats() -> impl Iterator<Item = (&'static str, &'static [&'static str])> {
    FORMATS.iter().map(|format| (format.name, format.extensions))
}

/// Names of all formats, for a message.
fn format_names() -> String {
    FORMATS.iter().map(|format| format.name).collect::<Vec<_>>().join(", ")
}

/// Reads a point cloud in any of the [`formats`], recognised by content first, then by extension.
///
/// Coordinates from about 1e4 on are stored relative to an origin of whole numbers, so that survey coordinates keep
/// their precision. Smaller coordinates keep the file's `f32` values exactly. Non-finite points stay in the cloud.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read; [`Error::UnknownFormat`], [`Error::Malformed`] and [`Error::Unsupported`]
/// for its content; [`Error::NothingKept`] if the options keep none of its points; [`Error::OutOfMemory`]; and
/// [`Error::Cancelled`] if `progress` says so.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::glam::DVec3;
/// use autosplats_formats::read;
///
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("scan.xyz");
/// std::fs::write(&path, "1 2 3\n4 5 6\n")?;
/// let cloud = read(&path, &())?;
/// assert_eq!(cloud.world_position(1), DVec3::new(4.0, 5.0, 6.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read(path: &Path, progress: &dyn Progress) -> Result<PointCloud, Error> {
    read_with(path, &ReadOptions::default(), progress)
}

/// Like [`read`], with options.
///
/// # Errors
/// Those of [`read`].
pub fn read_with(path: &Path, options: &ReadOptions, progress: &dyn Progress) -> Result<PointCloud, Error> {
    let bytes = Bytes::open(path)?;
    bytes.checked(read_bytes(path, &bytes, options, progress))
}

/// Like [`read_with`], from the bytes of a file. `name` helps to recognise the format and appears in messages.
///
/// # Errors
/// Those of [`read`].
///
/// # Examples
///
/// ```
/// use autosplats_formats::{ReadOptions, read_bytes};
///
/// let text = b"x,y,z,Intensity\n512000.5,5400000.25,310.0,7\n";
/// let cloud = read_bytes("survey.csv".as_ref(), text, &ReadOptions::default(), &())?;
/// assert_eq!(cloud.world_position(0).y, 5_400_000.25);
/// assert_eq!(cloud.fields()[0].name, "Intensity");
/// # Ok::<(), autosplats_cloud::Error>(())
/// ```
pub fn read_bytes(
    name: &Path,
    bytes: &[u8],
    options: &ReadOptions,
    progress: &dyn Progress,
) -> Result<PointCloud, Error> {
    with_job(name, bytes, options, progress, false, |job, _| Ok(kept(job)?.cloud))
}

/// Like [`read_with`], but returns all points, and which of them [`ReadOptions::keep`] leaves out.
///
/// # Errors
/// Those of [`read`].
///
/// # Examples
///
/// ```
/// use autosplats_cloud::PointFilter;
/// use autosplats_formats::{ReadOptions, read_marked};
///
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("scan.csv");
/// std::fs::write(&path, "x,y,z,Classification\n1,2,3,2\n4,5,60,7\n")?;
/// let options = ReadOptions { keep: Some(PointFilter::usual()), ..ReadOptions::default() };
/// let (cloud, left_out) = read_marked(&path, &options, &())?;
/// assert_eq!(cloud.len(), 2);
/// assert!(!left_out.has(0) && left_out.has(1), "noise");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_marked(
    path: &Path,
    options: &ReadOptions,
    progress: &dyn Progress,
) -> Result<(PointCloud, LeftOut), Error> {
    let bytes = Bytes::open(path)?;
    bytes.checked(with_job(path, &bytes, options, progress, false, |job, _| {
        let (contents, left) = contents(job)?;
        Ok((contents.cloud, left))
    }))
}

/// Reads points and the triangles between them.
///
/// # Errors
/// Those of [`read`].
pub fn read_mesh(path: &Path, options: &ReadOptions, progress: &dyn Progress) -> Result<Contents, Error> {
    let bytes = Bytes::open(path)?;
    bytes.checked(read_mesh_bytes(path, &bytes, options, progress))
}

/// Like [`read_mesh`], from the bytes of a file. `name` helps to recognise the format and appears in messages.
///
/// # Errors
/// Those of [`read`].
///
/// # Examples
///
/// ```
/// use autosplats_formats::{ReadOptions, read_mesh_bytes};
///
/// let text = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
/// let mesh = read_mesh_bytes("square.obj".as_ref(), text, &ReadOptions::default(), &())?;
/// assert_eq!(mesh.cloud.len(), 4);
/// assert_eq!(mesh.triangles.len(), 2);
/// # Ok::<(), autosplats_cloud::Error>(())
/// ```
pub fn read_mesh_bytes(
    name: &Path,
    bytes: &[u8],
    options: &ReadOptions,
    progress: &dyn Progress,
) -> Result<Contents, Error> {
    with_job(name, bytes, options, progress, true, |job, _| kept(job))
}

/// Duration of the first animation of a glTF in seconds, and the number of animations, if there are any.
///
/// # Errors
/// Those of [`read`].
pub fn gltf_animation(name: &Path, bytes: &[u8]) -> Result<Option<(f64, usize)>, Error> {
    with_job(name, bytes, &ReadOptions::default(), &(), false, |job, _| gltf::animation(job))
}

/// The mesh of a glTF at a time of its first animation.
///
/// # Errors
/// Those of [`read`].
pub fn read_gltf_at(name: &Path, bytes: &[u8], seconds: f64, progress: &dyn Progress) -> Result<Contents, Error> {
    with_job(name, bytes, &ReadOptions::default(), progress, true, |job, _| gltf::read_at(job, Some(seconds)))
}

/// Files that a file refers to: the buffers and images of a glTF, and the picture that gives a depth image its colours.
/// Only some of them need to exist.
///
/// # Examples
///
/// ```
/// use autosplats_formats::files_beside;
///
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("statue.gltf");
/// std::fs::write(&path, r#"{"asset": {"version": "2.0"}, "buffers": [{"uri": "statue.bin", "byteLength": 9}]}"#)?;
/// assert_eq!(files_beside(&path), [path.with_file_name("statue.bin")]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn files_beside(path: &Path) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = depth_image::color::beside(path).into_iter().collect();
    if named(path).is_some_and(|format| format.name == gltf::FORMAT.name)
        && path.is_file()
        && let Ok(bytes) = Bytes::open(path)
    {
        let linked = with_job(path, &bytes, &ReadOptions::default(), &(), false, |job, _| gltf::linked(job));
        // A file that cannot be read refers to none.
        files.extend(linked.unwrap_or_default());
    }
    files
}

/// Reads the header of a file, in milliseconds whatever the file's size. Of formats without a header that states counts
/// only the beginning is read.
///
/// # Errors
/// Those of [`read`], as far as the header shows them.
pub fn describe(path: &Path, options: &ReadOptions) -> Result<Description, Error> {
    let bytes = Bytes::open(path)?;
    bytes.checked(describe_bytes(path, &bytes, options))
}

/// Like [`describe`], from the bytes of a file.
///
/// # Errors
/// Those of [`describe`].
///
/// # Examples
///
/// ```
/// use autosplats_formats::{ReadOptions, describe_bytes};
///
/// let text = b"ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\n\
///     property float y\nproperty float z\nend_header\n0 0 1\n1 0 1\n";
/// let facts = describe_bytes("scan.ply".as_ref(), text, &ReadOptions::default())?;
/// assert_eq!(facts.points, Some(2));
/// assert_eq!(facts.attributes[2].name, "z");
/// # Ok::<(), autosplats_cloud::Error>(())
/// ```
pub fn describe_bytes(name: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Description, Error> {
    with_job(name, bytes, options, &(), false, |job, unpacked| {
        let mut description = (format(job)?.describe)(job)?;
        units::settle_description(&mut description);
        if let Some(encoding) = unpacked.encoding {
            description.details.retain(|(name, _)| name != "encoding");
            description.details.insert(0, ("encoding".into(), encoding.into()));
        }
        if unpacked.compressed {
            description.details.insert(0, ("compressed with".into(), "gzip".into()));
        }
        description.notes.extend(unpacked.note.clone());
        Ok(description)
    })
}

/// Runs a reader on the bytes of a file, decompressed and without a byte order mark.
fn with_job<T>(
    path: &Path,
    bytes: &[u8],
    options: &ReadOptions,
    progress: &dyn Progress,
    triangles: bool,
    run: impl FnOnce(&Job<'_>, &Unpacked<'_>) -> Result<T, Error>,
) -> Result<T, Error> {
    let unpacked = Unpacked::of(path, bytes, progress)?;
    let job = Job { path, progress, bytes: &unpacked.bytes, options, triangles };
    unpacked.note.iter().for_each(|note| job.note(note));
    run(&job, &unpacked)
}

/// Whether a name ends as those of a readable format do, or as those of such a file compressed with gzip.
///
/// # Examples
///
/// ```
/// use autosplats_formats::is_named_as_points;
///
/// assert!(is_named_as_points("scan.ply".as_ref()) && is_named_as_points("survey.XYZ.gz".as_ref()));
/// assert!(!is_named_as_points("notes.odt".as_ref()) && !is_named_as_points("backup.gz".as_ref()));
/// ```
#[must_use]
pub fn is_named_as_points(path: &Path) -> bool {
    named(path).is_some()
}

/// The format whose extension the name has.
fn named(path: &Path) -> Option<&'static Format> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let ends = |extension: &&str| without_gz(&name).strip_suffix(extension).is_some_and(|stem| stem.ends_with('.'));
    FORMATS.iter().find(|format| format.extensions.iter().any(ends)).copied()
}

/// Fails if the bytes of a file are a Git LFS pointer instead of the data.
///
/// # Errors
/// [`Error::Malformed`].
pub fn check_not_lfs_pointer(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    if bytes.starts_with(b"version https://git-lfs") {
        let what = "this is a Git LFS pointer instead of the file; 'git lfs pull' fetches the file";
        return Err(Error::malformed(path, "line 1", what));
    }
    Ok(())
}

/// The format of a file.
pub(super) fn format(job: &Job<'_>) -> Result<&'static Format, Error> {
    check_not_lfs_pointer(job.path, job.bytes)?;
    let by_content = FORMATS.iter().find(|format| (format.recognised)(job.bytes)).copied();
    // Rows of numbers can stand in files of any name, so they are looked for last.
    let rows = || xyz::looks_like_rows(job.bytes).then_some(&xyz::FORMAT);
    by_content
        .or_else(|| named(job.path))
        .or_else(rows)
        .ok_or_else(|| Error::UnknownFormat { path: job.path.into(), known: format_names() })
}

/// Reads a file and removes the points that the options leave out.
fn kept(job: &Job<'_>) -> Result<Contents, Error> {
    let (mut contents, left) = contents(job)?;
    choose::remove(&mut contents, &left);
    Ok(contents)
}

/// Reads a file. Returns the points that the options leave out too.
fn contents(job: &Job<'_>) -> Result<(Contents, LeftOut), Error> {
    job.tick(0.0)?;
    let format = format(job)?;
    tell_columns(job, format);
    let previews = choose::ChosenPreviews::new(job, format);
    let progress = previews.as_ref().map_or(job.progress, |previews| previews as &dyn Progress);
    let mut contents = (format.read)(&Job { progress, ..*job })?;
    units::settle(job, &mut contents.cloud)?;
    let model = MODELS.iter().any(|model| model.name == format.name) || ply::is_mesh(job);
    // Dropping points would remove corners of a mesh.
    if !job.options.keep_no_returns && !model && contents.triangles.is_empty() {
        drop_no_returns(job, format, &mut contents.cloud);
    }
    let left = choose::left_out(job, format, &contents.cloud)?;
    sensor::drop_far(job, &mut contents.cloud);
    job.tick(1.0)?;
    Ok((contents, left))
}

/// Whether the caller may name the columns of this file.
fn takes_columns(job: &Job<'_>, format: &Format) -> bool {
    [xyz::FORMAT.name, raw::FORMAT.name].contains(&format.name)
        || format.name == pcd::FORMAT.name && pcd::without_header(job)
}

/// Tells that names of columns are given to a format that has its own.
pub(super) fn tell_columns(job: &Job<'_>, format: &Format) {
    if job.options.columns.is_some() && !takes_columns(job, format) {
        job.note(format!("--columns is for text and headerless records; {} names its own columns", format.name));
    }
}

/// Drops points at (0, 0, 0), which scanners write for missing returns.
fn drop_no_returns(job: &Job<'_>, format: &Format, cloud: &mut PointCloud) {
    let total = cloud.len();
    cloud.drop_no_returns(|count| are_no_returns(job, format, count, total));
}

/// Decides whether `count` of `total` points at (0, 0, 0) are missing returns, and tells the user. A single such point
/// may be real, unless coordinates are in the sensor's frame.
pub(super) fn are_no_returns(job: &Job<'_>, format: &Format, count: usize, total: usize) -> bool {
    let least = if format.sensor_frame { 1 } else { 2 };
    let none = (least..total).contains(&count);
    if none {
        job.note(format!("dropped {count} of {total} points at (0, 0, 0), where nothing was measured"));
    }
    none
}
