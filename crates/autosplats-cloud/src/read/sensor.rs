//! Whether sensors stood where files say.

use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use super::Job;
use crate::{PointCloud, Scan, sample::hilbert};

/// Sensors stand this many times the size of what they saw away from it at most.
const FAR: f64 = 20.0;

/// Nor further than this from the cloud's origin: what is computed with them has to be finite.
const FARTHEST: f64 = 1e18;

/// Points looked at in each scan for that.
const BOUNDED: usize = 1000;

/// Points whose order tells whether they were seen from one place, and the fewest that do.
const SAMPLE: usize = 1 << 17;
const FEW: usize = 1000;

/// Points one after the other that are this many times as far away as each other are no piece of surface.
const STEP: f64 = 1.5;

/// Share of such steps: real sweeps have up to 0.12, a closed surface about a place within it or beside it 0.4 and more.
const STEPS: f64 = 0.25;

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

/// Whether these points can all have been seen from one place: it sees one surface in each direction, not one through another.
/// For where a file says only that the place is the origin, which many say who know none. Too few points say nothing
/// against it.
pub(super) fn may_be_seen_from(cloud: &PointCloud, points: Range<usize>, place: DVec3) -> bool {
    steps(cloud, points, place).is_none_or(|share| share <= STEPS)
}

/// In the order of a curve through all directions from a place: how many of the points' distances differ much from the
/// one before.
fn steps(cloud: &PointCloud, points: Range<usize>, place: DVec3) -> Option<f64> {
    let stride = points.len().div_ceil(SAMPLE).max(1);
    let seen = |i: usize| {
        let way = cloud.world_position(points.start + i * stride) - place;
        let distance = way.length();
        (distance > 0.0 && distance.is_finite()).then(|| {
            let cell = (way / distance + 1.0) * 32_767.0;
            (hilbert(cell.to_array().map(|value| value as u32)), distance)
        })
    };
    let mut sample: Vec<(u64, f64)> = (0..points.len() / stride).into_par_iter().filter_map(seen).collect();
    if sample.len() < FEW {
        return None;
    }
    sample.par_sort_unstable_by_key(|(direction, distance)| (*direction, distance.to_bits()));
    let apart = |pair: &&[(u64, f64)]| {
        let (near, far) = (pair[0].1.min(pair[1].1), pair[0].1.max(pair[1].1));
        far > STEP * near
    };
    Some(sample.windows(2).filter(apart).count() as f64 / (sample.len() - 1) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points on two spheres about the origin, the inner one with this share of them.
    fn spheres(inner: f64) -> PointCloud {
        let point = |i: u32| {
            // Evenly over the sphere, in no order that knows of the two.
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / 20_000.0;
            let (sin, cos) = (f64::from(i) * 2.399_963_229_728_653).sin_cos();
            let round = (1.0 - z * z).sqrt();
            let radius = if (f64::from(i) * 0.618_033_988_75).fract() < inner { 1.0 } else { 2.0 };
            (radius * DVec3::new(round * cos, round * sin, z)).as_vec3().to_array()
        };
        PointCloud::new(DVec3::ZERO, (0..20_000).map(point).collect())
    }

    fn may_be(cloud: &PointCloud, place: DVec3) -> bool {
        may_be_seen_from(cloud, 0..cloud.len(), place)
    }

    #[test]
    fn no_surface_is_seen_through_another() {
        assert!(may_be(&spheres(0.0), DVec3::ZERO), "from within a sphere");
        assert!(may_be(&spheres(0.0), DVec3::new(0.5, 0.6, 0.7)), "from anywhere within");
        assert!(may_be(&spheres(0.05), DVec3::ZERO), "some outliers");
        assert!(!may_be(&spheres(0.4), DVec3::ZERO), "one through the other");
        assert!(!may_be(&spheres(0.0), DVec3::new(0.0, 0.0, 2.6)), "both sides of it");
        let few = PointCloud::new(DVec3::ZERO, spheres(0.4).positions()[..900].to_vec());
        assert!(may_be(&few, DVec3::ZERO), "few say nothing");
        let mut broken = spheres(0.0);
        broken.positions[..30].fill([f32::NAN, 0.0, f32::INFINITY]);
        assert!(may_be(&broken, DVec3::ZERO), "what is nowhere says nothing");
    }
}
