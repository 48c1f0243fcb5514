//! Noise of disparities: the same in inverse depth everywhere.
//!
//! # How it works
//! In a camera's picture a plane is a linear function in inverse depth, too. So the picture is cut into square windows, a
//! plane is fitted to each, and what it leaves over is sorted by depth. The flattest windows of each range of depths show
//! noise, the others structure. If that is as much in inverse depth from near to far, it is noise of disparities: the
//! same error of a depth, as time of flight has it, falls with its square, and structure seen through an angle at least with depth.

use glam::DVec3;

use super::{Law, WIDEST};

/// Points in a full window, about. Of a Kinect's picture every fourth to sixth point is taken, and windows are 20 pixels wide,
/// twice as wide as those that it matches.
const WINDOW_POINTS: f64 = 96.0;
/// Share of them without which a window says nothing.
const LEAST_FULL: f64 = 0.5;
/// Ranges of depth, with as many windows in each.
const RANGES: usize = 6;
/// Windows in each, at least.
const LEAST_WINDOWS: usize = 24;
/// The noise of a range is this quantile of its windows.
const QUANTILE: f64 = 0.2;
/// Median depths of the farthest and the nearest range are at least so far apart, far over near.
const APART: f64 = 2.0;
/// Most power of depth that the noise of inverse depths may grow or fall with, and how far ranges may be off that, as
/// standard deviation of logarithms.
const STEEPEST: f64 = 0.5;
const TIGHT: f64 = 0.3;
/// Noise over rounding, at least.
const LEAST_NOISE: f64 = 8.0;
/// Noise over what windows show of it: they take part of it for the slope of their plane.
const UNSEEN: f64 = 1.25;
/// Cells along the longer side of the picture that tell how much of it is filled.
const CELLS: f64 = 128.0;

/// Sums over a window's points, about its middle: of 1, u, v, d, and of the products.
type Sums = [f64; 10];

/// The law of a camera's noise, by points in its own axes, depth last.
pub(super) fn law(mut points: Vec<DVec3>, rounding: f64) -> Option<Law> {
    points.retain_mut(|point| {
        let inverse = 1.0 / point.z;
        let is_seen = point.z > rounding;
        *point = DVec3::new(point.x * inverse, point.y * inverse, inverse);
        is_seen && point.x.abs() <= WIDEST && point.y.abs() <= WIDEST
    });
    let windows = windows(&points);
    let len = windows.len() / RANGES;
    if len < LEAST_WINDOWS {
        return None;
    }
    // Of each range: logarithms of depth, and of the noise of inverse depth.
    let ranges: Vec<[f64; 2]> = windows
        .chunks_exact(len)
        .take(RANGES)
        .map(|range| {
            let mut noise: Vec<f64> = range.iter().map(|window| window.noise).collect();
            let at = (QUANTILE * len as f64) as usize;
            [-range[len / 2].inverse_depth.ln(), noise.select_nth_unstable_by(at, f64::total_cmp).1.ln()]
        })
        .collect();
    let [depth, noise] = [0, 1].map(|at| ranges.iter().map(|range| range[at]).sum::<f64>() / RANGES as f64);
    let [mut dd, mut dn, mut nn] = [0.0; 3];
    for [depth_of, noise_of] in &ranges {
        let [d, n] = [depth_of - depth, noise_of - noise];
        (dd, dn, nn) = (dd + d * d, dn + d * n, nn + n * n);
    }
    let slope = dn / dd;
    let off = ((nn - slope * dn).max(0.0) / RANGES as f64).sqrt();
    let nearest = ranges[0][0].exp();
    let factor = UNSEEN * noise.exp();
    let is_law = ranges[RANGES - 1][0].exp() >= APART * nearest
        && slope.abs() <= STEEPEST
        && off <= TIGHT
        && factor * nearest * nearest > LEAST_NOISE * rounding;
    is_law.then_some(Law { factor, power: 2 })
}

/// What is left of the plane of a window.
struct Window {
    inverse_depth: f64,
    /// Standard deviation of inverse depths.
    noise: f64,
}

/// The windows of a picture that are filled, nearest first.
fn windows(on_picture: &[DVec3]) -> Vec<Window> {
    let mut least = [f64::INFINITY; 2];
    let mut most = [f64::NEG_INFINITY; 2];
    for point in on_picture {
        for axis in 0..2 {
            least[axis] = least[axis].min(point[axis]);
            most[axis] = most[axis].max(point[axis]);
        }
    }
    let longer = (most[0] - least[0]).max(most[1] - least[1]);
    if !(longer > 0.0) {
        return Vec::new();
    }
    let cell = |side: f64, point: &DVec3| [0, 1].map(|axis| ((point[axis] - least[axis]) / side) as usize);
    let side = longer / CELLS;
    let columns = CELLS as usize + 1;
    let mut filled = vec![false; columns * columns];
    for point in on_picture {
        let [column, row] = cell(side, point);
        filled[row * columns + column] = true;
    }
    let area = filled.iter().filter(|filled| **filled).count() as f64 * side * side;
    // No smaller than such cells, which bounds their number.
    let side = (area * WINDOW_POINTS / on_picture.len() as f64).sqrt().max(side);
    let columns = (longer / side) as usize + 1;
    let mut sums: Vec<Sums> = vec![[0.0; 10]; columns * columns];
    for point in on_picture {
        let [column, row] = cell(side, point);
        let u = (point[0] - least[0]) / side - column as f64 - 0.5;
        let v = (point[1] - least[1]) / side - row as f64 - 0.5;
        let d = point[2];
        let terms = [1.0, u, v, d, u * u, u * v, v * v, u * d, v * d, d * d];
        sums[row * columns + column].iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
    }
    let mut windows: Vec<Window> = sums.iter().filter_map(plane).collect();
    windows.sort_unstable_by(|a, b| b.inverse_depth.total_cmp(&a.inverse_depth).then(a.noise.total_cmp(&b.noise)));
    windows
}

/// Fits the plane of a window.
fn plane(&[count, u, v, d, uu, uv, vv, ud, vd, dd]: &Sums) -> Option<Window> {
    if count < LEAST_FULL * WINDOW_POINTS {
        return None;
    }
    let [u, v, d] = [u, v, d].map(|sum| sum / count);
    let [uu, uv, vv] = [uu / count - u * u, uv / count - u * v, vv / count - v * v];
    let [ud, vd, dd] = [ud / count - u * d, vd / count - v * d, dd / count - d * d];
    let determinant = uu * vv - uv * uv;
    // A line of points has no plane.
    if !(determinant > 1e-3 * (uu + vv) * (uu + vv)) {
        return None;
    }
    let [slope_u, slope_v] = [(vv * ud - uv * vd) / determinant, (uu * vd - uv * ud) / determinant];
    let rest = dd - slope_u * ud - slope_v * vd;
    // What is rounding has no logarithm to speak of.
    Some(Window { inverse_depth: d, noise: rest.max(0.0).sqrt().max(f64::MIN_POSITIVE) })
}
