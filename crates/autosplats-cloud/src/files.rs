//! Files that are written whole or not at all, temporary files, and bytes at places of files.

use std::{
    ffi::OsStr,
    fs::File,
    io::{BufWriter, Write as _},
    path::Path,
};

use crate::Error;

/// Size of the output buffer, in bytes.
const BUFFER: usize = 1 << 20;

/// Writes a file that appears complete or not at all, and replaces an existing one. A symbolic link stays, and its
/// target is replaced. `write` fills a [temporary file](temporary_beside), which is then renamed; on failure it is
/// removed. `failed` makes the caller's error of one of the operating system.
///
/// # Errors
/// Those of `write`, and those of the operating system.
///
/// # Examples
///
/// ```
/// use std::io::{Error, Write as _};
///
/// use autosplats_cloud::write_whole;
///
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("notes.txt");
/// write_whole(&path, |error| error, |file| file.write_all(b"all of it"))?;
/// let failed = write_whole(&path, |error| error, |file| {
///     file.write_all(b"half")?;
///     Err(Error::other("stopped"))
/// });
/// assert!(failed.is_err());
/// assert_eq!(std::fs::read(&path)?, b"all of it");
/// # Ok::<(), Error>(())
/// ```
pub fn write_whole<E>(
    path: &Path,
    failed: impl Fn(std::io::Error) -> E,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), E>,
) -> Result<(), E> {
    let target = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let mut file = temporary_beside(&target, ".tmp").map_err(&failed)?;
    let mut writer = BufWriter::with_capacity(BUFFER, file.as_file_mut());
    write(&mut writer)?;
    writer.flush().map_err(&failed)?;
    drop(writer);
    file.persist(target).map_err(|error| failed(error.error))?;
    Ok(())
}

/// A temporary file in the folder of `path`, to be renamed once complete. Its name ends in `suffix`.
///
/// # Errors
/// Those of the operating system.
pub fn temporary_beside(path: &Path, suffix: impl AsRef<OsStr>) -> std::io::Result<tempfile::NamedTempFile> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".autosplats-").suffix(suffix.as_ref());
    // Temporary files are private by default; the result shall have usual permissions.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder)
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
