//! The fit on the CPU: sixteen covariances at a time.

use glam::Vec3;
use pulp::Simd;
use rayon::prelude::*;

use super::alone::{MAX_NEAR_VARIATION, MIN_SURFACE_POINTS, NeighborStatistics};
use super::eigen::eigen;
use super::{Surfel, Surfels};
use crate::camera::View;
use crate::cancel::Cancel;
use crate::project::{ScreenPoint, ScreenPoints};
use crate::room;
use crate::search::{LANES, Lanes, NeighborhoodBlock, Neighborhoods};
use crate::simd::F32s;

/// Blocks per task.
const TASK_BLOCKS: usize = 64;
/// Ratio of the middle to the largest eigenvalue below which a neighbourhood is a line, not a plane.
pub(super) const MAX_LINE_EIGENVALUE_RATIO: f32 = 1e-5;
/// Sine of the angle between a line and the direction to the eye below which the line has no side towards the eye.
pub(super) const MIN_LINE_SINE: f32 = 1e-3;
/// Default limit of an ellipse's semi-major over semi-minor axis.
// Differs from the paper: without a limit, a nearly straight neighbourhood would draw a needle across the picture.
pub(crate) const LONGEST: f32 = 4.0;
/// Radius in pixels of the dot drawn for a kept point without neighbours.
pub(super) const ISOLATED_DOT_RADIUS_PX: f32 = 1.0;

/// Largest k-radius, in first search radii, that widens the splat of a point behind the culling plane of its cell.
// Differs from the paper: such a point is seen past the edge of a nearer surface, and its neighbours are mostly
// hidden. Its wide splat would stick out beyond the silhouette, where no depth map can hide it.
pub(super) const MAX_CULLED_FIRST_RADII: f32 = 3.0;

/// Factor on the splat radius of a point near the eye. With random samples, 1 in 3000 places of a surface lies in no
/// disc: a pixel elsewhere, a hole in the ground here. With this factor it is 1 in 200,000.
pub(super) const NEAR_RADIUS_GROWTH: f32 = 1.25;

/// Fewest neighbours that form a line of points; fewer are a line by chance.
pub(super) const MIN_SCAN_LINE_NEIGHBORS: f32 = 8.0;

/// Surface variation of a dot: the largest possible, as a dot is no surface. So only a sensor nearly straight behind a
/// dot sees it from the back.
pub(super) const DOT_CURVATURE: f32 = 1.0 / 3.0;

/// Settings of the fit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FitRules {
    pub(crate) k: u32,
    pub(crate) splat_scale: f32,
    /// Largest semi-major over semi-minor axis of an ellipse; 1 for circles.
    pub(crate) longest: f32,
    /// Whether surfels with the neighbours of a scan line keep their full length, for adaptation.
    pub(crate) scan_lines: bool,
    /// Whether to keep outliers: points without neighbours, as dots, and points off their neighbours' surface.
    pub(crate) keep_outliers: bool,
    /// Whether the test for outliers compares a point with the density around it.
    pub(crate) compares_density: bool,
    /// Radius in pixels of dots that face the eye and replace all surfels; `None` draws surfaces.
    pub(crate) dot_px: Option<f32>,
}

/// Fits a surfel to the neighbourhood of each of `queries`, indices of screen points, and appends it to `surfels`.
pub(crate) fn fit(
    screen: &ScreenPoints,
    queries: &[u32],
    neighborhoods: &Neighborhoods,
    view: &View,
    rules: &FitRules,
    surfels: &mut Surfels,
    cancel: &Cancel<'_>,
) {
    let first = surfels.len();
    if first == 0 {
        room::fit(surfels, queries.len());
    } else {
        surfels.resize(first + queries.len(), Surfel::default());
    }
    let out = surfels[first..].par_chunks_mut(TASK_BLOCKS * LANES);
    let queries = queries.par_chunks(TASK_BLOCKS * LANES);
    let blocks = neighborhoods.blocks.par_chunks(TASK_BLOCKS);
    out.zip(queries).zip(blocks).for_each(|((out, queries), blocks)| {
        if !cancel.is_given_up() {
            fit_blocks(screen, queries, blocks, view, rules, out);
        }
    });
}

#[pulp::with_simd(fit_blocks = pulp::Arch::new())]
#[inline(always)]
fn fit_blocks_with<'a, S: Simd>(
    simd: S,
    screen: &'a ScreenPoints,
    queries: &'a [u32],
    blocks: &'a [NeighborhoodBlock],
    view: &'a View,
    rules: &'a FitRules,
    out: &'a mut [Surfel],
) {
    let compares = rules.compares_density && screen.points.len() >= MIN_SURFACE_POINTS;
    for ((out, queries), block) in out.chunks_mut(LANES).zip(queries.chunks(LANES)).zip(blocks) {
        let mut fitted = Fitted::default();
        for vector in 0..LANES / S::F32_LANES {
            fitted.fit(simd, block, vector);
        }
        for (lane, (surfel, &query)) in out.iter_mut().zip(queries).enumerate() {
            let point = &screen.points[query as usize];
            let first_radius = || screen.density.initial_radius(point, rules.k, view);
            let usual_radius = compares.then_some(first_radius);
            *surfel = fitted.surfel(lane, block, point, usual_radius, view, rules);
            if screen.density.culls(point) {
                surfel.radius =
                    surfel.radius.min(splat_radius(MAX_CULLED_FIRST_RADII * first_radius(), rules.k as f32, rules));
            }
            if let Some(dot_px) = rules.dot_px {
                let center = point.position_view.into();
                let normal = view.to_eye(center).normalize_or(Vec3::NEG_Z);
                surfel.radius = dot_px * view.pixel_size(center.z);
                surfel.normal = normal.to_array();
                surfel.major_axis = normal.any_orthonormal_vector().to_array();
                surfel.major_ratio = 1.0;
                surfel.curvature = DOT_CURVATURE;
            }
            surfel.pixel = point.pixel;
            surfel.source = screen.source[query as usize];
            surfel.screen_and_flags |= query;
        }
    }
}

/// Plane through a neighbourhood.
pub(crate) struct Plane {
    /// Unit normal.
    pub(crate) normal: [f32; 3],
    /// Unit direction in the plane in which the neighbourhood is longest.
    pub(crate) major_axis: [f32; 3],
    /// Whether the neighbourhood is a line.
    pub(crate) is_line: bool,
    /// Ratio of the eigenvalues along and across the major axis, 1 to 1/[`MAX_LINE_EIGENVALUE_RATIO`].
    pub(crate) major_ratio: f32,
    /// Surface variation λ0/(λ0+λ1+λ2), 0 to 1/3.
    pub(crate) curvature: f32,
}

/// Principal axes of sixteen neighbourhoods.
#[derive(Default)]
pub(crate) struct Fitted {
    /// Eigenvalues, ascending, in squared k-radii.
    values: [Lanes; 3],
    normal: [Lanes; 3],
    major_axis: [Lanes; 3],
}

impl Fitted {
    /// Diagonalises the covariances of SIMD vector number `vector` of `block`.
    #[inline(always)]
    pub(crate) fn fit<S: Simd>(&mut self, simd: S, block: &NeighborhoodBlock, vector: usize) {
        let eigen = eigen(simd, covariance(simd, block, vector));
        for i in 0..3 {
            eigen.values[i].store(&mut self.values[i].0, vector);
            eigen.vectors[0][i].store(&mut self.normal[i].0, vector);
            eigen.vectors[2][i].store(&mut self.major_axis[i].0, vector);
        }
    }

    /// The plane through the neighbourhood of `lane` [Paper, Eq. 1 to 3], with the normal on the side of `toward`.
    ///
    /// A line or a single place lies in many planes; the plane most perpendicular to `toward` is taken.
    #[inline(always)]
    pub(crate) fn plane(&self, lane: usize, toward: [f32; 3]) -> Plane {
        let [least, middle, largest] = of_lane(&self.values, lane);
        let (mut normal, mut major_axis) = (of_lane(&self.normal, lane), of_lane(&self.major_axis, lane));
        let plane = middle > MAX_LINE_EIGENVALUE_RATIO * largest;
        if !plane {
            normal = facing(toward, major_axis, largest > 0.0);
            if !(largest > 0.0) {
                // A circle may have any tangent.
                major_axis = Vec3::from(normal).any_orthonormal_vector().to_array();
            }
        }
        let away = normal[0] * toward[0] + normal[1] * toward[1] + normal[2] * toward[2] < 0.0;
        let sum = least.max(0.0) + middle + largest;
        Plane {
            normal: if away { normal.map(|c| -c) } else { normal },
            major_axis,
            is_line: !plane && largest > 0.0,
            major_ratio: match (plane, largest > 0.0) {
                (true, _) => largest / middle,
                (false, true) => 1.0 / MAX_LINE_EIGENVALUE_RATIO,
                (false, false) => 1.0,
            },
            curvature: if sum > 0.0 { least.max(0.0) / sum } else { 0.0 },
        }
    }

    /// The surfel of a point. `usual_radius` computes the first search radius; with `None` the point is not compared
    /// with its surroundings.
    #[inline(always)]
    fn surfel(
        &self,
        lane: usize,
        block: &NeighborhoodBlock,
        point: &ScreenPoint,
        usual_radius: Option<impl Fn() -> f32>,
        view: &View,
        rules: &FitRules,
    ) -> Surfel {
        let [count, k_radius] = [block.count.0[lane], block.k_radius.0[lane]];
        let center = point.position_view;
        let plane = self.plane(lane, view.to_eye(center.into()).to_array());
        let mean = of_lane(&block.offset, lane).map(|sum| sum / (count * k_radius.max(f32::MIN_POSITIVE)));
        let around = NeighborStatistics { count, mean, normal: plane.normal, variance: self.values[0].0[lane] };
        let sparser = usual_radius.map(|usual| move || k_radius / usual());
        let fills_space = point.is_near() && !(plane.curvature <= MAX_NEAR_VARIATION);
        let outlier = !rules.keep_outliers && (fills_space || around.is_outlier(sparser, rules.k));
        let major_ratio = if rules.scan_lines && count >= MIN_SCAN_LINE_NEIGHBORS {
            plane.major_ratio
        } else if plane.is_line {
            // A line has no width to draw.
            1.0
        } else {
            plane.major_ratio.min(rules.longest)
        };
        let lone = if rules.keep_outliers { ISOLATED_DOT_RADIUS_PX * view.pixel_size(center[2]).max(0.0) } else { 0.0 };
        Surfel {
            center,
            radius: if outlier {
                0.0
            } else if count > 0.0 && !fills_space {
                let wider = if point.is_near() { NEAR_RADIUS_GROWTH } else { 1.0 };
                wider * splat_radius(k_radius, count, rules)
            } else {
                lone
            },
            normal: plane.normal,
            k_radius,
            major_axis: plane.major_axis,
            major_ratio,
            curvature: plane.curvature,
            screen_and_flags: if plane.is_line { Surfel::LINE } else { 0 },
            ..Surfel::default()
        }
    }
}

#[inline(always)]
fn of_lane(lanes: &[Lanes; 3], lane: usize) -> [f32; 3] {
    [lanes[0].0[lane], lanes[1].0[lane], lanes[2].0[lane]]
}

/// Splat radius of a point with `count` neighbours within `k_radius` [Paper, §6].
// Differs from the paper: a neighbourhood cut short by a gap counts as k neighbours. With κ, a point with fewer
// neighbours would spread wider over the gap: one neighbour at distance d would give a disc of radius 2d.
#[inline(always)]
fn splat_radius(k_radius: f32, count: f32, rules: &FitRules) -> f32 {
    rules.splat_scale * 2.0 * k_radius / count.max(rules.k as f32).sqrt()
}

/// Covariance of a point and its neighbours about their mean [Paper, Eq. 1, 2].
// Differs from the paper: divided by the count and the squared k-radius. This changes no axis and no ratio, and
// prevents overflow and underflow in any unit of the cloud.
#[inline(always)]
fn covariance<S: Simd>(simd: S, block: &NeighborhoodBlock, vector: usize) -> [F32s<S>; 6] {
    let load = |lanes: &Lanes| F32s::load(simd, &lanes.0, vector);
    let one = F32s::splat(simd, 1.0);
    let least = F32s::splat(simd, f32::MIN_POSITIVE);
    // The point itself is one of the points fitted, but adds nothing to sums about itself.
    let share = one / (load(&block.count) + one);
    let unit = one / load(&block.k_radius).max(least);
    let mut mean = [share; 3];
    for axis in 0..3 {
        mean[axis] = load(&block.offset[axis]) * unit * share;
    }
    let mut terms = [share; 6];
    for (term, (a, b)) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].into_iter().enumerate() {
        terms[term] = load(&block.second[term]) * unit * unit * share - mean[a] * mean[b];
    }
    terms
}

/// The unit normal of a neighbourhood that is no plane: as close to the direction of the eye as the line allows.
#[cold]
fn facing(to_eye: [f32; 3], line: [f32; 3], has_line: bool) -> [f32; 3] {
    let to_eye = Vec3::from(to_eye).normalize_or(Vec3::NEG_Z);
    let line = Vec3::from(line);
    let across = to_eye - line * line.dot(to_eye);
    // For a line towards the eye, the rest across it is rounding.
    let clear = across.length_squared() > MIN_LINE_SINE * MIN_LINE_SINE;
    match (has_line, clear) {
        (false, _) => to_eye,
        (true, true) => across.normalize(),
        (true, false) => line.any_orthonormal_vector(),
    }
    .to_array()
}
