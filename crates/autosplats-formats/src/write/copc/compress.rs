//! Compresses the points of a node into a chunk.

use std::io::Cursor;
use std::path::PathBuf;

use autosplats_cloud::Error;
use laz::{
    LazItem, LazItemRecordBuilder,
    record::{LayeredPointRecordCompressor, RecordCompressor as _},
};

use super::key::Place;
use crate::{
    las,
    write::las::{Totals, failed_packing},
};

/// How records are compressed.
pub(super) struct Compressor {
    path: PathBuf,
    pub(super) items: Vec<LazItem>,
    pub(super) record_len: usize,
}

/// The compressed points of a node.
pub(super) struct Packed {
    pub(super) bytes: Vec<u8>,
    pub(super) totals: Totals,
    /// Least and greatest time.
    pub(super) times: [f64; 2],
}

/// A node with its compressed points.
pub(super) struct Node {
    pub(super) place: Place,
    pub(super) packed: Packed,
}

impl Compressor {
    pub(super) fn new(path: PathBuf, format: usize, record_len: usize) -> Result<Self, Error> {
        let extra = record_len - las::RECORD_LEN[format];
        let items = LazItemRecordBuilder::default_for_point_format_id(format as u8, extra as u16)
            .map_err(|error| failed_packing(&path, &error))?;
        Ok(Self { path, items, record_len })
    }

    /// Compresses records in the order given.
    pub(super) fn pack(&self, records: &[u8]) -> Result<Packed, Error> {
        let totals = Totals::of(records, self.record_len, true);
        let none = [f64::INFINITY, f64::NEG_INFINITY];
        let times = records.chunks_exact(self.record_len).map(time_of);
        let times = times.fold(none, |[least, most], time| [least.min(time), most.max(time)]);
        if records.is_empty() {
            return Ok(Packed { bytes: Vec::new(), totals, times });
        }
        let io = |source| Error::Io { path: self.path.clone(), source };
        let mut compressor = LayeredPointRecordCompressor::new(Cursor::new(Vec::with_capacity(records.len() / 4)));
        compressor.set_fields_from(&self.items).map_err(|error| failed_packing(&self.path, &error))?;
        for record in records.chunks_exact(self.record_len) {
            compressor.compress_next(record).map_err(io)?;
        }
        compressor.done().map_err(io)?;
        Ok(Packed { bytes: compressor.into_inner().into_inner(), totals, times })
    }
}

/// The time of a record.
fn time_of(record: &[u8]) -> f64 {
    let mut raw = [0; 8];
    raw.copy_from_slice(&record[las::WIDE_TIME..las::WIDE_TIME + 8]);
    f64::from_le_bytes(raw)
}
