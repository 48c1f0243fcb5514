//! Records of equal length, encoded in parallel; shared by PLY and PCD.

use std::{
    fs::File,
    io::{BufWriter, Write as _},
};

use autosplats_cloud::Error;
use rayon::prelude::*;

use super::Job;

/// Bytes encoded before they are written.
const BUFFER: usize = 4 << 20;

/// Records that one thread encodes at a time.
const PIECE: usize = 1 << 13;

/// Writes a record of `stride` bytes per point. `encode` fills the records from a given point on.
pub(super) fn write_records(
    job: &Job<'_>,
    file: &mut BufWriter<&mut File>,
    stride: usize,
    encode: impl Fn(usize, &mut [u8]) + Sync,
) -> Result<(), Error> {
    let len = job.cloud.len();
    let block = (BUFFER / stride).max(PIECE);
    let mut buffer = vec![0; block.min(len) * stride];
    for start in (0..len).step_by(block) {
        job.tick(start as f32 / len as f32)?;
        let records = &mut buffer[..block.min(len - start) * stride];
        let pieces = records.par_chunks_mut(PIECE * stride).enumerate();
        pieces.for_each(|(index, piece)| encode(start + index * PIECE, piece));
        file.write_all(records).map_err(|source| job.io(source))?;
    }
    Ok(())
}
