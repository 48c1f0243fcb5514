//! Whether sensors can have stood where files say.

use glam::DVec3;

use super::Job;
use crate::{PointCloud, Scan};

/// Sensors stand this many times the size of what they saw away from it at most.
const FAR: f64 = 20.0;

/// Nor further than this from the cloud's origin: what is computed with them has to be finite.
const FARTHEST: f64 = 1e18;

/// Points looked at in each scan for that.
const BOUNDED: usize = 1000;

/// Poses are often left out where points were moved into a survey's coordinates; the origin is then no place of a sensor.
pub(super) fn drop_far(job: &Job<'_>, cloud: &mut PointCloud) {
    let kept: Vec<Scan> = cloud.scans.iter().filter(|scan| !is_far(cloud, scan)).cloned().collect();
    let count = cloud.scans.len() - kept.len();
    if count > 0 {
        job.note(format!("{count} of the sensors' places are far from all that was seen; taken for unknown"));
        cloud.scans = kept;
    }
}

fn is_far(cloud: &PointCloud, scan: &Scan) -> bool {
    if !((scan.position() - cloud.origin()).abs().max_element() <= FARTHEST) {
        return true;
    }
    let step = scan.points.len().div_ceil(BOUNDED).max(1);
    let sample = scan.points.clone().step_by(step).map(|i| cloud.world_position(i));
    let sample = sample.filter(|point| point.is_finite());
    let bounds = sample.fold(None, |bounds: Option<[DVec3; 2]>, point| {
        Some(bounds.map_or([point; 2], |[min, max]| [min.min(point), max.max(point)]))
    });
    bounds.is_some_and(|[min, max]| {
        let size = min.distance(max);
        size > 0.0 && scan.position().distance(0.5 * (min + max)) > FAR * size
    })
}
