//! Records of equal length, encoded in parallel; shared by PLY and PCD.

use std::{
    fs::File,
    io::{BufWriter, Write as _},
};

use autosplats_cloud::{Error, PointCloud};
use rayon::prelude::*;

use super::Job;

/// Bytes encoded before they are written.
const BUFFER: usize = 4 << 20;

/// Records that one thread encodes at a time.
const PIECE: usize = 1 << 13;

/// Writes the records of a file.
pub(super) struct Records {
    /// Number of points of the file, and of those written.
    total: u64,
    done: u64,
    buffer: Vec<u8>,
}

impl Records {
    pub(super) fn new(total: u64) -> Self {
        Self { total, done: 0, buffer: Vec::new() }
    }

    /// Writes a record of `stride` bytes for each point of a cloud. `encode` fills the records from a given point on.
    pub(super) fn write(
        &mut self,
        job: &Job<'_>,
        file: &mut BufWriter<&mut File>,
        cloud: &PointCloud,
        stride: usize,
        encode: impl Fn(usize, &mut [u8]) + Sync,
    ) -> Result<(), Error> {
        let len = cloud.len();
        let block = (BUFFER / stride).max(PIECE);
        self.buffer.resize(self.buffer.len().max(block.min(len) * stride), 0);
        for start in (0..len).step_by(block) {
            job.tick(self.done as f32 / self.total as f32)?;
            let count = block.min(len - start);
            let records = &mut self.buffer[..count * stride];
            let pieces = records.par_chunks_mut(PIECE * stride).enumerate();
            pieces.for_each(|(index, piece)| encode(start + index * PIECE, piece));
            file.write_all(records).map_err(|source| job.io(source))?;
            self.done += count as u64;
        }
        Ok(())
    }
}
