//! LAS 1.0 to 1.4, all point formats, also compressed as LAZ or COPC.
//!
//! # How it works
//!
//! The [`header`] states where the points are and how long their records. The variable length [`records`] describe the
//! [extra bytes](extra) and the coordinate system. Points are decoded in parallel runs straight into their [`columns`].
//! Runs of [`laz`] are chunks, decompressed piece by piece; values are taken while a piece is in the cache.
//!
//! The origin of the positions is chosen in advance. It is the middle of the claimed bounds if a sample of the points
//! agrees, otherwise the middle of the sample.

mod chunks;
mod columns;
mod coordinates;
mod decompressor;
mod describe;
mod dimension;
mod extra;
mod gps_time;
mod head;
mod header;
mod laz;
pub(super) mod parts;
mod point14;
mod records;
mod shape;
mod slices;
mod stream;
mod unpacked;

pub(crate) use self::{
    chunks::MAX_RATIO,
    columns::{Colors, narrow_note},
    head::Head,
    shape::{Decoded, Shape, read_shaped},
    stream::{Facts, Space, Stream},
};

use autosplats_cloud::{Contents, Crs, Error, Unit, degree_origin, sampled_middle};
use glam::DVec3;

use self::{
    chunks::Look,
    columns::{BATCH, Columns, preview},
    dimension::{Dimension, dimensions},
    header::Header,
    laz::Compressed,
    records::Records,
};
use super::{Format, Job};

/// Uncompressed points that one thread decodes at a time.
const RUN: usize = 1 << 13;

/// Largest edge of a box of points for which one origin suits `f32`.
const MAX_ORIGIN_BOX: f64 = 1e6;

pub(super) const FORMAT: Format = Format {
    name: "LAS",
    extensions: &["las", "laz", "copc"],
    recognised: |bytes| bytes.starts_with(b"LASF"),
    sensor_frame: false,
    describe: describe::describe,
    read,
};

fn read(job: &Job<'_>) -> Result<Contents, Error> {
    Ok(points(job, &Shape::default())?.cloud.into())
}

/// A file whose header and records are read, and how its points will be.
struct Opened<'a> {
    header: Header,
    dimensions: Vec<Dimension>,
    compressed: Option<Compressed<'a>>,
    points: usize,
    lost: u64,
    crs: Crs,
    origin: DVec3,
    /// Notes before those about the points, and after them.
    notes: [Vec<String>; 2],
}

fn open<'a>(job: &Job<'a>, shape: &Shape<'_>) -> Result<Opened<'a>, Error> {
    let mut header = Header::read(job)?;
    let records = Records::read(job.bytes, &header);
    let (mut dimensions, mut notes) = dimensions(&header, &records);
    shape.choose(&mut dimensions);
    notes.extend(records.notes.iter().cloned());
    let mut compressed = if header.compressed { Compressed::open(job, &header, &records, Look::Points)? } else { None };
    if let Some(compressed) = &mut compressed {
        compressed.layout.selection = shape.selection(&dimensions);
    }
    let (points, lost) = match &compressed {
        Some(compressed) => (compressed.points, compressed.missing),
        None => complete(job, &header)?,
    };
    if let Some(compressed) = &compressed {
        notes.extend(compressed.note.clone());
        header.points = header.points.max(points as u64);
    }
    notes.extend(header.more_than_stated(compressed.as_ref().map_or(header.held, |compressed| compressed.points)));
    let meaning = coordinates::of(&header, &records);
    let degrees = meaning.crs.unit == Some(Unit::Degree);
    let records_at = |i: usize| &job.bytes[header.point_data + i * header.record_len..];
    let origin = match (shape.origin, &compressed) {
        (Some(origin), _) => origin,
        (None, Some(compressed)) => {
            let first = compressed.first_records();
            origin(&header, degrees, first.len(), |i| header.world(first[i]))
        }
        (None, None) => origin(&header, degrees, points, |i| header.world(records_at(i))),
    };
    let notes = [notes, meaning.notes];
    Ok(Opened { header, dimensions, compressed, points, lost, crs: meaning.crs, origin, notes })
}

/// Reads the points, as far as `shape` wants them.
fn points(job: &Job<'_>, shape: &Shape<'_>) -> Result<Decoded, Error> {
    let Opened { header, dimensions, compressed, points, lost, crs, origin, notes } = open(job, shape)?;
    let exact = job.options.exact;
    let colors = shape.color_bytes(&header, exact);
    let fields: usize = dimensions.iter().map(Dimension::size).sum();
    job.check_memory(points, if exact { 24 } else { 12 } + colors + fields)?;
    if let Some(loss) = cut_off(lost, header.points).filter(|_| job.options.whole) {
        job.loss(CUT, loss)?;
    }
    let mut columns = Columns::new(&header, origin, exact, dimensions, points, shape.colors)?;
    let (damaged, more) = match &compressed {
        Some(compressed) => compressed.fill(job, &mut columns)?,
        None => {
            uncompressed(job, &header, &mut columns, points)?;
            (Vec::new(), false)
        }
    };

    columns.remove(&damaged);
    let levels = columns.levels();
    let (cloud, narrow) = columns.into_cloud()?;
    let [mut notes, after] = notes;
    notes.extend(narrow);
    let claimed = header.points;
    if more {
        notes.push(format!("the header states {claimed} points, but the compressed data hold more; they are left out"));
    }
    notes.iter().for_each(|note| job.note(note));
    let damaged = damaged.iter().map(|range| range.len() as u64).sum::<u64>();
    tell_lost(job, lost, damaged, claimed)?;
    after.iter().for_each(|note| job.note(note));
    let cloud = cloud.with_crs(crs).with_resolution(header.scale.abs());
    Ok(Decoded { cloud, levels, lost: lost + damaged })
}

/// Place of points that the file ends before.
const CUT: &str = "end of the file";

/// The loss of points that the file ends before.
fn cut_off(lost: u64, claimed: u64) -> Option<String> {
    (lost > 0).then(|| format!("the file is cut off: {lost} of {claimed} points are lost; copy it again"))
}

/// The loss of points that cannot be decompressed.
pub(crate) fn damage(lost: u64, claimed: u64) -> Option<String> {
    (lost > 0).then(|| format!("compressed data are damaged: {lost} of {claimed} points are lost; copy it again"))
}

/// Tells how many of the points the file ends before, and how many cannot be decompressed.
fn tell_lost(job: &Job<'_>, cut: u64, damaged: u64, claimed: u64) -> Result<(), Error> {
    cut_off(cut, claimed).map_or(Ok(()), |loss| job.loss(CUT, loss))?;
    damage(damaged, claimed).map_or(Ok(()), |loss| job.loss(DAMAGED, loss))
}

/// Place of points that cannot be decompressed.
pub(crate) const DAMAGED: &str = "compressed data";

/// The number of complete records, and the number of missing ones.
fn complete(job: &Job<'_>, header: &Header) -> Result<(usize, u64), Error> {
    let held = (job.bytes.len() - header.point_data) / header.record_len;
    let points = usize::try_from(header.points).map_or(held, |points| points.min(held));
    if points == 0 && header.points > 0 {
        let what = format!("the file ends before the first of {} points; it is cut off, copy it again", header.points);
        return Err(job.malformed(format!("byte {}", job.bytes.len()), what));
    }
    Ok((points, header.points - points as u64))
}

/// The origin of the positions; `sample` gives the coordinates of some points.
fn origin(header: &Header, degrees: bool, count: usize, sample: impl Fn(usize) -> DVec3) -> DVec3 {
    if degrees {
        return degree_origin(count, sample);
    }
    let middle = sampled_middle(count, sample);
    match header.sane_bounds() {
        Some([low, high])
            if (high - low).max_element() < MAX_ORIGIN_BOX
                // The middle of the sample is rounded.
                && middle.cmpge(low - 1.0).all()
                && middle.cmple(high + 1.0).all() =>
        {
            ((low + high) / 2.0).round()
        }
        _ => middle,
    }
}

fn uncompressed(job: &Job<'_>, header: &Header, columns: &mut Columns<'_>, points: usize) -> Result<(), Error> {
    let len = header.record_len;
    let records = &job.bytes[header.point_data..header.point_data + points * len];
    for start in (0..points).step_by(BATCH) {
        job.tick(start as f32 / points as f32)?;
        let batch = &records[start * len..(start + BATCH).min(points) * len];
        let runs: Vec<&[u8]> = batch.chunks(RUN * len).collect();
        let counts: Vec<usize> = runs.iter().map(|run| run.len() / len).collect();
        columns.fill(start, &counts, |index, piece| {
            piece.take(runs[index]);
            Ok(())
        });
        preview(job, columns, start, batch.len() / len)?;
    }
    Ok(())
}
