//! The noise of depth cameras.
//!
//! # How it works
//! A camera that finds depth by matching a pattern or a second picture knows disparities, which are inverse depths. It knows
//! them in steps, and neighbours err alike, because they are matched by windows of pixels. So its points lie on planes a
//! step apart, 3 mm at 1 m and 27 cm at 9.7 m, many times what neighbouring points are apart, or on a surface that waves as
//! much. Small neighbourhoods scatter little then, and their normals are wrong: what is measured in a frame (`noise`) says
//! that all is well. But such noise gives itself away in the scan as a whole, once for a cloud: depths come in steps
//! (`steps`), or what windows of neighbours leave of planes is as much in inverse depth near and far (`disparity`). It grows
//! with a power of the depth from its sensor, whatever the eye is. The noise of a surfel is this or what was measured,
//! whichever is larger; and as it was made along the ray from the sensor, it is undone along it. Each scan has a law of its
//! own, and each point that of the scan it belongs to.

mod disparity;
mod steps;
#[cfg(test)]
mod tests;

use std::ops::Range;

use autosplats_cloud::{PointCloud, Scan};
use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

use crate::camera::View;
use crate::fit::orient::runs;

/// Fewer points of a scan say nothing.
const LEAST_POINTS: usize = 1 << 10;
/// Points whose steps are looked at, of all scans together.
const STEPS_SAMPLE: usize = 1 << 14;
/// Points of windows, of all scans together.
const DISPARITY_SAMPLE: usize = 1 << 16;
/// Share of the points that may be outside of a camera's view.
const OUTSIDE: f64 = 0.001;
/// Tangent of half the widest angle of view.
const WIDEST: f64 = 4.0;
/// Rounding of coordinates, as a part of the largest one.
const ROUNDING: f64 = 4.0 * f32::EPSILON as f64;

/// A surfel moves at most this many standard deviations along the ray: a surface further away is not what it was seen on.
pub(super) const FARTHEST_ALONG: f32 = 3.0;
/// A disc becomes at most this many times as long as it was when it is turned.
pub(super) const LONGEST_SHADOW: f32 = 2.0;
/// Cosine of the angle between ray and normal at which a surfel is moved along both alike.
pub(super) const GRAZING: f32 = 0.1;

/// How depths scatter that one sensor measured, those of the points from one index on.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct DepthRun {
    /// Where the sensor stood, about the cloud's origin.
    pub(crate) position: [f32; 3],
    /// Index of the first point.
    pub(crate) first: u32,
    /// Where it looked: a unit vector, in the axes of the cloud.
    pub(crate) axis: [f32; 3],
    /// Standard deviation at depth 1 along the axis; 0 if nothing is known.
    pub(crate) factor: f32,
    /// Of depth, that it grows with: 0, 1 or 2.
    pub(crate) power: f32,
    pub(crate) padding: [u32; 3],
}

/// What is known of the noise of a cloud, in the order of its points, from point 0 on. Empty if nothing is.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct DepthNoise {
    pub(super) runs: Vec<DepthRun>,
}

/// What is known of the noise at a surfel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Known {
    /// Standard deviation, world units.
    pub(super) noise: f32,
    /// Unit direction along which it was made, view space.
    pub(super) ray: Vec3,
}

/// Standard deviation of depths: `factor`·depthᵖ.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Law {
    factor: f64,
    power: i32,
}

impl DepthNoise {
    /// Of the scans of `cloud`, each by itself.
    pub(crate) fn new(cloud: &PointCloud) -> Self {
        let runs = runs(cloud);
        let known = runs.iter().filter(|(_, scan)| scan.is_some()).count().max(1);
        let ends = runs.iter().skip(1).map(|(first, _)| *first as usize).chain([cloud.len()]);
        let of_run = |(&(first, scan), end): (&(u32, Option<&Scan>), usize)| {
            let found = scan.and_then(|scan| of_scan(cloud, scan, first as usize..end, known));
            DepthRun { first, ..found.unwrap_or_else(bytemuck::Zeroable::zeroed) }
        };
        let mut found: Vec<DepthRun> = runs.iter().zip(ends).collect::<Vec<_>>().into_par_iter().map(of_run).collect();
        found.dedup_by(|run, before| run.factor == 0.0 && before.factor == 0.0);
        let is_known = found.iter().any(|run| run.factor > 0.0);
        Self { runs: if is_known { found } else { Vec::new() } }
    }

    /// As the device has it: at least one run.
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

    /// At a place in the axes of these sensors; of a cloud's point.
    #[inline(always)]
    pub(super) fn at(&self, place: Vec3, point: u32) -> Option<Known> {
        let run = match self.runs.as_slice() {
            [] => return None,
            [run] => run,
            runs => &runs[runs.partition_point(|run| run.first <= point).checked_sub(1)?],
        };
        let from_sensor = place - Vec3::from(run.position);
        let depth = from_sensor.dot(run.axis.into());
        // What is in the sensor itself, or behind it, was not seen by it.
        if !(run.factor > 0.0 && depth > 0.0) {
            return None;
        }
        let noise = run.factor * if run.power == 0.0 { 1.0 } else { depth.powf(run.power) };
        Some(Known { noise, ray: from_sensor / from_sensor.length() })
    }
}

impl Known {
    /// A move by `offset` onto the plane with a `normal`, made along the ray instead; along the normal where the ray is
    /// nearly in the plane.
    #[inline(always)]
    pub(super) fn onto(&self, normal: Vec3, offset: Vec3) -> Vec3 {
        let distance = offset.dot(normal);
        let slope = self.ray.dot(normal);
        let inverse = 1.0 / (slope * slope + GRAZING * GRAZING);
        let along = distance * slope * inverse;
        let rest = distance * GRAZING * GRAZING * inverse;
        let limit = FARTHEST_ALONG * self.noise;
        let part = if along.abs() > limit { limit / along.abs() } else { 1.0 };
        (self.ray * along + normal * rest) * part
    }

    /// The shadow that a disc with the normal `before` casts along the ray on a plane with the normal `after`, as its major
    /// axis and how many times as long it is as wide; `None` if it is no longer. The disc was as wide as the points of a step
    /// need it, and would leave gaps where the surface is steep.
    #[inline(always)]
    pub(super) fn shadow(&self, before: Vec3, after: Vec3) -> Option<(Vec3, f32)> {
        let slope = self.ray.dot(after);
        let ratio = (self.ray.dot(before).abs() / slope.abs().max(GRAZING)).min(LONGEST_SHADOW);
        let major = (self.ray - after * slope).try_normalize()?;
        (ratio > 1.0).then_some((major, ratio))
    }
}

/// Of the points of a scan by index, where there are `scans` of them.
fn of_scan(cloud: &PointCloud, scan: &Scan, points: Range<usize>, scans: usize) -> Option<DepthRun> {
    if points.len() < LEAST_POINTS {
        return None;
    }
    let position = scan.position() - cloud.origin();
    let points = &cloud.positions()[points];
    // About so many, evenly.
    let sample = |most: usize, sensor_from_world: DMat3| -> Vec<DVec3> {
        let stride = points.len().div_ceil((most / scans).max(LEAST_POINTS));
        let picked = points.iter().step_by(stride).map(|point| Vec3::from(*point)).filter(|point| point.is_finite());
        picked.map(|point| sensor_from_world * (point.as_dvec3() - position)).collect()
    };
    let few = sample(STEPS_SAMPLE, DMat3::IDENTITY);
    // Coordinates are rounded where they are about the cloud's origin.
    let largest = few.iter().map(|point| point.abs().max_element()).fold(position.abs().max_element(), f64::max);
    let rounding = ROUNDING * largest;
    let [x, y, z] = [scan.world_from_sensor.x_axis, scan.world_from_sensor.y_axis, scan.world_from_sensor.z_axis]
        .map(|axis| axis.truncate().normalize_or_zero());
    // A camera looks along its third axis, and sees what is before it. But not all formats say what a sensor's axes are: it
    // is the one about which all points are.
    [[x, y, z], [y, z, x], [z, x, y], [x, y, -z], [y, z, -x], [z, x, -y]].into_iter().find_map(|[x, y, axis]| {
        let sensor_from_world = DMat3::from_cols(x, y, axis).transpose();
        let seen: Vec<DVec3> = few.iter().map(|point| sensor_from_world * *point).collect();
        let is_outside = |point: &&DVec3| {
            !(point.z > rounding && point.x.abs() <= WIDEST * point.z && point.y.abs() <= WIDEST * point.z)
        };
        let outside = seen.iter().filter(is_outside).count();
        if seen.len() < LEAST_POINTS || outside as f64 > OUTSIDE * seen.len() as f64 {
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
