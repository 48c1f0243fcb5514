//! The records of a file run by run, for whoever passes on more points than memory holds.
//!
//! # How it works
//!
//! Opening finds the runs: chunks of a compressed file, pieces of another. Each run is read by itself, from any thread.
//! Runs are read, not mapped, so that memory limits hold; only a chunk of many megabytes, as old writers make, is
//! mapped.

use std::{
    fs::File,
    io::ErrorKind,
    ops::Range,
    path::{Path, PathBuf},
    time::SystemTime,
};

use autosplats_cloud::{Bytes, Crs, Error, check_memory, free_disk, guard, read_exact_at};
use glam::DVec3;
use laz::DecompressionSelection;

use super::{
    Job,
    chunks::Look,
    complete, coordinates, cut_off,
    decompressor::{layered, selecting},
    header::Header,
    laz::{Compressed, Layout, decompress},
    records::Records,
    unpacked::{Lost, PIECE, Unpacked},
};
use crate::{
    las::{self, EXTRA_DESCRIPTOR},
    read::{ReadOptions, opened::Unpacking},
};

/// Longest chunk of which all records are decompressed before any is passed on, so that a damaged one is left out
/// whole.
const WHOLE: usize = 1 << 18;

/// Largest chunk that is read; a larger one is mapped.
const MAX_READ: u64 = 32 << 20;

/// A file whose records are read run by run.
pub(crate) struct Stream {
    pub(crate) path: PathBuf,
    /// Size and time of the last change, as opened.
    stamp: (u64, Option<SystemTime>),
    pub(crate) facts: Facts,
    layout: Option<Layout>,
    runs: Vec<Run>,
    unpacked: Option<Unpacked>,
}

/// What the header and the records say.
pub(crate) struct Facts {
    pub(crate) format: usize,
    pub(crate) record_len: usize,
    pub(crate) scale: DVec3,
    pub(crate) offset: DVec3,
    /// Lowest and highest coordinates, if they are possible.
    pub(crate) bounds: Option<[DVec3; 2]>,
    /// Number of points that there are, without those known to be lost.
    pub(crate) points: u64,
    /// Whether times count from 1980, and not from the start of a week.
    pub(crate) standard_time: bool,
    /// Day of the year, and year.
    pub(crate) created: (u16, u16),
    pub(crate) crs: Crs,
    /// Descriptions of the extra bytes.
    pub(crate) extras: Vec<[u8; EXTRA_DESCRIPTOR]>,
    pub(crate) notes: Vec<String>,
    /// The loss of points that the file ends before.
    pub(crate) cut: Option<String>,
}

/// Records that are read together.
struct Run {
    bytes: Range<u64>,
    points: usize,
    inconsistent: bool,
}

/// Buffers of a thread.
#[derive(Default)]
pub(crate) struct Space {
    packed: Vec<u8>,
    records: Vec<u8>,
}

impl Stream {
    /// Opens a LAS or LAZ file; `None` if it is another.
    pub(crate) fn open(path: &Path) -> Result<Option<Self>, Error> {
        let io = |source| Error::Io { path: path.into(), source };
        let stamp = stamp(&File::open(path).map_err(io)?).map_err(io)?;
        let bytes = Bytes::open(path)?;
        if !bytes.starts_with(b"LASF") {
            return Ok(None);
        }
        bytes.checked(Self::of(path, stamp, &bytes)).map(Some)
    }

    /// The records in the bytes of a file.
    fn of(path: &Path, stamp: (u64, Option<SystemTime>), bytes: &[u8]) -> Result<Self, Error> {
        let options = ReadOptions::default();
        let job = Job { path, progress: &(), bytes, options: &options, triangles: false };
        let mut header = Header::read(&job)?;
        let records = Records::read(bytes, &header);
        let meaning = coordinates::of(&header, &records);
        let mut notes: Vec<String> = records.notes.iter().cloned().chain(meaning.notes).collect();
        let (layout, runs, lost) = if header.compressed {
            let open = |look| Compressed::open(&job, &header, &records, look);
            let quick = if header.stated == 0 { Look::Points } else { Look::Table };
            let found = match open(quick) {
                Ok(Some(found)) if found.note.is_none() => Ok(Some(found)),
                Ok(None) => Ok(None),
                Ok(Some(_)) | Err(_) => open(Look::Points),
            };
            let (runs, layout, missing) = match found? {
                Some(found) => {
                    notes.extend(header.more_than_stated(found.points));
                    header.points = header.points.max(found.points as u64);
                    notes.extend(found.note.clone());
                    if found.more {
                        notes.push("the compressed data hold more points than stated; they are left out".into());
                    }
                    let run = |chunk: &super::chunks::Chunk| Run {
                        bytes: chunk.bytes.start as u64..chunk.bytes.end as u64,
                        points: chunk.points,
                        inconsistent: chunk.inconsistent,
                    };
                    (found.chunks.iter().map(run).collect(), Some(found.layout), found.missing)
                }
                None => (Vec::new(), None, 0),
            };
            (layout, runs, missing)
        } else {
            notes.extend(header.more_than_stated(header.held));
            let (points, lost) = complete(&job, &header)?;
            let run = |first: usize| {
                let count = PIECE.min(points - first);
                let at = |point: usize| (header.point_data + point * header.record_len) as u64;
                Run { bytes: at(first)..at(first + count), points: count, inconsistent: false }
            };
            (None, (0..points).step_by(PIECE).map(run).collect(), lost)
        };
        if las::has_waveforms(header.format) {
            notes.push("waveforms are not kept".into());
        }
        let points = runs.iter().map(|run: &Run| run.points as u64).sum();
        let described = records.all.iter().filter(|record| record.id == las::EXTRA_BYTES && record.user == las::SPEC);
        let facts = Facts {
            format: header.format,
            record_len: header.record_len,
            scale: header.scale,
            offset: header.offset,
            bounds: header.sane_bounds(),
            points,
            standard_time: header.global_encoding & 1 != 0,
            created: header.created,
            crs: meaning.crs,
            extras: described.flat_map(|record| record.data.as_chunks().0).copied().collect(),
            notes,
            cut: cut_off(lost, header.points),
        };
        Ok(Self { path: path.into(), stamp, facts, layout, runs, unpacked: None })
    }

    /// Keeps what is decompressed, if the disk has room, so that this is done once.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(super) fn unpack_to(&mut self, Unpacking { folder, leave }: Unpacking<'_>) -> Result<(), Error> {
        let len = self.facts.record_len;
        let bytes = self.facts.points.saturating_mul(len as u64).saturating_add(leave);
        if self.layout.is_some() && free_disk(folder).is_none_or(|free| free >= bytes) {
            self.unpacked = Some(Unpacked::new(folder, len, self.runs.iter().map(|run| run.points))?);
        }
        Ok(())
    }

    /// Number of runs.
    pub(crate) fn runs(&self) -> usize {
        self.runs.len()
    }

    /// Number of points that a run states.
    pub(crate) fn points(&self, run: usize) -> usize {
        self.runs[run].points
    }

    /// Reads a run, and passes on its records in pieces. Returns how many cannot be decompressed.
    ///
    /// # Errors
    /// Those of `take` and of reading, and [`Error::Malformed`] if the file has changed since it was opened.
    pub(crate) fn read(
        &self,
        run: usize,
        space: &mut Space,
        take: &mut dyn FnMut(&[u8]) -> Result<(), Error>,
    ) -> Result<Lost, Error> {
        let io = |source| Error::Io { path: self.path.clone(), source };
        let file = File::open(&self.path).map_err(io)?;
        let changed =
            || Error::malformed(&self.path, "size or time", "the file changed while it was read; start again");
        let check = || if stamp(&file).map_err(io)? == self.stamp { Ok(()) } else { Err(changed()) };
        check()?;
        let Space { packed, records } = space;
        if let Some(unpacked) = &self.unpacked
            && let Some(lost) = unpacked.read(run, records, take)?
        {
            return Ok(lost);
        }
        let number = run;
        let run = &self.runs[number];
        let len = run.bytes.end - run.bytes.start;
        let map;
        let bytes = if len > MAX_READ {
            map = Bytes::open(&self.path)?;
            map.get(run.bytes.start as usize..run.bytes.end as usize).ok_or_else(changed)?
        } else {
            packed.resize(len as usize, 0);
            read_exact_at(&file, packed, run.bytes.start)
                .map_err(|source| if source.kind() == ErrorKind::UnexpectedEof { changed() } else { io(source) })?;
            packed
        };
        let lost = match (&self.layout, &self.unpacked) {
            (None, _) => {
                take(bytes)?;
                Lost::default()
            }
            (Some(layout), None) => self.unpack(layout, bytes, run, records, take)?,
            (Some(layout), Some(unpacked)) => {
                let mut at = unpacked.start(number);
                let keep = &mut |records: &[u8]| {
                    unpacked.keep(&mut at, records)?;
                    take(records)
                };
                self.unpack(layout, bytes, run, records, keep)?
            }
        };
        check()?;
        if let Some(unpacked) = &self.unpacked {
            unpacked.finish(number, &lost);
        }
        Ok(lost)
    }

    fn unpack(
        &self,
        layout: &Layout,
        bytes: &[u8],
        run: &Run,
        records: &mut Vec<u8>,
        take: &mut dyn FnMut(&[u8]) -> Result<(), Error>,
    ) -> Result<Lost, Error> {
        let (len, mut left) = (self.facts.record_len, run.points);
        let lost = |left: usize, why| Ok(Lost { points: left as u64, why });
        if run.inconsistent || layered(&layout.items) && layout.stated_points(bytes).is_none() {
            return lost(left, "the lengths in a chunk are inconsistent; copy the file again".into());
        }
        let mut decompressor = match guard(|| selecting(&layout.items, bytes, DecompressionSelection::all())) {
            Ok(decompressor) => decompressor,
            Err(why) => return lost(left, why),
        };
        let most = if left > WHOLE { PIECE } else { left };
        check_memory("the records of a chunk", (most * len) as u64)?;
        records.resize(most * len, 0);
        while left > 0 {
            let piece = &mut records[..most.min(left) * len];
            let (whole, why) = match guard(|| Ok(decompress(&mut *decompressor, piece, len))) {
                Ok(Ok(())) => (piece.len() / len, None),
                Ok(Err((whole, why))) => (whole, Some(why)),
                Err(why) => (0, Some(why)),
            };
            match why {
                None => take(piece)?,
                Some(why) => {
                    // Of a long chunk the points before the fault are kept.
                    let kept = if run.points > WHOLE { whole } else { 0 };
                    if kept > 0 {
                        take(&piece[..kept * len])?;
                    }
                    return lost(left - kept, why);
                }
            }
            left -= piece.len() / len;
        }
        Ok(Lost::default())
    }
}

/// Size and time of the last change of a file.
fn stamp(file: &File) -> std::io::Result<(u64, Option<SystemTime>)> {
    let metadata = file.metadata()?;
    Ok((metadata.len(), metadata.modified().ok()))
}
