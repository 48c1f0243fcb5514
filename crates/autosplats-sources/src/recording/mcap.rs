//! Records of MCAP files.

use std::collections::HashMap;

use super::{
    chunk::Chunk,
    records::{Record, Topic},
};
use crate::wire::{Fault, Wire};

/// First and last bytes of an MCAP file.
pub(super) const MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// State carried from record to record: names of message types by number.
#[derive(Default)]
pub(super) struct Mcap {
    schemas: HashMap<u16, String>,
}

/// Kinds of records that are needed here.
mod op {
    pub(super) const FOOTER: u8 = 2;
    pub(super) const SCHEMA: u8 = 3;
    pub(super) const CHANNEL: u8 = 4;
    pub(super) const MESSAGE: u8 = 5;
    pub(super) const CHUNK: u8 = 6;
    pub(super) const MESSAGE_INDEX: u8 = 7;
}

/// Bytes of a record's kind and length.
const RECORD_HEAD_BYTES: usize = 9;

/// Bytes of an index entry: time and offset.
const INDEX_ENTRY_BYTES: usize = 16;

impl Mcap {
    pub(super) fn record<'a>(&mut self, bytes: &'a [u8], at: usize) -> Result<(Record<'a>, usize), Fault> {
        let mut wire = Wire::plain(bytes, at);
        let kind = wire.u8("a record")?;
        let len = wire.u64("a record")?;
        let left = wire.left();
        let end = usize::try_from(len).ok().filter(|len| *len <= left).map(|len| at + RECORD_HEAD_BYTES + len);
        let Some(end) = end else {
            let fault =
                Fault::new(at, format!("a record of {len} bytes is cut off after {left}; everything after it is lost"));
            return if kind == op::CHUNK { chunk(bytes, at + RECORD_HEAD_BYTES, Some(fault)) } else { Err(fault) };
        };
        let record = &bytes[..end];
        let mut wire = Wire::plain(record, at + RECORD_HEAD_BYTES);
        let record = match kind {
            0 => return Err(Fault::new(at, "there are zeros in place of records; everything after them is lost")),
            op::FOOTER => Record::End,
            op::SCHEMA => {
                let number = wire.u16("a schema")?;
                self.schemas.insert(number, wire.string("a schema's name")?.into_owned());
                Record::Other
            }
            op::CHANNEL => {
                let number = wire.u16("a channel")?;
                let schema = wire.u16("a channel")?;
                let name = wire.string("a topic's name")?;
                let encoding = wire.string("a topic's encoding")?;
                let type_name = self.schemas.get(&schema).map_or("", String::as_str);
                Record::Topic(number.into(), Topic::new(&name, type_name, &encoding))
            }
            op::MESSAGE => {
                let number = wire.u16("a message")?;
                let _sequence = wire.u32("a message")?;
                let time = nanoseconds(wire.u64("a message")?);
                let _published = wire.u64("a message")?;
                let data = wire.take(wire.left(), "a message")?;
                Record::Message(number.into(), time, data)
            }
            op::CHUNK => return chunk(&bytes[..end], at + RECORD_HEAD_BYTES, None),
            op::MESSAGE_INDEX => {
                let number = wire.u16("an index")?;
                let mut entries = Wire::plain(wire.bytes("an index")?, 0);
                let mut times = Vec::with_capacity(entries.left() / INDEX_ENTRY_BYTES);
                while entries.left() >= INDEX_ENTRY_BYTES {
                    let time = nanoseconds(entries.u64("an index")?);
                    let place = entries.u64("an index")?;
                    times.push((time, usize::try_from(place).unwrap_or(usize::MAX)));
                }
                Record::Index(number.into(), times)
            }
            _ => Record::Other,
        };
        Ok((record, end))
    }
}

/// Parses a chunk whose record ends with `bytes`.
fn chunk(bytes: &[u8], at: usize, cut: Option<Fault>) -> Result<(Record<'_>, usize), Fault> {
    let mut wire = Wire::plain(bytes, at);
    for _ in 0..2 {
        wire.u64("a chunk's times")?;
    }
    let size = wire.u64("a chunk's size")?;
    let crc = wire.u32("a chunk's checksum")?;
    let compression = wire.string("a chunk's compression")?.into_owned();
    let compressed = wire.u64("a chunk's size")?;
    let start = wire.at();
    let end = usize::try_from(compressed).ok().and_then(|len| start.checked_add(len));
    let end = match end {
        Some(end) if end <= bytes.len() => end,
        _ if cut.is_some() => bytes.len(),
        _ => return Err(Fault::new(start, format!("a chunk of {compressed} bytes is longer than its record"))),
    };
    Ok((Record::Chunk(Chunk { data: start..end, size, crc, compression, cut }), bytes.len()))
}

fn nanoseconds(time: u64) -> i64 {
    i64::try_from(time).unwrap_or(i64::MAX)
}
