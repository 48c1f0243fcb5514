//! The bytes of files: mapped, without a signal where a file is cut short meanwhile.

use std::{
    fs::{File, Metadata},
    io::{ErrorKind, Read as _},
    ops::Deref,
    path::{Path, PathBuf},
    time::SystemTime,
};

use crate::{Error, check_memory, maps::Map, reserving};

/// The content of a file: mapped, or read if the file cannot be mapped, such as a pipe.
///
/// If the file is cut short, or its disk is removed, while it is mapped, the missing bytes read as zeros. So whoever
/// works on the bytes asks [`checked`](Self::checked) afterwards.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{Bytes, Error};
///
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("numbers");
/// std::fs::write(&path, [1, 2, 3])?;
/// let bytes = Bytes::open(&path)?;
/// let sum = bytes.iter().sum::<u8>();
/// assert_eq!(bytes.checked(Ok(sum))?, 6);
/// std::fs::write(&path, [1])?;
/// assert!(matches!(bytes.checked(Ok(sum)), Err(Error::Malformed { .. })));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Bytes {
    content: Content,
    /// The file and how it was when it was opened; `None` for bytes that no file can change.
    source: Option<(PathBuf, Stamp)>,
}

enum Content {
    Mapped(Map),
    Read(Vec<u8>),
}

/// Bytes that are read between two checks of the memory, of what has no length.
const STEP: usize = 16 << 20;

impl Bytes {
    /// Opens a file. A pipe is read to its end.
    ///
    /// # Errors
    /// [`Error::Io`], also for devices, which have no end; and [`Error::OutOfMemory`] for a pipe with more bytes than
    /// memory is free.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let io = |source| Error::Io { path: path.into(), source };
        let mut file = File::open(path).map_err(io)?;
        let metadata = file.metadata().map_err(io)?;
        if !metadata.is_file() {
            check_ends(path, &metadata)?;
            return Ok(Self { content: Content::Read(read_pipe(path, &mut file)?), source: None });
        }
        let content = match Map::new(&file, metadata.len()).map_err(io)? {
            Some(map) => Content::Mapped(map),
            None => {
                let shown = path.file_name().unwrap_or_default().to_string_lossy();
                check_memory(&format!("the content of {shown}"), metadata.len())?;
                let mut bytes = Vec::new();
                file.read_to_end(&mut bytes).map_err(io)?;
                Content::Read(bytes)
            }
        };
        Ok(Self { content, source: Some((path.into(), Stamp::of(&metadata))) })
    }

    /// Fails if bytes are missing, because the file was cut short or its disk failed since it was opened. Asking costs
    /// nothing.
    ///
    /// # Errors
    /// [`Error::Malformed`].
    pub fn check(&self) -> Result<(), Error> {
        match (&self.content, &self.source) {
            (Content::Mapped(map), Some((path, _))) if map.is_cut() => Err(changed(path)),
            _ => Ok(()),
        }
    }

    /// What was made of the bytes, unless the file changed since it was opened. Then that is the error, whatever the
    /// bytes led to. A file that another replaced does not count: the bytes stay those of the old one.
    ///
    /// # Errors
    /// That of `made`, and [`Error::Malformed`].
    pub fn checked<T>(&self, made: Result<T, Error>) -> Result<T, Error> {
        if matches!(made, Err(Error::Cancelled)) {
            return made;
        }
        self.check()?;
        if let Some((path, stamp)) = &self.source
            && let Ok(metadata) = path.metadata()
        {
            let now = Stamp::of(&metadata);
            if now.file == stamp.file && now != *stamp {
                return Err(changed(path));
            }
        }
        made
    }
}

impl From<Vec<u8>> for Bytes {
    fn from(bytes: Vec<u8>) -> Self {
        Self { content: Content::Read(bytes), source: None }
    }
}

impl Deref for Bytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match &self.content {
            Content::Mapped(map) => map,
            Content::Read(bytes) => bytes,
        }
    }
}

/// Reads a small file whole, such as a pose or a camera.
///
/// # Errors
/// Those of the operating system; of the kind `FileTooLarge` if there are more than `most` bytes, `InvalidInput` for
/// a device.
pub fn read_small(path: &Path, most: u64) -> std::io::Result<Vec<u8>> {
    let file = File::open(path)?;
    if is_device(&file.metadata()?) {
        return Err(std::io::Error::new(ErrorKind::InvalidInput, DEVICE));
    }
    let mut bytes = Vec::new();
    file.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        let what = format!("the file has more than {} MiB, which is too much for what it should hold", most >> 20);
        return Err(std::io::Error::new(ErrorKind::FileTooLarge, what));
    }
    Ok(bytes)
}

/// What is wrong with a device.
const DEVICE: &str = "this is a device, which has no end; name a file or a pipe";

/// Fails for what can be read without end.
fn check_ends(path: &Path, metadata: &Metadata) -> Result<(), Error> {
    if is_device(metadata) {
        let source = std::io::Error::new(ErrorKind::InvalidInput, DEVICE);
        return Err(Error::Io { path: path.into(), source });
    }
    Ok(())
}

/// Whether something is a device. A terminal is one too, but nobody types points.
fn is_device(metadata: &Metadata) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt as _;
        metadata.file_type().is_char_device() || metadata.file_type().is_block_device()
    }
    #[cfg(not(unix))]
    {
        let _ = metadata;
        false
    }
}

/// All bytes of a pipe, as far as memory is free.
fn read_pipe(path: &Path, file: &mut File) -> Result<Vec<u8>, Error> {
    let mut bytes = Vec::new();
    loop {
        if bytes.capacity() - bytes.len() < STEP {
            let more = bytes.len().max(STEP);
            let what = || format!("what comes through {}", path.display());
            check_memory(&what(), (bytes.len() + more) as u64)?;
            let room = reserving(|| bytes.try_reserve(more));
            room.map_err(|_| Error::OutOfMemory { what: what(), bytes: more })?;
        }
        let read = file.by_ref().take(STEP as u64).read_to_end(&mut bytes);
        if read.map_err(|source| Error::Io { path: path.into(), source })? == 0 {
            return Ok(bytes);
        }
    }
}

fn changed(path: &Path) -> Error {
    Error::malformed(path, "size or time", "the file changed while it was read; start again")
}

/// Which file it is, its size and the time of its last change.
#[derive(PartialEq, Eq)]
struct Stamp {
    file: [u64; 2],
    len: u64,
    changed: Option<SystemTime>,
}

impl Stamp {
    fn of(metadata: &Metadata) -> Self {
        #[cfg(unix)]
        let file = {
            use std::os::unix::fs::MetadataExt as _;
            [metadata.dev(), metadata.ino()]
        };
        #[cfg(not(unix))]
        let file = [0; 2];
        Self { file, len: metadata.len(), changed: metadata.modified().ok() }
    }
}

#[cfg(test)]
mod tests {
    use std::fs::{OpenOptions, write};

    use super::*;

    #[cfg(unix)]
    #[test]
    fn a_file_that_is_cut_short_reads_as_zeros_and_is_told() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("scan");
        write(&path, vec![7_u8; 1 << 20]).expect("written");
        let [cut, kept] = [(); 2].map(|()| Bytes::open(&path).expect("opened"));
        assert_eq!(cut[(1 << 20) - 1], 7, "whole");
        OpenOptions::new().write(true).open(&path).expect("opened").set_len(5).expect("cut");
        // From two threads, of which each may be the first to see it.
        let sums = std::thread::scope(|scope| {
            let sum = || cut.iter().map(|&byte| u64::from(byte)).sum::<u64>();
            [scope.spawn(sum), scope.spawn(sum)].map(|thread| thread.join().expect("no signal"))
        });
        assert!(sums.iter().all(|&sum| sum <= 7 << 12), "at most a page is left: {sums:?}");
        let told = cut.check().expect_err("it was read").to_string();
        assert!(told.ends_with("size or time: the file changed while it was read; start again"), "{told}");
        assert!(kept.check().is_ok(), "nobody has read the other map");
        assert!(kept.checked(Ok(())).is_err(), "its size tells");
        assert!(matches!(kept.checked::<()>(Err(Error::Cancelled)), Err(Error::Cancelled)), "the user's wish is first");
    }

    #[test]
    fn a_file_that_another_replaces_has_not_changed() {
        let folder = tempfile::tempdir().expect("a folder");
        let [path, other] = ["scan", "other"].map(|name| folder.path().join(name));
        write(&path, [1; 9]).expect("written");
        let bytes = Bytes::open(&path).expect("opened");
        if cfg!(unix) {
            write(&other, [2; 5]).expect("written");
            std::fs::rename(&other, &path).expect("replaced");
            assert!(bytes.checked(Ok(())).is_ok() && *bytes == [1; 9], "the old bytes");
            std::fs::remove_file(&path).expect("removed");
            assert!(bytes.checked(Ok(())).is_ok() && *bytes == [1; 9], "still");
        }
    }

    #[cfg(unix)]
    #[test]
    fn devices_have_no_end() {
        let told = Bytes::open("/dev/zero".as_ref()).map(|bytes| bytes.len()).expect_err("without end").to_string();
        assert_eq!(told, format!("/dev/zero: {DEVICE}"));
        assert!(read_small("/dev/zero".as_ref(), 1 << 20).is_err(), "nor a small one");
    }

    #[test]
    fn small_files_are_small() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("pose");
        write(&path, vec![1; 1 << 20]).expect("written");
        assert_eq!(read_small(&path, 1 << 20).map(|bytes| bytes.len()).ok(), Some(1 << 20), "not more than allowed");
        write(&path, vec![1; (1 << 20) + 1]).expect("written");
        assert!(read_small(&path, 1 << 20).is_err_and(|error| error.to_string().contains("1 MiB")), "more");
    }
}
