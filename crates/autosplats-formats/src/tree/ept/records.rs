//! Nodes of plain records, which may be compressed with Zstandard.

use std::borrow::Cow;
use std::io::Read as _;

use ruzstd::decoding::StreamingDecoder;

use super::meta::{Encoding, Meta};
use crate::read::las::MAX_RATIO;

/// The records of a node with so many points.
pub(super) fn unpacked<'a>(meta: &Meta, bytes: &'a [u8], points: u32) -> Result<Cow<'a, [u8]>, String> {
    let expected = u64::from(points) * meta.columns.stride as u64;
    if u64::from(points) > MAX_RATIO as u64 * bytes.len() as u64 {
        return Err(format!("{points} points cannot be in {} bytes; copy the file again", bytes.len()));
    }
    let records = match meta.encoding {
        Encoding::Zstandard => {
            let frame = StreamingDecoder::new_with_max_window_size(bytes, expected.max(1 << 20));
            let mut records = Vec::new();
            // One byte more shows that there are too many.
            let frame = frame.map_err(|error| format!("it is no Zstandard frame ({error}); copy the file again"))?;
            let read = frame.take(expected + 1).read_to_end(&mut records);
            read.map_err(|error| format!("the compressed data are damaged ({error}); copy the file again"))?;
            Cow::Owned(records)
        }
        _ => Cow::Borrowed(bytes),
    };
    if records.len() as u64 == expected {
        Ok(records)
    } else {
        let stride = meta.columns.stride;
        Err(format!(
            "{points} points of {stride} bytes take {expected} bytes, not {}; copy the file again",
            records.len()
        ))
    }
}
