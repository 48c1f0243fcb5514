//! Temporary files: listed, locked, and removed whatever ends the process.
//!
//! # How it works
//!
//! Temporary files have names, because ffmpeg needs one and not every file system has files without. Each is locked as
//! long as its draft lives, and the system releases the lock of a process that was killed. The first draft in a folder
//! removes temporary files that nobody locks. Locks may not reach other computers, so that files of those stay a day.
//! A list of all drafts lets the process remove them when a signal ends it.

use std::{
    collections::HashSet,
    ffi::OsStr,
    fs::File,
    io::{Error, Result},
    path::{Path, PathBuf},
    sync::{Mutex, OnceLock},
    time::{Duration, Instant},
};

use tempfile::{NamedTempFile, TempPath};

use crate::lock;

/// What the names of all temporary files begin with.
pub(super) const PREFIX: &str = ".autosplats-";

/// Temporary files of other computers are removed at this age.
pub(super) const ABANDONED_AFTER: Duration = Duration::from_secs(24 * 60 * 60);

/// Most names of a folder that are looked at in the search for abandoned files.
const MAX_NAMES: usize = 100_000;

/// Longest wait for the list of drafts when the process ends.
const END_WITHIN: Duration = Duration::from_secs(1);

/// Most temporary names to try.
const MAX_TRIES: usize = 16;

/// Temporary files of this process.
struct Drafts {
    /// Whether the process ends, so that none may be added.
    ended: bool,
    paths: Vec<PathBuf>,
}

static DRAFTS: Mutex<Drafts> = Mutex::new(Drafts { ended: false, paths: Vec::new() });

/// Removes the temporary files of all drafts and lets no other begin: for a process that ends now. Returns after a
/// second at most, even if another thread holds the list of drafts. Takes no memory, unless paths are long.
pub fn abandon_drafts() {
    let begun = Instant::now();
    while begun.elapsed() < END_WITHIN {
        let Ok(mut drafts) = DRAFTS.try_lock() else {
            std::thread::sleep(Duration::from_millis(1));
            continue;
        };
        drafts.ended = true;
        for path in &drafts.paths {
            // It may be in place already.
            let _ = std::fs::remove_file(path);
        }
        return;
    }
}

/// A temporary file that the list knows. It is removed when dropped.
#[derive(Debug)]
pub(super) struct Temporary {
    pub(super) file: NamedTempFile,
}

impl Temporary {
    /// Creates and locks a temporary file.
    pub(super) fn new(folder: &Path, suffix: &OsStr) -> Result<Self> {
        let prefix = format!("{PREFIX}{:08x}-", computer());
        let mut builder = tempfile::Builder::new();
        builder.prefix(&prefix).suffix(suffix);
        // Temporary files are private by default; the result shall have usual permissions.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        for _ in 0..MAX_TRIES {
            let mut drafts = lock(&DRAFTS);
            if drafts.ended {
                return Err(Error::other("the program ends"));
            }
            drafts.paths.reserve(1);
            let file = builder.tempfile_in(folder)?;
            drafts.paths.push(file.path().to_owned());
            drop(drafts);
            let listed = Self { file };
            if listed.lock() {
                return Ok(listed);
            }
        }
        Err(Error::other("other programs remove its temporary files"))
    }

    /// Locks the file. False if somebody took it for an abandoned one before.
    fn lock(&self) -> bool {
        #[cfg(unix)]
        {
            use std::os::unix::fs::MetadataExt as _;
            let file = self.file.as_file();
            !matches!(file.try_lock(), Err(std::fs::TryLockError::WouldBlock))
                && file.metadata().is_ok_and(|metadata| metadata.nlink() > 0)
        }
        // A lock would keep other programs from writing to the file.
        #[cfg(not(unix))]
        true
    }

    /// Gives the file its name. Without `replace`, a file that is there stays, and is an error.
    pub(super) fn rename(self, path: &Path, replace: bool) -> Result<()> {
        if replace {
            return std::fs::rename(self.file.path(), path);
        }
        TempPath::try_from_path(self.file.path())?.persist_noclobber(path).map_err(|error| error.error)
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        let path = self.file.path();
        let _ = std::fs::remove_file(path);
        let mut drafts = lock(&DRAFTS);
        drafts.paths.retain(|listed| listed != path);
    }
}

/// A number that tells this computer, or container, from others.
pub(super) fn computer() -> u32 {
    static NUMBER: OnceLock<u32> = OnceLock::new();
    *NUMBER.get_or_init(|| {
        #[cfg(unix)]
        let name = rustix::system::uname().nodename().to_bytes().to_vec();
        #[cfg(not(unix))]
        let name = std::env::var_os("COMPUTERNAME").unwrap_or_default().into_encoded_bytes();
        // FNV-1a.
        name.iter().fold(0x811c_9dc5, |hash, &byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193))
    })
}

/// Removes what ended processes have left in a folder, once in the life of this process.
pub(super) fn sweep_once(folder: &Path) {
    static SWEPT: Mutex<Option<HashSet<PathBuf>>> = Mutex::new(None);
    let mut swept = lock(&SWEPT);
    if swept.get_or_insert_default().insert(folder.to_owned()) {
        drop(swept);
        sweep(folder);
    }
}

/// Removes abandoned temporary files. What cannot be removed stays.
pub(super) fn sweep(folder: &Path) {
    let Ok(entries) = folder.read_dir() else { return };
    let own = format!("{PREFIX}{:08x}-", computer());
    for entry in entries.take(MAX_NAMES).flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if !name.starts_with(PREFIX) || !entry.file_type().is_ok_and(|kind| kind.is_file()) {
            continue;
        }
        let age = entry.metadata().ok().and_then(|metadata| metadata.modified().ok()?.elapsed().ok());
        let is_old = age.is_some_and(|age| age > ABANDONED_AFTER);
        // Where no locks are, only the age tells.
        if !(is_old || cfg!(unix) && name.starts_with(&own)) {
            continue;
        }
        let path = entry.path();
        // The lock is held until the file is gone, so that no draft takes it for its own.
        let Ok(file) = File::open(&path) else { continue };
        if !cfg!(unix) || file.try_lock().is_ok() {
            let _ = std::fs::remove_file(&path);
        }
    }
}
