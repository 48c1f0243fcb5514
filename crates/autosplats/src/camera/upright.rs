//! Which way up a cloud is that does not say so.
//!
//! # How it works
//! A body stands on a flat end. An end is flat if the points in a thin slab there spread over much of what is seen of
//! the body along that axis, and spread no less in a thinner slab. The slab's convex hull finds feet and open rims, the
//! cells that it fills find closed bases. The two are multiplied, because three points that touch a plane by chance
//! have a wide hull and fill nothing. A round end spreads in proportion to the thickness of the slab, so its flatness
//! is 0. Points much flatter than wide, in one layer, are a scene seen from above or from a sensor. Their ground is
//! below the rest.

use autosplats_cloud::{Axes, Crs, PointCloud, Unit};
use glam::{DVec2, DVec3};

use super::body::{main_body, samples};

/// Points in the sample.
const GUESS_SAMPLES: usize = 1 << 15;
/// Radii of the core of the points within which all points tell the shape; see [`main_body`]. Sweeps are flat only as a
/// whole.
const BODY_REACH: f64 = 2.0;
/// Fewer points have no shape beyond their extent.
const MIN_SHAPE_POINTS: usize = 64;
/// Fraction of the points at an end that may stick out of it.
const STICKING_OUT_SHARE: f64 = 1e-3;
/// Thickness of the slabs at an end, each twice that of the one before, as fractions of the extent along the axis.
const SLABS: [f64; 4] = [0.005, 0.01, 0.02, 0.04];
/// Cells along the longest side of what is seen along an axis; fewer with few points.
const MAX_CELLS: usize = 48;
/// Points per cell, on average, of a square seen along an axis.
const POINTS_PER_CELL: f64 = 12.0;
/// Factor on the flatness of an end on which the body would topple.
const TOPPLING: f64 = 0.5;

/// Least difference between the flatness of an end and of the opposite one for the body to stand on it, whatever its
/// proportions.
const SURE_FLATNESS: f64 = 0.5;
/// Least difference for the body to stand on it if nothing else is known. Bodies without a flat end reach 0.02.
const MIN_FLATNESS: f64 = 0.02;
/// Factor on the flatness of ends on which a body stands with Y or Z up. An L, as a wall and its pavement, has two.
const CUSTOMARY: f64 = 1.2;
/// A body that can stand on both ends: the less flat end has at least these shares of the hull and of the flatness of
/// the flatter one, and consists of feet. An example is a table on its legs.
const FEET_HULL_SHARE: f64 = 0.6;
const FEET_FLATNESS_SHARE: f64 = 0.08;
/// Least height over length of such a body. In flatter scenes, places where walls end look like feet.
const MIN_FEET_HEIGHT: f64 = 0.25;
/// Feet fill at most this share of the length of an outline as wide as they are apart. Rims fill more.
const MAX_FEET_OUTLINE: f64 = 0.5;

/// A scene's height over its width, the middle one of the extents, if nothing else is known of its shape.
const MAX_SHEET_HEIGHT: f64 = 0.15;
/// A scene's height over its length, and over its width, if it is in one layer.
const MAX_LAYER_HEIGHTS: [f64; 2] = [0.4, 0.6];
/// Least share of what is seen along the axis in which the points are in one layer.
const MIN_LAYER_SHARE: f64 = 0.5;
/// Height of a layer over the height of the scene.
const MAX_LAYER_SHARE: f64 = 0.34;
/// Height over width of a room or a storey, with a floor and a ceiling.
const MAX_STOREY_HEIGHT: f64 = 0.65;
/// Least spread of the points in the thickest slab at floor and ceiling.
const MIN_STOREY_SPREAD: f64 = 0.3;
/// Evidence below this does not turn a scene upside down.
const MIN_REVERSAL: f64 = 0.03;

/// The axes that a cloud states, or else a guess from its shape. Clouds with an origin other than zero or a coordinate
/// system have Z up. Flat scenes have their least extent up, and bodies with one flat end stand on it. All others have
/// Y up.
///
/// # Examples
///
/// ```
/// use autosplats::{cloud::{Axes, PointCloud, glam::DVec3}, guess_axes};
///
/// let floor = (0..100).map(|i| [(i % 10) as f32, (i / 10) as f32, 0.0]).collect();
/// assert_eq!(guess_axes(&PointCloud::new(DVec3::ZERO, floor)), Axes::ZUp);
/// ```
pub fn guess_axes(cloud: &PointCloud) -> Axes {
    cloud.axes().unwrap_or_else(|| {
        let Crs { epsg, wkt, unit, .. } = cloud.crs();
        if cloud.origin() != DVec3::ZERO || epsg.is_some() || wkt.is_some() || *unit == Some(Unit::Degree) {
            return Axes::ZUp;
        }
        let (points, ranges) = main_body(samples(cloud, DVec3::AXES, GUESS_SAMPLES), BODY_REACH);
        upright(&points, ranges)
    })
}

/// Axes whose up direction is along an axis by number, or against it.
fn axes_of(axis: usize, against: bool) -> Axes {
    match (axis, against) {
        (0, false) => Axes::XUp,
        (0, true) => Axes::XDown,
        (1, false) => Axes::YUp,
        (1, true) => Axes::YDown,
        (_, false) => Axes::ZUp,
        (_, true) => Axes::ZDown,
    }
}

fn upright(points: &[DVec3], ranges: [[f64; 2]; 3]) -> Axes {
    let extent = ranges.map(|[low, high]| high - low);
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| extent[a].total_cmp(&extent[b]));
    let [least, width, length] = order.map(|axis| extent[axis]);
    let flattest = order[0];
    if points.len() < MIN_SHAPE_POINTS {
        return if least < MAX_SHEET_HEIGHT * width { axes_of(flattest, false) } else { Axes::YUp };
    }
    let silhouettes = [0, 1, 2].map(|axis| Silhouette::new(points, ranges, axis));
    let ends = silhouettes.each_ref().map(|silhouette| [1.0, -1.0].map(|up| silhouette.end(points, up)));
    let (axis, against, flatness) = (0..3)
        .flat_map(|axis| [(axis, false), (axis, true)])
        .map(|(axis, against)| {
            let [down, up] = if against { [1, 0] } else { [0, 1] };
            let flatness = ends[axis][down].flatness - ends[axis][up].flatness;
            (axis, against, if axis > 0 && !against { CUSTOMARY * flatness } else { flatness })
        })
        .fold((1, false, f64::NEG_INFINITY), |best, end| if end.2 > best.2 { end } else { best });
    let [low, high] = &ends[axis];
    let [feet, other] = if low.flatness < high.flatness { [low, high] } else { [high, low] };
    let stands_on_both = extent[axis] > MIN_FEET_HEIGHT * length
        && feet.are_feet
        && feet.hull > FEET_HULL_SHARE * other.hull
        && feet.flatness > FEET_FLATNESS_SHARE * other.flatness;
    let standing = axes_of(axis, against && !stands_on_both);
    if flatness > SURE_FLATNESS {
        return standing;
    }
    let layers = silhouettes[flattest].layers(points);
    let [low, high] = &ends[flattest];
    let is_layer =
        least < MAX_LAYER_HEIGHTS[0] * length && least < MAX_LAYER_HEIGHTS[1] * width && layers.share > MIN_LAYER_SHARE;
    let low_middle = low_middle(points, flattest);
    if least < MAX_SHEET_HEIGHT * width || is_layer {
        let evidence = low_middle + layers.rise + 0.5 * (low.flatness - high.flatness);
        return axes_of(flattest, evidence < -MIN_REVERSAL);
    }
    if least < MAX_STOREY_HEIGHT * width && low.spread.min(high.spread) > MIN_STOREY_SPREAD {
        return axes_of(flattest, low_middle < -MIN_REVERSAL);
    }
    if flatness > MIN_FLATNESS { standing } else { Axes::YUp }
}

/// How much nearer half of the points are to the low end along `axis` than to the high one: -0.5 to 0.5.
fn low_middle(points: &[DVec3], axis: usize) -> f64 {
    let mut along: Vec<f64> = points.iter().map(|p| p[axis]).collect();
    along.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| along[(share * (along.len() - 1) as f64) as usize];
    let [low, middle, high] = [0.01, 0.5, 0.99].map(at);
    if high > low { 0.5 - (middle - low) / (high - low) } else { 0.0 }
}

/// What is seen of the points along an axis.
struct Silhouette {
    axis: usize,
    extent: f64,
    /// Area of the convex hull.
    hull: f64,
    middle: DVec2,
    low: DVec2,
    cell: f64,
    side: usize,
    /// Number of cells with points.
    filled: f64,
}

/// One end of the points along an axis.
struct End {
    /// 0 of round ends to 1 of ends as wide as all that is seen.
    flatness: f64,
    /// Share of the hull within a thin slab.
    hull: f64,
    /// Whether the points within that slab are few for how far they are apart.
    are_feet: bool,
    /// Geometric mean of the shares of the hull and of the cells within the thickest slab.
    spread: f64,
}

/// Layers of points along an axis.
struct Layers {
    /// Share of what is seen along the axis in which the points are in one layer.
    share: f64,
    /// How much rougher the highest points are than the lowest, from cell to cell: -0.5 to 0.5.
    rise: f64,
}

impl Silhouette {
    fn new(points: &[DVec3], ranges: [[f64; 2]; 3], axis: usize) -> Self {
        let [across, over] = [(axis + 1) % 3, (axis + 2) % 3].map(|other| ranges[other]);
        let longest = (across[1] - across[0]).max(over[1] - over[0]);
        let side = ((points.len() as f64 / POINTS_PER_CELL).sqrt() as usize).clamp(1, MAX_CELLS);
        let middle = points.iter().map(|&p| flat(p, axis)).sum::<DVec2>() / points.len() as f64;
        let mut silhouette = Self {
            axis,
            extent: ranges[axis][1] - ranges[axis][0],
            hull: hull_area(points.iter().map(|&p| flat(p, axis)).collect()),
            middle,
            low: DVec2::new(across[0], over[0]),
            cell: longest / side as f64,
            side,
            filled: 0.0,
        };
        silhouette.filled = silhouette.count_cells(points.iter());
        silhouette
    }

    fn cell_of(&self, p: DVec3) -> usize {
        let [x, y] =
            ((flat(p, self.axis) - self.low) / self.cell).to_array().map(|at| (at as usize).min(self.side - 1));
        y * self.side + x
    }

    fn count_cells<'a>(&self, points: impl Iterator<Item = &'a DVec3>) -> f64 {
        let mut filled = vec![false; self.side * self.side];
        points.for_each(|&p| filled[self.cell_of(p)] = true);
        filled.iter().filter(|&&filled| filled).count() as f64
    }

    /// The lower end if `up` is 1, the upper one if it is -1.
    fn end(&self, points: &[DVec3], up: f64) -> End {
        let height = |p: &DVec3| up * p[self.axis];
        let mut heights: Vec<f64> = points.iter().map(height).collect();
        let sticking_out = (STICKING_OUT_SHARE * points.len() as f64) as usize;
        let ground = *heights.select_nth_unstable_by(sticking_out.max(2), f64::total_cmp).1;
        let mut spreads = [0.0; SLABS.len()];
        let mut hulls = [0.0; SLABS.len()];
        let mut are_feet = [false; SLABS.len()];
        let mut is_stable = false;
        for (((spread, hull), are_feet), slab) in spreads.iter_mut().zip(&mut hulls).zip(&mut are_feet).zip(SLABS) {
            let slab: Vec<DVec3> =
                points.iter().filter(|p| height(p) <= ground + slab * self.extent).copied().collect();
            let mut flattened: Vec<DVec2> = slab.iter().map(|&p| flat(p, self.axis)).collect();
            let area = hull_area(flattened.clone());
            *hull = area / self.hull.max(f64::MIN_POSITIVE);
            let cells = self.count_cells(slab.iter());
            *spread = (*hull * cells / self.filled).sqrt();
            *are_feet = cells < MAX_FEET_OUTLINE * 4.0 * area.sqrt() / self.cell;
            flattened.push(self.middle);
            is_stable = hull_area(flattened) <= area * (1.0 + 1e-9);
        }
        let growth = spreads.windows(2).map(|pair| (2.0 * pair[0] - pair[1]).max(0.0));
        let flatness = growth.sum::<f64>() / (SLABS.len() - 1) as f64;
        let flatness = if is_stable { flatness } else { TOPPLING * flatness };
        End { flatness, hull: hulls[1], are_feet: are_feet[1], spread: spreads[SLABS.len() - 1] }
    }

    fn layers(&self, points: &[DVec3]) -> Layers {
        let mut columns: Vec<(usize, f64)> = points.iter().map(|&p| (self.cell_of(p), p[self.axis])).collect();
        columns.sort_unstable_by(|(a, low), (b, high)| a.cmp(b).then(low.total_cmp(high)));
        let mut single = 0.0;
        let mut ends = vec![[f64::NAN; 2]; self.side * self.side];
        for column in columns.chunk_by(|(a, _), (b, _)| a == b) {
            let [(cell, low), (_, high)] = [column[0], column[column.len() - 1]];
            ends[cell] = [low, high];
            if high - low < MAX_LAYER_SHARE * self.extent {
                single += 1.0;
            }
        }
        // Steps between neighbouring cells that both have points.
        let steps = |end: usize| {
            let step = |cell: usize, other: usize| Some((ends[cell][end] - ends.get(other)?[end]).abs());
            let of_cell = |cell| [step(cell, cell + 1), step(cell, cell + self.side)];
            (0..ends.len()).flat_map(of_cell).flatten().filter(|step| step.is_finite()).sum::<f64>()
        };
        let [low, high] = [0, 1].map(steps);
        let area = self.filled * self.cell * self.cell;
        let covered = if self.hull > 0.0 { (area / self.hull).min(1.0) } else { 0.0 };
        let rise = if low + high > 0.0 { high / (low + high) - 0.5 } else { 0.0 };
        Layers { share: covered * single / self.filled, rise }
    }
}

/// A place seen along an axis.
fn flat(p: DVec3, axis: usize) -> DVec2 {
    DVec2::new(p[(axis + 1) % 3], p[(axis + 2) % 3])
}

/// Area of the convex hull of some places.
fn hull_area(mut places: Vec<DVec2>) -> f64 {
    places.sort_unstable_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let mut hull: Vec<DVec2> = Vec::new();
    let mut half = |places: &mut dyn Iterator<Item = &DVec2>| {
        let start = hull.len();
        for &place in places {
            while let [.., a, b] = hull[start..]
                && (b - a).perp_dot(place - a) <= 0.0
            {
                hull.pop();
            }
            hull.push(place);
        }
        hull.pop();
    };
    half(&mut places.iter());
    half(&mut places.iter().rev());
    let next = hull.iter().cycle().skip(1);
    0.5 * hull.iter().zip(next).map(|(a, b)| a.perp_dot(*b)).sum::<f64>().abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hulls_have_their_area() {
        let square = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0], [1.0, 1.0], [1.0, 0.0]];
        assert_eq!(hull_area(square.map(DVec2::from).to_vec()), 4.0, "a square and places in it");
        for few in [&square[..0], &square[..1], &square[..2], &[[1.0, 1.0]; 5]] {
            assert_eq!(hull_area(few.iter().copied().map(DVec2::from).collect()), 0.0, "{few:?}");
        }
    }

    #[test]
    fn round_ends_are_not_flat_and_cut_ones_are() {
        let ball = |i: usize| {
            let z = 1.0 - (i as f64 + 0.5) / 10_000.0;
            DVec2::from_angle(i as f64 * 2.399_963).extend(0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z
        };
        let flatness = |cut: f64| {
            let (points, ranges) = main_body((0..20_000).map(ball).filter(|p| p.z > cut).collect(), BODY_REACH);
            Silhouette::new(&points, ranges, 2).end(&points, 1.0).flatness
        };
        assert!(flatness(-2.0) < 0.01, "a ball: {}", flatness(-2.0));
        assert!(flatness(0.0) > 0.3, "half a ball, open: {}", flatness(0.0));
    }
}
