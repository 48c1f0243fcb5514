//! Turns records of any LAS file into those of the tree.

use std::path::PathBuf;

use autosplats_cloud::Error;

use super::{
    extras::Extras,
    frame::{Lattice, steps_of},
    schema::{Axis, Schema, too_far},
};
use crate::las::{self, ANGLE_STEP};

/// Bytes that all formats from 6 on share.
const WIDE: usize = 30;

/// How the records of one file become records of the tree.
pub(super) struct Recoder {
    name: PathBuf,
    format: usize,
    record_len: usize,
    to: usize,
    to_len: usize,
    axes: [Axis; 3],
    /// What to copy: from, to and length.
    moves: Vec<(usize, usize, usize)>,
    /// Whether nothing changes.
    same: bool,
}

impl Recoder {
    pub(super) fn new(
        name: PathBuf,
        format: usize,
        record_len: usize,
        lattice: &Lattice,
        extras: &Extras,
        schema: &Schema,
    ) -> Self {
        let axes = [0, 1, 2].map(|axis| Axis::between(lattice, &schema.lattice, axis));
        let to = schema.format;
        let mut moves = Vec::new();
        if las::is_wide(format) {
            moves.push((0, 0, WIDE));
        }
        if let (Some(from), Some(to)) = (las::colors(format), las::colors(to)) {
            moves.push((from, to, 6));
        }
        if matches!(format, 8 | 10) && to == 8 {
            moves.push((36, 36, 2));
        }
        if let Some(time) = las::time(format).filter(|_| !las::is_wide(format)) {
            moves.push((time, las::WIDE_TIME, 8));
        }
        let (from_extra, to_extra) = (las::RECORD_LEN[format], las::RECORD_LEN[to]);
        let extra = extras.moves(&schema.layout);
        let same = format == to
            && *extras == schema.layout
            && axes.iter().all(|axis| matches!(axis, Axis::Same))
            && record_len == schema.record_len;
        moves.extend(extra.into_iter().map(|(from, to, len)| (from_extra + from, to_extra + to, len)));
        Self { name, format, record_len, to, to_len: schema.record_len, axes, moves, same }
    }

    /// Adds records to `to`.
    pub(super) fn recode(&self, records: &[u8], to: &mut Vec<u8>) -> Result<(), Error> {
        if self.same {
            to.extend_from_slice(records);
            return Ok(());
        }
        let start = to.len();
        to.resize(start + records.len() / self.record_len * self.to_len, 0);
        let wide = las::is_wide(self.format);
        for (from, to) in records.chunks_exact(self.record_len).zip(to[start..].chunks_exact_mut(self.to_len)) {
            for &(at, other, len) in &self.moves {
                to[other..other + len].copy_from_slice(&from[at..at + len]);
            }
            let steps = steps_of(from);
            for axis in 0..3 {
                let value = self.axes[axis].apply(steps[axis]).ok_or_else(|| too_far(&self.name))?;
                to[4 * axis..4 * axis + 4].copy_from_slice(&value.to_le_bytes());
            }
            if !wide {
                widen(from, to);
            }
        }
        debug_assert!(self.to >= 6, "trees have the formats of LAS 1.4");
        Ok(())
    }
}

/// Turns the values of the first 20 bytes of formats 0 to 5, but for coordinates, into those of formats 6 and up.
fn widen(from: &[u8], to: &mut [u8]) {
    to[12..14].copy_from_slice(&from[12..14]);
    let (returns, class) = (from[14], from[15]);
    to[14] = returns & 7 | (returns >> 3 & 7) << 4;
    // Synthetic, key point and withheld; the direction of the mirror and the edge of the flight line.
    to[15] = class >> 5 | (returns >> 6) << 6;
    to[16] = class & 31;
    to[17] = from[17];
    let degrees = f32::from(from[16] as i8);
    to[18..20].copy_from_slice(&((degrees / ANGLE_STEP).round() as i16).to_le_bytes());
    to[20..22].copy_from_slice(&from[18..20]);
}
