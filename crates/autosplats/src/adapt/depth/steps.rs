//! Depths in coarse steps.
//!
//! # How it works
//! Depths in steps take few values, while coordinates along the sensor's other axes take many. The gaps between those
//! values follow a power of depth: 2 if disparities are whole numbers, 0 if depths are.

use glam::DVec3;

use super::Law;

/// Fewest distinct depths that give a law.
const LEAST_VALUES: usize = 8;
/// Fewest points per distinct depth.
const POINTS_PER_VALUE: usize = 6;
/// Fewest values along each other axis per depth value. Rounded coordinates and grids have fewer.
const OTHER_VALUES: usize = 4;
/// Least width of a step, in roundings of coordinates.
const LEAST_STEP: f64 = 8.0;
/// Fewest points of equal depth that are tested for lying on a line.
const MIN_EQUAL_DEPTH_POINTS: usize = 8;
/// Candidate powers of depth for the steps: of disparities, of something in between, of depths.
const POWERS: [i32; 3] = [2, 1, 0];
/// Largest deviation of a gap from a whole number of steps, in steps.
const MAX_STEP_MISFIT: f64 = 0.25;
/// Least share of the gaps that are one step wide.
const MIN_ONE_STEP_SHARE: f64 = 0.6;
/// Least share of the gaps that are a whole number of steps wide.
const MIN_WHOLE_STEPS_SHARE: f64 = 0.75;

/// Standard deviation of a depth, in steps: 1/√3. Rounding alone gives half as much. But neighbours are rounded alike,
/// so fits average out less than with independent errors, and depths between two steps toggle. With 1/√12 bodies are
/// lumpy and walls crazed; with √3/2 folds of cloth vanish. The value agrees with Nguyen, Izadi, Lovell: *Modeling
/// Kinect Sensor Noise for Improved 3D Reconstruction and Tracking*, 2012.
const STEP_ERROR: f64 = 0.577_350_269_189_625_8;

/// The law of a sensor's steps. `points` are in the sensor's axes, depth last; `rounding` is that of coordinates.
pub(super) fn law(points: &[DVec3], rounding: f64) -> Option<Law> {
    let values = distinct(points.iter().map(|point| point.z).filter(|depth| *depth > rounding), rounding);
    if values.len() < LEAST_VALUES || values.len() * POINTS_PER_VALUE > points.len() {
        return None;
    }
    let (step, power) = steps(&values).filter(|(step, power)| step * values[0].powi(*power) > LEAST_STEP * rounding)?;
    // Checked last, as it sorts twice more.
    let others = [0, 1].map(|axis| distinct(points.iter().map(|point| point[axis]), rounding).len());
    let alone = others.iter().all(|other| *other >= OTHER_VALUES * values.len()) && fill_areas(points, rounding);
    alone.then_some(Law { factor: STEP_ERROR * step, power })
}

/// Whether points of equal depth are spread over the picture. When a level camera sees a floor, each image row has one
/// depth. Depths of image rows follow the law of steps without any noise.
fn fill_areas(points: &[DVec3], rounding: f64) -> bool {
    let mut sorted: Vec<[f64; 3]> =
        points.iter().map(|point| [point.z, point.x / point.z, point.y / point.z]).collect();
    sorted.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    let [mut areas, mut all] = [0, 0];
    let mut along = Vec::new();
    for alike in sorted.chunk_by(|a, b| b[0] - a[0] <= rounding).filter(|alike| alike.len() >= MIN_EQUAL_DEPTH_POINTS) {
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

/// The sorted values, without those within `rounding` of the next smaller one.
fn distinct(values: impl Iterator<Item = f64>, rounding: f64) -> Vec<f64> {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let mut last = f64::NEG_INFINITY;
    sorted.retain(|value| {
        // Compared with the value just before, so that one value of a continuum is left.
        let is_new = *value - last > rounding;
        last = *value;
        is_new
    });
    sorted
}

/// The width of a step at depth 1 and the power of depth that steps grow with, if the gaps between values follow a law.
fn steps(values: &[f64]) -> Option<(f64, i32)> {
    let mut best: Option<(f64, f64, i32)> = None;
    for power in POWERS {
        // For disparities one step apart, the gap of two depths is proportional to their product.
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
        let one = share(&|steps, off| steps == 1.0 && off <= MAX_STEP_MISFIT);
        let whole = share(&|_, off| off <= MAX_STEP_MISFIT);
        let spread = widths.iter().map(|width| off(*width).1.min(1.0)).sum::<f64>();
        if one >= MIN_ONE_STEP_SHARE && whole >= MIN_WHOLE_STEPS_SHARE && best.is_none_or(|(least, ..)| spread < least)
        {
            best = Some((spread, step, power));
        }
    }
    best.map(|(_, step, power)| (step, power))
}
