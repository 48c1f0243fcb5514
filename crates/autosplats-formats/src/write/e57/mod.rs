//! E57: one scan per sensor, with positions in the sensor's frame, in double precision if `f32` would lose digits.
//!
//! Positions are exact to some 1e-15 of the largest coordinate. Colours of 8 and 16 bits, poses, and fields of any type
//! are kept, except unsigned integers beyond 63 bits. Points that no sensor saw come last. E57 requires metres, so
//! coordinates in other units are converted.
//!
//! # How it works
//!
//! What stands before the points of a scan depends on all of them, so the points are read several times. First comes
//! what all hold, then what each scan holds. Then the packets of scans are written, and those of points that no sensor
//! saw. A packet may end in another cloud than it begins in; points wait for the others of their packet.

mod facts;
mod pages;
mod scan;
mod values;
mod xml;

use std::{fs::File, io::BufWriter};

use autosplats_cloud::{Axes, Changed, Error, Held, PointCloud, Unit, check_memory, sample_step};
use glam::DVec3;

use self::{
    facts::{CloudFacts, Runs},
    pages::Pages,
    values::xml_name,
};
use super::{Format, Job, facts::Facts};

pub(super) const FORMAT: Format = Format { name: "E57", extensions: &["e57"], write };

fn write(job: &Job<'_>, file: &mut BufWriter<&mut File>) -> Result<(), Error> {
    match in_metres(job)? {
        None => write_metres(job, file),
        Some(change) => match job.clouds.whole() {
            // Changed once, if memory holds the points anyway.
            Some(cloud) => {
                // Memory: a copy, and the residuals of its positions.
                let bytes = cloud.byte_len() + 12 * cloud.len();
                check_memory(&format!("{} points in metres", cloud.len()), bytes as u64)?;
                let mut cloud = cloud.clone();
                change(&mut cloud);
                write_metres(&Job { clouds: &Held { name: job.clouds.name(), cloud: &cloud }, ..*job }, file)
            }
            None => write_metres(&Job { clouds: &Changed { clouds: job.clouds, change }, ..*job }, file),
        },
    }
}

fn write_metres(job: &Job<'_>, file: &mut BufWriter<&mut File>) -> Result<(), Error> {
    let known = CloudFacts::of(job)?;
    notes(job, &known);
    let runs = Runs::of(job, &known)?;
    let mut pages = Pages::new(file);
    let entries = scan::write(job, &known, &runs, &mut pages)?;
    let xml = xml::xml(&entries, known.like().crs(), pages.hash());
    pages.finish(&xml).map_err(|source| job.io(source))
}

/// Changes points.
type Change = Box<dyn Fn(&mut PointCloud) + Sync + Send>;

/// What brings the points to metres, if they state another unit.
fn in_metres(job: &Job<'_>) -> Result<Option<Change>, Error> {
    let Facts { like, points, .. } = Facts::of(job)?;
    let crs = like.crs();
    let Some(unit) = crs.unit else { return Ok(None) };
    let scale = like.metres_per_unit();
    if scale == Some(DVec3::ONE) || scale.is_none() && unit != Unit::Degree {
        return Ok(None);
    }
    let (what, change): (_, Change) = match scale {
        Some(scale) => {
            let heights = crs.vertical_unit.filter(|other| *other != unit);
            let heights = heights.map_or_else(String::new, |other| format!(", heights in {}", other.name()));
            let what = format!("coordinates in {}{heights} are scaled", unit.name());
            (what, Box::new(move |cloud: &mut PointCloud| cloud.scale_to_metres(scale)))
        }
        None => {
            let map = sample(job, points as usize)?.local_metres(None);
            let what = "degrees become metres about the middle of the points, east, north and up".to_owned();
            let change = move |cloud: &mut PointCloud| {
                if let Some(map) = &map {
                    cloud.to_metres_on(map);
                }
            };
            (what, Box::new(change))
        }
    };
    job.note(format!("E57 requires metres: {what}; the coordinate system is left out"));
    Ok(Some(change))
}

/// The points of the sample that the middle of all points is taken of.
fn sample(job: &Job<'_>, points: usize) -> Result<PointCloud, Error> {
    let step = sample_step(points);
    let (mut sample, mut before) = (PointCloud::default(), 0_usize);
    job.each(&mut |cloud| {
        let first = before.next_multiple_of(step) - before;
        before += cloud.len();
        for index in (first..cloud.len()).step_by(step) {
            let mut point = cloud.slice(index..index + 1);
            point.retain_fields(|_| false);
            sample.append(point);
        }
        Ok(())
    })?;
    Ok(sample)
}

/// Notes what the format cannot hold.
fn notes(job: &Job<'_>, known: &CloudFacts) {
    let is_lost = match known.like().axes() {
        // Readers assume Z up for clouds that are large or were scanned.
        Some(Axes::ZUp) => known.corners.is_small() && known.scans.is_empty(),
        Some(_) => true,
        None => false,
    };
    if is_lost {
        job.note("E57 does not store which axis is up");
    }
    let nowhere = known.nowhere;
    if nowhere > 0 {
        job.note(format!("{nowhere} points without finite coordinates are marked as invalid; readers leave them out"));
    }
    for field in known.like().fields() {
        if known.beyond.contains(&field.name) {
            job.note(format!("{}: integers beyond 63 bits are written as floats", field.name));
        }
        if xml_name(&field.name) != field.name {
            job.note(format!("the field '{}' is called {} in the file", field.name, xml_name(&field.name)));
        }
    }
}
