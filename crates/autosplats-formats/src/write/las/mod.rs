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

use std::{
    fs::File,
    io::{BufWriter, Seek as _, SeekFrom, Write as _},
    path::Path,
};

use autosplats_cloud::Error;
use laz::{LazItemRecordBuilder, LazVlr, LazVlrBuilder, ParLasZipCompressor};
use rayon::prelude::*;

pub(super) use self::header::{Head, Record, Totals, compression_record, crs_records, extra_records, today};
use self::shape::choose;
pub(super) use self::{
    plan::{Plan, finite},
    shape::{Shape, Survey},
};
use super::{Format, Job};

pub(super) const LAS: Format = Format { name: "LAS", extensions: &["las"], write: |job, file| write(job, file, false) };
pub(super) const LAZ: Format = Format { name: "LAZ", extensions: &["laz"], write: |job, file| write(job, file, true) };

/// Points of a compressed chunk: the customary number.
const CHUNK: usize = 50_000;

/// Points that one thread encodes at a time.
const PIECE: usize = 1 << 12;

fn write(job: &Job<'_>, file: &mut BufWriter<&mut File>, compressed: bool) -> Result<(), Error> {
    let survey = Survey::of(job.cloud);
    survey.note_losses(job.progress);
    let shape = Shape::of(&survey, choose(&survey), job.path, job.progress)?;
    let plan = Plan::of(job, &survey, &shape)?;
    let vlr = if compressed { Some(compression(job, &plan)?) } else { None };
    let mut totals = Totals::new();
    let io = |source| job.io(source);
    let (head, start) = header::bytes(&plan, &survey, &shape, &totals, vlr.as_ref());
    debug_assert_eq!(head.len(), start, "the points follow the records");
    file.write_all(&head).map_err(io)?;
    match vlr.clone() {
        Some(vlr) => {
            let mut compressor = ParLasZipCompressor::new(&mut *file, vlr).map_err(|error| failed(job, &error))?;
            let batch = CHUNK * rayon::current_num_threads().max(4);
            encode(job, &plan, batch, &mut totals, |records| compressor.compress_many(records).map_err(io))?;
            compressor.done().map_err(|error| failed(job, &error))?;
        }
        None => encode(job, &plan, CHUNK * 4, &mut totals, |records| file.write_all(records).map_err(io))?,
    }
    let (head, _) = header::bytes(&plan, &survey, &shape, &totals, vlr.as_ref());
    file.seek(SeekFrom::Start(0)).map_err(io)?;
    file.write_all(&head).map_err(io)
}

/// The compression record.
fn compression(job: &Job<'_>, plan: &Plan<'_>) -> Result<LazVlr, Error> {
    let items = LazItemRecordBuilder::default_for_point_format_id(plan.format as u8, plan.extra_len() as u16);
    Ok(LazVlrBuilder::new(items.map_err(|error| failed(job, &error))?).with_fixed_chunk_size(CHUNK as u32).build())
}

fn failed(job: &Job<'_>, error: &laz::LasZipError) -> Error {
    failed_packing(job.path, error)
}

/// The error of the compressor, which is one of the operating system.
pub(super) fn failed_packing(path: &Path, error: &laz::LasZipError) -> Error {
    Error::Io { path: path.into(), source: std::io::Error::other(error.to_string()) }
}

/// Passes the records of all points to `hand_on`, batch by batch.
fn encode(
    job: &Job<'_>,
    plan: &Plan<'_>,
    batch: usize,
    totals: &mut Totals,
    mut hand_on: impl FnMut(&[u8]) -> Result<(), Error>,
) -> Result<(), Error> {
    let mut buffer = vec![0; batch.min(plan.points()) * plan.record_len];
    for start in (0..plan.points()).step_by(batch) {
        job.tick(start as f32 / plan.points() as f32)?;
        let records = &mut buffer[..batch.min(plan.points() - start) * plan.record_len];
        let piece = |(index, records): (usize, &mut [u8])| {
            let first = start + index * PIECE;
            plan.encode(records, |i| plan.point(first + i));
            Totals::of(records, plan.record_len, plan.is_wide())
        };
        let parts: Vec<Totals> = records.par_chunks_mut(PIECE * plan.record_len).enumerate().map(piece).collect();
        parts.iter().for_each(|part| totals.add(part));
        hand_on(records)?;
    }
    Ok(())
}
