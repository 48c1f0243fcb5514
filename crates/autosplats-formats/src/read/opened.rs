//! A file that is read again and again, and not mapped, so that limits of memory hold.

use std::{
    fs::{File, Metadata},
    io::ErrorKind,
    ops::Range,
    path::{Path, PathBuf},
    time::SystemTime,
};

use autosplats_cloud::{Error, read_exact_at, reserving};

/// Where points of a compressed file wait, so that they are decompressed once.
#[derive(Clone, Copy, Debug)]
pub struct Unpacking<'a> {
    /// Folder for a temporary file without a name, which is gone when the [`Parts`](super::Parts) are dropped.
    pub folder: &'a Path,
    /// Bytes of the folder's disk that stay free. If there are fewer, points are decompressed each time.
    pub leave: u64,
}

/// A file that is read again and again, and must not change meanwhile.
pub(super) struct Opened {
    pub(super) path: PathBuf,
    stamp: Stamp,
    /// Number of bytes before those that readers see: a byte order mark.
    before: usize,
    len: usize,
    /// Bytes to read at a time.
    piece: usize,
}

/// Size and time of the last change.
type Stamp = (u64, Option<SystemTime>);

fn stamp(metadata: &Metadata) -> Stamp {
    (metadata.len(), metadata.modified().ok())
}

impl Opened {
    /// The file without its first bytes, to be read in pieces of about `piece` bytes. It shall stay as `metadata`
    /// tells.
    pub(super) fn new(path: &Path, metadata: &Metadata, before: usize, piece: usize) -> Self {
        let len = usize::try_from(metadata.len()).unwrap_or(usize::MAX).saturating_sub(before);
        Self { path: path.into(), stamp: stamp(metadata), before, len, piece }
    }

    /// Opens the file again.
    ///
    /// # Errors
    /// [`Error::Io`], and [`Error::Malformed`] if the file has changed.
    pub(super) fn reader(&self) -> Result<Reader<'_>, Error> {
        let file = File::open(&self.path).map_err(|source| self.failed(source))?;
        let reader = Reader { opened: self, file, unpacking: None };
        reader.check()?;
        Ok(reader)
    }

    fn failed(&self, source: std::io::Error) -> Error {
        if source.kind() == ErrorKind::UnexpectedEof {
            return self.changed();
        }
        Error::Io { path: self.path.clone(), source }
    }

    fn changed(&self) -> Error {
        Error::malformed(&self.path, "size or time", "the file changed while it was read; start again")
    }
}

/// The bytes of a file, open.
pub(super) struct Reader<'a> {
    opened: &'a Opened,
    file: File,
    unpacking: Option<Unpacking<'a>>,
}

impl<'a> Reader<'a> {
    /// The same file, whose decompressed points may wait on a disk.
    pub(super) fn unpacking_to(self, unpacking: Option<Unpacking<'a>>) -> Self {
        Self { unpacking, ..self }
    }

    /// Where decompressed points may wait.
    pub(super) fn unpacking(&self) -> Option<Unpacking<'a>> {
        self.unpacking
    }

    /// Number of bytes.
    pub(super) fn len(&self) -> usize {
        self.opened.len
    }

    /// Bytes to read at a time.
    pub(super) fn piece(&self) -> usize {
        self.opened.piece
    }

    /// Appends bytes of the file to `bytes`.
    pub(super) fn read(&self, range: Range<usize>, bytes: &mut Vec<u8>) -> Result<(), Error> {
        let start = bytes.len();
        reserving(|| bytes.try_reserve(range.len()))
            .map_err(|_| Error::OutOfMemory { what: "a part of the file".into(), bytes: range.len() })?;
        bytes.resize(start + range.len(), 0);
        let at = (self.opened.before + range.start) as u64;
        read_exact_at(&self.file, &mut bytes[start..], at).map_err(|source| self.opened.failed(source))
    }

    /// Fails if the file has changed since it was opened first.
    pub(super) fn check(&self) -> Result<(), Error> {
        let metadata = self.file.metadata().map_err(|source| self.opened.failed(source))?;
        if stamp(&metadata) == self.opened.stamp { Ok(()) } else { Err(self.opened.changed()) }
    }
}
