//! Checks that sensors can have stood where a file states.

use std::ops::Range;

use autosplats_cloud::{PointCloud, Scan};
use glam::DVec3;

use super::Job;

/// Largest distance of a sensor from the middle of its points, as a multiple of the diagonal of their bounding box.
const MAX_DISTANCE_DIAGONALS: f64 = 20.0;

/// Largest distance of a sensor from the cloud's origin along an axis. Computations with larger values would overflow.
const MAX_ORIGIN_DISTANCE: f64 = 1e18;

/// Points sampled per scan to estimate its bounding box.
const MAX_SAMPLED_POINTS: usize = 1000;

/// Drops scans whose sensor is too far away. Programs that move points into survey coordinates often leave out the
/// pose, and the origin is then no sensor position.
pub(super) fn drop_far(job: &Job<'_>, cloud: &mut PointCloud) {
    let is_far = |scan: &&Scan| {
        let mut sample = Sample::of(scan.points.len());
        sample.add(cloud, scan.points.clone());
        sample.is_far(scan.position(), cloud.origin())
    };
    let kept: Vec<Scan> = cloud.scans().iter().filter(|scan| !is_far(scan)).cloned().collect();
    let count = cloud.scans().len() - kept.len();
    if count > 0 {
        tell_far(job, count);
        *cloud = std::mem::take(cloud).with_scans(kept);
    }
}

/// Tells that this many scans have a sensor that is too far away.
pub(super) fn tell_far(job: &Job<'_>, count: usize) {
    let what = if count == 1 { "sensor position is" } else { "sensor positions are" };
    job.note(format!("{count} {what} far from all that was seen; treated as unknown"));
}

/// A sample of the points of a scan.
pub(super) struct Sample {
    step: usize,
    /// Number of points so far.
    seen: usize,
    bounds: Option<[DVec3; 2]>,
}

impl Sample {
    /// A sample of so many points.
    pub(super) fn of(points: usize) -> Self {
        Self { step: points.div_ceil(MAX_SAMPLED_POINTS).max(1), seen: 0, bounds: None }
    }

    /// Adds the next points of the scan, which are those of a range of a cloud.
    pub(super) fn add(&mut self, cloud: &PointCloud, points: Range<usize>) {
        let first = self.seen.next_multiple_of(self.step) - self.seen;
        for index in points.clone().skip(first).step_by(self.step) {
            let point = cloud.world_position(index);
            if point.is_finite() {
                self.bounds = Some(self.bounds.map_or([point; 2], |[min, max]| [min.min(point), max.max(point)]));
            }
        }
        self.seen += points.len();
    }

    /// Whether a sensor cannot have seen these points, which are stored about an origin.
    pub(super) fn is_far(&self, sensor: DVec3, origin: DVec3) -> bool {
        if !((sensor - origin).abs().max_element() <= MAX_ORIGIN_DISTANCE) {
            return true;
        }
        self.bounds.is_some_and(|[min, max]| {
            let size = min.distance(max);
            size > 0.0 && sensor.distance(0.5 * (min + max)) > MAX_DISTANCE_DIAGONALS * size
        })
    }
}
