//! Which side of a surface is seen: the one that its sensor saw, or its back.
//!
//! # How it works
//! A point was seen from where its sensor stood, so the surface there has its outside on that side. Surfels face the eye,
//! whatever the stages after the fit do with them; this marks those whose sensor was on the other side. Where the sensor
//! looked along the surface, or the eye does, noise decides on which side of the plane they are, all the more so the
//! thicker the neighbourhood is: there no back is claimed.

pub(crate) mod gpu;
#[cfg(test)]
mod tests;

use autosplats_cloud::{PointCloud, Scan};
use glam::Vec3;
use rayon::prelude::*;

use super::Surfel;
use crate::camera::View;

/// Cosine of the angle between the normal and the way to the sensor from which on the sensor's side is known.
pub(super) const SURE: f32 = 0.15;
/// The same of the way to the eye.
pub(super) const SEEN: f32 = 0.05;
/// Sensors further away than this from the cloud's origin are unknown: squares of distances must be finite.
const FARTHEST: f32 = 1e18;
/// Surfels per task.
const TASK: usize = 1 << 12;

/// Where the sensor stood that saw the points from one index on, as `orient.wgsl` has it.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct Sensor {
    /// About the cloud's origin; infinite if unknown.
    pub(crate) position: [f32; 3],
    /// Index of the first point.
    pub(crate) first: u32,
}

/// Where the sensor of each point stood. Empty if that is known of none.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Sensors {
    /// In the order of the points, the first from point 0 on.
    pub(super) runs: Vec<Sensor>,
}

/// Whether any point's sensor is known.
pub(crate) fn has_sensors(cloud: &PointCloud) -> bool {
    cloud.scans().iter().any(|scan| !scan.points.is_empty() && position(cloud, scan).is_some())
}

/// Where a scan's sensor stood, about the cloud's origin.
fn position(cloud: &PointCloud, scan: &Scan) -> Option<[f32; 3]> {
    let position = (scan.position() - cloud.origin()).as_vec3();
    (position.is_finite() && position.abs().max_element() <= FARTHEST).then_some(position.to_array())
}

/// Runs of points by the scan that they belong to, as the index of the first point and the scan, from point 0 on. A point
/// that several scans claim belongs to the first of them.
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
    /// Those of the scans of `cloud`.
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

    /// Where the sensor of a point stood, about the cloud's origin.
    fn of(&self, point: u32) -> Option<Vec3> {
        let begun = self.runs.partition_point(|run| run.first <= point);
        let position = Vec3::from(self.runs[begun.checked_sub(1)?].position);
        position.is_finite().then_some(position)
    }

    /// Marks the surfels that show their back.
    pub(crate) fn orient(&self, surfels: &mut [Surfel], view: &View) {
        if self.runs.is_empty() {
            return;
        }
        surfels.par_chunks_mut(TASK).flatten_iter().for_each(|surfel| {
            let sensor = self.of(surfel.source).map(|sensor| view.view_from_world * (sensor - view.eye_local));
            if sensor.is_some_and(|sensor| shows_back(surfel, sensor, view)) {
                surfel.screen |= Surfel::BACK;
            }
        });
    }
}

/// Whether the sensor, in view space, was surely on the other side of a surfel than the eye.
fn shows_back(surfel: &Surfel, sensor: Vec3, view: &View) -> bool {
    let [center, normal] = [surfel.center, surfel.normal].map(Vec3::from);
    let to_eye = view.to_eye(center);
    let to_sensor = sensor - center;
    // How thick the neighbourhood is for its width: about the tangent of the angle that its normal may be off by.
    let rough = (2.0 * surfel.curvature).sqrt();
    normal.dot(to_sensor) < -rough.max(SURE) * to_sensor.length()
        && normal.dot(to_eye) > rough.max(SEEN) * to_eye.length()
}
