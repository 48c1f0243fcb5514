//! One unit along all axes, for points of every format.
//!
//! Longitude and latitude stay in degrees; whoever shows or measures them [converts](PointCloud::to_local_metres) them
//! to metres on the ground. Heights in another unit of length than x and y are scaled to that unit.

use std::path::Path;

use autosplats_cloud::{Axes, Crs, Error, PointCloud, Unit, looks_like_degrees, sampled_bounds};
use glam::DVec3;

use super::{Description, Job, ReadOptions};

/// How much higher than wide a box must look to be in degrees, if nothing but its shape tells: a relief of one percent.
const DEGREES_RATIO: f64 = 1000.0;

/// How many times its width such a box must lie from zero, as boxes on the globe do.
const DEGREES_DISTANCE: f64 = 10.0;

/// Note on points whose shape tells that they are in degrees.
pub(super) const LOOKS_LIKE_DEGREES: &str = "no coordinate system; x and y look like degrees of longitude and latitude";

/// Whether points of a file without units look like longitude and latitude. The coordinates must be `f64` or text.
pub(super) fn look_like_degrees(count: usize, world: impl Fn(usize) -> DVec3) -> bool {
    sampled_bounds(count, world).is_some_and(|[low, high]| {
        let [low_xy, high_xy] = [low, high].map(DVec3::truncate);
        let distance = low_xy.midpoint(high_xy).abs().max_element();
        distance > DEGREES_DISTANCE * (high_xy - low_xy).max_element() && looks_like_degrees([low, high], DEGREES_RATIO)
    })
}

/// Settles the units of points that were read: heights get the unit of x and y, and beside degrees they are in metres
/// unless the file states another unit. Above longitude and latitude z is up.
pub(super) fn settle(job: &Job<'_>, cloud: &mut PointCloud) -> Result<(), Error> {
    if let Some(note) = scaled(cloud.crs()) {
        // Memory: the residuals that keep all digits.
        job.check_memory(cloud.len(), size_of::<[f32; 3]>())?;
        cloud.scale_heights();
        job.note(note);
    }
    if cloud.crs().unit == Some(Unit::Degree) {
        let crs = with_heights(cloud.crs().clone());
        let axes = cloud.axes().unwrap_or(Axes::ZUp);
        *cloud = std::mem::take(cloud).with_crs(crs).with_axes(axes);
    }
    Ok(())
}

/// A part of a scan with its units [settled](settle), without a note.
pub(crate) fn settled(name: &Path, mut cloud: PointCloud) -> Result<PointCloud, Error> {
    let options = ReadOptions::default();
    let job = Job { path: name, progress: &(), bytes: &[], options: &options, triangles: false };
    settle(&job, &mut cloud)?;
    Ok(cloud)
}

/// Settles the units of a description like those of the points.
pub(crate) fn settle_description(description: &mut Description) {
    if let (Some(note), Some(scale)) = (scaled(&description.crs), description.crs.height_scale()) {
        let scale = DVec3::new(1.0, 1.0, scale);
        description.bounds = description.bounds.map(|bounds| bounds.map(|corner| corner * scale));
        description.resolution = description.resolution.map(|step| step * scale);
        description.crs = std::mem::take(&mut description.crs).horizontal();
        description.notes.push(note);
    }
    description.crs = with_heights(std::mem::take(&mut description.crs));
}

/// Note on heights that are scaled.
pub(super) fn scaled(crs: &Crs) -> Option<String> {
    crs.height_scale()?;
    let (across, upward) = (crs.unit?.name(), crs.vertical_unit?.name());
    Some(format!("x and y are in {across}, heights in {upward}; heights are scaled to {across}"))
}

/// The system; heights beside degrees are in metres if nothing is stated.
fn with_heights(crs: Crs) -> Crs {
    let unit = (crs.unit == Some(Unit::Degree)).then_some(Unit::Metre);
    Crs { vertical_unit: crs.vertical_unit.or(unit), ..crs }
}
