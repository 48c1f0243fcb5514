//! Files as bytes: mapped for reading, and temporary ones.

use std::{fs::File, io::Read as _, ops::Deref, path::Path};

use crate::Error;

/// The content of a file: mapped, or read if the file cannot be mapped, such as a pipe.
pub enum Bytes {
    /// A map of the file.
    Mapped(memmap2::Mmap),
    /// A copy of the content.
    Read(Vec<u8>),
}

impl Bytes {
    /// Opens a file.
    ///
    /// # Errors
    /// Those of the operating system.
    #[allow(unsafe_code, reason = "a memory map is several times faster than reading, and needs unsafe")]
    pub fn open(path: &Path) -> std::io::Result<Self> {
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

/// A temporary file without a name, which the system removes once it is closed, however the program ends.
///
/// # Errors
/// Those of the operating system.
pub fn temporary_unnamed(folder: &Path) -> std::io::Result<File> {
    tempfile::tempfile_in(folder)
}

/// Bytes that can be written to the disk of a folder, if the system states them (not on Windows).
pub fn free_disk(folder: &Path) -> Option<u64> {
    #[cfg(unix)]
    return rustix::fs::statvfs(folder).ok().and_then(|disk| disk.f_bavail.checked_mul(disk.f_frsize));
    #[cfg(not(unix))]
    {
        let _ = folder;
        None
    }
}

/// Fails if the disk of a folder has less room than `bytes` for temporary files, which `what` needs.
///
/// # Errors
/// [`Error::Io`], which tells what is needed and what is there.
pub fn check_disk(folder: &Path, bytes: u64, what: &str) -> Result<(), Error> {
    let Some(free) = free_disk(folder).filter(|&free| free < bytes) else { return Ok(()) };
    let [need, free] = [bytes, free].map(|bytes| bytes.div_ceil(1 << 20));
    let what = format!(
        "{what} takes {need} MiB of disk for a while, but only {free} MiB are free; name another folder for temporary \
         files"
    );
    Err(Error::Io { path: folder.into(), source: std::io::Error::new(std::io::ErrorKind::StorageFull, what) })
}

/// Reads the bytes of a file from byte `at` on, whatever other threads read.
///
/// # Errors
/// Those of the operating system.
pub fn read_exact_at(file: &File, bytes: &mut [u8], at: u64) -> std::io::Result<()> {
    #[cfg(unix)]
    return std::os::unix::fs::FileExt::read_exact_at(file, bytes, at);
    #[cfg(windows)]
    {
        use std::io::ErrorKind::{Interrupted, UnexpectedEof};
        let (mut bytes, mut at) = (bytes, at);
        while !bytes.is_empty() {
            match std::os::windows::fs::FileExt::seek_read(file, bytes, at) {
                Ok(0) => return Err(UnexpectedEof.into()),
                Ok(read) => (bytes, at) = (&mut bytes[read..], at + read as u64),
                Err(error) if error.kind() == Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}

/// Writes bytes to a file from byte `at` on, whatever other threads write.
///
/// # Errors
/// Those of the operating system.
pub fn write_all_at(file: &File, bytes: &[u8], at: u64) -> std::io::Result<()> {
    #[cfg(unix)]
    return std::os::unix::fs::FileExt::write_all_at(file, bytes, at);
    #[cfg(windows)]
    {
        use std::io::ErrorKind::{Interrupted, WriteZero};
        let (mut bytes, mut at) = (bytes, at);
        while !bytes.is_empty() {
            match std::os::windows::fs::FileExt::seek_write(file, bytes, at) {
                Ok(0) => return Err(WriteZero.into()),
                Ok(written) => (bytes, at) = (&bytes[written..], at + written as u64),
                Err(error) if error.kind() == Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}
