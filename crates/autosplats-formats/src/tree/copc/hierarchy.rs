//! Pages of the hierarchy of a COPC file: 32 bytes for each node.

use std::ops::Range;

use autosplats_cloud::Key;

use crate::{read::las::MAX_RATIO, tree::directory::Entry};

/// Bytes of an entry.
const ENTRY: usize = 32;

/// Most bytes of pages that are in memory at once, before they are entries.
pub(super) const MAX_PAGES: u64 = 64 << 20;

/// What entries may name.
pub(super) struct Limits {
    /// Bytes of the file that chunks may have.
    pub(super) data: Range<u64>,
    /// Bytes of an uncompressed point, with which every chunk begins.
    pub(super) record_len: u64,
}

/// Checks the place of a page.
pub(super) fn check_page(offset: u64, bytes: u64, size: u64) -> Result<(), String> {
    let end = offset.checked_add(bytes).filter(|&end| end <= size);
    let whole = bytes > 0 && bytes.is_multiple_of(ENTRY as u64);
    if end.is_none() {
        Err(format!("a page of {bytes} bytes at byte {offset} reaches beyond the end; copy the file again"))
    } else if bytes > MAX_PAGES {
        Err(format!("a page of {bytes} bytes is too large; at most {MAX_PAGES} are read"))
    } else if !whole {
        Err(format!("a page of {bytes} bytes is not made of entries of {ENTRY} bytes; build the file again"))
    } else {
        Ok(())
    }
}

/// The entries of a page. An error has the byte of the faulty entry, counted from the start of the page.
pub(super) fn entries(page: &[u8], limits: &Limits, size: u64) -> Result<Vec<(Key, Entry)>, (usize, String)> {
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
            check_page(offset, bytes.into(), size)?;
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
