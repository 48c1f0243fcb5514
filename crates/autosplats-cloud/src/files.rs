//! Temporary files, and bytes at places of files.

use std::{
    fs::File,
    io::ErrorKind::{FileTooLarge, QuotaExceeded, StorageFull},
    path::Path,
};

use crate::Error;

/// A temporary file without a name, which the system removes once it is closed, however the program ends.
///
/// # Errors
/// Those of the operating system.
pub fn temporary_unnamed(folder: &Path) -> std::io::Result<File> {
    tempfile::tempfile_in(folder)
}

/// The error of a [temporary file](temporary_unnamed) in a folder. If its disk is full, it says what helps.
pub fn temporary_failed(folder: &Path, source: &std::io::Error) -> Error {
    let remedy = if is_full(source) { "; free some, or name another folder for temporary files" } else { "" };
    let what = format!("temporary files cannot be kept there: {source}{remedy}");
    Error::Io { path: folder.into(), source: std::io::Error::new(source.kind(), what) }
}

/// Whether there was no room for what was written.
pub fn is_full(error: &std::io::Error) -> bool {
    matches!(error.kind(), StorageFull | QuotaExceeded | FileTooLarge)
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
    Err(Error::Io { path: folder.into(), source: std::io::Error::new(StorageFull, what) })
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
