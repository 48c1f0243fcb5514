//! Pages of the hierarchy of a COPC file: 32 bytes for each node.

use std::ops::Range;

use autosplats_cloud::Key;

use crate::{
    read::las::MAX_RATIO,
    tree::{
        directory::Entry,
        paged::{Page, Parsed},
    },
};

/// Bytes of an entry.
pub(super) const ENTRY: usize = 32;

/// What entries may name.
pub(super) struct Limits {
    /// Bytes of the file that chunks may have.
    pub(super) data: Range<u64>,
    /// Bytes of an uncompressed point, with which every chunk begins.
    pub(super) record_len: u64,
}

/// The entries of a page of a file of `size` bytes.
pub(super) fn entries(page: &[u8], limits: &Limits, size: u64) -> Parsed {
    let (raw, _) = page.as_chunks::<ENTRY>();
    raw.iter().enumerate().map(|(index, raw)| entry(raw, limits, size).map_err(|what| (index * ENTRY, what))).collect()
}

fn entry(raw: &[u8; ENTRY], limits: &Limits, size: u64) -> Result<(Key, Entry), String> {
    let int = |at: usize| i32::from_le_bytes([raw[at], raw[at + 1], raw[at + 2], raw[at + 3]]);
    let numbers = [int(0), int(4), int(8), int(12)];
    let key = match numbers.map(u32::try_from) {
        [Ok(level), Ok(x), Ok(y), Ok(z)] => Key::new(level, [x, y, z]),
        _ => None,
    };
    let name = numbers.map(|number| number.to_string()).join("-");
    let key = key.ok_or_else(|| format!("there is no place {name} in an octree of {} levels", Key::MAX_LEVEL))?;
    let offset = u64::from(int(16).cast_unsigned()) | u64::from(int(20).cast_unsigned()) << 32;
    let (bytes, points) = (int(24), int(28));
    let length = || u32::try_from(bytes).map_err(|_| format!("node {key} has {bytes} bytes; build the file again"));
    match points {
        -1 => {
            let bytes = length()?;
            Page { offset, bytes: bytes.into() }.check(size, ENTRY)?;
            Ok((key, Entry::Page { offset, bytes }))
        }
        // An inner node without points of its own.
        0 => Ok((key, Entry::Node { points: 0, offset: 0, bytes: 0 })),
        1.. => {
            let bytes = length()?;
            let points = points.cast_unsigned();
            let end = offset.checked_add(bytes.into());
            if offset < limits.data.start || end.is_none_or(|end| end > limits.data.end) {
                let Range { start, end } = limits.data;
                return Err(format!(
                    "the {bytes} bytes of node {key} at byte {offset} are not among the points, which may be at \
                     {start} to {end}; copy the file again"
                ));
            }
            if u64::from(bytes) < limits.record_len || u64::from(points) > MAX_RATIO as u64 * u64::from(bytes) {
                return Err(format!("{points} points of node {key} cannot be in {bytes} bytes; build the file again"));
            }
            Ok((key, Entry::Node { points, offset, bytes }))
        }
        _ => Err(format!("node {key} has {points} points; build the file again")),
    }
}
