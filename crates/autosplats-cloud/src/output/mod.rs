//! The one way to an output: every file that the project writes is a [`Draft`] first.
//!
//! # How it works
//!
//! A draft is a temporary file in the folder of the output. Finishing syncs it to the disk and renames it, so that the
//! output is there whole or not at all, even after a power cut. What is at the output's path is looked at when the
//! draft begins, and again when it is finished:
//!
//! | at the path | [`Existing::Replace`] | [`Existing::Keep`] |
//! |---|---|---|
//! | nothing | made | made; an error if something comes meanwhile |
//! | a file | replaced by one with its owner and access rights; an error if it is read-only | an error |
//! | a link | what it points to is meant, and may be missing | an error |
//! | a pipe, a character device | written into | written into |
//! | a folder, a block device, a socket | an error | an error |

mod temporary;

use std::{
    ffi::OsStr,
    fs::{File, Metadata, OpenOptions},
    io::{BufWriter, Error, ErrorKind, Result, Seek as _, Write as _},
    path::{Path, PathBuf},
};

pub use self::temporary::abandon_drafts;
use self::temporary::{Temporary, sweep_once};

/// Size of the output buffer, in bytes.
const BUFFER: usize = 1 << 20;

/// Most links that lead to an output, as in Linux.
const MAX_LINKS: usize = 40;

/// What happens to a file that is at the path of an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Existing {
    /// It stays until the new file is complete, and is then replaced.
    Replace,
    /// It stays, and writing fails with [`ErrorKind::AlreadyExists`].
    Keep,
}

/// Where a file is written, and what happens to one that is there. A path alone means [`Existing::Replace`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Output<'a> {
    /// Path of the file.
    pub path: &'a Path,
    /// What happens to a file that is there.
    pub existing: Existing,
}

impl<'a, P: AsRef<Path> + ?Sized> From<&'a P> for Output<'a> {
    fn from(path: &'a P) -> Self {
        Self { path: path.as_ref(), existing: Existing::Replace }
    }
}

/// What a finished draft does.
#[derive(Debug)]
enum Target {
    /// It becomes the file with this path, which no link is.
    File { path: PathBuf, existing: Existing },
    /// Its content goes into the pipe or device with this path.
    Stream(PathBuf),
}

/// A file in the making, which appears at its path once it is [finished](Self::finish). A dropped draft leaves nothing.
///
/// # Examples
///
/// ```
/// use std::io::{ErrorKind, Write as _};
///
/// use autosplats_cloud::{Draft, Existing, Output};
///
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("notes.txt");
/// let output = Output { path: &path, existing: Existing::Keep };
/// let [mut first, second] = [Draft::begin(output, ".tmp")?, Draft::begin(output, ".tmp")?];
/// first.file().write_all(b"the first")?;
/// assert!(!path.exists());
/// assert_eq!(first.finish()?, 9);
/// assert_eq!(second.finish().map_err(|error| error.kind()), Err(ErrorKind::AlreadyExists));
/// assert_eq!(std::fs::read(&path)?, b"the first");
/// # Ok::<(), std::io::Error>(())
/// ```
#[derive(Debug)]
pub struct Draft {
    temporary: Temporary,
    target: Target,
}

impl Draft {
    /// Begins a file. The temporary name ends in `suffix`.
    ///
    /// # Errors
    /// Those of the operating system; [`ErrorKind::AlreadyExists`] for what is to be kept; and other kinds for what is
    /// neither a file nor a pipe or a character device, and for read-only files.
    pub fn begin<'a>(output: impl Into<Output<'a>>, suffix: impl AsRef<OsStr>) -> Result<Self> {
        let output = output.into();
        let (target, replaced) = target(output)?;
        let folder = match &target {
            Target::File { path, .. } => folder_of(path).to_owned(),
            Target::Stream(_) => std::env::temp_dir(),
        };
        sweep_once(&folder);
        let temporary = Temporary::new(&folder, suffix.as_ref())?;
        if let Some(replaced) = replaced {
            keep_access(temporary.file.as_file(), &replaced)?;
        }
        Ok(Self { temporary, target })
    }

    /// The file to fill.
    pub fn file(&mut self) -> &mut File {
        self.temporary.file.as_file_mut()
    }

    /// The temporary path, for another program that fills the file.
    pub fn path(&self) -> &Path {
        self.temporary.file.path()
    }

    /// Puts the file in place and returns its size in bytes.
    ///
    /// # Errors
    /// Those of the operating system, and [`ErrorKind::AlreadyExists`] if a file has come that is to be kept.
    pub fn finish(self) -> Result<u64> {
        let Self { mut temporary, target } = self;
        let bytes = std::fs::metadata(temporary.file.path())?.len();
        match &target {
            Target::Stream(path) => {
                let mut stream = OpenOptions::new().write(true).open(path)?;
                if !is_stream(&stream.metadata()?) {
                    return Err(Error::new(ErrorKind::AlreadyExists, "something else has come in its place"));
                }
                let file = temporary.file.as_file_mut();
                file.rewind()?;
                std::io::copy(file, &mut stream)?;
                stream.flush()?;
            }
            Target::File { path, existing } => {
                sync(temporary.file.as_file())?;
                if *existing == Existing::Replace {
                    check_file(path)?;
                }
                temporary.rename(path, *existing == Existing::Replace).map_err(|error| match error.kind() {
                    ErrorKind::AlreadyExists => already_exists(),
                    _ => error,
                })?;
            }
        }
        Ok(bytes)
    }
}

/// Writes a file that appears complete or not at all. `write` fills a [`Draft`]; on failure nothing is left. `failed`
/// makes the caller's error of one of the operating system. Returns the size of the file in bytes.
///
/// # Errors
/// Those of `write` and those of [`Draft`].
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
pub fn write_whole<'a, E>(
    output: impl Into<Output<'a>>,
    failed: impl Fn(Error) -> E,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> std::result::Result<(), E>,
) -> std::result::Result<u64, E> {
    let mut draft = Draft::begin(output, ".tmp").map_err(&failed)?;
    let mut writer = BufWriter::with_capacity(BUFFER, draft.file());
    write(&mut writer)?;
    writer.flush().map_err(&failed)?;
    drop(writer);
    draft.finish().map_err(failed)
}

/// Whether something is at a path, which may be a link to nothing.
pub fn is_there(path: &Path) -> bool {
    path.symlink_metadata().is_ok()
}

/// Folder of a file.
fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// What a finished draft does, and the file that it replaces.
fn target(Output { path, existing }: Output<'_>) -> Result<(Target, Option<Metadata>)> {
    let ends_in_separator = path.as_os_str().to_string_lossy().ends_with(std::path::is_separator);
    if ends_in_separator || path.file_name().is_none() {
        return Err(is_folder());
    }
    let followed = match std::fs::metadata(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => None,
        metadata => Some(metadata?),
    };
    if followed.as_ref().is_some_and(is_stream) {
        return Ok((Target::Stream(path.into()), None));
    }
    if existing == Existing::Keep {
        return match path.symlink_metadata() {
            Err(error) if error.kind() == ErrorKind::NotFound => {
                Ok((Target::File { path: path.into(), existing }, None))
            }
            Err(error) => Err(error),
            Ok(metadata) if metadata.is_dir() => Err(is_folder()),
            Ok(_) => Err(already_exists()),
        };
    }
    let path = if followed.is_some() { path.canonicalize()? } else { end_of_links(path)? };
    let replaced = check_file(&path)?;
    if replaced.as_ref().is_some_and(|file| !is_writable(&path, file)) {
        return Err(Error::new(ErrorKind::PermissionDenied, "it is read-only; make it writable or name another file"));
    }
    Ok((Target::File { path, existing }, replaced))
}

fn already_exists() -> Error {
    Error::new(ErrorKind::AlreadyExists, "already exists")
}

fn is_folder() -> Error {
    Error::new(ErrorKind::IsADirectory, "this is a folder; name a file")
}

/// The missing file that links lead to.
fn end_of_links(path: &Path) -> Result<PathBuf> {
    let mut path = path.to_owned();
    for _ in 0..MAX_LINKS {
        match path.read_link() {
            Ok(next) => path = folder_of(&path).join(next),
            Err(_) => return Ok(path),
        }
    }
    Err(Error::other("its links lead in a circle"))
}

/// The file at a path, if any. Fails if something else is there.
fn check_file(path: &Path) -> Result<Option<Metadata>> {
    match path.symlink_metadata() {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
        Ok(metadata) if metadata.is_file() => Ok(Some(metadata)),
        Ok(metadata) if metadata.is_dir() => Err(is_folder()),
        Ok(_) => Err(Error::other("this is no file, pipe or character device; name another file")),
    }
}

/// Whether this is written into and never replaced.
fn is_stream(metadata: &Metadata) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt as _;
        metadata.file_type().is_fifo() || metadata.file_type().is_char_device()
    }
    #[cfg(not(unix))]
    {
        let _ = metadata;
        false
    }
}

/// Whether somebody may write to a file, and this process too.
fn is_writable(path: &Path, file: &Metadata) -> bool {
    // The superuser may write to every file: a file that nobody else may write to is protected nevertheless.
    if file.permissions().readonly() {
        return false;
    }
    #[cfg(unix)]
    return rustix::fs::access(path, rustix::fs::Access::WRITE_OK).is_ok();
    #[cfg(not(unix))]
    {
        let _ = path;
        true
    }
}

/// Gives a new file the owner and the access rights of the one that it replaces.
#[cfg(unix)]
fn keep_access(file: &File, replaced: &Metadata) -> Result<()> {
    use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _, fchown};
    let mut mode = replaced.mode() & 0o777;
    let own = file.metadata()?;
    let owner = (own.uid() != replaced.uid()).then_some(replaced.uid());
    let group = (own.gid() != replaced.gid()).then_some(replaced.gid());
    if (owner.is_some() || group.is_some())
        && fchown(file, owner, group).is_err()
        && group.is_some()
        && fchown(file, None, group).is_err()
    {
        // The rights were given to another group; this one gets those of all others.
        mode = (mode & 0o707) | ((mode & 0o007) << 3);
    }
    file.set_permissions(std::fs::Permissions::from_mode(mode))
}

/// Files get their access rights from the folder here.
#[cfg(not(unix))]
fn keep_access(_file: &File, _replaced: &Metadata) -> Result<()> {
    Ok(())
}

/// Waits until the disk has the file. Late errors, such as those of quotas and networks, come out here.
fn sync(file: &File) -> Result<()> {
    match file.sync_all() {
        // Some file systems cannot.
        Err(error) if matches!(error.kind(), ErrorKind::InvalidInput | ErrorKind::Unsupported) => Ok(()),
        synced => synced,
    }
}

#[cfg(test)]
mod tests;
