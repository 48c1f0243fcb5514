//! Readers of point cloud files, one module per format.
//!
//! # How it works
//!
//! A file is mapped into memory. Its format is recognised by its first bytes, then by its extension. Most formats end
//! in the same shape, a [`table`]: named columns of numbers at fixed strides. Positions, colours and fields are taken
//! from the table in parallel. Binary PLY and PCD already are such a table in the file; their text and lists are packed
//! into a table first. Bare text, whose files can be the largest, is parsed straight into the columns of a cloud. LAS
//! has columns of bits and integer coordinates and makes its cloud itself.
//!
//! A file is not trusted: the claims of its header are checked against its size before anything is allocated.

mod columns;
mod depth_image;
mod describe;
mod e57;
mod framing;
mod gltf;
mod guard;
mod las;
mod lines;
mod mesh;
mod obj;
mod off;
mod options;
mod pcd;
mod placed;
mod ply;
mod ptx;
mod raw;
mod sensor;
mod stl;
mod table;
mod text;
mod xyz;

use std::{fs::File, io::Read as _, ops::Deref, path::Path};

pub(crate) use self::depth_image::color::beside as colors_beside;
pub(crate) use self::framing::{Found, Framing};
pub(crate) use self::{
    columns::numbered,
    guard::guard,
    table::{ColorScale, Column, MAX_COLUMNS, SMALL, Scalar, Table, middle},
};
pub use self::{
    describe::{Attribute, Description},
    options::{DepthCamera, ReadOptions},
};
use glam::DVec3;
use rayon::prelude::*;

use crate::{Error, PointCloud, Progress, error::message, memory::check_memory, progress::tick};

/// A file format: how to recognise and how to read it.
struct Format {
    /// Name in messages and tables.
    name: &'static str,
    /// Extensions of file names, in lower case and without the first dot.
    extensions: &'static [&'static str],
    /// Whether the content starts as only this format does.
    recognised: fn(&[u8]) -> bool,
    /// Whether coordinates are in the sensor's frame, so that even a single point at (0, 0, 0) is a missing return.
    sensor_frame: bool,
    /// Reads the header.
    describe: fn(&Job<'_>) -> Result<Description, Error>,
    /// Reads the points, and the triangles of a mesh if asked for.
    read: fn(&Job<'_>) -> Result<Contents, Error>,
}

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
/// use autosplats_cloud::formats;
///
/// assert!(formats().any(|(_, extensions)| extensions.contains(&"e57")));
/// ```
pub fn formats() -> impl Iterator<Item = (&'static str, &'static [&'static str])> {
    FORMATS.iter().map(|format| (format.name, format.extensions))
}

/// Names of all formats, for a message.
pub(crate) fn format_names() -> String {
    FORMATS.iter().map(|format| format.name).collect::<Vec<_>>().join(", ")
}

/// Contents of a file: points, and triangles between them if the file is a mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Contents {
    /// The points.
    pub cloud: PointCloud,
    /// Corners of triangles, as indices of points; empty unless read by [`read_mesh`]. Polygons are cut into triangles.
    /// Faces with corners that do not exist are left out.
    pub triangles: Vec<[u32; 3]>,
}

impl From<PointCloud> for Contents {
    fn from(cloud: PointCloud) -> Self {
        Self { cloud, triangles: Vec::new() }
    }
}

/// Reads a point cloud in any of the [`formats`], recognised by content first, then by extension.
///
/// Coordinates from about 1e4 on are stored relative to an origin of whole numbers, so that survey coordinates keep
/// their precision. Smaller coordinates keep the file's `f32` values exactly. Non-finite points stay in the cloud.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read; [`Error::UnknownFormat`], [`Error::Malformed`] and [`Error::Unsupported`]
/// for its content; [`Error::OutOfMemory`]; and [`Error::Cancelled`] if `progress` says so.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{glam::DVec3, read};
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
    let bytes = Bytes::open(path).map_err(|source| Error::Io { path: path.into(), source })?;
    read_bytes(path, &bytes, options, progress)
}

/// Like [`read_with`], from the bytes of a file. `name` helps to recognise the format and appears in messages.
///
/// # Errors
/// Those of [`read`].
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{ReadOptions, read_bytes};
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
    Ok(contents(&Job { path: name, progress, bytes, options, triangles: false })?.cloud)
}

/// Reads points and the triangles between them.
///
/// # Errors
/// Those of [`read`].
pub fn read_mesh(path: &Path, options: &ReadOptions, progress: &dyn Progress) -> Result<Contents, Error> {
    let bytes = Bytes::open(path).map_err(|source| Error::Io { path: path.into(), source })?;
    read_mesh_bytes(path, &bytes, options, progress)
}

/// Like [`read_mesh`], from the bytes of a file. `name` helps to recognise the format and appears in messages.
///
/// # Errors
/// Those of [`read`].
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{ReadOptions, read_mesh_bytes};
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
    contents(&Job { path: name, progress, bytes, options, triangles: true })
}

/// Duration of the first animation of a glTF in seconds, and the number of animations, if there are any.
pub(crate) fn gltf_animation(name: &Path, bytes: &[u8]) -> Result<Option<(f64, usize)>, Error> {
    let options = ReadOptions::default();
    gltf::animation(&Job { path: name, progress: &(), bytes, options: &options, triangles: false })
}

/// The mesh of a glTF at a time of its first animation.
pub(crate) fn read_gltf_at(
    name: &Path,
    bytes: &[u8],
    seconds: f64,
    progress: &dyn Progress,
) -> Result<Contents, Error> {
    let options = ReadOptions::default();
    gltf::read_at(&Job { path: name, progress, bytes, options: &options, triangles: true }, Some(seconds))
}

/// Reads the header of a file, in milliseconds whatever the file's size. Of formats without a header that states counts
/// only the beginning is read.
///
/// # Errors
/// Those of [`read`], as far as the header shows them.
pub fn describe(path: &Path, options: &ReadOptions) -> Result<Description, Error> {
    let bytes = Bytes::open(path).map_err(|source| Error::Io { path: path.into(), source })?;
    describe_bytes(path, &bytes, options)
}

/// Like [`describe`], from the bytes of a file.
///
/// # Errors
/// Those of [`describe`].
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{ReadOptions, describe_bytes};
///
/// let text = b"ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\n\
///     property float y\nproperty float z\nend_header\n0 0 1\n1 0 1\n";
/// let facts = describe_bytes("scan.ply".as_ref(), text, &ReadOptions::default())?;
/// assert_eq!(facts.points, Some(2));
/// assert_eq!(facts.attributes[2].name, "z");
/// # Ok::<(), autosplats_cloud::Error>(())
/// ```
pub fn describe_bytes(name: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Description, Error> {
    let job = Job { path: name, progress: &(), bytes, options, triangles: false };
    (format(&job)?.describe)(&job)
}

/// Fails if the file is a Git LFS pointer instead of the data.
pub(crate) fn check_not_lfs_pointer(job: &Job<'_>) -> Result<(), Error> {
    if job.bytes.starts_with(b"version https://git-lfs") {
        let what = "this is a Git LFS pointer instead of the file; 'git lfs pull' fetches the file";
        return Err(job.malformed("line 1", what));
    }
    Ok(())
}

fn format(job: &Job<'_>) -> Result<&'static Format, Error> {
    check_not_lfs_pointer(job)?;
    let name = job.path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let ends = |extension: &&str| name.strip_suffix(extension).is_some_and(|stem| stem.ends_with('.'));
    let by_content = FORMATS.iter().find(|format| (format.recognised)(job.bytes));
    let by_name = || FORMATS.iter().find(|format| format.extensions.iter().any(ends));
    // Rows of numbers can stand in files of any name, so they are looked for last.
    let rows = || xyz::looks_like_rows(job.bytes).then_some(&&xyz::FORMAT);
    by_content.or_else(by_name).or_else(rows).copied().ok_or_else(|| Error::UnknownFormat { path: job.path.into() })
}

fn contents(job: &Job<'_>) -> Result<Contents, Error> {
    job.tick(0.0)?;
    let format = format(job)?;
    if job.options.columns.is_some() && !takes_columns(job, format) {
        job.note(format!("--columns is for text and headerless records; {} names its own columns", format.name));
    }
    let mut contents = (format.read)(job)?;
    let model = MODELS.iter().any(|model| model.name == format.name) || ply::is_mesh(job);
    // Dropping points would remove corners of a mesh.
    if !job.options.keep_no_returns && !model && contents.triangles.is_empty() {
        drop_no_returns(job, format, &mut contents.cloud);
    }
    sensor::drop_far(job, &mut contents.cloud);
    job.tick(1.0)?;
    Ok(contents)
}

/// Whether the caller may name the columns of this file.
fn takes_columns(job: &Job<'_>, format: &Format) -> bool {
    [xyz::FORMAT.name, raw::FORMAT.name].contains(&format.name)
        || format.name == pcd::FORMAT.name && pcd::without_header(job)
}

/// Drops points at (0, 0, 0), which scanners write for missing returns. A single such point may be real, unless
/// coordinates are in the sensor's frame.
fn drop_no_returns(job: &Job<'_>, format: &Format, cloud: &mut PointCloud) {
    let total = cloud.len();
    let least = if format.sensor_frame { 1 } else { 2 };
    let count = take_out_no_returns(cloud, |count| (least..total).contains(&count));
    if count > 0 {
        job.note(format!("dropped {count} of {total} points at (0, 0, 0), where nothing was measured"));
    }
}

/// Removes the points at (0, 0, 0) if `if_so_many` accepts their number, and returns how many it removed.
pub(crate) fn take_out_no_returns(cloud: &mut PointCloud, if_so_many: impl Fn(usize) -> bool) -> usize {
    // With the origin at zero, positions are world coordinates. A zero has no bit set but the sign.
    let exact = cloud.origin() == DVec3::ZERO && cloud.residuals().is_none();
    let zero = |[x, y, z]: &[f32; 3]| (x.to_bits() | y.to_bits() | z.to_bits()) << 1 == 0;
    let absent = |i: usize| {
        if exact { zero(&cloud.positions()[i]) } else { cloud.world_position(i) == DVec3::ZERO }
    };
    let count = if exact {
        let zeros = |points: &[[f32; 3]]| points.iter().map(|point| usize::from(zero(point))).sum::<usize>();
        cloud.positions().par_chunks(BLOCK).map(zeros).sum()
    } else {
        (0..cloud.len()).into_par_iter().filter(|&i| absent(i)).count()
    };
    if count == 0 || !if_so_many(count) {
        return 0;
    }
    let keep: Vec<bool> = (0..cloud.len()).into_par_iter().map(|i| !absent(i)).collect();
    cloud.retain(|i| keep[i]);
    count
}

/// Points checked for zeros as one piece of parallel work.
const BLOCK: usize = 1 << 14;

/// Longest header line, in bytes; a longer one means a broken file.
const MAX_HEADER_LINE: usize = 1 << 16;

/// Input of every reader.
#[derive(Clone, Copy)]
pub(crate) struct Job<'a> {
    pub(crate) path: &'a Path,
    pub(crate) progress: &'a dyn Progress,
    pub(crate) bytes: &'a [u8],
    pub(crate) options: &'a ReadOptions,
    /// Whether triangles shall be read.
    pub(crate) triangles: bool,
}

impl Job<'_> {
    pub(crate) fn tick(&self, fraction: f32) -> Result<(), Error> {
        tick(self.progress, fraction)
    }

    /// Reports a note to the user.
    pub(crate) fn note(&self, note: impl AsRef<str>) {
        self.progress.note(&message(note.as_ref()));
    }

    /// Fails if the caller cancels; reports no progress.
    fn go_on(&self) -> Result<(), Error> {
        if self.progress.cancelled() { Err(Error::Cancelled) } else { Ok(()) }
    }

    /// Passes points to the caller before reading ends, if the caller wants chunks.
    fn preview(&self, points: impl FnOnce() -> Result<PointCloud, Error>) -> Result<(), Error> {
        if self.progress.wants_chunks() {
            self.go_on()?;
            let points = points()?;
            if !points.is_empty() {
                self.progress.chunk(points);
            }
        }
        Ok(())
    }

    /// Fails if `count` points of `bytes_per_point` bytes do not fit into memory, before anything is allocated.
    fn check_memory(&self, count: usize, bytes_per_point: usize) -> Result<(), Error> {
        let bytes = (count as u64).saturating_mul(bytes_per_point as u64);
        let name = self.path.file_name().unwrap_or_default().to_string_lossy();
        check_memory(&format!("the {count} points of {name}"), bytes)
    }

    pub(crate) fn malformed(&self, place: impl Into<String>, what: impl Into<String>) -> Error {
        Error::Malformed { path: self.path.into(), place: place.into(), what: message(&what.into()) }
    }

    pub(crate) fn unsupported(&self, what: impl Into<String>) -> Error {
        Error::Unsupported { path: self.path.into(), what: message(&what.into()) }
    }

    /// The line that contains byte `offset`, as the place of an error.
    fn line(&self, offset: usize) -> String {
        let newlines = self.bytes[..offset.min(self.bytes.len())].iter().filter(|&&byte| byte == b'\n').count();
        format!("line {}", newlines + 1)
    }

    /// Fails if binary data passed through a text conversion, which replaces every byte that is no UTF-8 by U+FFFD.
    /// Lengths and values are then wrong. Intact floats are hardly ever valid UTF-8, and never contain that character.
    fn check_not_text_converted(&self, start: usize) -> Result<(), Error> {
        let sample = &self.bytes[start..self.bytes.len().min(start + (1 << 16))];
        let valid = match std::str::from_utf8(sample) {
            Ok(text) => Some(text),
            // The sample may end inside a character.
            Err(error) if error.error_len().is_none() => std::str::from_utf8(&sample[..error.valid_up_to()]).ok(),
            Err(_) => None,
        };
        if valid.is_some_and(|text| text.contains('\u{FFFD}')) {
            return Err(self.malformed(
                format!("byte {start}"),
                "the binary data was destroyed by a conversion to UTF-8 text; copy the original file as binary",
            ));
        }
        Ok(())
    }
}

/// A piece of a file for a message: at most 40 bytes, without characters that act on a terminal.
pub(crate) fn shown(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(40)]);
    text.chars().flat_map(char::escape_debug).collect()
}

/// The content of a file: mapped, or read if the file cannot be mapped, such as a pipe.
pub(crate) enum Bytes {
    Mapped(memmap2::Mmap),
    Read(Vec<u8>),
}

impl Bytes {
    #[allow(unsafe_code, reason = "a memory map is several times faster than reading, and needs unsafe")]
    pub(crate) fn open(path: &Path) -> std::io::Result<Self> {
        let mut file = File::open(path)?;
        let metadata = file.metadata()?;
        if metadata.is_file() && metadata.len() > 0 {
            // SAFETY: the map is read-only and private to this call. If another program shortens the file meanwhile,
            // the system ends the process with a bus error. If another program writes to the file, values are wrong,
            // but every access is checked against the length at mapping. All programs that map files carry both risks.
            let map = unsafe { memmap2::Mmap::map(&file) }?;
            return Ok(Self::Mapped(map));
        }
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        Ok(Self::Read(bytes))
    }
}

impl Deref for Bytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Mapped(map) => map,
            Self::Read(bytes) => bytes,
        }
    }
}
