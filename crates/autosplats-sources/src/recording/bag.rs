//! Records of ROS 1 bags, version 2.0.

use super::{
    chunk::Chunk,
    records::{Record, Topic},
};
use crate::wire::{Fault, Wire};

/// First bytes of a bag.
pub(super) const MAGIC: &[u8] = b"#ROSBAG V2.0\n";

/// Parser of bag records. Bags need no state, because each record has named fields.
pub(super) struct Bag;

/// Kinds of records.
mod op {
    pub(super) const MESSAGE: u8 = 2;
    pub(super) const INDEX: u8 = 4;
    pub(super) const CHUNK: u8 = 5;
    pub(super) const CHUNK_INFO: u8 = 6;
    pub(super) const CONNECTION: u8 = 7;
}

/// Bytes of an index entry: the time in two numbers, and the offset.
const INDEX_ENTRY_BYTES: usize = 12;

impl Bag {
    pub(super) fn record<'a>(&mut self, bytes: &'a [u8], at: usize) -> Result<(Record<'a>, usize), Fault> {
        let mut wire = Wire::plain(bytes, at);
        let header = Header(wire.bytes("a record's header")?);
        let kind = header.number::<1>(b"op").map(|[kind]| kind);
        let kind = kind.ok_or_else(|| Fault::new(at, "a record has no kind; everything after it is lost"))?;
        let connection = || {
            let number = header.number(b"conn").map(u32::from_le_bytes);
            number.ok_or_else(|| Fault::new(at, "a record names no topic; everything after it is lost"))
        };
        let len = wire.u32("a record")? as usize;
        let start = wire.at();
        if kind == op::CHUNK {
            let size = header.number(b"size").map_or(0, u32::from_le_bytes);
            let compression = String::from_utf8_lossy(header.value(b"compression").unwrap_or_default()).into_owned();
            let left = wire.left();
            let cut = (len > left).then(|| {
                Fault::new(at, format!("a chunk of {len} bytes is cut off after {left}; everything after it is lost"))
            });
            let data = start..start + len.min(left);
            let end = data.end;
            return Ok((Record::Chunk(Chunk { data, size: size.into(), crc: 0, compression, cut }), end));
        }
        let data = wire.take(len, "a record")?;
        let record = match kind {
            op::CONNECTION => {
                let own = Header(data);
                let text = |value: Option<&[u8]>| String::from_utf8_lossy(value.unwrap_or_default()).into_owned();
                let name = text(own.value(b"topic").or_else(|| header.value(b"topic")));
                Record::Topic(connection()?, Topic::new(&name, &text(own.value(b"type")), "ros1"))
            }
            op::MESSAGE => Record::Message(connection()?, header.number(b"time").map_or(0, time), data),
            op::INDEX => {
                let entries = data.chunks_exact(INDEX_ENTRY_BYTES).filter_map(|entry| {
                    let (stamp, place) = entry.split_first_chunk::<8>()?;
                    Some((time(*stamp), u32::from_le_bytes(*place.first_chunk()?) as usize))
                });
                Record::Index(connection()?, entries.collect())
            }
            // Summary of a chunk. These records follow all others in a bag that was closed properly.
            op::CHUNK_INFO => Record::End,
            _ => Record::Other,
        };
        Ok((record, start + len))
    }
}

/// Converts seconds and nanoseconds to nanoseconds.
fn time(raw: [u8; 8]) -> i64 {
    let [seconds, nanoseconds] = bytemuck::cast::<[u8; 8], [[u8; 4]; 2]>(raw).map(u32::from_le_bytes);
    i64::from(seconds) * 1_000_000_000 + i64::from(nanoseconds)
}

/// Fields of a record header by name.
struct Header<'a>(&'a [u8]);

impl<'a> Header<'a> {
    fn value(&self, name: &[u8]) -> Option<&'a [u8]> {
        let mut wire = Wire::plain(self.0, 0);
        while wire.left() > 0 {
            let field = wire.bytes("a field").ok()?;
            if let Some(value) = field.strip_prefix(name).and_then(|rest| rest.strip_prefix(b"=")) {
                return Some(value);
            }
        }
        None
    }

    fn number<const N: usize>(&self, name: &[u8]) -> Option<[u8; N]> {
        self.value(name)?.try_into().ok()
    }
}
