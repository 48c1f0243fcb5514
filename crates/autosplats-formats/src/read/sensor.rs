//! Checks that sensors can have stood where a file states.

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
    let kept: Vec<Scan> = cloud.scans().iter().filter(|scan| !is_far(cloud, scan)).cloned().collect();
    let count = cloud.scans().len() - kept.len();
    if count > 0 {
        let what = if count == 1 { "sensor position is" } else { "sensor positions are" };
        job.note(format!("{count} {what} far from all that was seen; treated as unknown"));
        *cloud = std::mem::take(cloud).with_scans(kept);
    }
}

fn is_far(cloud: &PointCloud, scan: &Scan) -> bool {
    if !((scan.position() - cloud.origin()).abs().max_element() <= MAX_ORIGIN_DISTANCE) {
        return true;
    }
    let step = scan.points.len().div_ceil(MAX_SAMPLED_POINTS).max(1);
    let sample = scan.points.clone().step_by(step).map(|i| cloud.world_position(i));
    let sample = sample.filter(|point| point.is_finite());
    let bounds = sample.fold(None, |bounds: Option<[DVec3; 2]>, point| {
        Some(bounds.map_or([point; 2], |[min, max]| [min.min(point), max.max(point)]))
    });
    bounds.is_some_and(|[min, max]| {
        let size = min.distance(max);
        size > 0.0 && scan.position().distance(0.5 * (min + max)) > MAX_DISTANCE_DIAGONALS * size
    })
}
