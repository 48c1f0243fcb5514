//! Writing the packets of the scans.

use std::ops::Range;

use autosplats_cloud::{Error, FieldValues, PointCloud};
use rayon::prelude::*;

use super::{
    super::Job,
    facts::{CloudFacts, Frame, Run, Runs},
    pages::Pages,
    values::{Value, values},
    xml::ScanEntry,
};

/// Largest size of a packet, in bytes.
const PACKET: usize = 1 << 16;

/// Packets encoded at a time.
const BATCH: usize = 64;

/// The scans, as they are written one after another.
pub(super) struct Scans<'a, 'p, 'f> {
    job: &'a Job<'a>,
    known: &'a CloudFacts,
    runs: &'a [Run],
    pages: &'a mut Pages<'p, 'f>,
    /// Scans that are written, and the one that is being written.
    entries: Vec<ScanEntry>,
    /// Points of each packet of the scan that is being written, but for its last.
    per_packet: usize,
    /// Points of that scan which do not fill a packet yet.
    rest: PointCloud,
    done: usize,
}

/// Writes all scans. Those points that no sensor saw are read once more, for they come last.
pub(super) fn write<'a>(
    job: &'a Job<'a>,
    known: &'a CloudFacts,
    all: &'a Runs,
    pages: &'a mut Pages<'_, '_>,
) -> Result<Vec<ScanEntry>, Error> {
    let runs = &all.runs;
    let mut scans = Scans {
        job,
        known,
        runs,
        pages,
        entries: Vec::with_capacity(runs.len()),
        per_packet: 1,
        rest: PointCloud::default(),
        done: 0,
    };
    if all.outside != Some(0) {
        all.each(job, &mut |cloud, points, run| {
            if all.outside == Some(run) { Ok(()) } else { scans.take(cloud, points, run) }
        })?;
    }
    if all.outside.is_some() {
        all.each(job, &mut |cloud, points, run| {
            if all.outside == Some(run) { scans.take(cloud, points, run) } else { Ok(()) }
        })?;
    }
    // Scans without points.
    scans.begin_up_to(runs.len() - 1)?;
    scans.end()?;
    Ok(scans.entries)
}

impl Scans<'_, '_, '_> {
    /// Writes points of a scan, behind those that came before.
    fn take(&mut self, cloud: &PointCloud, points: Range<usize>, run: usize) -> Result<(), Error> {
        self.begin_up_to(run)?;
        let Range { mut start, end } = points;
        if !self.rest.is_empty() {
            let filled = end.min(start + self.per_packet - self.rest.len());
            self.rest.append(cloud.slice(start..filled));
            start = filled;
            if self.rest.len() == self.per_packet {
                self.end()?;
            }
        }
        let whole = (end - start) / self.per_packet * self.per_packet;
        self.packets(cloud, start..start + whole)?;
        if start + whole < end {
            self.rest.append(cloud.slice(start + whole..end));
        }
        Ok(())
    }

    /// Begins all scans up to this one that are not begun yet.
    fn begin_up_to(&mut self, run: usize) -> Result<(), Error> {
        while self.entries.len() <= run {
            self.end()?;
            let runs = self.runs;
            self.begin(&runs[self.entries.len()])?;
        }
        Ok(())
    }

    /// Writes what stands before the packets of a scan.
    fn begin(&mut self, run: &Run) -> Result<(), Error> {
        let (job, known) = (self.job, self.known);
        let values = self.values(known.like(), run);
        let fixed = 6 + 2 * values.len() + 4;
        let bits: usize = values.iter().map(|value| value.source.bits()).sum();
        // Every stream gets whole bytes, so that no value lies in two packets.
        let per_packet = PACKET.saturating_sub(fixed) * 8 / bits / 8 * 8;
        if per_packet == 0 {
            let what = format!("{} fields do not fit into a packet of E57; write PLY", known.like().fields().len());
            return Err(Error::unsupported(job.path, what));
        }
        let packet_len = |points: usize| {
            let data: usize = values.iter().map(|value| (value.source.bits() * points).div_ceil(8)).sum();
            (6 + 2 * values.len() + data).next_multiple_of(4)
        };
        let whole = run.len / per_packet * packet_len(per_packet);
        let rest = run.len % per_packet;
        let packets = whole + if rest > 0 { packet_len(rest) } else { 0 };
        let prototype = values.iter().map(|value| format!("<{} {}/>\n", value.name, value.source.stored())).collect();

        self.pages.align().map_err(|source| job.io(source))?;
        let offset = self.pages.physical(0);
        let mut header = [0; 32];
        header[0] = 1;
        header[8..16].copy_from_slice(&(packets as u64 + 32).to_le_bytes());
        header[16..24].copy_from_slice(&self.pages.physical(32).to_le_bytes());
        self.pages.write(&header).map_err(|source| job.io(source))?;
        let [low, high] = run.facts.bounds;
        let intensity = known.like().fields().iter().find(|field| field.name == "Intensity");
        self.entries.push(ScanEntry {
            name: run.name.clone(),
            pose: run.pose,
            bounds: (low.x <= high.x).then_some([low, high]),
            max_color: if known.wide { Some(u16::MAX) } else { known.like().colors().map(|_| 255) },
            intensity: intensity.and_then(|field| {
                let ends = run.facts.intensity;
                let integers = !matches!(field.values, FieldValues::F32(_) | FieldValues::F64(_));
                (ends[0] <= ends[1]).then_some((ends, integers))
            }),
            offset,
            points: run.len,
            prototype,
        });
        self.per_packet = per_packet;
        Ok(())
    }

    fn values<'c>(&self, cloud: &'c PointCloud, run: &Run) -> Vec<Value<'c>> {
        let frame = run.frame();
        values(cloud, self.known, frame, self.known.single(frame), !run.facts.valid)
    }

    /// Writes points as packets, all full but for the last.
    fn packets(&mut self, cloud: &PointCloud, points: Range<usize>) -> Result<(), Error> {
        if points.is_empty() {
            return Ok(());
        }
        let runs = self.runs;
        let run = &runs[self.entries.len() - 1];
        let (frame, values, per_packet) = (run.frame(), self.values(cloud, run), self.per_packet);
        let starts: Vec<usize> = points.clone().step_by(per_packet).collect();
        for starts in starts.chunks(BATCH) {
            self.job.tick(self.done as f32 / self.known.len() as f32)?;
            let packet = |start: &usize| packet(cloud, frame, &values, *start..points.end.min(start + per_packet));
            for packet in starts.par_iter().map(packet).collect::<Vec<_>>() {
                self.pages.write(&packet).map_err(|source| self.job.io(source))?;
            }
            self.done += (starts.len() * per_packet).min(points.end - starts[0]);
        }
        Ok(())
    }

    /// Writes the points that are left.
    fn end(&mut self) -> Result<(), Error> {
        let rest = std::mem::take(&mut self.rest);
        self.packets(&rest, 0..rest.len())
    }
}

/// One packet: the values of some points, one stream after the other.
fn packet(cloud: &PointCloud, frame: Frame, values: &[Value<'_>], points: Range<usize>) -> Vec<u8> {
    let start = 6 + 2 * values.len();
    let mut packet = Vec::with_capacity(PACKET);
    packet.resize(start, 0);
    for (index, value) in values.iter().enumerate() {
        let before = packet.len();
        value.source.encode(cloud, frame, points.clone(), &mut packet);
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
