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

use crate::{
    Error,
    files::{read_exact_at, temporary_failed, temporary_unnamed, write_all_at},
};

/// Bytes of a slot: large ones are read fast, small ones let many cells gather records.
const LARGEST_SLOT: usize = 256 << 10;
const SMALLEST_SLOT: usize = 4 << 10;

/// The temporary file, and how much is gathered.
///
/// # Examples
///
/// ```
/// use std::sync::Mutex;
///
/// use autosplats_cloud::{Spill, SpillCell};
///
/// # let folder = tempfile::tempdir()?;
/// let cells: [Mutex<SpillCell>; 2] = Default::default();
/// let spill = Spill::new(folder.path(), 4, cells.len(), 1 << 20)?;
/// spill.append(&cells, 1, &[1, 2, 3, 4])?;
/// spill.append(&cells, 1, &[5, 6, 7, 8])?;
/// let mut found = Vec::new();
/// let [_, second] = cells.map(|cell| cell.into_inner().unwrap_or_default());
/// spill.take(second, |records| Ok(found.extend_from_slice(records)))?;
/// assert_eq!(found, [1, 2, 3, 4, 5, 6, 7, 8]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Spill {
    folder: PathBuf,
    file: File,
    /// Bytes of a record.
    pub record_len: usize,
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
#[derive(Debug, Default)]
pub struct SpillCell {
    gathered: Vec<u8>,
    /// Slots on the disk, each with its number of bytes.
    slots: Vec<(u32, u32)>,
    /// Number of records.
    pub count: u64,
}

impl Spill {
    /// Makes a file in `folder` for records of `record_len` bytes, which up to `cells` cells gather in `budget` bytes.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn new(folder: &Path, record_len: usize, cells: usize, budget: usize) -> Result<Self, Error> {
        let wished = (budget / cells.max(1)).clamp(SMALLEST_SLOT, LARGEST_SLOT);
        let slot = (wished / record_len).max(1) * record_len;
        let file = temporary_unnamed(folder).map_err(|source| temporary_failed(folder, &source))?;
        let (gathered, slots) = (AtomicUsize::new(0), Mutex::default());
        let (stored, most) = (AtomicU64::new(0), AtomicU64::new(0));
        Ok(Self { folder: folder.into(), file, record_len, slot, budget, gathered, slots, stored, most })
    }

    fn io(&self, source: std::io::Error) -> Error {
        temporary_failed(&self.folder, &source)
    }

    /// Adds records to one of the cells, from any thread.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn append(&self, cells: &[Mutex<SpillCell>], index: usize, mut records: &[u8]) -> Result<(), Error> {
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
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write_all(&self, cells: &[Mutex<SpillCell>]) -> Result<(), Error> {
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

    fn write(&self, cell: &mut SpillCell) -> Result<(), Error> {
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
    ///
    /// # Errors
    /// [`Error::Io`] and those of `each`.
    pub fn take(&self, cell: SpillCell, each: impl FnMut(&[u8]) -> Result<(), Error>) -> Result<(), Error> {
        self.visit(&cell, each)?;
        let SpillCell { gathered, slots, .. } = cell;
        let len: u64 = slots.iter().map(|&(_, len)| u64::from(len)).sum();
        lock(&self.slots).free.extend(slots.iter().map(|&(slot, _)| slot));
        self.stored.fetch_sub(len, Ordering::Relaxed);
        if gathered.capacity() > 0 {
            self.gathered.fetch_sub(self.slot, Ordering::Relaxed);
        }
        Ok(())
    }

    /// Reads the records of a cell, a slot at a time, and leaves them there.
    ///
    /// # Errors
    /// [`Error::Io`] and those of `each`.
    pub fn visit(&self, cell: &SpillCell, mut each: impl FnMut(&[u8]) -> Result<(), Error>) -> Result<(), Error> {
        let mut bytes = vec![0; if cell.slots.is_empty() { 0 } else { self.slot }];
        for &(slot, len) in &cell.slots {
            let bytes = &mut bytes[..len as usize];
            read_exact_at(&self.file, bytes, u64::from(slot) * self.slot as u64).map_err(|source| self.io(source))?;
            each(bytes)?;
        }
        if cell.gathered.is_empty() { Ok(()) } else { each(&cell.gathered) }
    }

    /// Most bytes of records that were on the disk at once. Slots that are not full leave holes, which take no room.
    pub fn bytes(&self) -> u64 {
        self.most.load(Ordering::Relaxed)
    }
}

/// Locks, whether or not another thread has panicked.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
