//! Memory and disk for examining more points than memory holds.

use std::path::{Path, PathBuf};

use autosplats_cloud::{Error, Part, Progress, Spool, available_memory, check_disk, usual_memory};
use autosplats_formats::{ReadOptions, Unpacking, open_parts_unpacked};

use crate::args::RoomArgs;
use crate::parts::SPOOLED_BYTES;

/// Memory per point of examining all points at once, in bytes.
const BYTES_PER_POINT: u64 = 140;

/// Disk per point of work on neighbourhoods, in bytes.
const DISK_BYTES: u64 = 28;

/// Where and with how much memory points are examined.
pub(super) struct Room {
    /// Memory that the user allows, in bytes.
    asked: Option<u64>,
    /// Folder for temporary files.
    pub(super) folder: PathBuf,
}

impl Room {
    pub(super) fn new(args: &RoomArgs) -> Self {
        Self { asked: args.memory, folder: args.temp.clone().unwrap_or_else(std::env::temp_dir) }
    }

    /// Memory for work in parts, in bytes.
    pub(super) fn memory(&self) -> u64 {
        self.asked.unwrap_or_else(usual_memory)
    }

    /// Whether memory holds so many points.
    pub(super) fn holds(&self, points: u64) -> bool {
        let memory = self.asked.or_else(|| available_memory().map(|free| free / 4 * 3));
        memory.is_none_or(|memory| points.saturating_mul(BYTES_PER_POINT) <= memory)
    }

    /// Reads the points of a file, about so many, onto the disk. `None` if the file has to be read whole.
    pub(super) fn spool(
        &self,
        path: &Path,
        points: u64,
        options: &ReadOptions,
        progress: &dyn Progress,
    ) -> Result<Option<Spool>, Error> {
        let part = |start: f32| Part { whole: progress, start, len: 0.5 };
        let disk = |points: u64| points.saturating_mul(SPOOLED_BYTES + DISK_BYTES);
        let unpacking = Unpacking { folder: &self.folder, leave: disk(points) };
        let Some(parts) = open_parts_unpacked(path, options, unpacking, &part(0.0))? else { return Ok(None) };
        check_disk(&self.folder, disk(parts.points() as u64), "examining the points")?;
        Spool::of(&parts, &self.folder, &part(0.5)).map(Some)
    }
}
