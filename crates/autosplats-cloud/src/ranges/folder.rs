//! Files below one address.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::{Counter, FileRanges, Ranges, Traffic};
use crate::{Error, Progress, check_memory, read_small};

/// Files below one address, on many threads at once.
pub trait Folder: Send + Sync + fmt::Debug {
    /// Path or address of the folder, for messages.
    fn name(&self) -> &Path;

    /// The bytes of each of the files `names`, in the order asked for, such as `ept-data/0-0-0-0.laz`. Files may be
    /// fetched at the same time.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for a file of more than `most` bytes, [`Error::Io`], [`Error::Remote`],
    /// [`Error::OutOfMemory`], and [`Error::Cancelled`] if `progress` says so.
    fn read(&self, names: &[String], most: u64, progress: &dyn Progress) -> Result<Vec<Vec<u8>>, Error>;

    /// Opens a file of which only parts are read. What is read of it counts for itself.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Remote`], [`Error::OutOfMemory`], and [`Error::Cancelled`] if `progress` says so.
    fn open(&self, name: &str, progress: &dyn Progress) -> Result<Arc<dyn Ranges>, Error>;

    /// What has been read so far.
    fn traffic(&self) -> Traffic;
}

/// A folder of the file system.
#[derive(Debug)]
pub struct LocalFolder {
    path: PathBuf,
    read: Counter,
}

impl LocalFolder {
    /// The folder at `path`, which is not looked at before a file is read.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into(), read: Counter::default() }
    }

    fn one(&self, name: &str, most: u64) -> Result<Vec<u8>, Error> {
        let path = self.path.join(name);
        let fail = |source| Error::Io { path: path.clone(), source };
        let size = std::fs::metadata(&path).map_err(fail)?.len();
        if size > most {
            return Err(Error::unsupported(&path, too_large(size, most)));
        }
        check_memory("a file of a tree", size)?;
        let bytes = read_small(&path, most).map_err(fail)?;
        self.read.add(bytes.len() as u64);
        Ok(bytes)
    }
}

/// Message for a file that is larger than it may be.
pub(crate) fn too_large(size: u64, most: u64) -> String {
    format!("it has {size} bytes, more than the {most} that such a file may have")
}

impl Folder for LocalFolder {
    fn name(&self) -> &Path {
        &self.path
    }

    fn read(&self, names: &[String], most: u64, progress: &dyn Progress) -> Result<Vec<Vec<u8>>, Error> {
        let one = |name: &String| if progress.cancelled() { Err(Error::Cancelled) } else { self.one(name, most) };
        names.iter().map(one).collect()
    }

    fn open(&self, name: &str, _: &dyn Progress) -> Result<Arc<dyn Ranges>, Error> {
        Ok(Arc::new(FileRanges::open(&self.path.join(name))?))
    }

    fn traffic(&self) -> Traffic {
        self.read.traffic()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_gives_small_files() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::create_dir(folder.path().join("a")).expect("a folder in it");
        std::fs::write(folder.path().join("a/b"), [1, 2, 3]).expect("a file");
        let local = LocalFolder::new(folder.path());
        assert_eq!(local.read(&["a/b".into()], 3, &()).expect("small"), [vec![1, 2, 3]]);
        assert!(matches!(local.read(&["a/b".into()], 2, &()), Err(Error::Unsupported { .. })), "too large");
        assert!(matches!(local.read(&["c".into()], 2, &()), Err(Error::Io { .. })), "no such file");
        assert_eq!(local.traffic(), Traffic { requests: 1, bytes: 3 });
        let ranges = local.open("a/b", &()).expect("a file");
        assert_eq!((ranges.size(), ranges.read(&[1..3, 0..1], &()).expect("inside")), (3, vec![vec![2, 3], vec![1]]));
        assert!(matches!(local.open("c", &()), Err(Error::Io { .. })), "no such file");
    }
}
