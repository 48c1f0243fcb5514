//! Where the chunks of compressed records are, and how many points each has.
//!
//! # How it works
//!
//! A table behind the points states the length of each chunk. If there is no table, or it cannot be true, the chunks
//! are found one after the other. A chunk in layers states its number of points and its length. Any other chunk has a
//! fixed number of points, and ends where decompressing these ends.

use std::{io::Cursor, ops::Range};

use laz::{LazItem, LazItemType, LazVlr, laszip::ChunkTable};

use super::super::Job;
use super::{
    decompressor::{decompressor, layered},
    header::Header,
    point14,
};

/// Most points per byte of the file. Real data need a byte or more per point, but a chunk of equal points far less.
pub(crate) const MAX_RATIO: usize = 1024;

/// Points decompressed between two checks for cancellation.
const CHECKED: usize = 1 << 16;

/// How far chunks are looked at to find them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Look {
    /// The table alone, where it can be used.
    Table,
    /// The beginnings of the chunks too.
    Starts,
    /// Points are decompressed if nothing else tells their number.
    Points,
}

/// A run of records that can only be decompressed from its beginning.
pub(super) struct Chunk {
    pub(super) bytes: Range<usize>,
    pub(super) points: usize,
    /// Whether the lengths in the chunk are impossible.
    pub(super) inconsistent: bool,
}

/// The chunks of a file.
pub(super) struct Chunks {
    pub(super) list: Vec<Chunk>,
    /// Whether they have more points than the header states.
    pub(super) more: bool,
    /// Whether the lengths in the table add up to the place of the table.
    exact: bool,
    /// Note on a table that cannot be used.
    pub(super) note: Option<String>,
}

impl Chunks {
    /// Finds the chunks. Later code trusts only what is checked here.
    pub(super) fn find(
        job: &Job<'_>,
        header: &Header,
        vlr: &LazVlr,
        chunked: bool,
        look: Look,
    ) -> Result<Self, String> {
        let stated = usize::try_from(header.stated).map_err(|_| "too many points".to_owned())?;
        if !chunked {
            let list = match stated {
                0 => return Err("the header states 0 points; nothing else tells how many there are".into()),
                points => vec![Chunk { bytes: header.point_data..job.bytes.len(), points, inconsistent: false }],
            };
            return Ok(Self { list, more: false, exact: true, note: None });
        }
        let variable = vlr.uses_variable_size_chunks();
        let search = Search {
            job,
            items: vlr.items(),
            record_len: header.record_len,
            start: header.point_data + 8,
            stated: (stated > 0).then_some(stated),
            size: (!variable).then_some(vlr.chunk_size() as usize),
            look,
        };
        let table = search.table(header.point_data);
        let by_table = match table {
            Some(table) => search.by_table(table),
            None => Err("the file ends before its chunk table; it is cut off, copy it again".into()),
        };
        let count = |list: &[Chunk]| list.iter().map(|chunk| chunk.points).sum::<usize>();
        let why = match &by_table {
            Ok(Self { list, exact: true, .. }) if count(list) >= stated.max(1) => return by_table,
            // A file without points.
            Ok(_) if stated == 0 && table == Some(search.start) => return by_table,
            Ok(Self { exact: true, .. }) => "it lacks points",
            Ok(_) | Err(_) => "it is missing or damaged",
        };
        let list = search.one_by_one(table, header.end);
        let better = |chunks: &Self| (count(&chunks.list), chunks.exact) >= (count(&list), true);
        if list.is_empty() || by_table.as_ref().is_ok_and(better) {
            return by_table.and_then(|chunks| match count(&chunks.list) {
                0 if stated > 0 => {
                    Err(format!("the chunks hold none of {stated} points; the file is cut off, copy it again"))
                }
                _ => Ok(chunks),
            });
        }
        let found = list.len();
        let note = format!("the table of the compressed chunks cannot be used: {why}; {found} whole chunks are found");
        Ok(Self { list, more: false, exact: false, note: Some(note) })
    }
}

/// What is known of the chunks in advance.
struct Search<'a> {
    job: &'a Job<'a>,
    items: &'a Vec<LazItem>,
    record_len: usize,
    /// First byte of the first chunk.
    start: usize,
    /// Number of points in the header, unless it is zero.
    stated: Option<usize>,
    /// Points of each chunk but the last; `None` if their number varies.
    size: Option<usize>,
    look: Look,
}

impl Search<'_> {
    /// First byte of the table, as stated at the start of the points or at the end of the file.
    fn table(&self, point_data: usize) -> Option<usize> {
        let bytes = self.job.bytes;
        let offset_at = |at: usize| Some(i64::from_le_bytes(*bytes.get(at..)?.first_chunk()?));
        let inside = |offset: i64| usize::try_from(offset).ok().filter(|at| (self.start..bytes.len()).contains(at));
        // A writer that cannot seek back leaves -1 and stores the offset at the very end.
        offset_at(point_data).and_then(inside).or_else(|| offset_at(bytes.len().checked_sub(8)?).and_then(inside))
    }

    fn by_table(&self, table: usize) -> Result<Chunks, String> {
        let bytes = self.job.bytes;
        let count = bytes.get(table + 4..).and_then(|rest| rest.first_chunk()).copied().map(u32::from_le_bytes);
        let cut = "the file ends before its chunk table; it is cut off, copy it again";
        let count = count.ok_or(cut)? as usize;
        if count > (bytes.len() - self.start) / self.record_len {
            // Every chunk begins with one uncompressed record.
            return Err(format!("{count} chunks cannot be in a file of this size"));
        }
        let entries = ChunkTable::read(&mut Cursor::new(&bytes[table..]), self.size.is_none())
            .map_err(|error| error.to_string())?;
        let entries = entries.as_ref();

        let mut list: Vec<Chunk> = Vec::new();
        let looks = self.look != Look::Table;
        let mut more = false;
        let (mut at, mut left) = (self.start, self.stated.unwrap_or(usize::MAX));
        for (index, entry) in entries.iter().enumerate() {
            let fail = |what: &str| format!("chunk {} {what}; the file is damaged, copy it again", index + 1);
            let end = usize::try_from(entry.byte_count).ok().and_then(|len| at.checked_add(len));
            let end = end.filter(|&end| end <= table).ok_or_else(|| fail("reaches beyond the points"))?;
            let chunk = &bytes[at..end];
            let own = if looks { self.layers(chunk).map(|(points, _)| points) } else { None };
            let held = match self.size {
                None => usize::try_from(entry.point_count).unwrap_or(usize::MAX),
                Some(size) if self.stated.is_some() => size,
                Some(size) => match own {
                    Some(points) => points.min(size),
                    None if index + 1 == entries.len() => self.points_in(chunk, size),
                    None => size,
                },
            };
            // The last chunk of a fixed size may hold fewer points, unless it states its number.
            let known = own.map(|own| own.min(held)).or(self.size.is_none().then_some(held));
            more |= end > at && known.map_or(left == 0, |known| known > left);
            let points = held.min(left);
            if points > 0 {
                let inconsistent = looks && layered(self.items) && own.is_none();
                list.push(Chunk { bytes: at..end, points, inconsistent });
            }
            at = end;
            left -= points;
        }
        Ok(Chunks { list, more: more && self.stated.is_some(), exact: at == table, note: None })
    }

    /// The whole chunks before the table, or before `end` if there is none.
    fn one_by_one(&self, table: Option<usize>, end: usize) -> Vec<Chunk> {
        let end = table.unwrap_or(end);
        let mut list = Vec::new();
        let (mut at, mut left) = (self.start, self.stated.unwrap_or(usize::MAX));
        while left > 0 && at < end && !self.job.progress.cancelled() {
            let rest = &self.job.bytes[at..end];
            let found = if layered(self.items) {
                self.layers(rest)
            } else {
                // Only what follows shows that the last chunk is whole: the table, or other data.
                let size =
                    self.size.map(|size| size.min(left)).filter(|_| self.look == Look::Points && self.stated.is_some());
                let whole = |len: &usize| table.is_some() || *len < rest.len();
                size.and_then(|size| Some((size, self.len_of(rest, size).filter(whole)?)))
            };
            let fits = |(points, len): &(usize, usize)| {
                *points > 0 && *len > 0 && self.size.is_none_or(|size| *points <= size)
            };
            let Some((points, len)) = found.filter(fits) else { break };
            list.push(Chunk { bytes: at..at + len, points: points.min(left), inconsistent: false });
            at += len;
            left = left.saturating_sub(points);
        }
        list
    }

    /// Number of points and length of the chunk in layers at the start of `bytes`, if the layers fit into `bytes`. They
    /// follow the first record, the number of points and their lengths. The decompressor allocates what these claim.
    fn layers(&self, bytes: &[u8]) -> Option<(usize, usize)> {
        layered(self.items).then(|| layers(bytes, self.items, self.record_len)).flatten()
    }

    /// Length of the chunk at the start of `bytes`, which has this many points.
    fn len_of(&self, bytes: &[u8], points: usize) -> Option<usize> {
        let mut records = decompressor(self.items, bytes).ok()?;
        let mut record = vec![0; self.record_len];
        for index in 0..points {
            records.decompress_next(&mut record).ok()?;
            if index % CHECKED == 0 && self.job.progress.cancelled() {
                return None;
            }
        }
        usize::try_from(records.get().position()).ok()
    }

    /// Number of points in a chunk of at most `size`: those that it takes to decompress all of its bytes.
    fn points_in(&self, chunk: &[u8], size: usize) -> usize {
        let Ok(mut records) = decompressor(self.items, chunk) else { return 0 };
        let mut record = vec![0; self.record_len];
        let most = if self.look == Look::Points { size.min(MAX_RATIO.saturating_mul(chunk.len())) } else { 0 };
        (0..most)
            .take_while(|index| {
                let checked = index % CHECKED == 0 && self.job.progress.cancelled();
                let done = records.get().position() >= chunk.len() as u64;
                !checked && !done && records.decompress_next(&mut record).is_ok()
            })
            .count()
    }
}

/// Number of points and length of the chunk in layers at the start of `bytes`; `None` if its layers do not fit.
pub(super) fn layers(bytes: &[u8], items: &[LazItem], record_len: usize) -> Option<(usize, usize)> {
    let layers: usize = items
        .iter()
        .map(|item| match item.item_type() {
            LazItemType::Point14 => point14::LAYERS,
            LazItemType::RGBNIR14 => 2,
            LazItemType::Byte14(count) => count.into(),
            _ => 1,
        })
        .sum();
    let (points, rest) = bytes.get(record_len..)?.split_first_chunk()?;
    let (sizes, data) = rest.split_at_checked(4 * layers)?;
    let claimed: u64 = sizes.as_chunks::<4>().0.iter().map(|&size| u64::from(u32::from_le_bytes(size))).sum();
    let claimed = usize::try_from(claimed).ok().filter(|&claimed| claimed <= data.len())?;
    Some((u32::from_le_bytes(*points) as usize, bytes.len() - data.len() + claimed))
}
