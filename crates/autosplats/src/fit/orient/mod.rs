//! The side of a surface that is seen: the sensor's side, or the back.
//!
//! # How it works
//! A point was seen from its sensor, so the outside of the surface is on the sensor's side. Surfels face the eye in
//! all stages; this stage marks surfels whose sensor was on the other side. Where the sensor or the eye looks along
//! the surface, noise decides the side of the plane, more so in a thick neighbourhood. No back is claimed there.

pub(crate) mod gpu;
#[cfg(test)]
mod tests;

use autosplats_cloud::{PointCloud, Scan};
use glam::Vec3;
use rayon::prelude::*;

use super::Surfel;
use crate::camera::View;
use crate::cancel::Cancel;

/// Cosine of the angle between the normal and the direction to the sensor above which the sensor's side is certain.
pub(super) const MIN_SENSOR_COSINE: f32 = 0.15;
/// Cosine of the angle between the normal and the direction to the eye above which the eye's side is certain.
pub(super) const MIN_EYE_COSINE: f32 = 0.05;
/// Largest coordinate of a known sensor about the cloud's origin, world units. Larger squares could overflow.
const MAX_SENSOR_COORDINATE: f32 = 1e18;
/// Surfels per task.
const TASK_SURFELS: usize = 1 << 12;

/// Position of the sensor of a run of points, laid out as in `orient.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct Sensor {
    /// Position about the cloud's origin, world units; infinite if unknown.
    pub(crate) position: [f32; 3],
    /// Index of the first point of the run.
    pub(crate) first: u32,
}

/// Positions of the sensors of all points, empty if none is known.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Sensors {
    /// Runs of points, in the order of the points. The first begins at point 0.
    pub(super) runs: Vec<Sensor>,
}

/// Whether any point's sensor is known.
pub(crate) fn has_sensors(cloud: &PointCloud) -> bool {
    cloud.scans().iter().any(|scan| !scan.points.is_empty() && position(cloud, scan).is_some())
}

/// Position of a scan's sensor about the cloud's origin; `None` if not finite or too far away.
fn position(cloud: &PointCloud, scan: &Scan) -> Option<[f32; 3]> {
    let position = (scan.position() - cloud.origin()).as_vec3();
    (position.is_finite() && position.abs().max_element() <= MAX_SENSOR_COORDINATE).then_some(position.to_array())
}

/// Runs of points by scan: the index of the first point, and the scan if any. The first run begins at point 0. A point
/// in several scans belongs to the first of them.
pub(crate) fn runs(cloud: &PointCloud) -> Vec<(u32, Option<&Scan>)> {
    let mut scans: Vec<&Scan> = cloud.scans().iter().filter(|scan| !scan.points.is_empty()).collect();
    scans.sort_by_key(|scan| (scan.points.start, scan.points.end));
    let mut runs = Vec::new();
    let mut end = 0;
    for scan in scans {
        if scan.points.start > end {
            runs.push((end as u32, None));
        }
        if scan.points.end > end {
            runs.push((end.max(scan.points.start) as u32, Some(scan)));
            end = scan.points.end;
        }
    }
    if end < cloud.len() {
        runs.push((end as u32, None));
    }
    runs
}

impl Sensors {
    /// The sensors of the scans of `cloud`.
    pub(crate) fn new(cloud: &PointCloud) -> Self {
        if !has_sensors(cloud) {
            return Self::default();
        }
        let mut of_sensors: Vec<Sensor> = Vec::new();
        for (first, scan) in runs(cloud) {
            let position = scan.and_then(|scan| position(cloud, scan)).unwrap_or([f32::INFINITY; 3]);
            if of_sensors.last().is_none_or(|last| last.position != position) {
                of_sensors.push(Sensor { position, first });
            }
        }
        Self { runs: of_sensors }
    }

    /// Number of runs of points.
    pub(crate) fn len(&self) -> usize {
        self.runs.len()
    }

    /// Position of a point's sensor about the cloud's origin.
    fn of(&self, point: u32) -> Option<Vec3> {
        let begun = self.runs.partition_point(|run| run.first <= point);
        let position = Vec3::from(self.runs[begun.checked_sub(1)?].position);
        position.is_finite().then_some(position)
    }

    /// Marks the surfels that show their back.
    pub(crate) fn orient(&self, surfels: &mut [Surfel], view: &View, cancel: &Cancel<'_>) {
        if self.runs.is_empty() {
            return;
        }
        let tasks = surfels.par_chunks_mut(TASK_SURFELS).filter(|_| !cancel.is_given_up());
        tasks.flatten_iter().for_each(|surfel| {
            let sensor = self.of(surfel.source).map(|sensor| view.view_from_world * (sensor - view.eye_local));
            if sensor.is_some_and(|sensor| is_seen_from_behind(surfel, sensor, view)) {
                surfel.screen_and_flags |= Surfel::BACK;
            }
        });
    }
}

/// Whether the sensor, in view space, was certainly on the other side of a surfel than the eye.
fn is_seen_from_behind(surfel: &Surfel, sensor: Vec3, view: &View) -> bool {
    let [center, normal] = [surfel.center, surfel.normal].map(Vec3::from);
    let to_eye = view.to_eye(center);
    let to_sensor = sensor - center;
    // Thickness of the neighbourhood over its width: about the tangent of the normal's error angle.
    let rough = (2.0 * surfel.curvature).sqrt();
    normal.dot(to_sensor) < -rough.max(MIN_SENSOR_COSINE) * to_sensor.length()
        && normal.dot(to_eye) > rough.max(MIN_EYE_COSINE) * to_eye.length()
}
