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
mod repair;
mod source;
mod xml;

use autosplats_cloud::{Contents, Error};

use self::{
    pages::Pages,
    source::{Dropped, Source},
    xml::{ScanHeader, open},
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
    root.notes.iter().for_each(|note| job.note(note));
    if pages.cut_off() {
        job.note(format!("the file is cut off at byte {}; what is left is read", job.bytes.len()));
    }
    let mut left = job.bytes.len();
    let mut done = 0.0;
    let mut sources: Vec<Source<'_>> = Vec::new();
    let mut dropped = Dropped::default();
    let in_xml = |(scan, what): &(String, String)| (scan.clone(), "XML section".to_owned(), what.clone());
    let mut faults: Vec<_> = root.faults.iter().map(in_xml).collect();
    let mut told = Vec::new();
    for header in &root.scans {
        let share = GATHERING / root.scans.len() as f32;
        let source = source(job, &pages, header, (&mut left, &mut dropped), done..done + share);
        done += share;
        match source {
            Ok(source) => {
                told.extend(losses(header, &source).map(|what| format!("{}: {what}", header.shown())));
                if job.progress.wants_chunks() {
                    cloud::preview(job, &source)?;
                }
                sources.push(source);
            }
            Err(Error::Malformed { place, what, .. }) => faults.push((header.shown(), place, what)),
            Err(other) => return Err(other),
        }
    }
    if let Some((scan, place, what)) = faults.first() {
        if sources.iter().all(|source| source.len() == 0) {
            return Err(job.malformed(place, format!("{scan}: {what}")));
        }
        told.extend(faults.iter().map(|(scan, place, what)| format!("{scan} is left out: {place}: {what}")));
    }
    told.iter().take(MAX_NOTED_LOSSES).for_each(|note| job.note(note));
    if told.len() > MAX_NOTED_LOSSES {
        job.note(format!("{} more losses in scans", told.len() - MAX_NOTED_LOSSES));
    }
    dropped.note(job);
    Ok(cloud::cloud(job, &sources, root.is_ours(), GATHERING)?.with_crs(root.crs).into())
}

/// Reads the values of one scan.
fn source<'a>(
    job: &Job<'_>,
    pages: &Pages<'_>,
    header: &'a ScanHeader,
    (left, dropped): (&mut usize, &mut Dropped),
    part: std::ops::Range<f32>,
) -> Result<Source<'a>, Error> {
    if header.elements.len() > MAX_COLUMNS {
        let what = format!("{} values a point; at most {MAX_COLUMNS}", header.elements.len());
        return Err(job.malformed("XML section", what));
    }
    let values = packets::gather(job, pages, header, left, part)?;
    Source::new(job, header, values, dropped)
}

/// Descriptions of what is missing or not read of a scan.
fn losses(header: &ScanHeader, source: &Source<'_>) -> impl Iterator<Item = String> {
    let (count, points) = (source.values.count, header.points);
    let cut = ((count as u64) < points).then(|| format!("the data end after {count} of {points} points"));
    let text = header.elements.iter().any(|element| element.stored == element::Stored::Text);
    header.pose_note.clone().into_iter().chain(cut).chain(text.then(|| "values that are text are left out".into()))
}
