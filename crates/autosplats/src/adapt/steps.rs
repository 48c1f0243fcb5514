//! Depths in coarse steps.
//!
//! # How it works
//! A camera that finds depth by matching a pattern knows it in steps of disparity, so its points lie on planes a step apart:
//! 3 mm at 1 m, 27 cm at 9.7 m, many times what neighbouring points are apart. Small neighbourhoods lie on one plane then,
//! which scatters not at all and has the wrong normal: what is measured in a frame (`noise`) says that all is well. But depths
//! in steps give themselves away, once for a cloud: along the axis of their sensor the points of a scan have few different
//! values, along the other axes many, and the gaps between those values follow a power of depth. The noise of a surfel is
//! what was measured or what those steps make, whichever is larger; and as that was made along the ray from the sensor, it
//! is undone along it. Each scan has a law of its own, and each point that of the scan it belongs to.

use autosplats_cloud::{PointCloud, Scan};
use glam::{DVec3, Vec3};

use crate::camera::View;
use crate::fit::orient::runs;

/// Points looked at, of all scans together; of each at least [`LEAST_POINTS`].
const SAMPLE: usize = 1 << 14;
/// Fewer points say nothing.
const LEAST_POINTS: usize = 1 << 10;
/// Fewer steps have no law.
const LEAST_VALUES: usize = 8;
/// Points per value, at least.
const POINTS_PER_VALUE: usize = 6;
/// Values along other axes per value along the sensor's: coordinates that are all rounded, and grids, have no such axis.
const OTHER_VALUES: usize = 4;
/// Share of the points that may be behind the sensor, or nearer than can be told.
const BEHIND: f64 = 0.001;
/// Rounding of coordinates, as a part of the largest one: values that are no further apart are one.
const ROUNDING: f64 = 4.0 * f32::EPSILON as f64;
/// Steps are at least this many times as wide as that.
const LEAST_STEP: f64 = 8.0;
/// Powers of depth that steps may grow with: by how they are stored, by nothing known, and by disparity.
const POWERS: [i32; 3] = [2, 1, 0];
/// A gap is as wide as a number of steps up to this part of one.
const TIGHT: f64 = 0.25;
/// Share of the gaps that are one step wide, at least, and of those that are some whole number of steps wide.
const ONE_STEP: f64 = 0.6;
const WHOLE_STEPS: f64 = 0.75;

/// Standard deviation of a depth, in steps: 1/√3. Rounding alone makes half as much, but neighbours are rounded alike, so that
/// fits average less out than of errors that are independent, and depths between two steps toggle. With 1/√12 bodies are
/// lumpy and walls crazed, with √3/2 folds of cloth are gone. Nguyen, Izadi, Lovell: *Modeling Kinect Sensor Noise for Improved
/// 3D Reconstruction and Tracking*, 2012, measured as much.
const STEP_ERROR: f64 = 0.577_350_269;
/// A surfel moves at most this many standard deviations along the ray: a surface further away is not what it was seen on.
pub(super) const FARTHEST_ALONG: f32 = 3.0;
/// A disc becomes at most this many times as long as it was when it is turned.
pub(super) const LONGEST_SHADOW: f32 = 2.0;
/// Cosine of the angle between ray and normal at which a surfel is moved along both alike.
pub(super) const GRAZING: f32 = 0.1;

/// The sensor whose points have depths in steps, and of the points from one index on.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct Stepped {
    /// Where it stood, about the cloud's origin.
    pub(crate) position: [f32; 3],
    /// Index of the first point.
    pub(crate) first: u32,
    /// Where it looked: a unit vector, in the axes of the cloud.
    pub(crate) axis: [f32; 3],
    /// Standard deviation of depths from what they should be, at depth 1 along the axis; 0 if there are no steps.
    pub(crate) factor: f32,
    /// Of depth, that it grows with: 0, 1 or 2.
    pub(crate) power: f32,
    pub(crate) padding: [u32; 3],
}

/// The runs of points of a cloud by their depths' steps: in the order of the points, the first from point 0 on. Empty if
/// none has steps.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct DepthSteps {
    pub(super) runs: Vec<Stepped>,
}

/// What is known of the noise at a surfel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Known {
    /// Standard deviation, world units.
    pub(super) noise: f32,
    /// Unit direction along which it was made, view space.
    pub(super) ray: Vec3,
}

impl DepthSteps {
    /// Of the scans of `cloud`, each by itself.
    pub(crate) fn new(cloud: &PointCloud) -> Self {
        let of_sensors = runs(cloud);
        let each = (SAMPLE / of_sensors.len().max(1)).max(LEAST_POINTS);
        let starts = of_sensors.iter().map(|(first, _)| *first as usize).skip(1).chain([cloud.len()]);
        let found: Vec<Stepped> = of_sensors
            .iter()
            .zip(starts)
            .map(|(&(first, scan), end)| {
                let none = Stepped { first, ..bytemuck::Zeroable::zeroed() };
                scan.and_then(|scan| steps_of(cloud, scan, first as usize..end, each))
                    .map_or(none, |law| law.run(first))
            })
            .collect();
        if found.iter().all(|run| run.factor == 0.0) {
            return Self::default();
        }
        Self { runs: found }
    }

    /// As the device has them: at least one.
    pub(crate) fn on_device(&self) -> Vec<Stepped> {
        if self.runs.is_empty() { vec![bytemuck::Zeroable::zeroed()] } else { self.runs.clone() }
    }

    /// The same in a view's axes, relative to the eye.
    pub(super) fn seen_by(&self, view: &View) -> Self {
        let turn = |run: &Stepped| Stepped {
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

/// Steps along an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Law {
    /// About the cloud's origin.
    position: DVec3,
    /// In the cloud's axes.
    axis: DVec3,
    /// Width of a step at depth 1.
    step: f64,
    power: i32,
}

impl Law {
    fn run(&self, first: u32) -> Stepped {
        Stepped {
            position: self.position.as_vec3().to_array(),
            first,
            axis: self.axis.as_vec3().to_array(),
            factor: (STEP_ERROR * self.step) as f32,
            power: self.power as f32,
            padding: [0; 3],
        }
    }
}

/// The steps of a scan's points by index, of which about `most` are looked at.
fn steps_of(cloud: &PointCloud, scan: &Scan, points: std::ops::Range<usize>, most: usize) -> Option<Law> {
    let stride = (points.len() / most).max(1);
    let position = scan.position() - cloud.origin();
    let mut largest = 0f64;
    let sample: Vec<DVec3> = cloud.positions()[points]
        .iter()
        .step_by(stride)
        .map(|position| Vec3::from(*position))
        .filter(|position| position.is_finite())
        .map(|point| {
            let point = point.as_dvec3();
            let from_sensor = point - position;
            largest = largest.max(point.abs().max_element()).max(from_sensor.abs().max_element());
            from_sensor
        })
        .collect();
    if sample.len() < LEAST_POINTS || !largest.is_finite() {
        return None;
    }
    let rounding = ROUNDING * largest;
    let axes = [scan.world_from_sensor.z_axis, scan.world_from_sensor.x_axis, scan.world_from_sensor.y_axis]
        .map(|axis| axis.truncate().normalize_or_zero());
    // A camera's axis is its third, and what it sees is before it. Formats that say less of the sensor's axes than where it
    // stood may have any: the sign and the axis are those that all points agree with.
    (0..3).find_map(|index| {
        let along = |axis: DVec3| sample.iter().map(move |point| point.dot(axis));
        let ahead = along(axes[index]).filter(|depth| *depth > rounding).count();
        let most = (BEHIND * sample.len() as f64) as usize;
        let axis = if ahead + most >= sample.len() {
            axes[index]
        } else if ahead <= most && along(-axes[index]).filter(|depth| *depth > rounding).count() + most >= sample.len()
        {
            -axes[index]
        } else {
            return None;
        };
        let values = distinct(along(axis).filter(|depth| *depth > rounding), rounding);
        if values.len() < LEAST_VALUES || values.len() * POINTS_PER_VALUE > sample.len() {
            return None;
        }
        let (step, power) =
            law(&values).filter(|(step, power)| step * values[0].powi(*power) > LEAST_STEP * rounding)?;
        // Last, because it sorts twice more.
        let others = [1, 2].map(|other| distinct(along(axes[(index + other) % 3]), rounding).len());
        let alone = others.iter().all(|other| *other >= OTHER_VALUES * values.len());
        alone.then_some(Law { position, axis, step, power })
    })
}

/// The values that are further than `rounding` apart, in order.
fn distinct(values: impl Iterator<Item = f64>, rounding: f64) -> Vec<f64> {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let mut last = f64::NEG_INFINITY;
    sorted.retain(|value| {
        // To the value before, not to the first that is equal: of a continuum one is left.
        let is_new = *value - last > rounding;
        last = *value;
        is_new
    });
    sorted
}

/// The width of a step at 1 and the power of depth that it grows with, if gaps between the values have such a law.
fn law(values: &[f64]) -> Option<(f64, i32)> {
    let mut best: Option<(f64, f64, i32)> = None;
    for power in POWERS {
        // Between equal disparities the gap of two depths is their product times a constant.
        let widths: Vec<f64> =
            values.windows(2).map(|pair| (pair[1] - pair[0]) / (pair[0] * pair[1]).sqrt().powi(power)).collect();
        let mut sorted = widths.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        let step = sorted[sorted.len() / 2];
        let off = |width: f64| {
            let steps = (width / step).round().max(1.0);
            (steps, (width / step - steps).abs())
        };
        let share = |holds: &dyn Fn(f64, f64) -> bool| {
            let held = widths.iter().filter(|width| {
                let (steps, off) = off(**width);
                holds(steps, off)
            });
            held.count() as f64 / widths.len() as f64
        };
        let one = share(&|steps, off| steps == 1.0 && off <= TIGHT);
        let whole = share(&|_, off| off <= TIGHT);
        let spread = widths.iter().map(|width| off(*width).1.min(1.0)).sum::<f64>();
        if one >= ONE_STEP && whole >= WHOLE_STEPS && best.is_none_or(|(least, ..)| spread < least) {
            best = Some((spread, step, power));
        }
    }
    best.map(|(_, step, power)| (step, power))
}
