//! A file that is written again, or a folder or a pattern to which files are added. Nobody tells: it is looked at now and
//! then.

use std::{
    cmp::Ordering,
    collections::HashSet,
    path::{Path, PathBuf},
    sync::Arc,
    thread::sleep,
    time::{Duration, SystemTime},
};

use glob::glob;

use super::{bytes::Until, guarded, mailbox::Mailbox, now};
use crate::{
    Error, PointCloud, ReadOptions, Update,
    memory::check_memory,
    read_bytes,
    source::animation::{is_named_as_cloud, natural},
};

/// Time between two looks; what two in a row find the same is taken for whole.
const LOOK: Duration = Duration::from_millis(100);

/// A file as it was at a look.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Seen {
    changed: SystemTime,
    path: PathBuf,
    len: u64,
}

impl Seen {
    fn of(path: PathBuf) -> Option<Self> {
        let data = std::fs::metadata(&path).ok().filter(std::fs::Metadata::is_file)?;
        Some(Self { changed: data.modified().unwrap_or(SystemTime::UNIX_EPOCH), path, len: data.len() })
    }

    /// The order in which files were written, by names where they were at once.
    fn order(&self, other: &Self) -> Ordering {
        let names = || natural(&self.path.to_string_lossy(), &other.path.to_string_lossy());
        self.changed.cmp(&other.changed).then_with(names)
    }

    fn is_newer(&self, than: &Self) -> bool {
        self.order(than).is_gt()
    }
}

/// Watches until nobody wants the points.
pub(super) fn watch(path: &Path, options: &ReadOptions, mailbox: &Mailbox) {
    let mut known: Option<Seen> = None;
    let mut before: HashSet<Seen> = HashSet::new();
    while !mailbox.is_abandoned() {
        let files = look(path);
        // When the newest is taken away, those before it are still those before it.
        let follows = |file: &Seen| known.as_ref().is_none_or(|known| file.is_newer(known) || file.path == known.path);
        // Of those that are whole: behind the newest of them another may always be on its way.
        let whole = files.iter().filter(|file| before.contains(*file) && follows(file));
        let newest = whole.max_by(|a, b| a.order(b)).filter(|newest| Some(*newest) != known.as_ref());
        if let Some(newest) = newest {
            let read = guarded(&newest.path, || read(newest, options, mailbox));
            // What has changed meanwhile is still being written.
            if Seen::of(newest.path.clone()).as_ref() == Some(newest) {
                let between =
                    |file: &&Seen| known.as_ref().is_some_and(|known| file.is_newer(known)) && newest.is_newer(file);
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
        sleep(LOOK);
    }
}

/// The file, or those of the folder or the pattern that may be clouds.
fn look(path: &Path) -> Vec<Seen> {
    if let Some(file) = Seen::of(path.into()) {
        return vec![file];
    }
    let files: Vec<PathBuf> = match std::fs::read_dir(path) {
        Ok(entries) => entries.filter_map(|entry| Some(entry.ok()?.path())).collect(),
        // What is no pattern either is a file that is not there yet.
        Err(_) => path.to_str().and_then(|name| glob(name).ok()).into_iter().flatten().filter_map(Result::ok).collect(),
    };
    files.into_iter().filter(|file| is_named_as_cloud(file)).filter_map(Seen::of).collect()
}

/// Reads a file into memory first: mapped, one that is cut shorter meanwhile would end the process.
fn read(file: &Seen, options: &ReadOptions, mailbox: &Mailbox) -> Result<PointCloud, Error> {
    let path = &file.path;
    check_memory(&path.display().to_string(), file.len)?;
    let bytes = std::fs::read(path).map_err(|source| Error::Io { path: path.clone(), source })?;
    read_bytes(path, &bytes, options, &Until(mailbox))
}
