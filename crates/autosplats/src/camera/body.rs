//! The main body of a cloud: what a view of the whole has to show.

use std::collections::BTreeMap;

use autosplats_cloud::PointCloud;
use glam::DVec3;

/// Fraction of the points at each end of each axis that may be outliers.
pub(super) const OUTLIER_SHARE: f64 = 0.005;
/// Trimmed ends are kept if they reach no further than this fraction of the rest's extent.
const KEPT_EXTENT_SHARE: f64 = 0.2;

/// Share of the points that are nearest to the middle, within the core radius.
const CORE_SHARE: f64 = 0.75;
/// Least share of the points in a connected part for the part to be in the main body, however far away.
const MIN_PART_SHARE: f64 = 0.02;
/// Side of the cells that connect points, in core radii.
const CELL_CORE_RADII: f64 = 1.0 / 6.0;
/// Least side of these cells, in core radii over the square root of the number of points. This is about twice the
/// distance between points on a surface.
const CELL_POINT_DISTANCES: f64 = 8.0;
/// Largest index of a cell.
const MAX_CELL: f64 = 1e9;

/// Finite positions relative to the cloud's origin along `axes`, from at most `most` evenly spaced indices.
pub(super) fn samples(cloud: &PointCloud, axes: [DVec3; 3], most: usize) -> Vec<DVec3> {
    let positions = cloud.positions();
    let step = positions.len().div_ceil(most).max(1);
    let finite = positions.iter().step_by(step).map(|&p| DVec3::from(p.map(f64::from))).filter(|p| p.is_finite());
    finite.map(|p| DVec3::from(axes.map(|axis| axis.dot(p)))).collect()
}

/// The main body of some points, with its range along each axis. Single points further than `reach` core radii from the
/// middle are left out, and then the few outermost along each axis that stick out. A ball filled evenly reaches 1.1
/// core radii, a rod 1.34, a square 1.45.
pub(super) fn main_body(points: Vec<DVec3>, reach: f64) -> (Vec<DVec3>, [[f64; 2]; 3]) {
    let mut points = without_strays(points, reach);
    let ranges = [0, 1, 2].map(|axis| robust_range(&points, axis));
    points.retain(|p| (0..3).all(|i| (ranges[i][0]..=ranges[i][1]).contains(&p[i])));
    (points, ranges)
}

/// Leaves out points that are far from the middle and connected to few others. Structure from motion has such points.
fn without_strays(mut points: Vec<DVec3>, reach: f64) -> Vec<DVec3> {
    let Some(last) = points.len().checked_sub(1) else { return points };
    let quantile = |mut values: Vec<f64>, share: f64| {
        let index = (share * last as f64) as usize;
        *values.select_nth_unstable_by(index, f64::total_cmp).1
    };
    let middle = DVec3::from([0, 1, 2].map(|axis| quantile(points.iter().map(|p| p[axis]).collect(), 0.5)));
    let core = quantile(points.iter().map(|p| p.distance(middle)).collect(), CORE_SHARE);
    let is_far = |p: &DVec3| p.distance(middle) > reach * core;
    if !(core > 0.0) || !points.iter().any(is_far) {
        return points;
    }
    let side = core * CELL_CORE_RADII.max(CELL_POINT_DISTANCES / (points.len() as f64).sqrt());
    let cell_of = |p: &DVec3| ((p - middle) / side).floor().clamp(DVec3::splat(-MAX_CELL), DVec3::splat(MAX_CELL));
    let cells: Vec<[i32; 3]> = points.iter().map(|p| cell_of(p).to_array().map(|index| index as i32)).collect();
    let parts = Parts::of(&cells);
    let least = (MIN_PART_SHARE * points.len() as f64) as usize;
    let mut cells = cells.iter();
    points.retain(|p| {
        let count = cells.next().map_or(0, |cell| parts.size(*cell));
        !is_far(p) || count > least
    });
    points
}

/// Points in connected parts: points are connected if their cells touch.
struct Parts {
    /// The number of each occupied cell.
    numbers: BTreeMap<[i32; 3], usize>,
    /// Another cell of the same part with a lower number, or the cell itself if it is the first.
    first: Vec<usize>,
    /// Points in the part that starts with this cell.
    sizes: Vec<usize>,
}

impl Parts {
    fn of(cells: &[[i32; 3]]) -> Self {
        let mut numbers: BTreeMap<[i32; 3], usize> = cells.iter().map(|&cell| (cell, 0)).collect();
        numbers.values_mut().enumerate().for_each(|(number, value)| *value = number);
        let mut parts = Self { first: (0..numbers.len()).collect(), sizes: vec![0; numbers.len()], numbers };
        for (&[x, y, z], &number) in &parts.numbers {
            // Half of the neighbours, because connections are mutual: all with a lower place in the order.
            for [dx, dy] in [[-1, -1], [-1, 0], [-1, 1], [0, -1], [0, 0]] {
                let end = if [dx, dy] == [0, 0] { -1 } else { 1 };
                for (_, &other) in parts.numbers.range([x + dx, y + dy, z - 1]..=[x + dx, y + dy, z + end]) {
                    let [a, b] = [number, other].map(|cell| start(&mut parts.first, cell));
                    parts.first[a.max(b)] = a.min(b);
                }
            }
        }
        for cell in cells {
            let first = start(&mut parts.first, parts.numbers[cell]);
            parts.sizes[first] += 1;
        }
        for number in 0..parts.first.len() {
            parts.first[number] = start(&mut parts.first, number);
        }
        parts
    }

    /// Number of points in the part of a cell.
    fn size(&self, cell: [i32; 3]) -> usize {
        self.numbers.get(&cell).map_or(0, |&number| self.sizes[self.first[number]])
    }
}

/// The first cell of a cell's part; shortens the way there.
fn start(first: &mut [usize], mut cell: usize) -> usize {
    while first[cell] != cell {
        first[cell] = first[first[cell]];
        cell = first[cell];
    }
    cell
}

/// Range along `axis` without outliers; (0, 0) without points.
pub(super) fn robust_range(samples: &[DVec3], axis: usize) -> [f64; 2] {
    let mut values: Vec<f64> = samples.iter().map(|p| p[axis]).collect();
    values.sort_unstable_by(f64::total_cmp);
    let (Some(&first), Some(&last)) = (values.first(), values.last()) else { return [0.0; 2] };
    let trim = (values.len() as f64 * OUTLIER_SHARE) as usize;
    let [low, high] = [values[trim], values[values.len() - 1 - trim]];
    let margin = KEPT_EXTENT_SHARE * (high - low);
    let nearest = |bound: f64| {
        let inside = values.partition_point(|&v| v < bound);
        values[inside.min(values.len() - 1)]
    };
    let furthest = |bound: f64| values[values.partition_point(|&v| v <= bound).max(1) - 1];
    [
        if first < low - margin { nearest(low - margin) } else { first },
        if last > high + margin { furthest(high + margin) } else { last },
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of points, 1 unit wide, about `middle`.
    fn square(count: usize, middle: DVec3) -> impl Iterator<Item = DVec3> {
        let at = |i: usize, step: f64| (i as f64 * step).fract() - 0.5;
        (0..count).map(move |i| middle + DVec3::new(at(i, 0.754_877_666), at(i, 0.569_840_296), 0.0))
    }

    fn kept(points: impl Iterator<Item = DVec3>) -> Vec<DVec3> {
        without_strays(points.collect(), 1.3)
    }

    #[test]
    fn single_points_far_away_go() {
        let strays =
            || (0..200).map(|i| DVec3::new((f64::from(i) * 0.7).sin(), f64::from(i).cos(), 0.3) * 1.5f64.powi(i));
        let points = kept(square(2000, DVec3::ZERO).chain(strays()));
        assert!(points.iter().all(|p| p.length() < 2.0), "the far ones are gone");
        assert!(points.len() >= 2000, "and nothing else");
    }

    #[test]
    fn parts_stay_however_far_they_are() {
        for apart in [10.0, 1e6] {
            let both = || square(2000, DVec3::ZERO).chain(square(100, DVec3::X * apart));
            assert_eq!(kept(both()).len(), 2100, "a twentieth of the points, {apart} away");
        }
        let rod = (0..500).map(|i| DVec3::Z * (0.01 * f64::from(i)));
        assert_eq!(kept(square(4500, DVec3::ZERO).chain(rod)).len(), 5000, "a mast with few points");
        let thin = (0..30).map(|i| DVec3::Z * (0.5 + f64::from(i)));
        assert!(kept(square(4500, DVec3::ZERO).chain(thin)).len() < 4505, "points that are apart");
    }

    #[test]
    fn few_points_and_points_in_one_place_stay() {
        for count in [0, 1, 2, 7] {
            assert_eq!(kept(square(count, DVec3::ONE)).len(), count);
        }
        assert_eq!(kept((0..50).map(|_| DVec3::ONE)).len(), 50);
        let [low, high] = robust_range(&[DVec3::ONE], 1);
        assert_eq!([low, high, robust_range(&[], 0)[1]], [1.0, 1.0, 0.0]);
    }
}
