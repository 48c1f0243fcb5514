//! E57: one scan per sensor, with positions in the sensor's frame, in double precision if `f32` would lose digits.
//!
//! Positions are exact to some 1e-15 of the largest coordinate. Colours of 8 and 16 bits, poses, and fields of any type
//! are kept, except unsigned integers beyond 63 bits. Points that no sensor saw come last. E57 requires metres, so
//! coordinates in other units are converted.

mod pages;
mod values;
mod xml;

use std::{
    fs::File,
    io::BufWriter,
    ops::{Deref, Range},
};

use autosplats_cloud::{Axes, Error, FieldValues, PointCloud, Unit, check_memory};
use glam::{DMat3, DMat4, DVec3};
use rayon::prelude::*;

use self::{
    pages::Pages,
    values::{CloudFacts, Frame, Value, values, xml_name},
    xml::ScanEntry,
};
use super::Format;

pub(super) const FORMAT: Format = Format { name: "E57", extensions: &["e57"], write };

/// Largest size of a packet, in bytes.
const PACKET: usize = 1 << 16;

/// Packets encoded at a time.
const BATCH: usize = 64;

/// A job, and all points of it.
struct Job<'a> {
    job: &'a super::Job<'a>,
    cloud: &'a PointCloud,
}

impl<'a> Deref for Job<'a> {
    type Target = super::Job<'a>;

    fn deref(&self) -> &Self::Target {
        self.job
    }
}

/// Points that make a scan.
struct ScanPoints {
    name: Option<String>,
    pose: Option<DMat4>,
    /// Ranges of points in the cloud.
    ranges: Vec<Range<usize>>,
    len: usize,
}

fn write(job: &super::Job<'_>, file: &mut BufWriter<&mut File>) -> Result<(), Error> {
    let job = &Job { job, cloud: job.whole("E57")? };
    let metric = in_metres(job)?;
    let job = &Job { cloud: metric.as_ref().unwrap_or(job.cloud), ..*job };
    let known = CloudFacts::of(job.cloud);
    notes(job, &known);
    let mut pages = Pages::new(file);
    let mut entries = Vec::new();
    let mut done = 0;
    for run in runs(job) {
        let entry = scan(job, &known, &mut pages, &run, done)?;
        done += run.len;
        entries.push(entry);
    }
    let xml = xml::xml(&entries, job.cloud.crs(), pages.hash());
    pages.finish(&xml).map_err(|source| job.io(source))
}

/// The cloud in metres, if it states another unit.
fn in_metres(job: &Job<'_>) -> Result<Option<PointCloud>, Error> {
    let cloud = job.cloud;
    let Some(unit) = cloud.crs().unit else { return Ok(None) };
    let scale = cloud.metres_per_unit();
    if scale == Some(DVec3::ONE) || scale.is_none() && unit != Unit::Degree {
        return Ok(None);
    }
    // Memory: a copy, and the residuals of its positions.
    let bytes = cloud.byte_len() + 12 * cloud.len();
    check_memory(&format!("{} points in metres", cloud.len()), bytes as u64)?;
    let mut metric = cloud.clone();
    let what = if let Some(scale) = scale {
        metric.scale_to_metres(scale);
        let heights = cloud.crs().vertical_unit.filter(|other| *other != unit);
        let heights = heights.map_or_else(String::new, |other| format!(", heights in {}", other.name()));
        format!("coordinates in {}{heights} are scaled", unit.name())
    } else {
        metric.to_local_metres();
        "degrees become metres about the middle of the points, east, north and up".into()
    };
    job.note(format!("E57 requires metres: {what}; the coordinate system is left out"));
    Ok(Some(metric))
}

/// Notes what the format cannot hold.
fn notes(job: &Job<'_>, known: &CloudFacts<'_>) {
    let cloud = job.cloud;
    let is_lost = match cloud.axes() {
        // Readers assume Z up for clouds that are large or were scanned.
        Some(Axes::ZUp) => cloud.is_small() && cloud.scans().is_empty(),
        Some(_) => true,
        None => false,
    };
    if is_lost {
        job.note("E57 does not store which axis is up");
    }
    let nowhere = cloud.positions().par_iter().filter(|place| !place.iter().all(|along| along.is_finite())).count();
    if nowhere > 0 {
        job.note(format!("{nowhere} points without finite coordinates are marked as invalid; readers leave them out"));
    }
    for field in cloud.fields() {
        if known.beyond.contains(&&*field.name) {
            job.note(format!("{}: integers beyond 63 bits are written as floats", field.name));
        }
        if xml_name(&field.name) != field.name {
            job.note(format!("the field '{}' is called {} in the file", field.name, xml_name(&field.name)));
        }
    }
}

/// The scans of the cloud, then the points outside of all scans.
fn runs(job: &Job<'_>) -> Vec<ScanPoints> {
    let cloud = job.cloud;
    let mut scans: Vec<_> = cloud.scans().iter().collect();
    scans.sort_by_key(|scan| (scan.points.start, scan.points.end));
    let mut runs = Vec::new();
    let mut outside = Vec::new();
    let mut end = 0;
    let (mut shared, mut bent) = (false, false);
    for scan in scans {
        if scan.points.start > end {
            outside.push(end..scan.points.start);
        }
        let range = scan.points.start.max(end)..scan.points.end.max(end);
        shared |= range != scan.points && !scan.points.is_empty();
        end = range.end;
        let pose = rigid(scan.world_from_sensor);
        bent |= pose.is_none();
        let pose = pose.unwrap_or(DMat4::from_translation(scan.position()));
        let pose = if pose.is_finite() { pose } else { DMat4::IDENTITY };
        runs.push(ScanPoints { name: scan.name.clone(), pose: Some(pose), len: range.len(), ranges: vec![range] });
    }
    if end < cloud.len() {
        outside.push(end..cloud.len());
    }
    if shared {
        job.note("points that several scans share are written with the first of them");
    }
    if bent {
        job.note("poses that scale or mirror are written without rotation");
    }
    let len = outside.iter().map(Range::len).sum();
    if len > 0 || runs.is_empty() {
        runs.push(ScanPoints { name: None, pose: None, len, ranges: outside });
    }
    runs
}

/// The map, if it keeps lengths and does not mirror.
fn rigid(map: DMat4) -> Option<DMat4> {
    let turn = DMat3::from_mat4(map);
    let error = turn.transpose() * turn - DMat3::IDENTITY;
    let rotation = error.to_cols_array().iter().all(|value| value.abs() < 1e-6) && turn.determinant() > 0.0;
    (rotation && map.is_finite()).then_some(map)
}

/// Writes the packets of one scan.
fn scan<'a>(
    job: &Job<'a>,
    known: &CloudFacts<'a>,
    pages: &mut Pages<'_, '_>,
    run: &ScanPoints,
    done: usize,
) -> Result<ScanEntry, Error> {
    let cloud = job.cloud;
    let frame = run.pose.map_or(Frame::WORLD, |pose| {
        // The rotation as readers will compute it, from the quaternion.
        let rotation = DMat3::from_quat(glam::DQuat::from_mat4(&pose).normalize());
        Frame { rotation, translation: pose.w_axis.truncate() }
    });
    let single = frame.is_world() && cloud.origin() == DVec3::ZERO && cloud.residuals().is_none();
    let points = || run.ranges.par_iter().flat_map(|range| range.clone().into_par_iter());
    let valid = |i: &usize| cloud.positions()[*i].iter().all(|value| value.is_finite());
    let nothing = || [DVec3::INFINITY, DVec3::NEG_INFINITY];
    let join =
        |[low, high]: [DVec3; 2], [other_low, other_high]: [DVec3; 2]| [low.min(other_low), high.max(other_high)];
    let bounds = points().filter(valid).map(|i| [frame.local(cloud.world_position(i)); 2]).reduce(nothing, join);
    let values = values(job, known, frame, single, !points().all(|i| valid(&i)));

    let fixed = 6 + 2 * values.len() + 4;
    let bits: usize = values.iter().map(|value| value.source.bits()).sum();
    // Every stream gets whole bytes, so that no value lies in two packets.
    let per_packet = PACKET.saturating_sub(fixed) * 8 / bits / 8 * 8;
    if per_packet == 0 {
        return Err(Error::Unsupported {
            path: job.path.into(),
            what: format!("{} fields do not fit into a packet of E57; write PLY", cloud.fields().len()),
        });
    }
    let packet_len = |points: usize| {
        let data: usize = values.iter().map(|value| (value.source.bits() * points).div_ceil(8)).sum();
        (6 + 2 * values.len() + data).next_multiple_of(4)
    };
    let whole = run.len / per_packet * packet_len(per_packet);
    let rest = run.len % per_packet;
    let packets = whole + if rest > 0 { packet_len(rest) } else { 0 };

    pages.align().map_err(|source| job.io(source))?;
    let offset = pages.physical(0);
    let mut header = [0; 32];
    header[0] = 1;
    header[8..16].copy_from_slice(&(packets as u64 + 32).to_le_bytes());
    header[16..24].copy_from_slice(&pages.physical(32).to_le_bytes());
    pages.write(&header).map_err(|source| job.io(source))?;
    for start in (0..run.len).step_by(per_packet * BATCH) {
        job.tick((done + start) as f32 / cloud.len() as f32)?;
        let end = run.len.min(start + per_packet * BATCH);
        let starts: Vec<usize> = (start..end).step_by(per_packet).collect();
        let packets = starts.into_par_iter().map(|start| {
            let points = run.points(start..end.min(start + per_packet));
            packet(job, frame, &values, &points)
        });
        for packet in packets.collect::<Vec<_>>() {
            pages.write(&packet).map_err(|source| job.io(source))?;
        }
    }
    let prototype = values.iter().map(|value| format!("<{} {}/>\n", value.name, value.source.stored())).collect();
    Ok(ScanEntry {
        name: run.name.clone(),
        pose: run.pose,
        bounds: (bounds[0].x <= bounds[1].x).then_some(bounds),
        max_color: match known.wide_colors {
            Some(_) => Some(u16::MAX),
            None => cloud.colors().map(|_| 255),
        },
        intensity: cloud.fields().iter().find(|field| field.name == "Intensity").and_then(|field| {
            let ends = points().map(|i| field.values.get(i)).filter(|value| value.is_finite()).map(|value| [value; 2]);
            let ends = ends.reduce(|| [f64::INFINITY, f64::NEG_INFINITY], |a, b| [a[0].min(b[0]), a[1].max(b[1])]);
            let integers = !matches!(field.values, FieldValues::F32(_) | FieldValues::F64(_));
            (ends[0] <= ends[1]).then_some((ends, integers))
        }),
        offset,
        points: run.len,
        prototype,
    })
}

impl ScanPoints {
    /// Indices in the cloud of some of the run's points.
    fn points(&self, wanted: Range<usize>) -> Vec<usize> {
        let mut points = Vec::with_capacity(wanted.len());
        let mut start = 0;
        for range in &self.ranges {
            let from = wanted.start.clamp(start, start + range.len()) - start;
            let to = wanted.end.clamp(start, start + range.len()) - start;
            points.extend(range.start + from..range.start + to);
            start += range.len();
        }
        points
    }
}

/// One packet: the values of some points, one stream after the other.
fn packet(job: &Job<'_>, frame: Frame, values: &[Value<'_>], points: &[usize]) -> Vec<u8> {
    let start = 6 + 2 * values.len();
    let mut packet = Vec::with_capacity(PACKET);
    packet.resize(start, 0);
    for (index, value) in values.iter().enumerate() {
        let before = packet.len();
        value.source.encode(job.cloud, frame, points, &mut packet);
        let len = (packet.len() - before) as u16;
        packet[6 + 2 * index..8 + 2 * index].copy_from_slice(&len.to_le_bytes());
    }
    packet.resize(packet.len().next_multiple_of(4), 0);
    packet[0] = 1;
    let len = (packet.len() - 1) as u16;
    packet[2..4].copy_from_slice(&len.to_le_bytes());
    packet[4..6].copy_from_slice(&(values.len() as u16).to_le_bytes());
    packet
}
