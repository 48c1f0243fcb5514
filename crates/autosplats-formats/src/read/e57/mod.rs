//! E57: pages with checksums, an XML section, and packets of bit-packed points. See docs/decisions/0019-own-e57.md.
//!
//! # How it works
//!
//! [`pages`] strips the checksums, and [`xml`] reads the descriptions of the scans. [`packets`] joins the bits of each
//! element to one stream, and [`element`] unpacks any value. [`cloud`] joins all points and applies the poses.
//!
//! Damage costs only the scans that it affects; the others are read.

mod cloud;
mod colors;
mod describe;
mod element;
mod packets;
mod pages;
pub(super) mod parts;
mod repair;
mod source;
mod xml;

use autosplats_cloud::{Contents, Error};

use std::ops::Range;

use self::{
    cloud::{Kept, Run, Settled},
    packets::Packets,
    pages::Pages,
    source::{Counts, Dropped, Source},
    xml::{Root, ScanHeader, open},
};
use super::{Format, Job, columns::MAX_COLUMNS};

/// First bytes of a file.
const MAGIC: &[u8] = b"ASTM-E57";

/// Largest number of losses in scans that are noted one by one.
const MAX_NOTED_LOSSES: usize = 10;

/// Fraction of the work that joining the streams takes.
const GATHERING: f32 = 0.4;

pub(super) const FORMAT: Format = Format {
    name: "E57",
    extensions: &["e57"],
    recognised: |bytes| bytes.starts_with(MAGIC),
    sensor_frame: false,
    describe: describe::describe,
    read,
};

fn read(job: &Job<'_>) -> Result<Contents, Error> {
    let (pages, root) = open(job)?;
    let sources = scans(job, &pages, &root, GATHERING, |header, packets, part| {
        let values = packets.values(job, &pages, header, 0..packets.count, part)?;
        let mut source = Source::new(job, header, values)?;
        let counts = source.counts();
        source.keep_measured(&counts);
        if job.progress.wants_chunks() {
            cloud::preview(job, &source)?;
        }
        Ok((source, counts))
    })?;
    let kept: Vec<Kept<'_>> =
        sources.iter().map(|source| Kept { header: source.header, points: source.len() }).collect();
    let runs: Vec<Run<'_>> = sources.iter().enumerate().map(|(scan, source)| Run { scan, source, first: 0 }).collect();
    let settled = Settled::of(job, &kept, root.is_ours(), &mut |see| runs.iter().try_for_each(see), None)?;
    let total = kept.iter().map(|kept| kept.points).sum();
    job.check_memory(total, settled.point_bytes(job.options.exact))?;
    let mut cloud = settled.build(job, &runs, GATHERING)?;
    if let Some(axes) = settled.axes(|| cloud.is_small()) {
        cloud = cloud.with_axes(axes);
    }
    Ok(cloud.with_crs(root.crs).into())
}

/// Finds the points of all scans, and tells what is lost. `get` makes something of each scan, and counts its points;
/// `share` is the share of the work.
fn scans<'a, T>(
    job: &Job<'_>,
    pages: &Pages<'_>,
    root: &'a Root,
    share: f32,
    mut get: impl FnMut(&'a ScanHeader, Packets, Range<f32>) -> Result<(T, Counts), Error>,
) -> Result<Vec<T>, Error> {
    root.notes.iter().for_each(|note| job.note(note));
    if pages.cut_off() {
        let end = format!("byte {}", job.bytes.len());
        job.loss(&end, format!("the file is cut off at {end}"))?;
    }
    let mut left = job.bytes.len();
    let mut done = 0.0;
    let (mut found, mut points, mut dropped) = (Vec::new(), 0, Dropped::default());
    let in_xml = |(scan, what): &(String, String)| (scan.clone(), "XML section".to_owned(), what.clone());
    let mut faults: Vec<_> = root.faults.iter().map(in_xml).collect();
    let mut told = Vec::new();
    for header in &root.scans {
        let part = done..done + share / root.scans.len() as f32;
        done = part.end;
        let mut scan = || {
            if header.elements.len() > MAX_COLUMNS {
                let what = format!("{} values a point; at most {MAX_COLUMNS}", header.elements.len());
                return Err(job.malformed("XML section", what));
            }
            get(header, packets::find(job, pages, header, &mut left)?, part.clone())
        };
        match scan() {
            Ok((scan, counts)) => {
                let about = |(what, is_damage)| (format!("{}: {what}", header.shown()), is_damage);
                told.extend(losses(header, counts.values).map(about));
                points += counts.kept();
                dropped.add(&counts);
                found.push(scan);
            }
            Err(Error::Malformed { place, what, .. }) => faults.push((header.shown(), place, what)),
            Err(other) => return Err(other),
        }
    }
    if let Some((scan, place, what)) = faults.first() {
        if points == 0 {
            return Err(job.malformed(place, format!("{scan}: {what}")));
        }
        told.extend(faults.iter().map(|(scan, place, what)| (format!("{scan} is left out: {place}: {what}"), true)));
    }
    for (loss, is_damage) in told.iter().take(MAX_NOTED_LOSSES) {
        if *is_damage {
            job.loss("scans", loss)?;
        } else {
            job.note(loss);
        }
    }
    if told.len() > MAX_NOTED_LOSSES {
        job.loss("scans", format!("{} more losses in scans", told.len() - MAX_NOTED_LOSSES))?;
    }
    dropped.note(job);
    Ok(found)
}

/// Descriptions of what is missing or not read of a scan, each with whether the file is damaged.
fn losses(header: &ScanHeader, count: usize) -> impl Iterator<Item = (String, bool)> {
    let points = header.points;
    let cut = ((count as u64) < points).then(|| format!("the data end after {count} of {points} points"));
    let text = header.elements.iter().any(|element| element.stored == element::Stored::Text);
    let text = text.then(|| "values that are text are left out".into());
    let note = |what| (what, false);
    header.pose_note.clone().into_iter().map(note).chain(cut.map(|what| (what, true))).chain(text.map(note))
}
