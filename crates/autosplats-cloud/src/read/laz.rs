//! The compressed records of LAZ and COPC.
//!
//! # How it works
//!
//! Records are compressed in chunks, and a table at the end says how long each chunk is. Chunks are independent, so
//! several are decompressed side by side with the `laz` crate's record decompressors. Its own readers are not used, as
//! they allocate what the chunk table claims; here every claim is compared with the length of the file first.

use std::{io::Cursor, ops::Range};

use laz::{
    LazItem, LazItemType, LazVlr,
    laszip::ChunkTable,
    record::{LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor},
};
use rayon::prelude::*;

use super::{Job, guard, las::Header, table::reserve};
use crate::Error;

/// Points decompressed between two looks at the caller's wish to stop, about.
const BATCH: usize = 1 << 19;

/// Points that one byte can stand for. Real data need a byte or more for each; a chunk of 50,000 equal points is about
/// 70 bytes.
const MAX_RATIO: u64 = 4096;

/// Bytes before the data of a variable length record.
const RECORD_HEADER: usize = 54;

/// A run of records that is decompressed from its beginning.
struct Chunk {
    bytes: Range<usize>,
    points: usize,
}

/// Decompresses all points; `keep` gets the records of some hundred thousand at a time.
pub(super) fn decode(
    job: &Job<'_>,
    header: &Header,
    mut keep: impl FnMut(&[u8]) -> Result<(), Error>,
) -> Result<(), Error> {
    if header.points == 0 {
        return Ok(());
    }
    let fail = |what: String| job.malformed(format!("byte {}", header.point_data), what);
    let (vlr, chunked) = compression(job, header)?;
    check_items(vlr.items(), header).map_err(fail)?;
    if header.points > MAX_RATIO.saturating_mul(job.bytes.len() as u64) {
        return Err(fail(format!("{} points cannot be in a file of this size", header.points)));
    }
    let chunks = guard(|| chunks(job.bytes, header, &vlr, chunked)).map_err(fail)?;

    let mut decoder = Decoder { job, header, items: vlr.items(), records: Vec::new(), done: 0 };
    let mut rest = &chunks[..];
    while let Some(first) = rest.first() {
        if first.points > BATCH {
            decoder.long_chunk(first, &mut keep)?;
            rest = &rest[1..];
            continue;
        }
        let mut points = 0;
        let fitting = rest.iter().take_while(|chunk| {
            points += chunk.points;
            points <= BATCH
        });
        let (batch, after) = rest.split_at(fitting.count());
        decoder.batch(batch, &mut keep)?;
        rest = after;
    }
    Ok(())
}

/// Where the decompression stands.
struct Decoder<'a> {
    job: &'a Job<'a>,
    header: &'a Header,
    items: &'a Vec<LazItem>,
    /// The records decompressed last.
    records: Vec<u8>,
    /// Points decompressed before these.
    done: usize,
}

impl Decoder<'_> {
    /// Decompresses chunks side by side.
    fn batch(&mut self, chunks: &[Chunk], keep: &mut impl FnMut(&[u8]) -> Result<(), Error>) -> Result<(), Error> {
        let len = self.header.record_len;
        self.make_room(chunks.iter().map(|chunk| chunk.points).sum())?;
        let mut outputs = Vec::new();
        let mut unassigned = &mut self.records[..];
        for chunk in chunks {
            let (output, after) = unassigned.split_at_mut(chunk.points * len);
            outputs.push((&self.job.bytes[chunk.bytes.clone()], output));
            unassigned = after;
        }
        let items = self.items;
        outputs
            .into_par_iter()
            .try_for_each(|(input, output)| guard(|| decompress(&mut *decompressor(items, input)?, output, len)))
            .map_err(|what| self.fail(&format!("here or in the points that follow: {what}")))?;
        self.done += self.records.len() / len;
        keep(&self.records)
    }

    /// Decompresses a chunk that is too long for one batch, as old writers make them, piece by piece.
    fn long_chunk(&mut self, chunk: &Chunk, keep: &mut impl FnMut(&[u8]) -> Result<(), Error>) -> Result<(), Error> {
        let input = &self.job.bytes[chunk.bytes.clone()];
        let mut decompressor = guard(|| decompressor(self.items, input)).map_err(|what| self.fail(&what))?;
        let end = self.done + chunk.points;
        while self.done < end {
            let points = (end - self.done).min(BATCH / 4);
            self.make_room(points)?;
            guard(|| decompress(&mut *decompressor, &mut self.records, self.header.record_len))
                .map_err(|what| self.fail(&what))?;
            self.done += points;
            keep(&self.records)?;
        }
        Ok(())
    }

    fn make_room(&mut self, points: usize) -> Result<(), Error> {
        self.job.tick(0.9 * self.done as f32 / self.header.points as f32)?;
        let len = points * self.header.record_len;
        self.records.clear();
        reserve(&mut self.records, len, "compressed points")?;
        self.records.resize(len, 0);
        Ok(())
    }

    fn fail(&self, what: &str) -> Error {
        self.job.malformed(format!("point {}", self.done + 1), what)
    }
}

/// How the points are compressed, and whether in chunks: one of the variable length records after the header.
fn compression(job: &Job<'_>, header: &Header) -> Result<(LazVlr, bool), Error> {
    let (mut at, count) = header.records;
    for _ in 0..count {
        let Some(record) = job.bytes[..header.point_data].get(at..).filter(|rest| rest.len() >= RECORD_HEADER) else {
            break;
        };
        let id = u16::from_le_bytes([record[18], record[19]]);
        let len = usize::from(u16::from_le_bytes([record[20], record[21]]));
        if id == LazVlr::RECORD_ID && record[2..].starts_with(LazVlr::USER_ID.as_bytes()) {
            let data = &record[RECORD_HEADER..record.len().min(RECORD_HEADER + len)];
            let fail = |what| job.malformed(format!("byte {at}"), format!("bad compression record ({what})"));
            let vlr = guard(|| LazVlr::from_buffer(data).map_err(|error| error.to_string())).map_err(fail)?;
            // The compressor is the first number: 1 is a single run, as the oldest writers made it; 2 and 3 are chunks.
            return match (data[0], layered(vlr.items())) {
                (1, false) => Ok((vlr, false)),
                (2, false) | (3, true) => Ok((vlr, true)),
                (compressor, _) => Err(fail(format!("compressor {compressor} does not go with its items"))),
            };
        }
        at += RECORD_HEADER + len;
    }
    let what = "the points are compressed, but the record that says how is missing; copy the file again";
    Err(job.malformed(format!("byte {at}"), what))
}

/// Whether chunks keep each kind of value apart, as those of formats 6 and up do.
fn layered(items: &[LazItem]) -> bool {
    items.first().is_some_and(|item| item.version() >= 3)
}

/// The parts that records are compressed in make up a whole record of the format, in the right order.
fn check_items(items: &[LazItem], header: &Header) -> Result<(), String> {
    let wide = header.format >= 6;
    let size = |item: &LazItem| match item.item_type() {
        LazItemType::Point10 => 20,
        LazItemType::GpsTime | LazItemType::RGBNIR14 => 8,
        LazItemType::RGB12 | LazItemType::RGB14 => 6,
        LazItemType::WavePacket13 | LazItemType::WavePacket14 => 29,
        LazItemType::Point14 => 30,
        LazItemType::Byte(count) | LazItemType::Byte14(count) => count,
    };
    let first = if wide { LazItemType::Point14 } else { LazItemType::Point10 };
    let sum: usize = items.iter().map(|item| usize::from(size(item))).sum();
    let known = items.iter().all(|item| item.size() == size(item));
    if known && sum == header.record_len && items.first().is_some_and(|item| item.item_type() == first) {
        Ok(())
    } else {
        Err(format!("the compression record does not fit records of format {}", header.format))
    }
}

/// Finds the chunks. Nothing that follows trusts more than what is checked here.
fn chunks(bytes: &[u8], header: &Header, vlr: &LazVlr, chunked: bool) -> Result<Vec<Chunk>, String> {
    let points = usize::try_from(header.points).map_err(|_| "too many points".to_owned())?;
    let cut = || "the file ends before its chunk table; it is cut off, copy it again".to_owned();
    if !chunked {
        return Ok(vec![Chunk { bytes: header.point_data..bytes.len(), points }]);
    }
    let start = header.point_data + 8;
    let offset_at = |at: usize| Some(i64::from_le_bytes(*bytes.get(at..)?.first_chunk()?));
    // A writer that cannot go back leaves -1 and puts the offset at the very end.
    let inside = |offset: &i64| usize::try_from(*offset).is_ok_and(|at| at >= start && at < bytes.len());
    let table = offset_at(header.point_data)
        .filter(inside)
        .or_else(|| offset_at(bytes.len().checked_sub(8)?).filter(inside))
        .and_then(|offset| usize::try_from(offset).ok())
        .ok_or_else(cut)?;
    let count = bytes.get(table + 4..).and_then(|rest| rest.first_chunk()).copied().map(u32::from_le_bytes);
    let count = count.ok_or_else(cut)? as usize;
    if count > (bytes.len() - start) / header.record_len {
        // Every chunk begins with one whole record.
        return Err(format!("{count} chunks cannot be in a file of this size"));
    }
    let variable = vlr.uses_variable_size_chunks();
    let entries = ChunkTable::read(&mut Cursor::new(&bytes[table..]), variable).map_err(|error| error.to_string())?;

    let mut chunks = Vec::new();
    let (mut at, mut left) = (start, points);
    for entry in entries.as_ref() {
        let fail = |what: &str| format!("chunk {} {what}; the file is damaged, copy it again", chunks.len() + 1);
        let end = usize::try_from(entry.byte_count).ok().and_then(|len| at.checked_add(len));
        let end = end.filter(|&end| end <= table).ok_or_else(|| fail("reaches beyond the points"))?;
        let held = if variable { entry.point_count } else { vlr.chunk_size().into() };
        let held = usize::try_from(held).map_or(left, |held| held.min(left));
        if held > 0 {
            if layered(vlr.items()) {
                check_layers(&bytes[at..end], vlr.items(), header.record_len).ok_or_else(|| fail("is inconsistent"))?;
            }
            chunks.push(Chunk { bytes: at..end, points: held });
        }
        at = end;
        left -= held;
    }
    if left > 0 {
        return Err(format!("the chunks hold {} of {points} points; it is cut off, copy it again", points - left));
    }
    Ok(chunks)
}

/// A layered chunk gives, after its first record and the number of points, the length of each layer; the decompressor
/// allocates them as they are claimed.
fn check_layers(chunk: &[u8], items: &[LazItem], record_len: usize) -> Option<()> {
    let layers: usize = items
        .iter()
        .map(|item| match item.item_type() {
            LazItemType::Point14 => 9,
            LazItemType::RGBNIR14 => 2,
            LazItemType::Byte14(count) => count.into(),
            _ => 1,
        })
        .sum();
    let sizes = chunk.get(record_len + 4..record_len + 4 + 4 * layers)?;
    let claimed: u64 = sizes.as_chunks::<4>().0.iter().map(|&size| u64::from(u32::from_le_bytes(size))).sum();
    let held = (chunk.len() - record_len - 4 - 4 * layers) as u64;
    (claimed <= held).then_some(())
}

type Decompressor<'a> = Box<dyn RecordDecompressor<Cursor<&'a [u8]>> + Send + Sync + 'a>;

fn decompressor<'a>(items: &Vec<LazItem>, chunk: &'a [u8]) -> Result<Decompressor<'a>, String> {
    let mut decompressor: Decompressor<'a> = if layered(items) {
        Box::new(LayeredPointRecordDecompressor::new(Cursor::new(chunk)))
    } else {
        Box::new(SequentialPointRecordDecompressor::new(Cursor::new(chunk)))
    };
    decompressor.set_fields_from(items).map_err(|error| error.to_string())?;
    Ok(decompressor)
}

fn decompress(
    decompressor: &mut (dyn RecordDecompressor<Cursor<&[u8]>> + Send + Sync),
    records: &mut [u8],
    len: usize,
) -> Result<(), String> {
    let damaged = |error| format!("the compressed data are damaged ({error}); copy the file again");
    records.chunks_exact_mut(len).try_for_each(|record| decompressor.decompress_next(record)).map_err(damaged)
}
