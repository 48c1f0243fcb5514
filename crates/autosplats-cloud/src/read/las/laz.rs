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

use super::{
    super::{Job, guard},
    BATCH,
    columns::Columns,
    gps_time::GpsTime11,
    header::Header,
    point14::{self, Point14},
    preview,
    records::Records,
};
use crate::Error;

/// Points decompressed before they are taken apart, while they are in cache.
const PIECE: usize = 1 << 11;

/// Chunks decompressed side by side; files of very short ones would need much memory for bookkeeping.
const MAX_CHUNKS: usize = 1 << 10;

/// Points that one byte can stand for. Real data need a byte or more for each; a chunk of 50,000 equal points is about
/// 70 bytes.
const MAX_RATIO: u64 = 1024;

/// A run of records that is decompressed from its beginning.
struct Chunk {
    bytes: Range<usize>,
    points: usize,
    /// Whether what it says of itself cannot be.
    inconsistent: bool,
}

/// The compressed points of a file.
pub(super) struct Compressed<'a> {
    /// Points that the chunks hold, and how many more the header tells of.
    pub(super) points: usize,
    pub(super) missing: u64,
    bytes: &'a [u8],
    record_len: usize,
    items: Vec<LazItem>,
    chunks: Vec<Chunk>,
}

impl<'a> Compressed<'a> {
    /// Finds the chunks; nothing if there are no points.
    pub(super) fn open(job: &Job<'a>, header: &Header, records: &Records<'a>) -> Result<Option<Self>, Error> {
        if header.points == 0 {
            return Ok(None);
        }
        let fail = |what: String| job.malformed(format!("byte {}", header.point_data), what);
        let (vlr, chunked) = compression(job, header, records)?;
        check_items(vlr.items(), header).map_err(fail)?;
        if header.points > MAX_RATIO.saturating_mul(job.bytes.len() as u64) {
            return Err(fail(format!("{} points cannot be in a file of this size", header.points)));
        }
        let chunks = guard(|| chunks(job.bytes, header, &vlr, chunked)).map_err(fail)?;
        let points = chunks.iter().map(|chunk| chunk.points).sum();
        Ok(Some(Self {
            points,
            missing: header.points - points as u64,
            bytes: job.bytes,
            record_len: header.record_len,
            items: vlr.items().clone(),
            chunks,
        }))
    }

    /// The first record of each chunk, which is not compressed.
    pub(super) fn first_records(&self) -> Vec<&'a [u8]> {
        let first = |chunk: &Chunk| self.bytes[chunk.bytes.clone()].get(..self.record_len);
        self.chunks.iter().filter_map(first).collect()
    }

    /// Decompresses all points into columns. Returns the ranges of points that could not be decompressed.
    pub(super) fn fill(&self, job: &Job<'_>, columns: &mut Columns<'_>) -> Result<Vec<Range<usize>>, Error> {
        let mut filling = Filling { file: self, job, columns, done: 0, damaged: Vec::new(), why: String::new() };
        let mut rest = &self.chunks[..];
        while let Some(first) = rest.first() {
            if first.points > BATCH {
                filling.long_chunk(first)?;
                rest = &rest[1..];
                continue;
            }
            let mut points = 0;
            let fitting = rest.iter().take(MAX_CHUNKS).take_while(|chunk| {
                points += chunk.points;
                points <= BATCH
            });
            let (batch, after) = rest.split_at(fitting.count());
            filling.batch(batch)?;
            rest = after;
        }
        let Filling { damaged, why, .. } = filling;
        if damaged.iter().map(ExactSizeIterator::len).sum::<usize>() == self.points {
            return Err(job.malformed("point 1", why));
        }
        Ok(damaged)
    }
}

/// Where the decompression stands.
struct Filling<'a, 'b> {
    file: &'a Compressed<'a>,
    job: &'a Job<'a>,
    columns: &'a mut Columns<'b>,
    /// Points that are done with.
    done: usize,
    damaged: Vec<Range<usize>>,
    /// What is wrong with the first that is damaged.
    why: String,
}

impl Filling<'_, '_> {
    /// Decompresses chunks side by side.
    fn batch(&mut self, chunks: &[Chunk]) -> Result<(), Error> {
        self.tick()?;
        let file = self.file;
        let counts: Vec<usize> = chunks.iter().map(|chunk| chunk.points).collect();
        let outcomes = self.columns.fill(self.done, &counts, |index, piece| {
            let chunk = &chunks[index];
            guard(|| {
                if chunk.inconsistent {
                    return Err("the lengths in a chunk are inconsistent; copy the file again".into());
                }
                let mut decompressor = decompressor(&file.items, &file.bytes[chunk.bytes.clone()])?;
                let mut records = vec![0; PIECE.min(chunk.points) * file.record_len];
                let mut left = chunk.points;
                while left > 0 {
                    let records = &mut records[..PIECE.min(left) * file.record_len];
                    decompress(&mut *decompressor, records, file.record_len).map_err(|(_, what)| what)?;
                    piece.take(records);
                    left -= records.len() / file.record_len;
                }
                Ok(())
            })
        });
        let start = self.done;
        for (outcome, count) in outcomes.into_iter().zip(counts) {
            if let Err(what) = outcome {
                self.lose(self.done..self.done + count, what);
            }
            self.done += count;
        }
        preview(self.job, self.columns, start, self.done - start)
    }

    /// Decompresses a chunk that is too long for one batch, as old writers make them, piece by piece: what comes before a
    /// fault can be kept.
    fn long_chunk(&mut self, chunk: &Chunk) -> Result<(), Error> {
        let end = self.done + chunk.points;
        let file = self.file;
        let input = &file.bytes[chunk.bytes.clone()];
        let opened = guard(|| match chunk.inconsistent {
            true => Err("the lengths in a chunk are inconsistent; copy the file again".into()),
            false => decompressor(&file.items, input),
        });
        let mut decompressor = match opened {
            Ok(decompressor) => decompressor,
            Err(what) => {
                self.lose(self.done..end, what);
                self.done = end;
                return Ok(());
            }
        };
        let mut buffer = vec![0; PIECE * file.record_len];
        while self.done < end {
            self.tick()?;
            let start = self.done;
            let stop = end.min(start + BATCH / 4);
            while self.done < stop {
                let count = PIECE.min(stop - self.done);
                let records = &mut buffer[..count * file.record_len];
                let outcome = guard(|| Ok(decompress(&mut *decompressor, records, file.record_len)));
                let (whole, why) = match outcome {
                    Ok(Ok(())) => (count, None),
                    Ok(Err((whole, what))) => (whole, Some(what)),
                    Err(what) => (0, Some(what)),
                };
                self.columns.fill(self.done, &[whole], |_, piece| {
                    piece.take(&records[..whole * file.record_len]);
                    Ok(())
                });
                self.done += whole;
                if let Some(what) = why {
                    preview(self.job, self.columns, start, self.done - start)?;
                    self.lose(self.done..end, what);
                    self.done = end;
                    return Ok(());
                }
            }
            preview(self.job, self.columns, start, self.done - start)?;
        }
        Ok(())
    }

    fn lose(&mut self, points: Range<usize>, what: String) {
        if self.damaged.is_empty() {
            self.why = what;
        }
        self.damaged.push(points);
    }

    fn tick(&self) -> Result<(), Error> {
        self.job.tick(self.done as f32 / self.file.points as f32)
    }
}

/// How the points are compressed, and whether in chunks: one of the variable length records after the header.
fn compression(job: &Job<'_>, header: &Header, records: &Records<'_>) -> Result<(LazVlr, bool), Error> {
    let Some(record) = records.find(LazVlr::USER_ID, LazVlr::RECORD_ID) else {
        let what = "the points are compressed, but the record that says how is missing; copy the file again";
        return Err(job.malformed(format!("byte {}", header.records.0), what));
    };
    let fail = |what| job.malformed(format!("byte {}", record.at), format!("bad compression record ({what})"));
    let vlr = guard(|| LazVlr::from_buffer(record.data).map_err(|error| error.to_string())).map_err(fail)?;
    // The compressor is the first number: 1 is a single run, as the oldest writers made it; 2 and 3 are chunks.
    match (record.data[0], layered(vlr.items())) {
        (1, false) => Ok((vlr, false)),
        (2, false) | (3, true) => Ok((vlr, true)),
        (compressor, _) => Err(fail(format!("compressor {compressor} does not go with its items"))),
    }
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
        return Ok(vec![Chunk { bytes: header.point_data..bytes.len(), points, inconsistent: false }]);
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
            let inconsistent = layered(vlr.items()) && !layers_fit(&bytes[at..end], vlr.items(), header.record_len);
            chunks.push(Chunk { bytes: at..end, points: held, inconsistent });
        }
        at = end;
        left -= held;
    }
    if left == points {
        return Err(format!("the chunks hold none of {points} points; the file is cut off, copy it again"));
    }
    Ok(chunks)
}

/// A layered chunk gives, after its first record and the number of points, the length of each layer; the decompressor
/// allocates them as they are claimed, so they must be in the chunk.
pub(super) fn layers_fit(chunk: &[u8], items: &[LazItem], record_len: usize) -> bool {
    let layers: usize = items
        .iter()
        .map(|item| match item.item_type() {
            LazItemType::Point14 => point14::LAYERS,
            LazItemType::RGBNIR14 => 2,
            LazItemType::Byte14(count) => count.into(),
            _ => 1,
        })
        .sum();
    let Some(sizes) = chunk.get(record_len + 4..record_len + 4 + 4 * layers) else { return false };
    let claimed: u64 = sizes.as_chunks::<4>().0.iter().map(|&size| u64::from(u32::from_le_bytes(size))).sum();
    claimed <= (chunk.len() - record_len - 4 - 4 * layers) as u64
}

pub(super) type Decompressor<'a> = Box<dyn RecordDecompressor<Cursor<&'a [u8]>> + Send + Sync + 'a>;

/// Parts are ours where damaged data would fill the stack of the crate's.
pub(super) fn decompressor<'a>(items: &[LazItem], chunk: &'a [u8]) -> Result<Decompressor<'a>, String> {
    let theirs = |decompressor: &mut dyn RecordDecompressor<Cursor<&'a [u8]>>, item: LazItem| {
        decompressor.set_fields_from(&vec![item]).map_err(|error| error.to_string())
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

/// Decompresses the next records; an error comes with the number of those before it.
fn decompress(
    decompressor: &mut (dyn RecordDecompressor<Cursor<&[u8]>> + Send + Sync),
    records: &mut [u8],
    len: usize,
) -> Result<(), (usize, String)> {
    for (index, record) in records.chunks_exact_mut(len).enumerate() {
        let damaged = |error| format!("the compressed data are damaged ({error}); copy the file again");
        decompressor.decompress_next(record).map_err(|error| (index, damaged(error)))?;
    }
    Ok(())
}
