//! Watches a file that is rewritten, or a folder or pattern to which files are added, by polling.

use std::{
    cmp::Ordering,
    collections::HashSet,
    path::{Path, PathBuf},
    sync::Arc,
    thread::sleep,
    time::{Duration, SystemTime},
};

use autosplats_cloud::{Error, PointCloud, check_memory};
use autosplats_formats::{ReadOptions, read_bytes};
use glob::glob;

use super::{
    mailbox::Mailbox,
    work::{UntilAbandoned, guarded, now},
};
use crate::{
    Update,
    listing::{is_named_as_cloud, natural},
    stream::or_empty,
};

/// Time between two polls. A file that is the same in two consecutive polls counts as complete.
const POLL_INTERVAL: Duration = Duration::from_millis(100);

/// State of a file at a poll.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct FileState {
    changed: SystemTime,
    path: PathBuf,
    len: u64,
}

impl FileState {
    fn of(path: PathBuf) -> Option<Self> {
        let data = std::fs::metadata(&path).ok().filter(std::fs::Metadata::is_file)?;
        Some(Self { changed: data.modified().unwrap_or(SystemTime::UNIX_EPOCH), path, len: data.len() })
    }

    /// Order of writing; files of the same time are ordered by name.
    fn order(&self, other: &Self) -> Ordering {
        let names = || natural(&self.path.to_string_lossy(), &other.path.to_string_lossy());
        self.changed.cmp(&other.changed).then_with(names)
    }

    fn is_newer(&self, than: &Self) -> bool {
        self.order(than).is_gt()
    }
}

/// Watches until the mailbox is abandoned.
pub(super) fn watch(path: &Path, options: &ReadOptions, mailbox: &Mailbox) {
    let mut known: Option<FileState> = None;
    let mut before: HashSet<FileState> = HashSet::new();
    while !mailbox.is_abandoned() {
        let files = look(path);
        // If the newest file is deleted, older files must not be shown again.
        let follows =
            |file: &FileState| known.as_ref().is_none_or(|known| file.is_newer(known) || file.path == known.path);
        // Only complete files count; a newer one may still be in the middle of being written.
        let whole = files.iter().filter(|file| before.contains(*file) && follows(file));
        let newest = whole.max_by(|a, b| a.order(b)).filter(|newest| Some(*newest) != known.as_ref());
        if let Some(newest) = newest {
            let read = guarded(&newest.path, || read(newest, options, mailbox));
            // A file that changed while it was read is still being written.
            if FileState::of(newest.path.clone()).as_ref() == Some(newest) {
                let between = |file: &&FileState| {
                    known.as_ref().is_some_and(|known| file.is_newer(known)) && newest.is_newer(file)
                };
                mailbox.drop_updates(files.iter().filter(between).count() as u64);
                known = Some(newest.clone());
                match read {
                    Ok(cloud) => mailbox.put(Update { channel: 0, stamp: now(), cloud: Arc::new(cloud) }),
                    Err(Error::Cancelled) => {}
                    Err(error) => mailbox.refuse(error),
                }
            }
        }
        before = files.into_iter().collect();
        sleep(POLL_INTERVAL);
    }
}

/// The file, or the files of the folder or pattern that may be clouds.
fn look(path: &Path) -> Vec<FileState> {
    if let Some(file) = FileState::of(path.into()) {
        return vec![file];
    }
    let files: Vec<PathBuf> = match std::fs::read_dir(path) {
        Ok(entries) => entries.filter_map(|entry| Some(entry.ok()?.path())).collect(),
        // A name that is not a pattern either is a file that does not exist yet.
        Err(_) => path.to_str().and_then(|name| glob(name).ok()).into_iter().flatten().filter_map(Result::ok).collect(),
    };
    files.into_iter().filter(|file| is_named_as_cloud(file)).filter_map(FileState::of).collect()
}

/// Reads a file into memory first. If it were mapped and another program shortened it, the process would crash.
fn read(file: &FileState, options: &ReadOptions, mailbox: &Mailbox) -> Result<PointCloud, Error> {
    let path = &file.path;
    check_memory(&path.display().to_string(), file.len)?;
    let bytes = std::fs::read(path).map_err(|source| Error::Io { path: path.clone(), source })?;
    or_empty(read_bytes(path, &bytes, options, &UntilAbandoned(mailbox)))
}
