//! E57: pages with checksums, an XML section that says what is where, and packets of points, each bit packed.
//!
//! # How it works
//!
//! [`pages`] takes the checksums out, [`xml`] reads the descriptions of all scans, [`packets`] puts the bits of each
//! value of the points together, which [`element`] unpacks at any place, and [`cloud`] makes the points of all scans one
//! cloud, poses applied.
//!
//! Damage costs the scans that it is in; what is left is read.

mod cloud;
mod colors;
mod describe;
mod element;
mod packets;
mod pages;
mod xml;

use self::{cloud::Dropped, cloud::Source, pages::Pages, xml::Root, xml::ScanHeader};
use super::{Contents, Format, Job, table::MAX_COLUMNS};
use crate::Error;

/// The first bytes of a file.
const MAGIC: &[u8] = b"ASTM-E57";

/// Part of the work that putting the values together is.
const GATHERING: f32 = 0.4;

pub(super) const FORMAT: Format = Format {
    name: "E57",
    extensions: &["e57"],
    recognised: |bytes| bytes.starts_with(MAGIC),
    sensor_frame: false,
    describe: describe::describe,
    read,
};

/// The header and the XML section.
fn open<'a>(job: &Job<'a>) -> Result<(Pages<'a>, Root), Error> {
    let pages = Pages::new(job)?;
    let xml = pages.xml(job)?;
    let root = Root::parse(job, &xml)?;
    Ok((pages, root))
}

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
    let mut faults = Vec::new();
    for (index, header) in root.scans.iter().enumerate() {
        let share = GATHERING / root.scans.len() as f32;
        let source = source(job, &pages, header, index, (&mut left, &mut dropped), done..done + share);
        done += share;
        match source {
            Ok(source) => {
                if job.progress.wants_chunks() {
                    cloud::preview(job, &source)?;
                }
                sources.push(source);
            }
            Err(Error::Malformed { place, what, .. }) => faults.push((header.shown(index), place, what)),
            Err(other) => return Err(other),
        }
    }
    if let Some((scan, place, what)) = faults.first() {
        if sources.iter().all(|source| source.len() == 0) {
            return Err(job.malformed(place, format!("{scan}: {what}")));
        }
        for (scan, place, what) in faults.iter().take(10) {
            job.note(format!("{scan} is left out: {place}: {what}"));
        }
        if faults.len() > 10 {
            job.note(format!("{} more scans are left out", faults.len() - 10));
        }
    }
    dropped.note(job);
    Ok(cloud::cloud(job, &sources, GATHERING)?.with_crs(root.crs).into())
}

/// The values of one scan.
fn source<'a>(
    job: &Job<'_>,
    pages: &Pages<'_>,
    header: &'a ScanHeader,
    index: usize,
    (left, dropped): (&mut usize, &mut Dropped),
    part: std::ops::Range<f32>,
) -> Result<Source<'a>, Error> {
    if header.elements.len() > MAX_COLUMNS {
        let what = format!("{} values a point; at most {MAX_COLUMNS}", header.elements.len());
        return Err(job.malformed("XML section", what));
    }
    let values = packets::gather(job, pages, header, left, part)?;
    if (values.count as u64) < header.points {
        let (count, points) = (values.count, header.points);
        job.note(format!("{}: the data end after {count} of {points} points", header.shown(index)));
    }
    if header.elements.iter().any(|element| element.stored == element::Stored::Text) {
        job.note(format!("{}: values that are text are left out", header.shown(index)));
    }
    Source::new(job, header, values, dropped)
}
