//! The compressed records of LAZ and COPC. See docs/decisions/0020-laz-codec.md.
//!
//! # How it works
//!
//! Records are compressed in chunks, and a table at the end states the length of each chunk. Chunks are independent, so
//! several are decompressed in parallel with the record decompressors of the `laz` crate. The crate's readers are not
//! used: they allocate what the chunk table claims. Here every claim is first compared with the length of the file.

use std::{io::Cursor, ops::Range};

use autosplats_cloud::{Error, guard};
use laz::{
    LazItem, LazItemType, LazVlr,
    laszip::ChunkTable,
    record::{LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor},
};

use super::super::Job;
use super::{
    columns::{BATCH, Columns, preview},
    gps_time::GpsTime11,
    header::Header,
    point14::{self, Point14},
    records::Records,
};

/// Points decompressed before their values are taken, while they are in the cache.
const PIECE: usize = 1 << 11;

/// Most chunks decompressed in parallel; many very short chunks would need much memory for bookkeeping.
const MAX_CHUNKS: usize = 1 << 10;

/// Most points per byte of the file. Real data need a byte or more per point, but a chunk of equal points far less.
const MAX_RATIO: u64 = 1024;

/// A run of records that can only be decompressed from its beginning.
struct Chunk {
    bytes: Range<usize>,
    points: usize,
    /// Whether the lengths in the chunk are impossible.
    inconsistent: bool,
}

/// The compressed points of a file.
pub(super) struct Compressed<'a> {
    /// Number of points in the chunks, and number of further points that the header claims.
    pub(super) points: usize,
    pub(super) missing: u64,
    bytes: &'a [u8],
    record_len: usize,
    items: Vec<LazItem>,
    chunks: Vec<Chunk>,
}

impl<'a> Compressed<'a> {
    /// Finds the chunks; `None` if there are no points.
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

/// State of the decompression.
struct Filling<'a, 'b> {
    file: &'a Compressed<'a>,
    job: &'a Job<'a>,
    columns: &'a mut Columns<'b>,
    /// Number of points processed.
    done: usize,
    damaged: Vec<Range<usize>>,
    /// Fault of the first damaged chunk.
    why: String,
}

impl Filling<'_, '_> {
    /// Decompresses chunks in parallel.
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

    /// Decompresses a chunk too long for one batch, as old writers make them. It works piece by piece, so that the
    /// points before a fault are kept.
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

/// The compression record, and whether the points are in chunks.
fn compression(job: &Job<'_>, header: &Header, records: &Records<'_>) -> Result<(LazVlr, bool), Error> {
    let Some(record) = records.find(LazVlr::USER_ID, LazVlr::RECORD_ID) else {
        let what = "the points are compressed, but their compression record is missing; copy the file again";
        return Err(job.malformed(format!("byte {}", header.records.0), what));
    };
    let fail = |what| job.malformed(format!("byte {}", record.at), format!("bad compression record ({what})"));
    let vlr = guard(|| LazVlr::from_buffer(record.data).map_err(|error| error.to_string())).map_err(fail)?;
    // The first number is the compressor: 1 is a single run, as the oldest writers made; 2 and 3 are chunks.
    match (record.data[0], layered(vlr.items())) {
        (1, false) => Ok((vlr, false)),
        (2, false) | (3, true) => Ok((vlr, true)),
        (compressor, _) => Err(fail(format!("compressor {compressor} does not fit its items"))),
    }
}

/// Whether chunks store each kind of value apart, as those of point formats 6 and up do.
fn layered(items: &[LazItem]) -> bool {
    items.first().is_some_and(|item| item.version() >= 3)
}

/// Checks that the compressed items form a complete record of the point format, in the right order.
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

/// Finds the chunks. Later code trusts only what is checked here.
fn chunks(bytes: &[u8], header: &Header, vlr: &LazVlr, chunked: bool) -> Result<Vec<Chunk>, String> {
    let points = usize::try_from(header.points).map_err(|_| "too many points".to_owned())?;
    let cut = || "the file ends before its chunk table; it is cut off, copy it again".to_owned();
    if !chunked {
        return Ok(vec![Chunk { bytes: header.point_data..bytes.len(), points, inconsistent: false }]);
    }
    let start = header.point_data + 8;
    let offset_at = |at: usize| Some(i64::from_le_bytes(*bytes.get(at..)?.first_chunk()?));
    // A writer that cannot seek back leaves -1 and stores the offset at the very end.
    let inside = |offset: &i64| usize::try_from(*offset).is_ok_and(|at| at >= start && at < bytes.len());
    let table = offset_at(header.point_data)
        .filter(inside)
        .or_else(|| offset_at(bytes.len().checked_sub(8)?).filter(inside))
        .and_then(|offset| usize::try_from(offset).ok())
        .ok_or_else(cut)?;
    let count = bytes.get(table + 4..).and_then(|rest| rest.first_chunk()).copied().map(u32::from_le_bytes);
    let count = count.ok_or_else(cut)? as usize;
    if count > (bytes.len() - start) / header.record_len {
        // Every chunk begins with one uncompressed record.
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

/// Whether the layers of a chunk fit into it. Their lengths follow the first record and the number of points, and the
/// decompressor allocates what they claim.
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

/// Makes a decompressor. Items on which damage would overflow the crate's stack are decoded by this project's code.
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

/// Decompresses the next records. An error holds the number of complete records before it.
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
