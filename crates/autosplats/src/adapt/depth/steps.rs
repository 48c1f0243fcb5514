//! Depths in coarse steps.
//!
//! # How it works
//! Depths in steps have few different values, while there are many along the other axes of the sensor; and the gaps between
//! those values follow a power of depth: 2 where disparities are whole numbers, 0 where depths are.

use glam::DVec3;

use super::Law;

/// Fewer steps have no law.
const LEAST_VALUES: usize = 8;
/// Points per value, at least.
const POINTS_PER_VALUE: usize = 6;
/// Values along other axes per value along the sensor's: coordinates that are all rounded, and grids, have no such axis.
const OTHER_VALUES: usize = 4;
/// Steps are at least this many times as wide as coordinates are rounded.
const LEAST_STEP: f64 = 8.0;
/// Points of a depth that tell whether they are a line.
const LEAST_ALIKE: usize = 8;
/// Powers of depth that steps may grow with: of disparities, of anything between, of depths.
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
const STEP_ERROR: f64 = 0.577_350_269_189_625_8;

/// The law of a sensor's steps, by points in its own axes, depth last.
pub(super) fn law(points: &[DVec3], rounding: f64) -> Option<Law> {
    let values = distinct(points.iter().map(|point| point.z).filter(|depth| *depth > rounding), rounding);
    if values.len() < LEAST_VALUES || values.len() * POINTS_PER_VALUE > points.len() {
        return None;
    }
    let (step, power) = steps(&values).filter(|(step, power)| step * values[0].powi(*power) > LEAST_STEP * rounding)?;
    // Last, because it sorts twice more.
    let others = [0, 1].map(|axis| distinct(points.iter().map(|point| point[axis]), rounding).len());
    let alone = others.iter().all(|other| *other >= OTHER_VALUES * values.len()) && fill_areas(points, rounding);
    alone.then_some(Law { factor: STEP_ERROR * step, power })
}

/// Whether points of a depth are spread over the picture. All of a row has one depth where a camera is held level over a floor,
/// and depths of rows have the same law as steps, though there is no noise at all.
fn fill_areas(points: &[DVec3], rounding: f64) -> bool {
    let mut sorted: Vec<[f64; 3]> =
        points.iter().map(|point| [point.z, point.x / point.z, point.y / point.z]).collect();
    sorted.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    let [mut areas, mut all] = [0, 0];
    let mut along = Vec::new();
    for alike in sorted.chunk_by(|a, b| b[0] - a[0] <= rounding).filter(|alike| alike.len() >= LEAST_ALIKE) {
        let is_line = [1, 2].into_iter().any(|axis| {
            along.clear();
            along.extend(alike.iter().map(|point| point[axis]));
            along.sort_unstable_by(f64::total_cmp);
            let longest = along.chunk_by(|a, b| b - a <= rounding / alike[0][0]).map(<[f64]>::len).max();
            longest.is_some_and(|longest| 2 * longest >= alike.len())
        });
        areas += usize::from(!is_line);
        all += 1;
    }
    2 * areas > all
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
fn steps(values: &[f64]) -> Option<(f64, i32)> {
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
