//! The noise of depth cameras.
//!
//! # How it works
//! A camera that finds depth by matching a pattern or a second picture measures disparities, which are inverse depths.
//! Disparities come in steps, and neighbours err alike because windows of pixels are matched. So the camera's points
//! lie on planes a step apart: 3 mm at 1 m and 27 cm at 9.7 m, many times the distance of neighbours. Or they lie on a
//! surface with waves as high. Small neighbourhoods then scatter little and their normals are wrong, and the noise
//! measured in a frame (`noise`) is far too low. Such noise shows in the scan as a whole, once per cloud. Either depths
//! come in steps (`steps`), or the residuals of planes in windows are equal in inverse depth near and far
//! (`disparity`). The noise grows with a power of the depth from the sensor, independent of the eye. A surfel uses the
//! larger of this known noise and the measured one. As the noise acts along the sensor's ray, surfels move along that
//! ray. Each scan has its own law, and each point that of its scan. See docs/decisions/0009-depth-cameras.md.

mod disparity;
mod steps;
#[cfg(test)]
mod tests;

use std::ops::Range;

use autosplats_cloud::{PointCloud, Scan};
use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

use crate::camera::View;
use crate::cancel::Cancel;
use crate::fit::orient::runs;

/// Fewest points of a scan that give a law.
const LEAST_POINTS: usize = 1 << 10;
/// Points checked for steps, of all scans together.
const STEPS_SAMPLE: usize = 1 << 14;
/// Points put into windows, of all scans together.
const DISPARITY_SAMPLE: usize = 1 << 16;
/// Largest share of a scan's points outside the field of view.
const MAX_OUTSIDE_SHARE: f64 = 0.001;
/// Tangent of half the widest field of view.
const MAX_HALF_FOV_TANGENT: f64 = 4.0;
/// Rounding of coordinates, relative to the largest one.
const COORDINATE_ROUNDING: f64 = 4.0 * f32::EPSILON as f64;

/// Longest move of a surfel along the ray, in standard deviations; surfaces further away are others.
pub(super) const FARTHEST_ALONG: f32 = 3.0;
/// Largest factor by which a disc grows in length when it is turned.
pub(super) const LONGEST_SHADOW: f32 = 2.0;
/// Cosine between ray and normal at which half of the way to the plane is along the ray, half along the normal.
pub(super) const GRAZING_COSINE: f32 = 0.1;

/// The noise law of one sensor, for the points from one index on.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct DepthRun {
    /// Position of the sensor relative to the cloud's origin.
    pub(crate) position: [f32; 3],
    /// Index of the first point.
    pub(crate) first: u32,
    /// Viewing direction: a unit vector in the axes of the cloud.
    pub(crate) axis: [f32; 3],
    /// Standard deviation at depth 1 along the axis; 0 if unknown.
    pub(crate) factor: f32,
    /// Power of depth that the noise grows with: 0, 1 or 2.
    pub(crate) power: f32,
    pub(crate) padding: [u32; 3],
}

/// The known noise of a cloud: runs in the order of points, from point 0 on. Empty if nothing is known.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct DepthNoise {
    pub(super) runs: Vec<DepthRun>,
}

/// The known noise at a surfel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct KnownNoise {
    /// Standard deviation, world units.
    pub(super) noise: f32,
    /// Unit direction along which the noise acts, view space.
    pub(super) ray: Vec3,
}

/// Standard deviation of depths: `factor`·depthᵖ.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Law {
    factor: f64,
    power: i32,
}

impl DepthNoise {
    /// Estimates the noise of each scan of `cloud`.
    pub(crate) fn new(cloud: &PointCloud, cancel: &Cancel<'_>) -> Self {
        let runs = runs(cloud);
        let known = runs.iter().filter(|(_, scan)| scan.is_some()).count().max(1);
        let ends = runs.iter().skip(1).map(|(first, _)| *first as usize).chain([cloud.len()]);
        let of_run = |(&(first, scan), end): (&(u32, Option<&Scan>), usize)| {
            let scan = scan.filter(|_| !cancel.is_given_up());
            let found = scan.and_then(|scan| law_of_scan(cloud, scan, first as usize..end, known));
            DepthRun { first, ..found.unwrap_or_else(bytemuck::Zeroable::zeroed) }
        };
        let mut found: Vec<DepthRun> = runs.iter().zip(ends).collect::<Vec<_>>().into_par_iter().map(of_run).collect();
        found.dedup_by(|run, before| run.factor == 0.0 && before.factor == 0.0);
        let is_known = found.iter().any(|run| run.factor > 0.0);
        Self { runs: if is_known { found } else { Vec::new() } }
    }

    /// The runs for the GPU, at least one.
    pub(crate) fn on_device(&self) -> Vec<DepthRun> {
        if self.runs.is_empty() { vec![bytemuck::Zeroable::zeroed()] } else { self.runs.clone() }
    }

    /// The same in a view's axes, relative to the eye.
    pub(super) fn seen_by(&self, view: &View) -> Self {
        let turn = |run: &DepthRun| DepthRun {
            position: (view.view_from_world * (Vec3::from(run.position) - view.eye_local)).to_array(),
            axis: (view.view_from_world * Vec3::from(run.axis)).to_array(),
            ..*run
        };
        Self { runs: self.runs.iter().map(turn).collect() }
    }

    /// The noise at `place`, in the axes of these sensors, for a point of the cloud; `None` if unknown.
    #[inline(always)]
    pub(super) fn at(&self, place: Vec3, point: u32) -> Option<KnownNoise> {
        let run = match self.runs.as_slice() {
            [] => return None,
            [run] => run,
            runs => &runs[runs.partition_point(|run| run.first <= point).checked_sub(1)?],
        };
        let from_sensor = place - Vec3::from(run.position);
        let depth = from_sensor.dot(run.axis.into());
        // The sensor saw nothing at itself or behind.
        if !(run.factor > 0.0 && depth > 0.0) {
            return None;
        }
        let noise = run.factor * if run.power == 0.0 { 1.0 } else { depth.powf(run.power) };
        Some(KnownNoise { noise, ray: from_sensor / from_sensor.length() })
    }
}

impl KnownNoise {
    /// Replaces a move by `offset` onto the plane with a `normal` by a move along the ray. Where the ray nearly lies in
    /// the plane, the move stays along the normal.
    #[inline(always)]
    pub(super) fn onto(&self, normal: Vec3, offset: Vec3) -> Vec3 {
        let distance = offset.dot(normal);
        let slope = self.ray.dot(normal);
        let inverse = 1.0 / (slope * slope + GRAZING_COSINE * GRAZING_COSINE);
        let along = distance * slope * inverse;
        let rest = distance * GRAZING_COSINE * GRAZING_COSINE * inverse;
        let limit = FARTHEST_ALONG * self.noise;
        let part = if along.abs() > limit { limit / along.abs() } else { 1.0 };
        (self.ray * along + normal * rest) * part
    }

    /// The shadow that a disc with the normal `before` casts along the ray onto a plane with the normal `after`: major
    /// axis and ratio of length to width. `None` if the shadow is no longer than the disc. The unstretched disc fits
    /// the points of a depth step and would leave gaps on a steep surface.
    #[inline(always)]
    pub(super) fn shadow(&self, before: Vec3, after: Vec3) -> Option<(Vec3, f32)> {
        let slope = self.ray.dot(after);
        let ratio = (self.ray.dot(before).abs() / slope.abs().max(GRAZING_COSINE)).min(LONGEST_SHADOW);
        let major = (self.ray - after * slope).try_normalize()?;
        (ratio > 1.0).then_some((major, ratio))
    }
}

/// The noise of a scan with these points; `scans` is the number of scans that share the samples.
fn law_of_scan(cloud: &PointCloud, scan: &Scan, points: Range<usize>, scans: usize) -> Option<DepthRun> {
    if points.len() < LEAST_POINTS {
        return None;
    }
    let position = scan.position() - cloud.origin();
    let points = &cloud.positions()[points];
    // An even sample of about `most / scans` points.
    let sample = |most: usize, sensor_from_world: DMat3| -> Vec<DVec3> {
        let stride = points.len().div_ceil((most / scans).max(LEAST_POINTS));
        let picked = points.iter().step_by(stride).map(|point| Vec3::from(*point)).filter(|point| point.is_finite());
        picked.map(|point| sensor_from_world * (point.as_dvec3() - position)).collect()
    };
    let few = sample(STEPS_SAMPLE, DMat3::IDENTITY);
    // Coordinates are rounded relative to the cloud's origin.
    let largest = few.iter().map(|point| point.abs().max_element()).fold(position.abs().max_element(), f64::max);
    let rounding = COORDINATE_ROUNDING * largest;
    let [x, y, z] = [scan.world_from_sensor.x_axis, scan.world_from_sensor.y_axis, scan.world_from_sensor.z_axis]
        .map(|axis| axis.truncate().normalize_or_zero());
    // A camera looks along its third axis, but some formats do not define a sensor's axes. So each axis with all points
    // before it is tried.
    [[x, y, z], [y, z, x], [z, x, y], [x, y, -z], [y, z, -x], [z, x, -y]].into_iter().find_map(|[x, y, axis]| {
        let sensor_from_world = DMat3::from_cols(x, y, axis).transpose();
        let seen: Vec<DVec3> = few.iter().map(|point| sensor_from_world * *point).collect();
        let is_outside = |point: &&DVec3| {
            !(point.z > rounding
                && point.x.abs() <= MAX_HALF_FOV_TANGENT * point.z
                && point.y.abs() <= MAX_HALF_FOV_TANGENT * point.z)
        };
        let outside = seen.iter().filter(is_outside).count();
        if seen.len() < LEAST_POINTS || outside as f64 > MAX_OUTSIDE_SHARE * seen.len() as f64 {
            return None;
        }
        let law = steps::law(&seen, rounding).filter(|law| law.power == 2).or_else(|| {
            let many = sample(DISPARITY_SAMPLE, sensor_from_world);
            disparity::law(many, rounding).or_else(|| steps::law(&seen, rounding))
        })?;
        Some(DepthRun {
            position: position.as_vec3().to_array(),
            first: 0,
            axis: axis.as_vec3().to_array(),
            factor: law.factor as f32,
            power: law.power as f32,
            padding: [0; 3],
        })
    })
}
