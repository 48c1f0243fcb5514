//! The record decompressors of the `laz` crate, with this project's own for items that theirs decodes wrongly.

use std::io::Cursor;

use laz::{
    DecompressionSelection, LasZipError, LazItem, LazItemType,
    record::{LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor},
};

use super::{gps_time::GpsTime11, point14::Point14};

/// Whether chunks store each kind of value apart, as those of point formats 6 and up do.
pub(super) fn layered(items: &[LazItem]) -> bool {
    items.first().is_some_and(|item| item.version() >= 3)
}

pub(super) type DynDecompressor<'a> = dyn RecordDecompressor<Cursor<&'a [u8]>> + Send + Sync + 'a;
pub(super) type Decompressor<'a> = Box<DynDecompressor<'a>>;

/// Makes a [`decompressor`] of selected values; values that are not in layers are all decompressed.
pub(super) fn selecting<'a>(
    items: &[LazItem],
    chunk: &'a [u8],
    selection: DecompressionSelection,
) -> Result<Decompressor<'a>, String> {
    let mut decompressor = decompressor(items, chunk)?;
    decompressor.set_selection(selection);
    Ok(decompressor)
}

/// What the crate says is wrong, without the names of its types.
pub(super) fn why(error: &LasZipError) -> String {
    match error {
        LasZipError::IoError(error) => error.to_string(),
        error => error.to_string(),
    }
}

/// Makes a decompressor of all values. Items on which damage would overflow the crate's stack are decoded by this
/// project's code.
pub(super) fn decompressor<'a>(items: &[LazItem], chunk: &'a [u8]) -> Result<Decompressor<'a>, String> {
    let theirs = |decompressor: &mut dyn RecordDecompressor<Cursor<&'a [u8]>>, item: LazItem| {
        decompressor.set_fields_from(&vec![item]).map_err(|error| why(&error))
    };
    if layered(items) {
        let mut decompressor = LayeredPointRecordDecompressor::new(Cursor::new(chunk));
        for &item in items {
            match (item.item_type(), item.version()) {
                (LazItemType::Point14, version @ 3..=4) => decompressor.add_field_decompressor(Point14::new(version)),
                _ => theirs(&mut decompressor, item)?,
            }
        }
        return Ok(Box::new(decompressor));
    }
    let mut decompressor = SequentialPointRecordDecompressor::new(Cursor::new(chunk));
    for &item in items {
        match (item.item_type(), item.version()) {
            (LazItemType::GpsTime, 2) => decompressor.add_field_decompressor(GpsTime11::default()),
            _ => theirs(&mut decompressor, item)?,
        }
    }
    Ok(Box::new(decompressor))
}
