//! A file that is written again, or a folder to which files are added. Nobody tells: it is looked at now and then.

use std::{
    cmp::Ordering,
    path::{Path, PathBuf},
    sync::Arc,
    thread::sleep,
    time::{Duration, SystemTime},
};

use super::{bytes::Until, mailbox::Mailbox, now};
use crate::{
    Error, PointCloud, ReadOptions, Update,
    memory::check_memory,
    read_bytes,
    source::animation::{is_named_as_cloud, natural},
};

/// Time between two looks; what two in a row find the same is taken for whole.
const LOOK: Duration = Duration::from_millis(100);

/// A file as it was at a look.
#[derive(Clone, Debug, PartialEq)]
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
    let (mut known, mut pending): (Option<Seen>, Option<Seen>) = (None, None);
    while !mailbox.is_abandoned() {
        let files = look(path);
        // When the newest is taken away, those before it are still those before it.
        let follows = |file: &&Seen| known.as_ref().is_none_or(|known| file.is_newer(known) || file.path == known.path);
        let newest = files.iter().filter(follows).max_by(|a, b| a.order(b));
        match newest {
            Some(newest) if Some(newest) == known.as_ref() => pending = None,
            Some(newest) if Some(newest) == pending.as_ref() => {
                pending = None;
                let read = read(newest, options, mailbox);
                // What has changed meanwhile is still being written.
                if Seen::of(newest.path.clone()).as_ref() == Some(newest) {
                    let between = |file: &&Seen| {
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
            newest => pending = newest.cloned(),
        }
        sleep(LOOK);
    }
}

/// The file, or those of the folder that may be clouds.
fn look(path: &Path) -> Vec<Seen> {
    let Ok(entries) = std::fs::read_dir(path) else { return Seen::of(path.into()).into_iter().collect() };
    entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| is_named_as_cloud(path))
        .filter_map(Seen::of)
        .collect()
}

/// Reads a file into memory first: mapped, one that is cut shorter meanwhile would end the process.
fn read(file: &Seen, options: &ReadOptions, mailbox: &Mailbox) -> Result<PointCloud, Error> {
    let path = &file.path;
    check_memory(&path.display().to_string(), file.len)?;
    let bytes = std::fs::read(path).map_err(|source| Error::Io { path: path.clone(), source })?;
    read_bytes(path, &bytes, options, &Until(mailbox))
}
