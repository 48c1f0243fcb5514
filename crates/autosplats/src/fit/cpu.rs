//! The fit on the CPU: sixteen covariances at a time.

use rayon::prelude::*;

use super::eigen::eigen;
use super::{Surfel, Surfels};
use crate::camera::View;
use crate::project::ScreenPoints;
use crate::search::{LANES, Lanes, NeighborhoodBlock, Neighborhoods};

/// Blocks per task.
const TASK_BLOCKS: usize = 64;
/// A neighbourhood whose middle eigenvalue is below this part of the largest is a line, not a plane.
const LINE: f32 = 1e-5;
/// Longest ellipse, semi-major over semi-minor axis.
// Differs from the paper: it sets no limit, and a nearly straight neighbourhood would draw a needle across the picture.
const LONGEST: f32 = 4.0;
/// Radius in pixels of a point drawn although it has no neighbour.
const LONE_RADIUS_PX: f32 = 1.0;

/// What the fit may be asked for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FitRules {
    pub(crate) splat_scale: f32,
    pub(crate) ellipses: bool,
    /// Keep points without neighbours, as dots.
    pub(crate) keep_lone: bool,
}

/// Fits a surfel to the neighbourhood of each of `queries`, indices of screen points, and appends them to `surfels`.
pub(crate) fn fit(
    screen: &ScreenPoints,
    queries: &[u32],
    neighborhoods: &Neighborhoods,
    view: &View,
    rules: &FitRules,
    surfels: &mut Surfels,
) {
    let first = surfels.len();
    surfels.resize(first + queries.len(), Surfel::default());
    let out = surfels[first..].par_chunks_mut(TASK_BLOCKS * LANES);
    let queries = queries.par_chunks(TASK_BLOCKS * LANES);
    let blocks = neighborhoods.blocks.par_chunks(TASK_BLOCKS);
    out.zip(queries).zip(blocks).for_each(|((out, queries), blocks)| {
        fit_blocks(screen, queries, blocks, view, rules, out);
    });
}

#[multiversion::multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+avx2+bmi1+bmi2+lzcnt+popcnt",
    "x86_64+avx2+bmi1+bmi2+lzcnt+popcnt",
))]
fn fit_blocks(
    screen: &ScreenPoints,
    queries: &[u32],
    blocks: &[NeighborhoodBlock],
    view: &View,
    rules: &FitRules,
    out: &mut [Surfel],
) {
    for ((out, queries), block) in out.chunks_mut(LANES).zip(queries.chunks(LANES)).zip(blocks) {
        let covariance = covariance(block);
        let eigen = eigen(&covariance);
        for (lane, (surfel, &query)) in out.iter_mut().zip(queries).enumerate() {
            let point = &screen.points[query as usize];
            let values = eigen.values.map(|value| value.0[lane]);
            let axis = |i: usize| eigen.vectors[i].map(|axis: Lanes| axis.0[lane]);
            let neighborhood = Neighborhood {
                count: block.count.0[lane],
                k_radius: block.k_radius.0[lane],
                values,
                normal: axis(0),
                major_axis: axis(2),
            };
            *surfel = neighborhood.surfel(point.position_view, view, rules);
            surfel.pixel = point.pixel;
            surfel.source = screen.source[query as usize];
        }
    }
}

/// Covariance of the point and its neighbours about their mean [Paper, Eq. 1, 2].
// Differs from the paper: it is divided by the count and the k-radius, which changes no axis and no ratio.
#[inline(always)]
fn covariance(block: &NeighborhoodBlock) -> [Lanes; 6] {
    let mut covariance = [Lanes::default(); 6];
    for lane in 0..LANES {
        // The point itself is one of the points fitted; it adds nothing to sums about itself.
        let share = 1.0 / (block.count.0[lane] + 1.0);
        // In units of the k-radius nothing over- or underflows, whatever the cloud's unit.
        let unit = 1.0 / block.k_radius.0[lane].max(f32::MIN_POSITIVE);
        let mean = block.offset.map(|axis| axis.0[lane] * unit * share);
        for (term, (i, j)) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].into_iter().enumerate() {
            covariance[term].0[lane] = block.second[term].0[lane] * unit * unit * share - mean[i] * mean[j];
        }
    }
    covariance
}

/// One neighbourhood with its principal axes.
struct Neighborhood {
    count: f32,
    k_radius: f32,
    /// Eigenvalues, ascending.
    values: [f32; 3],
    normal: [f32; 3],
    major_axis: [f32; 3],
}

impl Neighborhood {
    #[inline(always)]
    fn surfel(&self, center: [f32; 3], view: &View, rules: &FitRules) -> Surfel {
        let Self { count, k_radius, values, .. } = *self;
        let to_eye = if view.perspective { center.map(|c| -c) } else { [0.0, 0.0, -1.0] };
        let [least, middle, largest] = values;
        let plane = middle > LINE * largest;
        let normal = if plane { self.normal } else { facing(to_eye, self.major_axis, largest > 0.0) };
        // Any tangent does for a circle.
        let major_axis = if plane { self.major_axis } else { tangent(normal) };
        let normal = if dot(normal, to_eye) < 0.0 { normal.map(|c| -c) } else { normal };
        let lone = if rules.keep_lone { LONE_RADIUS_PX * view.pixel_size(center[2]) } else { 0.0 };
        let radius = if count > 0.0 { rules.splat_scale * 2.0 * k_radius / count.sqrt() } else { lone };
        let ellipse = rules.ellipses & plane & (middle > 0.0);
        let sum = least.max(0.0) + middle + largest;
        Surfel {
            center,
            radius,
            normal,
            k_radius,
            major_axis,
            major_ratio: if ellipse { (largest / middle).min(LONGEST) } else { 1.0 },
            curvature: if sum > 0.0 { (least / sum).max(0.0) } else { 0.0 },
            ..Surfel::default()
        }
    }
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The unit normal of a neighbourhood that is no plane: as much towards the eye as its line allows.
#[cold]
fn facing(to_eye: [f32; 3], line: [f32; 3], has_line: bool) -> [f32; 3] {
    let to_eye = glam::Vec3::from(to_eye).normalize_or(glam::Vec3::NEG_Z);
    let line = glam::Vec3::from(line);
    let across = to_eye - line * line.dot(to_eye);
    (if has_line { across.normalize_or(line.any_orthonormal_vector()) } else { to_eye }).to_array()
}

/// Some unit vector orthogonal to `normal`.
#[cold]
fn tangent(normal: [f32; 3]) -> [f32; 3] {
    glam::Vec3::from(normal).any_orthonormal_vector().to_array()
}
