//! Files to point clouds, one module per format.
//!
//! # How it works
//!
//! A file is mapped into memory and its format told by its first bytes, then by its extension. Every format ends in the
//! same shape, a [`table`]: named columns of numbers at fixed distances, from which positions, colours and fields are
//! taken in parallel. Binary PLY and PCD are such a table as they lie on the disk; text and lists are first packed into
//! one. LAS has columns of bits and integer coordinates and makes its cloud itself.
//!
//! A file is not trusted: what its header claims is checked against its size before anything is allocated.

mod las;
mod laz;
mod pcd;
mod ply;
mod table;
mod text;
mod xyz;

use std::{fs::File, io::Read as _, ops::Deref, path::Path};

pub(crate) use self::table::{SMALL, middle};
use crate::{Error, PointCloud, Progress, progress::tick};

/// What [`read`] understands, for messages.
pub(crate) const FORMATS: &str = "PLY, LAS, LAZ, COPC, PCD and text points (.xyz .txt .csv .pts .asc)";

/// Reads a point cloud, recognising PLY, LAS, LAZ, COPC, PCD and plain text by content first, then by extension.
///
/// Coordinates above about 1e4 are stored about an origin of whole numbers, so that survey coordinates keep their
/// precision; smaller ones keep the file's `f32` bits. Non-finite points stay in the cloud.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read, [`Error::UnknownFormat`], [`Error::Malformed`] and [`Error::Unsupported`]
/// for what is in it, [`Error::OutOfMemory`], and [`Error::Cancelled`] if `progress` says so.
pub fn read(path: &Path, progress: &dyn Progress) -> Result<PointCloud, Error> {
    let bytes = Bytes::open(path).map_err(|source| Error::Io { path: path.into(), source })?;
    let job = Job { path, progress, bytes: &bytes };
    tick(progress, 0.0)?;
    let cloud = match Format::of(&bytes, path) {
        Some(Format::Ply) => ply::read(&job),
        Some(Format::Las) => las::read(&job),
        Some(Format::Pcd) => pcd::read(&job),
        Some(Format::Xyz) => xyz::read(&job),
        None => Err(Error::UnknownFormat { path: path.into() }),
    }?;
    tick(progress, 1.0)?;
    Ok(cloud)
}

enum Format {
    Ply,
    Las,
    Pcd,
    Xyz,
}

impl Format {
    fn of(bytes: &[u8], path: &Path) -> Option<Self> {
        if bytes.starts_with(b"LASF") {
            return Some(Self::Las);
        }
        if bytes.starts_with(b"ply") && bytes.get(3).is_none_or(u8::is_ascii_whitespace) {
            return Some(Self::Ply);
        }
        if pcd::recognised(bytes) {
            return Some(Self::Pcd);
        }
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "ply" => Some(Self::Ply),
            "las" | "laz" => Some(Self::Las),
            "pcd" => Some(Self::Pcd),
            "xyz" | "txt" | "csv" | "pts" | "asc" => Some(Self::Xyz),
            _ => None,
        }
    }
}

/// What every reader is given.
#[derive(Clone, Copy)]
struct Job<'a> {
    path: &'a Path,
    progress: &'a dyn Progress,
    bytes: &'a [u8],
}

impl Job<'_> {
    fn tick(&self, fraction: f32) -> Result<(), Error> {
        tick(self.progress, fraction)
    }

    fn malformed(&self, place: impl Into<String>, what: impl Into<String>) -> Error {
        Error::Malformed { path: self.path.into(), place: place.into(), what: what.into() }
    }

    fn unsupported(&self, what: impl Into<String>) -> Error {
        Error::Unsupported { path: self.path.into(), what: what.into() }
    }

    /// The line that the byte at `offset` is in, as a place in an error.
    fn line(&self, offset: usize) -> String {
        let newlines = self.bytes[..offset.min(self.bytes.len())].iter().filter(|&&byte| byte == b'\n').count();
        format!("line {}", newlines + 1)
    }

    /// Refuses binary data that went through a text conversion: every byte that was no UTF-8 has become U+FFFD, so
    /// lengths and values are wrong. Intact floats are hardly ever valid UTF-8, and never with that character in it.
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

/// A piece of a file as it may stand in a message: short, and without characters that would act on a terminal.
fn shown(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(40)]);
    text.chars().flat_map(char::escape_debug).collect()
}

/// The whole content of a file: mapped, or read where there is nothing to map, as for a pipe.
enum Bytes {
    Mapped(memmap2::Mmap),
    Read(Vec<u8>),
}

impl Bytes {
    #[allow(unsafe_code, reason = "a memory map is several times faster than reading, and needs unsafe")]
    fn open(path: &Path) -> std::io::Result<Self> {
        let mut file = File::open(path)?;
        let metadata = file.metadata()?;
        if metadata.is_file() && metadata.len() > 0 {
            // SAFETY: the map is read-only and private to this call. Should another program shorten the file meanwhile,
            // the system ends the process with a bus error; should it write to it, values are wrong but every access is
            // checked against the length seen here. Both are documented risks of all programs that map files.
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
