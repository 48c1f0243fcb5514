//! LAS and LAZ, versions 1.2 and 1.4, with extra bytes for values that the point format cannot hold.
//!
//! # How it works
//!
//! A [`plan`] chooses the point format by the cloud's fields, and a [`grid`] for the coordinates, which are integers in
//! the file. Records are encoded in parallel, batch by batch, and written directly or through the `laz` crate's
//! parallel compressor. Bounds and counts are gathered on the way, so the [`header`] is written twice.

mod grid;
mod header;
mod plan;
mod shape;
mod wkt;

use std::{
    fs::File,
    io::{BufWriter, Seek as _, SeekFrom, Write as _},
    path::Path,
};

use autosplats_cloud::{Error, PointCloud};
use laz::{LazItemRecordBuilder, LazVlr, LazVlrBuilder, ParLasZipCompressor};
use rayon::prelude::*;

pub(super) use self::header::{Head, Record, Totals, compression_record, crs_records, extra_records, today};
use self::{grid::Grid, shape::choose};
pub(super) use self::{
    plan::{Plan, finite},
    shape::{Shape, Survey},
    wkt::well_known_text,
};
use super::{Format, Job};
use crate::las;

pub(super) const LAS: Format = Format { name: "LAS", extensions: &["las"], write: |job, file| write(job, file, false) };
pub(super) const LAZ: Format = Format { name: "LAZ", extensions: &["laz"], write: |job, file| write(job, file, true) };

/// Points of a compressed chunk: the customary number.
const CHUNK: usize = 50_000;

/// Points that one thread encodes at a time.
const PIECE: usize = 1 << 12;

fn write(job: &Job<'_>, file: &mut BufWriter<&mut File>, compressed: bool) -> Result<(), Error> {
    let survey = survey(job)?;
    survey.note_losses(job.progress);
    let shape = Shape::of(&survey, choose(&survey), job.path, job.progress)?;
    let grid = Grid::of(job, &survey)?;
    let vlr = if compressed { Some(compression(job, &shape)?) } else { None };
    let mut totals = Totals::new();
    let io = |source| job.io(source);
    let (head, start) = header::bytes(&survey, &shape, &grid, &totals, vlr.as_ref());
    debug_assert_eq!(head.len(), start, "the points follow the records");
    file.write_all(&head).map_err(io)?;
    let mut encoder = Encoder { job, shape: &shape, grid: &grid, points: survey.points, done: 0, totals: &mut totals };
    match vlr.clone() {
        Some(vlr) => {
            let mut compressor = ParLasZipCompressor::new(&mut *file, vlr).map_err(|error| failed(job, &error))?;
            let batch = CHUNK * rayon::current_num_threads().max(4);
            // The compressor wraps errors of the operating system twice.
            let unwrapped = |error: std::io::Error| match error.downcast::<laz::LasZipError>() {
                Ok(error) => failed(job, &error),
                Err(source) => job.io(source),
            };
            encoder.encode(batch, |records| compressor.compress_many(records).map_err(unwrapped))?;
            compressor.done().map_err(|error| failed(job, &error))?;
        }
        None => encoder.encode(CHUNK * 4, |records| file.write_all(records).map_err(io))?,
    }
    let (head, _) = header::bytes(&survey, &shape, &grid, &totals, vlr.as_ref());
    file.seek(SeekFrom::Start(0)).map_err(io)?;
    file.write_all(&head).map_err(io)
}

/// Reads all points for what they hold.
fn survey(job: &Job<'_>) -> Result<Survey, Error> {
    let mut all: Option<Survey> = None;
    job.each(&mut |cloud| {
        let own = Survey::of(cloud);
        match &mut all {
            Some(all) => all.add(own).map_err(|what| Error::unsupported(job.clouds.name(), what))?,
            None => all = Some(own),
        }
        Ok(())
    })?;
    Ok(all.unwrap_or_else(|| Survey::of(&PointCloud::default())))
}

/// The compression record.
fn compression(job: &Job<'_>, shape: &Shape) -> Result<LazVlr, Error> {
    let extra = shape.record_len - las::RECORD_LEN[shape.format];
    let items = LazItemRecordBuilder::default_for_point_format_id(shape.format as u8, extra as u16);
    Ok(LazVlrBuilder::new(items.map_err(|error| failed(job, &error))?).with_fixed_chunk_size(CHUNK as u32).build())
}

fn failed(job: &Job<'_>, error: &laz::LasZipError) -> Error {
    failed_packing(job.path, error)
}

/// The error of the compressor, which is one of the operating system.
pub(super) fn failed_packing(path: &Path, error: &laz::LasZipError) -> Error {
    let source = match error {
        laz::LasZipError::IoError(source) => std::io::Error::new(source.kind(), source.to_string()),
        error => std::io::Error::other(error.to_string()),
    };
    Error::Io { path: path.into(), source }
}

/// Makes records of points.
struct Encoder<'a> {
    job: &'a Job<'a>,
    shape: &'a Shape,
    grid: &'a Grid,
    /// Number of points that are written, and that are done.
    points: usize,
    done: usize,
    totals: &'a mut Totals,
}

impl Encoder<'_> {
    /// Passes the records of all points to `hand_on`, `batch` at a time.
    fn encode(&mut self, batch: usize, mut hand_on: impl FnMut(&[u8]) -> Result<(), Error>) -> Result<(), Error> {
        let Self { job, shape, grid, .. } = *self;
        let len = shape.record_len;
        let mut buffer = vec![0; batch.min(self.points) * len];
        let mut filled = 0;
        job.each(&mut |cloud| {
            let plan = Plan::bind(cloud, shape, grid.scale, grid.offset, finite(cloud));
            let mut at = 0;
            while at < plan.points() {
                let count = (plan.points() - at).min(batch - filled);
                job.tick(self.done as f32 / self.points as f32)?;
                let records = &mut buffer[filled * len..(filled + count) * len];
                let piece = |(index, records): (usize, &mut [u8])| {
                    let first = at + index * PIECE;
                    plan.encode(records, |i| plan.point(first + i));
                    Totals::of(records, len, las::is_wide(shape.format))
                };
                let parts: Vec<Totals> = records.par_chunks_mut(PIECE * len).enumerate().map(piece).collect();
                parts.iter().for_each(|part| self.totals.add(part));
                (at, filled, self.done) = (at + count, filled + count, self.done + count);
                if filled == batch {
                    hand_on(&buffer)?;
                    filled = 0;
                }
            }
            Ok(())
        })?;
        hand_on(&buffer[..filled * len])
    }
}
