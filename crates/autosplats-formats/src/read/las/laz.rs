//! The compressed records of LAZ and COPC. See docs/decisions/0020-laz-codec.md.
//!
//! # How it works
//!
//! Records are compressed in [`chunks`](super::chunks), which are independent. So several are decompressed in parallel
//! with the record decompressors of the `laz` crate. The crate's readers are not used: they allocate what the chunk
//! table claims. Here every claim is first compared with the length of the file.

use std::{
    io::Cursor,
    ops::Range,
    sync::atomic::{AtomicBool, Ordering},
};

use autosplats_cloud::{Error, guard};
use laz::{DecompressionSelection, LazItem, LazItemType, LazVlr, record::RecordDecompressor};

use super::super::Job;
use super::{
    chunks::{Chunk, Chunks, Look, MAX_RATIO, layers},
    columns::{BATCH, Columns, Piece, preview},
    decompressor::{Decompressor, DynDecompressor, layered, selecting, why},
    header::Header,
    records::Records,
};

/// Points decompressed before their values are taken, while they are in the cache.
const PIECE: usize = 1 << 11;

/// Most chunks decompressed in parallel; many very short chunks would need much memory for bookkeeping.
const MAX_CHUNKS: usize = 1 << 10;

/// The compressed points of a file.
pub(super) struct Compressed<'a> {
    /// Number of points in the chunks, and number of further points that the header claims.
    pub(super) points: usize,
    pub(super) missing: u64,
    /// Whether the chunks are known to have more points than the header states.
    pub(super) more: bool,
    /// Note on the chunks.
    pub(super) note: Option<String>,
    bytes: &'a [u8],
    /// How the records are compressed.
    pub(super) layout: Layout,
    pub(super) chunks: Vec<Chunk>,
}

/// How records are compressed, and which of their values are decompressed.
#[derive(Clone)]
pub(super) struct Layout {
    pub(super) items: Vec<LazItem>,
    record_len: usize,
    /// Whether the records are in chunks.
    chunked: bool,
    pub(super) selection: DecompressionSelection,
}

impl<'a> Compressed<'a> {
    /// Finds the chunks; `None` if there are no points.
    pub(super) fn open(
        job: &Job<'a>,
        header: &Header,
        records: &Records<'a>,
        look: Look,
    ) -> Result<Option<Self>, Error> {
        if header.stated == 0 && header.end <= header.point_data + header.record_len {
            return Ok(None);
        }
        let fail = |what: String| job.malformed(format!("byte {}", header.point_data), what);
        let (layout, vlr) = Layout::read(job, header, records)?;
        let most = MAX_RATIO.saturating_mul(job.bytes.len());
        if header.stated > most as u64 {
            return Err(fail(format!("{} points cannot be in a file of this size", header.stated)));
        }
        let Chunks { list: chunks, more, note, .. } =
            guard(|| Chunks::find(job, header, &vlr, layout.chunked, look)).map_err(fail)?;
        let points = chunks.iter().map(|chunk| chunk.points).sum();
        if points > most {
            return Err(fail(format!("{points} points cannot be in a file of this size")));
        }
        Ok((points > 0).then(|| Self {
            points,
            missing: header.stated.saturating_sub(points as u64),
            more,
            note,
            bytes: job.bytes,
            layout,
            chunks,
        }))
    }

    /// The first record of each chunk, which is not compressed.
    pub(super) fn first_records(&self) -> Vec<&'a [u8]> {
        let first = |chunk: &Chunk| self.bytes[chunk.bytes.clone()].get(..self.layout.record_len);
        self.chunks.iter().filter_map(first).collect()
    }

    /// Whether bytes of the last chunk are left when its points are decompressed. A run without chunks may end
    /// anywhere, and layers state their points.
    fn has_more(&self, chunk: &Chunk, decompressor: &DynDecompressor<'_>) -> bool {
        let last = self.chunks.last().is_some_and(|last| last.bytes == chunk.bytes);
        let Layout { items, chunked, .. } = &self.layout;
        *chunked && last && !layered(items) && decompressor.get().position() < chunk.bytes.len() as u64
    }

    /// Decompresses all points into columns. Returns the ranges of points that could not be decompressed, and whether
    /// some chunk has more points than are read.
    pub(super) fn fill(&self, job: &Job<'_>, columns: &mut Columns<'_>) -> Result<(Vec<Range<usize>>, bool), Error> {
        let mut filling = Filling {
            file: self,
            job,
            columns,
            done: 0,
            damaged: Vec::new(),
            why: String::new(),
            more: AtomicBool::new(self.more),
        };
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
        let Filling { damaged, why, more, .. } = filling;
        if damaged.iter().map(ExactSizeIterator::len).sum::<usize>() == self.points {
            return Err(job.malformed("point 1", why));
        }
        Ok((damaged, more.into_inner()))
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
    more: AtomicBool,
}

impl Filling<'_, '_> {
    /// Decompresses chunks in parallel.
    fn batch(&mut self, chunks: &[Chunk]) -> Result<(), Error> {
        self.tick()?;
        let (file, more) = (self.file, &self.more);
        let counts: Vec<usize> = chunks.iter().map(|chunk| chunk.points).collect();
        let outcomes = self.columns.fill(self.done, &counts, |index, piece| {
            let chunk = &chunks[index];
            guard(|| {
                if chunk.inconsistent {
                    return Err("the lengths in a chunk are inconsistent; copy the file again".into());
                }
                let decompressor = file.layout.take_chunk(&file.bytes[chunk.bytes.clone()], chunk.points, piece)?;
                more.fetch_or(file.has_more(chunk, &*decompressor), Ordering::Relaxed);
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
        let layout = &file.layout;
        let input = &file.bytes[chunk.bytes.clone()];
        let opened = guard(|| match chunk.inconsistent {
            true => Err("the lengths in a chunk are inconsistent; copy the file again".into()),
            false => selecting(&layout.items, input, layout.selection),
        });
        let mut decompressor = match opened {
            Ok(decompressor) => decompressor,
            Err(what) => {
                self.lose(self.done..end, what);
                self.done = end;
                return Ok(());
            }
        };
        let mut buffer = vec![0; PIECE * layout.record_len];
        while self.done < end {
            self.tick()?;
            let start = self.done;
            let stop = end.min(start + BATCH / 4);
            while self.done < stop {
                let count = PIECE.min(stop - self.done);
                let records = &mut buffer[..count * layout.record_len];
                let outcome = guard(|| Ok(decompress(&mut *decompressor, records, layout.record_len)));
                let (whole, why) = match outcome {
                    Ok(Ok(())) => (count, None),
                    Ok(Err((whole, what))) => (whole, Some(what)),
                    Err(what) => (0, Some(what)),
                };
                self.columns.fill(self.done, &[whole], |_, piece| {
                    piece.take(&records[..whole * layout.record_len]);
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
        self.more.fetch_or(file.has_more(chunk, &*decompressor), Ordering::Relaxed);
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

impl Layout {
    /// Reads the compression record.
    pub(super) fn read(job: &Job<'_>, header: &Header, records: &Records<'_>) -> Result<(Self, LazVlr), Error> {
        let (vlr, chunked) = compression(job, header, records)?;
        check_items(vlr.items(), header).map_err(|what| job.malformed(format!("byte {}", header.point_data), what))?;
        let (items, record_len) = (vlr.items().clone(), header.record_len);
        Ok((Self { items, record_len, chunked, selection: DecompressionSelection::all() }, vlr))
    }

    /// The same records, of which only these values are decompressed.
    pub(super) fn selecting(&self, selection: DecompressionSelection) -> Self {
        Self { selection, ..self.clone() }
    }

    /// Number of points that a chunk in layers states, if its layers fit into it.
    pub(super) fn stated_points(&self, chunk: &[u8]) -> Option<usize> {
        layered(&self.items).then(|| layers(chunk, &self.items, self.record_len)).flatten().map(|(points, _)| points)
    }

    /// Decompresses a chunk into its part of the columns. Returns the decompressor behind the last point.
    pub(super) fn take_chunk<'a>(
        &self,
        chunk: &'a [u8],
        points: usize,
        piece: &mut Piece<'_>,
    ) -> Result<Decompressor<'a>, String> {
        let mut decompressor = selecting(&self.items, chunk, self.selection)?;
        let mut records = vec![0; PIECE.min(points) * self.record_len];
        let mut left = points;
        while left > 0 {
            let records = &mut records[..PIECE.min(left) * self.record_len];
            decompress(&mut *decompressor, records, self.record_len).map_err(|(_, what)| what)?;
            piece.take(records);
            left -= records.len() / self.record_len;
        }
        Ok(decompressor)
    }
}

/// The compression record, and whether the points are in chunks.
fn compression(job: &Job<'_>, header: &Header, records: &Records<'_>) -> Result<(LazVlr, bool), Error> {
    let Some(record) = records.find(LazVlr::USER_ID, LazVlr::RECORD_ID) else {
        let what = "the points are compressed, but their compression record is missing; copy the file again";
        return Err(job.malformed(format!("byte {}", header.records.0), what));
    };
    let fail = |what| job.malformed(format!("byte {}", record.at), format!("bad compression record ({what})"));
    let vlr = guard(|| LazVlr::from_buffer(record.data).map_err(|error| why(&error))).map_err(fail)?;
    // The first number is the compressor: 1 is a single run, as the oldest writers made; 2 and 3 are chunks.
    match (record.data[0], layered(vlr.items())) {
        (1, false) => Ok((vlr, false)),
        (2, false) | (3, true) => Ok((vlr, true)),
        (compressor, _) => Err(fail(format!("compressor {compressor} does not fit its items"))),
    }
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

/// Decompresses the next records. An error holds the number of complete records before it.
pub(super) fn decompress(
    decompressor: &mut (dyn RecordDecompressor<Cursor<&[u8]>> + Send + Sync),
    records: &mut [u8],
    len: usize,
) -> Result<(), (usize, String)> {
    for (index, record) in records.chunks_exact_mut(len).enumerate() {
        let damaged = |error: std::io::Error| format!("the compressed data are damaged ({error}); copy the file again");
        decompressor.decompress_next(record).map_err(|error| (index, damaged(error)))?;
    }
    Ok(())
}
