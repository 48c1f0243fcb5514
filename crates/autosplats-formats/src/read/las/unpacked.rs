//! Decompressed records that wait in a file, for whoever reads them several times.
//!
//! # How it works
//!
//! Decompressing takes far longer than copying to a disk and back. So the records of a run are kept when it is read
//! first. Each run has its own place in the file, so threads need not wait for each other.

use std::{
    fs::File,
    path::{Path, PathBuf},
    sync::OnceLock,
};

use autosplats_cloud::{Error, read_exact_at, temporary_failed, temporary_unnamed, write_all_at};

/// Records of a run of an uncompressed file, and of a piece of a long run that is passed on in pieces.
pub(super) const PIECE: usize = 1 << 16;

/// Points that cannot be read, and why.
#[derive(Clone, Default)]
pub(crate) struct Lost {
    pub(crate) points: u64,
    pub(crate) why: String,
}

/// Records of a file, decompressed.
pub(super) struct Unpacked {
    folder: PathBuf,
    file: File,
    record_len: usize,
    runs: Vec<Kept>,
}

/// Where the records of a run are.
struct Kept {
    at: u64,
    points: usize,
    /// The points that cannot be read; set once the others are in the file.
    lost: OnceLock<Lost>,
}

impl Unpacked {
    /// A file without a name in `folder`, for runs of so many records each.
    pub(super) fn new(folder: &Path, record_len: usize, counts: impl Iterator<Item = usize>) -> Result<Self, Error> {
        let file = temporary_unnamed(folder).map_err(|source| temporary_failed(folder, &source))?;
        let mut end = 0;
        let run = |points| {
            let at = end;
            end += (points * record_len) as u64;
            Kept { at, points, lost: OnceLock::new() }
        };
        Ok(Self { folder: folder.into(), file, record_len, runs: counts.map(run).collect() })
    }

    /// Passes on the records of a run in pieces; `None` if they are not there yet.
    pub(super) fn read(
        &self,
        run: usize,
        records: &mut Vec<u8>,
        take: &mut dyn FnMut(&[u8]) -> Result<(), Error>,
    ) -> Result<Option<Lost>, Error> {
        let &Kept { mut at, points, ref lost } = &self.runs[run];
        let Some(lost) = lost.get() else { return Ok(None) };
        let mut left = points - lost.points as usize;
        while left > 0 {
            let count = left.min(PIECE);
            records.resize(count * self.record_len, 0);
            read_exact_at(&self.file, records, at).map_err(|source| temporary_failed(&self.folder, &source))?;
            take(records)?;
            at += records.len() as u64;
            left -= count;
        }
        Ok(Some(lost.clone()))
    }

    /// Where the records of a run begin in the file.
    pub(super) fn start(&self, run: usize) -> u64 {
        self.runs[run].at
    }

    /// Keeps records at a place in the file, and moves the place behind them.
    pub(super) fn keep(&self, at: &mut u64, records: &[u8]) -> Result<(), Error> {
        write_all_at(&self.file, records, *at).map_err(|source| temporary_failed(&self.folder, &source))?;
        *at += records.len() as u64;
        Ok(())
    }

    /// Notes that all records of a run are kept but those that are lost. They are read from the file from now on.
    pub(super) fn finish(&self, run: usize, lost: &Lost) {
        self.runs[run].lost.get_or_init(|| lost.clone());
    }
}
