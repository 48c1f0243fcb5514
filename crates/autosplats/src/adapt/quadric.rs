//! Quadrics: height fields with six coefficients, fitted to the points of a ball.

use std::ops::RangeInclusive;

use glam::Vec3;
use pulp::Simd;

use super::cells::{COPY_PADDING, Cells, Cluster, Level};
use crate::camera::View;
use crate::fit::eigenvectors;
use crate::search::{LANES, Lanes};
use crate::simd::F32s;

/// Least radius of a ball in cells, where cells are that fine. With more cells, cell borders matter less.
pub(super) const CELLS_PER_RADIUS: f32 = 4.0;
/// Fewest clusters for a fit of six coefficients.
pub(super) const LEAST_CLUSTERS: usize = 12;
/// Fewest clusters for a plane. Through three there always is one.
pub(super) const LEAST_OF_PLANE: usize = 4;
/// Squared distance, in squared radii, up to which a cluster counts in full. The weight falls to 0 at the radius, so
/// that no cluster comes or goes at once.
pub(super) const FULL_WEIGHT_SQUARED_RADII: f32 = 0.5;
/// Ridge weight that pulls curvatures to 0, as a share of all weight. One-sided balls hardly determine curvatures.
pub(super) const RIDGE: f32 = 0.003;
/// Smallest pivot of the elimination, as a share of all weight.
pub(super) const LEAST_PIVOT: f32 = 1e-6;

const _: () = assert!(COPY_PADDING <= LANES, "what is copied over the end of a run has room");

/// Weight of a ball evenly filled with one point per square of its radius.
pub(super) const EVEN_WEIGHT: f32 = 0.5 * std::f32::consts::PI * (1.0 + FULL_WEIGHT_SQUARED_RADII);

/// The cells that may reach into a ball.
pub(super) struct Window<'a> {
    level: &'a Level,
    columns: RangeInclusive<usize>,
    rows: RangeInclusive<usize>,
}

impl<'a> Window<'a> {
    /// The cells for the ball of `radius` around `center` (view space). Takes the coarsest level with at least
    /// `cells_per_radius` cells to a radius, or the finest. `None` if there are no levels.
    #[inline(always)]
    pub(super) fn around(
        cells: &'a Cells,
        center: Vec3,
        radius: f32,
        cells_per_radius: f32,
        view: &View,
    ) -> Option<Self> {
        let [px, py] = view.to_pixel(center);
        let radius_px = radius / view.pixel_size(center.z);
        let mut level = cells.levels.first()?;
        for coarser in &cells.levels[1..] {
            if coarser.side_px as f32 * cells_per_radius <= radius_px {
                level = coarser;
            }
        }
        let side = level.side_px as f32;
        // Casts from float saturate at 0.
        let range = |at: f32, count: usize| {
            let last = (((at + radius_px) / side) as usize).min(count - 1);
            (((at - radius_px) / side) as usize).min(last)..=last
        };
        Some(Self { level, columns: range(px, level.columns), rows: range(py, level.rows.len()) })
    }

    /// Copies the clusters and pads the last group with empty ones. Returns the number of groups of sixteen.
    #[inline(always)]
    fn copy_to(&self, copied: &mut [Vec<f32>; 4]) -> usize {
        let columns = *self.columns.start()..self.columns.end() + 1;
        let mut len = 0;
        for row in &self.level.rows[self.rows.clone()] {
            let run = row.run(columns.clone());
            let end = len + run.len();
            // Copies go in fixed lengths, which may reach beyond the end, as may the last group.
            let needed = (end + LANES).next_multiple_of(LANES);
            if copied[0].len() < needed {
                copied.iter_mut().for_each(|values| values.resize(2 * needed, 0.0));
            }
            row.copy(run, copied, len);
            len = end;
        }
        let groups = len.div_ceil(LANES);
        copied[3][len..groups * LANES].fill(0.0);
        groups
    }

    /// The clusters of each cell.
    #[inline(always)]
    pub(super) fn clusters(&self) -> impl Iterator<Item = impl Iterator<Item = Cluster>> {
        let columns = move |row| self.columns.clone().map(move |column| self.level.clusters([column, row]));
        self.rows.clone().flat_map(columns)
    }
}

/// The clusters within a ball, sixteen to a group for SIMD: positions relative to the centre, in radii, and weights.
/// Lanes without a cluster have weight 0.
#[derive(Debug, Default)]
pub(super) struct Gathered {
    /// X, y, z (view space) and counts of the candidates.
    copied: [Vec<f32>; 4],
    lanes: Vec<[Lanes; 4]>,
    /// Groups of `lanes` in use.
    filled: usize,
    /// Number of clusters within the ball.
    len: usize,
    /// Side of the cells, in ball radii, which is also about the thickness of their slabs.
    side: f32,
}

/// The plane through a ball's clusters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    /// Unit axis of least spread, of either sign.
    pub(super) axis: Vec3,
    /// Variances along the least, middle and largest axes, squared radii.
    pub(super) variances: [f32; 3],
    /// Weighted mean of the clusters relative to the ball's centre, radii.
    pub(super) mean: Vec3,
    /// Sum of the clusters' weights.
    pub(super) weight: f32,
}

impl Plane {
    /// Surface variation λ0/(λ0+λ1+λ2), 0 to 1/3.
    #[inline(always)]
    pub(super) fn curvature(&self) -> f32 {
        let [least, middle, largest] = self.variances;
        let sum = least + middle + largest;
        if sum > 0.0 { least / sum } else { 0.0 }
    }
}

/// The quadric fitted to a ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Quadric {
    /// Unit normal of the surface at the point's place, of either sign.
    pub(super) normal: Vec3,
    /// Distance from the point to the surface along `axis`, world units.
    pub(super) height: f32,
    /// Unit direction of the heights.
    pub(super) axis: Vec3,
    /// Standard deviation of points from the surface, world units.
    pub(super) scatter: f32,
    /// Standard error of the normal's slope, in radians per world unit of noise.
    pub(super) error: f32,
    /// Surface variation λ0/(λ0+λ1+λ2) of the clusters, 0 to 1/3.
    pub(super) curvature: f32,
    /// Radius of the ball, or a value between those of several balls, world units.
    pub(super) radius: f32,
    /// Slopes at the point along the [`tangents`] of the axis; 0 for an upright quadric.
    pub(super) slope: [f32; 2],
    /// Second-order coefficients xx, xy and yy, in radii.
    pub(super) bend: [f32; 3],
}

impl Quadric {
    /// The same surface with heights along its normal at the point, to second order, if the surface is near the point.
    #[inline(always)]
    pub(super) fn upright(&self) -> Self {
        let &Self { normal, axis, bend: [xx, xy, yy], .. } = self;
        let (u, v) = tangents(axis);
        let (p, q) = tangents(normal);
        let [(px, py), (qx, qy)] = [p, q].map(|tangent| (tangent.dot(u), tangent.dot(v)));
        let cos = axis.dot(normal);
        let bend = [
            cos * (xx * px * px + xy * px * py + yy * py * py),
            cos * (2.0 * xx * px * qx + xy * (px * qy + qx * py) + 2.0 * yy * py * qy),
            cos * (xx * qx * qx + xy * qx * qy + yy * qy * qy),
        ];
        Self { height: self.height * cos, axis: normal, slope: [0.0; 2], bend, ..*self }
    }

    /// Interpolates between this upright quadric (`share` 0) and a larger ball's `other` with the same axis (`share`
    /// 1).
    #[inline(always)]
    pub(super) fn towards(&self, other: &Self, share: f32) -> Self {
        let between = |from: f32, to: f32| from + share * (to - from);
        let radius = between(self.radius, other.radius);
        let slope = other.slope.map(|slope| share * slope);
        // Each bend is in radii of its own ball; curvatures in world units are comparable.
        let bend =
            std::array::from_fn(|at| radius * between(self.bend[at] / self.radius, other.bend[at] / other.radius));
        let (u, v) = tangents(self.axis);
        Self {
            normal: (self.axis - u * slope[0] - v * slope[1]).normalize(),
            height: between(self.height, other.height),
            axis: self.axis,
            scatter: between(self.scatter, other.scatter),
            error: between(self.error, other.error),
            curvature: other.curvature,
            radius,
            slope,
            bend,
        }
    }
}

/// Two unit vectors perpendicular to `axis` and to each other, along which slopes are measured.
#[inline(always)]
pub(super) fn tangents(axis: Vec3) -> (Vec3, Vec3) {
    let u = axis.any_orthonormal_vector();
    (u, axis.cross(u))
}

impl Gathered {
    /// Reads the clusters in the ball of `radius` around `center` (view space), and returns their number.
    #[inline(always)]
    pub(super) fn read<S: Simd>(
        &mut self,
        simd: S,
        cells: &Cells,
        center: [f32; 3],
        radius: f32,
        view: &View,
    ) -> usize {
        (self.filled, self.len) = (0, 0);
        let Some(window) = Window::around(cells, center.into(), radius, CELLS_PER_RADIUS, view) else { return 0 };
        let per_radius = 1.0 / radius;
        self.side = window.level.side_px as f32 * view.pixel_size(center[2]) * per_radius;
        let groups = window.copy_to(&mut self.copied);
        if self.lanes.len() < groups {
            self.lanes.resize(groups, [Lanes::default(); 4]);
        }
        // A group of sixteen stays if one cluster is inside, and those outside get weight 0. Compacting them costs more
        // than it saves. Loops are used because the compiler does not inline all closures.
        let [cx, cy, cz] = [F32s::splat(simd, center[0]), F32s::splat(simd, center[1]), F32s::splat(simd, center[2])];
        let (zero, one) = (F32s::splat(simd, 0.0), F32s::splat(simd, 1.0));
        let (per_radius, per_rest) =
            (F32s::splat(simd, per_radius), F32s::splat(simd, 1.0 / (1.0 - FULL_WEIGHT_SQUARED_RADII)));
        let lanes = &mut self.lanes[..groups];
        let [xs, ys, zs, counts] = &self.copied;
        let mut filled = 0;
        let mut inside = Lanes::default();
        for group in 0..groups {
            let into = &mut lanes[filled];
            let mut is_any = false;
            for vector in 0..LANES / S::F32_LANES {
                let at = group * (LANES / S::F32_LANES) + vector;
                let (x, y) = (F32s::load(simd, xs, at), F32s::load(simd, ys, at));
                let (z, count) = (F32s::load(simd, zs, at), F32s::load(simd, counts, at));
                let (x, y, z) = ((x - cx) * per_radius, (y - cy) * per_radius, (z - cz) * per_radius);
                let rest = one - (x * x + y * y + z * z);
                // Padding has count 0, hence weight 0.
                let weight = (rest * per_rest).min(one) * count;
                let is_in = zero.less(weight);
                is_any |= is_in.any();
                is_in.keep(x).store(&mut into[0].0, vector);
                is_in.keep(y).store(&mut into[1].0, vector);
                is_in.keep(z).store(&mut into[2].0, vector);
                is_in.keep(weight).store(&mut into[3].0, vector);
                (F32s::load(simd, &inside.0, vector) + is_in.keep(one)).store(&mut inside.0, vector);
            }
            filled += usize::from(is_any);
        }
        self.filled = filled;
        // Exact: whole numbers far below 2²⁴.
        let [len] = add_lanes(&mut [inside]);
        self.len = len as usize;
        self.len
    }

    /// Sum of the clusters' weights.
    #[inline(always)]
    pub(super) fn weight(&self) -> f32 {
        let mut sums = Lanes::default();
        for [.., weights] in &self.lanes[..self.filled] {
            for lane in 0..LANES {
                sums.0[lane] += weights.0[lane];
            }
        }
        sums.0.iter().sum()
    }

    /// Removes the clusters less than `from` radii from the centre towards `side`. Returns how many are left.
    pub(super) fn keep_beside(&mut self, side: Vec3, from: f32) -> usize {
        for at in 0..self.filled * LANES {
            let [x, y, z, w] = &mut self.lanes[at / LANES];
            let lane = at % LANES;
            if (w.0[lane] > 0.0) && side.dot(Vec3::new(x.0[lane], y.0[lane], z.0[lane])) < from {
                w.0[lane] = 0.0;
                self.len -= 1;
            }
        }
        self.len
    }

    /// Fits the plane through the clusters.
    #[inline(always)]
    pub(super) fn plane<S: Simd>(&self, simd: S) -> Plane {
        let mut lanes = [Lanes::default(); 10];
        for vector in 0..LANES / S::F32_LANES {
            let mut sums = [F32s::splat(simd, 0.0); 10];
            for clusters in &self.lanes[..self.filled] {
                let [x, y, z, w] = load(simd, clusters, vector);
                let (wx, wy, wz) = (w * x, w * y, w * z);
                let terms = [w, wx, wy, wz, wx * x, wx * y, wx * z, wy * y, wy * z, wz * z];
                for term in 0..10 {
                    sums[term] += terms[term];
                }
            }
            store(&sums, vector, &mut lanes);
        }
        let [w, x, y, z, xx, xy, xz, yy, yz, zz] = add_lanes(&mut lanes);
        let share = 1.0 / w;
        let [x, y, z] = [x * share, y * share, z * share];
        let second = [xx * share - x * x, xy * share - x * y, xz * share - x * z, yy * share - y * y];
        let (values, axes) =
            eigenvectors([second[0], second[1], second[2], second[3], yz * share - y * z, zz * share - z * z]);
        let axis = Vec3::from(axes[0]);
        Plane { axis, variances: [values[0].max(0.0), values[1], values[2]], mean: Vec3::new(x, y, z), weight: w }
    }

    /// Fits a quadric with heights along `axis`; `curvature` is stored with the quadric.
    #[inline(always)]
    pub(super) fn quadric<S: Simd>(&self, simd: S, radius: f32, axis: Vec3, curvature: f32) -> Quadric {
        let (u, v) = tangents(axis);
        let splat = |value: f32| F32s::splat(simd, value);
        let (ux, uy, uz) = (splat(u.x), splat(u.y), splat(u.z));
        let (vx, vy, vz) = (splat(v.x), splat(v.y), splat(v.z));
        let (ax, ay, az) = (splat(axis.x), splat(axis.y), splat(axis.z));
        let mut lanes = [Lanes::default(); 22];
        for vector in 0..LANES / S::F32_LANES {
            let mut sums = [splat(0.0); 22];
            for clusters in &self.lanes[..self.filled] {
                let [px, py, pz, w] = load(simd, clusters, vector);
                let x = ux * px + uy * py + uz * pz;
                let y = vx * px + vy * py + vz * pz;
                let h = ax * px + ay * py + az * pz;
                let (xx, xy, yy) = (x * x, x * y, y * y);
                let (wx, wy, wxx, wxy, wyy, wh) = (w * x, w * y, w * xx, w * xy, w * yy, w * h);
                #[rustfmt::skip]
                let terms = [
                    w, wx, wy, wxx, wxy, wyy, wxx * x, wxx * y, wxy * y, wyy * y,
                    wxx * xx, wxx * xy, wxx * yy, wxy * yy, wyy * yy,
                    wh, wh * x, wh * y, wh * xx, wh * xy, wh * yy, wh * h,
                ];
                for term in 0..22 {
                    sums[term] += terms[term];
                }
            }
            store(&sums, vector, &mut lanes);
        }
        #[rustfmt::skip]
        let [w, x, y, xx, xy, yy, xxx, xxy, xyy, yyy, xxxx, xxxy, xxyy, xyyy, yyyy, h, hx, hy, hxx, hxy, hyy, hh] = add_lanes(&mut lanes);
        let ridge = RIDGE * w;
        // Slopes come last: after elimination of the others, their rows hold the slopes' own information.
        let mut rows = [
            [xxxx + ridge, xxxy, xxyy, xx, xxx, xxy, hxx],
            [xxxy, xxyy + ridge, xyyy, xy, xxy, xyy, hxy],
            [xxyy, xyyy, yyyy + ridge, yy, xyy, yyy, hyy],
            [xx, xy, yy, w, x, y, h],
            [xxx, xxy, xyy, x, xx, xy, hx],
            [xxy, xyy, yyy, y, xy, yy, hy],
        ];
        let mut rest = hh;
        for pivot in 0..6 {
            // Never divide by the rounding error that remains of a dependent row.
            let inverse = 1.0 / rows[pivot][pivot].max(LEAST_PIVOT * w);
            rest -= rows[pivot][6] * rows[pivot][6] * inverse;
            for row in pivot + 1..6 {
                let factor = rows[row][pivot] * inverse;
                for column in pivot..7 {
                    rows[row][column] -= factor * rows[pivot][column];
                }
            }
        }
        let pivot = |at: usize| rows[at][at].max(LEAST_PIVOT * w);
        let slope_y = rows[5][6] / pivot(5);
        let slope_x = (rows[4][6] - rows[4][5] * slope_y) / pivot(4);
        let height = (rows[3][6] - rows[3][4] * slope_x - rows[3][5] * slope_y) / pivot(3);
        let known = |row: usize| rows[row][3] * height + rows[row][4] * slope_x + rows[row][5] * slope_y;
        let yy = (rows[2][6] - known(2)) / pivot(2);
        let xy = (rows[1][6] - known(1) - rows[1][2] * yy) / pivot(1);
        let xx = (rows[0][6] - known(0) - rows[0][1] * xy - rows[0][2] * yy) / pivot(0);
        // Trace of the inverse of the 2×2 matrix that remains for the slopes.
        let tilt = rows[4][5] / pivot(4);
        let trace = 1.0 / pivot(4) + (1.0 + tilt * tilt) / pivot(5);
        let len = self.len.max(LEAST_CLUSTERS) as f32;
        // A cluster counts once per point, and its mean scatters less than its points by the root of their number.
        // Where noise is thicker than slabs, slabs cut it: clusters then scatter as points do, but for the part within
        // a slab. Either variance is too large where the other applies, so the lesser is right.
        let squares = rest.max(0.0) / (len - 6.0);
        let variance = squares.min(squares * len / w + self.side * self.side * (1.0 / 12.0));
        Quadric {
            normal: (axis - u * slope_x - v * slope_y).normalize(),
            height: height * radius,
            axis,
            scatter: variance.sqrt() * radius,
            error: trace.sqrt() / radius,
            curvature,
            radius,
            slope: [slope_x, slope_y],
            bend: [xx, xy, yy],
        }
    }
}

/// Positions and weights of the `vector`-th part of a group.
#[inline(always)]
fn load<S: Simd>(simd: S, lanes: &[Lanes; 4], vector: usize) -> [F32s<S>; 4] {
    let [x, y, z, w] = lanes;
    [
        F32s::load(simd, &x.0, vector),
        F32s::load(simd, &y.0, vector),
        F32s::load(simd, &z.0, vector),
        F32s::load(simd, &w.0, vector),
    ]
}

/// Stores the `vector`-th part of some sums at its place among all lanes.
#[inline(always)]
fn store<S: Simd, const N: usize>(sums: &[F32s<S>; N], vector: usize, lanes: &mut [Lanes; N]) {
    for index in 0..N {
        sums[index].store(&mut lanes[index].0, vector);
    }
}

/// Sums the lanes half to half: the same bits for any vector width, with short chains of dependent additions.
#[inline(always)]
fn add_lanes<const N: usize>(lanes: &mut [Lanes; N]) -> [f32; N] {
    for Lanes(lanes) in &mut *lanes {
        for half in [8, 4, 2, 1] {
            let (low, high) = lanes.split_at_mut(half);
            for lane in 0..half {
                low[lane] += high[lane];
            }
        }
    }
    std::array::from_fn(|index| lanes[index].0[0])
}

#[cfg(test)]
mod tests;
