//! Noise of disparities: the same in inverse depth everywhere.
//!
//! # How it works
//! In a camera's picture a plane is a linear function in inverse depth, too. So the picture is cut into square windows,
//! a plane is fitted to each, and the residuals are sorted by depth. In each range of depths the flattest windows show
//! noise, the others structure. A residual that is the same in inverse depth from near to far is noise of disparities.
//! In inverse depth, the constant depth error of time of flight falls with the square of depth. Structure seen through
//! a fixed angle falls at least with depth.

use glam::DVec3;

use super::{Law, MAX_HALF_FOV_TANGENT};

/// Expected points in a full window. A Kinect's picture is sampled at every fourth to sixth point. Windows are then 20
/// pixels wide, twice as wide as those that the Kinect matches.
const WINDOW_POINTS: f64 = 96.0;
/// Least filling of a window, as a share of [`WINDOW_POINTS`].
const LEAST_FULL: f64 = 0.5;
/// Ranges of depth, with equally many windows each.
const RANGES: usize = 6;
/// Fewest windows per range.
const LEAST_WINDOWS: usize = 24;
/// Quantile of a range's windows that is the noise.
const WINDOW_NOISE_QUANTILE: f64 = 0.2;
/// Least ratio of the median depths of the farthest and the nearest range.
const MIN_DEPTH_RATIO: f64 = 2.0;
/// Largest power of depth, up or down, that noise of inverse depths may follow.
const MAX_NOISE_POWER: f64 = 0.5;
/// Largest deviation of ranges from such a power, as a standard deviation of logarithms.
const MAX_POWER_MISFIT: f64 = 0.3;
/// Least ratio of noise to rounding.
const LEAST_NOISE: f64 = 8.0;
/// Ratio of noise to what windows show of it. The slope of a window's plane absorbs a part.
const NOISE_OVER_RESIDUAL: f64 = 1.25;
/// Cells along the longer side of the picture, for measuring how much of the picture is filled.
const FILL_CELLS: f64 = 128.0;

/// Sums over a window's points, about its middle: of 1, u, v, d, and of the products.
type Sums = [f64; 10];

/// The law of a camera's noise. `points` are in the camera's axes, depth last; `rounding` is that of coordinates.
pub(super) fn law(mut points: Vec<DVec3>, rounding: f64) -> Option<Law> {
    points.retain_mut(|point| {
        let inverse = 1.0 / point.z;
        let is_seen = point.z > rounding;
        *point = DVec3::new(point.x * inverse, point.y * inverse, inverse);
        is_seen && point.x.abs() <= MAX_HALF_FOV_TANGENT && point.y.abs() <= MAX_HALF_FOV_TANGENT
    });
    let windows = windows(&points);
    let len = windows.len() / RANGES;
    if len < LEAST_WINDOWS {
        return None;
    }
    // Per range: logarithms of depth, and of the noise of inverse depth.
    let ranges: Vec<[f64; 2]> = windows
        .chunks_exact(len)
        .take(RANGES)
        .map(|range| {
            let mut noise: Vec<f64> = range.iter().map(|window| window.noise).collect();
            let at = (WINDOW_NOISE_QUANTILE * len as f64) as usize;
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
    let factor = NOISE_OVER_RESIDUAL * noise.exp();
    let is_law = ranges[RANGES - 1][0].exp() >= MIN_DEPTH_RATIO * nearest
        && slope.abs() <= MAX_NOISE_POWER
        && off <= MAX_POWER_MISFIT
        && factor * nearest * nearest > LEAST_NOISE * rounding;
    is_law.then_some(Law { factor, power: 2 })
}

/// Residual of a window's plane.
struct Window {
    inverse_depth: f64,
    /// Standard deviation of inverse depths.
    noise: f64,
}

/// The filled windows of a picture, nearest first.
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
    let side = longer / FILL_CELLS;
    let columns = FILL_CELLS as usize + 1;
    let mut filled = vec![false; columns * columns];
    for point in on_picture {
        let [column, row] = cell(side, point);
        filled[row * columns + column] = true;
    }
    let area = filled.iter().filter(|filled| **filled).count() as f64 * side * side;
    // At least as large as these cells, which bounds the number of windows.
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
    // A residual of 0 has no logarithm.
    Some(Window { inverse_depth: d, noise: rest.max(0.0).sqrt().max(f64::MIN_POSITIVE) })
}
