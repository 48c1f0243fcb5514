//! Records that wait on the disk: one temporary file of slots, which cells fill and empty.
//!
//! # How it works
//!
//! The file has no name, so the system removes it whatever ends the program. A cell gathers records in memory and
//! writes them as a slot once they fill one. All cells together hold no more memory than they may: beyond it, all that
//! is gathered is written, as slots that are not full. Slots that were read are used again.

use std::{
    fs::File,
    path::{Path, PathBuf},
    sync::{
        Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, AtomicUsize, Ordering},
    },
};

use autosplats_cloud::{Error, read_exact_at, temporary_unnamed, write_all_at};

/// Bytes of a slot: large ones are read fast, small ones let many cells gather records.
const LARGEST_SLOT: usize = 256 << 10;
const SMALLEST_SLOT: usize = 4 << 10;

/// The temporary file.
pub(super) struct Spill {
    folder: PathBuf,
    file: File,
    pub(super) record_len: usize,
    /// Bytes of a slot, a multiple of the record's.
    slot: usize,
    /// Bytes that all cells together may gather, and that they hold.
    budget: usize,
    gathered: AtomicUsize,
    slots: Mutex<Slots>,
    /// Bytes of records on the disk, and the most there were.
    stored: AtomicU64,
    most: AtomicU64,
}

/// Which slots are free.
#[derive(Default)]
struct Slots {
    free: Vec<u32>,
    used: u32,
}

/// Records of one place.
#[derive(Default)]
pub(super) struct Cell {
    gathered: Vec<u8>,
    /// Slots on the disk, each with its number of bytes.
    slots: Vec<(u32, u32)>,
    /// Number of records.
    pub(super) count: u64,
}

impl Spill {
    /// Makes a file in `folder` for records of `record_len` bytes, which up to `cells` cells gather in `budget` bytes.
    pub(super) fn new(folder: &Path, record_len: usize, cells: usize, budget: usize) -> Result<Self, Error> {
        let wished = (budget / cells.max(1)).clamp(SMALLEST_SLOT, LARGEST_SLOT);
        let slot = (wished / record_len).max(1) * record_len;
        let file = temporary_unnamed(folder).map_err(|source| Error::Io { path: folder.into(), source })?;
        let (gathered, slots) = (AtomicUsize::new(0), Mutex::default());
        let (stored, most) = (AtomicU64::new(0), AtomicU64::new(0));
        Ok(Self { folder: folder.into(), file, record_len, slot, budget, gathered, slots, stored, most })
    }

    fn io(&self, source: std::io::Error) -> Error {
        let source = std::io::Error::new(source.kind(), format!("temporary records: {source}"));
        Error::Io { path: self.folder.clone(), source }
    }

    /// Adds records to one of the cells.
    pub(super) fn append(&self, cells: &[Mutex<Cell>], index: usize, mut records: &[u8]) -> Result<(), Error> {
        let mut cell = lock(&cells[index]);
        cell.count += (records.len() / self.record_len) as u64;
        while !records.is_empty() {
            if cell.gathered.capacity() == 0 {
                cell.gathered.reserve_exact(self.slot);
                self.gathered.fetch_add(self.slot, Ordering::Relaxed);
            }
            let (now, later) = records.split_at(records.len().min(self.slot - cell.gathered.len()));
            cell.gathered.extend_from_slice(now);
            if cell.gathered.len() == self.slot {
                self.write(&mut cell)?;
            }
            records = later;
        }
        drop(cell);
        if self.gathered.load(Ordering::Relaxed) > self.budget {
            self.write_all(cells)?;
        }
        Ok(())
    }

    /// Writes what the cells have gathered, but for cells that are in use.
    pub(super) fn write_all(&self, cells: &[Mutex<Cell>]) -> Result<(), Error> {
        for cell in cells {
            let Ok(mut cell) = cell.try_lock() else { continue };
            if !cell.gathered.is_empty() {
                self.write(&mut cell)?;
            }
            if cell.gathered.capacity() > 0 {
                cell.gathered = Vec::new();
                self.gathered.fetch_sub(self.slot, Ordering::Relaxed);
            }
        }
        Ok(())
    }

    fn write(&self, cell: &mut Cell) -> Result<(), Error> {
        let slot = {
            let mut slots = lock(&self.slots);
            slots.free.pop().unwrap_or_else(|| {
                slots.used += 1;
                slots.used - 1
            })
        };
        let at = u64::from(slot) * self.slot as u64;
        write_all_at(&self.file, &cell.gathered, at).map_err(|source| self.io(source))?;
        let len = cell.gathered.len() as u64;
        let stored = self.stored.fetch_add(len, Ordering::Relaxed) + len;
        self.most.fetch_max(stored, Ordering::Relaxed);
        cell.slots.push((slot, len as u32));
        cell.gathered.clear();
        Ok(())
    }

    /// Takes the records out of a cell, a slot at a time.
    pub(super) fn take(&self, cell: Cell, mut each: impl FnMut(&[u8]) -> Result<(), Error>) -> Result<(), Error> {
        let Cell { gathered, slots, .. } = cell;
        let mut bytes = vec![0; if slots.is_empty() { 0 } else { self.slot }];
        for (slot, len) in slots {
            let bytes = &mut bytes[..len as usize];
            read_exact_at(&self.file, bytes, u64::from(slot) * self.slot as u64).map_err(|source| self.io(source))?;
            lock(&self.slots).free.push(slot);
            self.stored.fetch_sub(u64::from(len), Ordering::Relaxed);
            each(bytes)?;
        }
        if gathered.capacity() > 0 {
            self.gathered.fetch_sub(self.slot, Ordering::Relaxed);
        }
        if gathered.is_empty() { Ok(()) } else { each(&gathered) }
    }

    /// Most bytes of records that were on the disk at once. Slots that are not full leave holes, which take no room.
    pub(super) fn bytes(&self) -> u64 {
        self.most.load(Ordering::Relaxed)
    }
}

pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
