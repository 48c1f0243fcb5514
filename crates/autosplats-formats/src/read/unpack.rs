//! What lies around the bytes of any format: compression with gzip, and the encoding of text.

use std::{borrow::Cow, io::Read as _, path::Path};

use autosplats_cloud::{Error, Progress, Unmarked, check_memory, reserving};
use flate2::bufread::GzDecoder;

/// First bytes of a file that gzip compressed.
pub(super) const GZIP: &[u8] = &[0x1f, 0x8b, 8];

/// Fewest and most bytes decompressed between two checks of the memory and of cancellation.
const STEPS: [usize; 2] = [1 << 16, 1 << 24];

/// The bytes that a reader gets.
pub(super) struct Unpacked<'a> {
    pub(super) bytes: Cow<'a, [u8]>,
    /// The encoding that a byte order mark states, for people.
    pub(super) encoding: Option<&'static str>,
    pub(super) compressed: bool,
    /// Note for the user.
    pub(super) note: Option<String>,
}

impl<'a> Unpacked<'a> {
    pub(super) fn of(path: &Path, bytes: &'a [u8], progress: &dyn Progress) -> Result<Self, Error> {
        if !bytes.starts_with(GZIP) {
            let Unmarked { bytes, encoding } = Unmarked::of(bytes)?;
            return Ok(Self { bytes, encoding, compressed: false, note: None });
        }
        let (bytes, left) = decompress(path, bytes, progress)?;
        let note = (left > 0).then(|| format!("{left} bytes after the compressed data are no gzip; left out"));
        let Unmarked { bytes: text, encoding } = Unmarked::of(&bytes)?;
        let bytes = match text {
            Cow::Borrowed(text) => {
                let mark = bytes.len() - text.len();
                let mut bytes = bytes;
                bytes.drain(..mark);
                bytes
            }
            Cow::Owned(text) => text,
        };
        Ok(Self { bytes: bytes.into(), encoding, compressed: true, note })
    }
}

/// The decompressed bytes of all members, and the number of bytes after them that are no member.
fn decompress(path: &Path, mut rest: &[u8], progress: &dyn Progress) -> Result<(Vec<u8>, usize), Error> {
    let what = format!("{}, decompressed", path.file_name().unwrap_or_default().to_string_lossy());
    let whole = rest.len();
    let mut bytes = Vec::new();
    while rest.starts_with(GZIP) {
        let mut decoder = GzDecoder::new(rest);
        loop {
            progress.tick(0.0)?;
            // A few kilobytes may decompress to gigabytes, so memory is asked for step by step.
            let step = bytes.len().clamp(STEPS[0], STEPS[1]);
            if bytes.capacity() - bytes.len() < step {
                let more = bytes.len().max(step);
                check_memory(&what, (bytes.len() + more) as u64)?;
                let room = reserving(|| bytes.try_reserve(more));
                room.map_err(|_| Error::OutOfMemory { what: what.clone(), bytes: more })?;
            }
            let read = decoder.by_ref().take(step as u64).read_to_end(&mut bytes).map_err(|error| {
                let at = whole - decoder.get_ref().len();
                let why = if error.kind() == std::io::ErrorKind::UnexpectedEof { "is cut off" } else { "is damaged" };
                Error::malformed(path, format!("byte {at}"), format!("the compressed data {why}; copy the file again"))
            })?;
            if read == 0 {
                break;
            }
        }
        rest = decoder.into_inner();
    }
    // Tapes and some programs pad with zeros.
    Ok((bytes, if rest.iter().all(|&byte| byte == 0) { 0 } else { rest.len() }))
}

/// A name without the ending of compressed files.
pub(super) fn without_gz(name: &str) -> &str {
    let cut = name.len().saturating_sub(3);
    if cut > 0 && name.is_char_boundary(cut) && name[cut..].eq_ignore_ascii_case(".gz") { &name[..cut] } else { name }
}
