//! Ranges of a file, read where they are asked for. The file is not mapped, so that memory limits hold.

use std::fs::File;
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::{Counter, Ranges, Traffic, check_range};
use crate::{Error, Progress, check_memory, read_exact_at};

/// Ranges of a local file.
#[derive(Debug)]
pub struct FileRanges {
    path: PathBuf,
    file: File,
    size: u64,
    read: Counter,
}

impl FileRanges {
    /// Opens a file.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn open(path: &Path) -> Result<Self, Error> {
        let open = || {
            let file = File::open(path)?;
            let size = file.metadata()?.len();
            Ok((file, size))
        };
        let (file, size) = open().map_err(|source| Error::Io { path: path.into(), source })?;
        Ok(Self { path: path.into(), file, size, read: Counter::default() })
    }

    fn one(&self, range: &Range<u64>) -> Result<Vec<u8>, Error> {
        check_range(&self.path, range, self.size)?;
        let len = range.end - range.start;
        check_memory("a part of a file", len)?;
        let mut bytes = vec![0; len as usize];
        read_exact_at(&self.file, &mut bytes, range.start)
            .map_err(|source| Error::Io { path: self.path.clone(), source })?;
        self.read.add(len);
        Ok(bytes)
    }
}

impl Ranges for FileRanges {
    fn name(&self) -> &Path {
        &self.path
    }

    fn size(&self) -> u64 {
        self.size
    }

    fn read(&self, ranges: &[Range<u64>], progress: &dyn Progress) -> Result<Vec<Vec<u8>>, Error> {
        let one = |range| if progress.cancelled() { Err(Error::Cancelled) } else { self.one(range) };
        ranges.iter().map(one).collect()
    }

    fn traffic(&self) -> Traffic {
        self.read.traffic()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_gives_its_ranges_and_no_more() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("ten");
        std::fs::write(&path, (0..10).collect::<Vec<u8>>()).expect("a file");
        let file = FileRanges::open(&path).expect("it is there");
        assert_eq!(file.size(), 10);
        assert_eq!(file.read(&[8..10, 0..3], &()).expect("inside"), [vec![8, 9], vec![0, 1, 2]]);
        assert_eq!(file.traffic(), Traffic { requests: 2, bytes: 5 });
        assert!(matches!(file.read(&[0..1, 8..u64::MAX], &()), Err(Error::Malformed { .. })), "beyond the end");
        assert!(matches!(FileRanges::open(&folder.path().join("no")), Err(Error::Io { .. })), "no such file");
    }
}
