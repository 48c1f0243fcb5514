//! Bytes of a file, of memory or of an address, range by range.

mod file;
mod folder;
mod memory;

use std::fmt;
use std::ops::Range;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::{Error, Progress};

pub use file::FileRanges;
pub use folder::{Folder, LocalFolder};
pub use memory::MemoryRanges;

/// Something of which byte ranges can be read, on many threads at once, without reading the rest.
pub trait Ranges: Send + Sync + fmt::Debug {
    /// Path or address, for messages.
    fn name(&self) -> &Path;

    /// Size in bytes.
    fn size(&self) -> u64;

    /// The bytes of each range, in the order asked for. Ranges close to each other may be fetched together, and
    /// distant ones at the same time.
    ///
    /// # Errors
    /// [`Error::Malformed`] if a range reaches beyond the end, [`Error::Io`], [`Error::Remote`],
    /// [`Error::OutOfMemory`], and [`Error::Cancelled`] if `progress` says so.
    fn read(&self, ranges: &[Range<u64>], progress: &dyn Progress) -> Result<Vec<Vec<u8>>, Error>;

    /// What has been read so far.
    fn traffic(&self) -> Traffic;
}

/// Amount of reading.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Reads of a file or requests to a server, with those that were tried again.
    pub requests: u64,
    /// Bytes received.
    pub bytes: u64,
}

/// Counts reading, on many threads at once.
#[derive(Debug, Default)]
struct Counter {
    requests: AtomicU64,
    bytes: AtomicU64,
}

impl Counter {
    /// Counts a read of `bytes`.
    fn add(&self, bytes: u64) {
        self.requests.fetch_add(1, Ordering::Relaxed);
        self.bytes.fetch_add(bytes, Ordering::Relaxed);
    }

    fn traffic(&self) -> Traffic {
        Traffic { requests: self.requests.load(Ordering::Relaxed), bytes: self.bytes.load(Ordering::Relaxed) }
    }
}

/// Fails for a range that reaches beyond `size` bytes.
///
/// # Errors
/// [`Error::Malformed`].
pub fn check_range(name: &Path, range: &Range<u64>, size: u64) -> Result<(), Error> {
    if range.start <= range.end && range.end <= size {
        return Ok(());
    }
    let what = format!("bytes up to {} are named, but there are {size}; it is cut off, copy it again", range.end);
    Err(Error::malformed(name, format!("byte {}", range.start), what))
}
