//! How far points scatter about the surface.

use pulp::Simd;
use rayon::prelude::*;

use super::cells::Cells;
use super::cpu::first_radius;
use super::quadric::{Gathered, LEAST_CLUSTERS};
use super::{SCALES, STEP};
use crate::camera::View;
use crate::fit::Surfel;
use crate::project::DensityGrid;

/// Surfels looked at.
pub(crate) const SAMPLE: usize = 4096;
/// Surfels per task.
const TASK: usize = 64;
/// Fewer that find anything in a ball say nothing.
const LEAST_SAMPLE: usize = 64;
/// So does less than one of this many.
const LEAST_SHARE: usize = 5;
/// A surface is thin in a ball if points scatter less than this part of the radius: of points that fill it, it is 0.4.
const THIN: f32 = 0.2;
/// A scale tells the noise if this share of the sample finds a thin surface.
const THIN_SHARE: f32 = 0.3;
/// The noise is this quantile of what is found: more scatter is structure too small for the ball.
const QUANTILE: f32 = 0.3;

/// Standard deviation of points from their surface, world units, from a sample of `surfels`; 0 if there are too few.
pub(crate) fn measure_noise(surfels: &[Surfel], cells: &Cells, density: &DensityGrid, view: &View, k: u32) -> f32 {
    let step = surfels.len().div_ceil(SAMPLE).max(1);
    let sample: Vec<&Surfel> = surfels.iter().step_by(step).collect();
    let mut scatter = vec![[None; SCALES]; sample.len()];
    let sample = sample.par_chunks(TASK).zip(scatter.par_chunks_mut(TASK));
    sample.for_each_init(Gathered::default, |gathered, (surfels, out)| {
        scatter_of(surfels, &Task { cells, density, view, k }, gathered, out);
    });
    noise(&scatter)
}

/// What all surfels of a sample share.
#[derive(Clone, Copy)]
struct Task<'a> {
    cells: &'a Cells,
    density: &'a DensityGrid,
    view: &'a View,
    k: u32,
}

#[pulp::with_simd(scatter_of = pulp::Arch::new())]
#[inline(always)]
fn scatter_of_with<'a, S: Simd>(
    simd: S,
    surfels: &'a [&'a Surfel],
    task: &'a Task<'a>,
    gathered: &'a mut Gathered,
    out: &'a mut [[Option<Scatter>; SCALES]],
) {
    let Task { cells, density, view, k } = *task;
    for (surfel, out) in surfels.iter().zip(out) {
        // A discarded point has no ball.
        if surfel.radius == 0.0 {
            continue;
        }
        let mut radius = first_radius(surfel, density, view, k);
        for out in out {
            radius *= STEP;
            if gathered.read(cells, surfel.center, radius, view) >= LEAST_CLUSTERS {
                let (axis, curvature) = gathered.plane(simd);
                let scatter = gathered.quadric(simd, radius, axis, curvature).scatter;
                *out = Some(Scatter { distance: scatter, thin: scatter < THIN * radius });
            }
        }
    }
}

/// What is left of the quadric of a ball.
#[derive(Clone, Copy, Debug)]
struct Scatter {
    /// Standard deviation, world units.
    distance: f32,
    thin: bool,
}

/// The noise of a sample with these scatters at each scale.
fn noise(sample: &[[Option<Scatter>; SCALES]]) -> f32 {
    let mut before: Option<f32> = None;
    let (mut least_growth, mut plateau) = (f32::INFINITY, 0.0);
    for scale in 0..SCALES {
        let found: Vec<Scatter> = sample.iter().filter_map(|scatter| scatter[scale]).collect();
        if found.len() < LEAST_SAMPLE.max(sample.len() / LEAST_SHARE) {
            before = None;
            continue;
        }
        let mut thin: Vec<f32> = found.iter().filter(|found| found.thin).map(|found| found.distance).collect();
        if thin.len() as f32 >= THIN_SHARE * found.len() as f32 {
            return quantile(&mut thin);
        }
        // Thicker than every ball: where the scatter grows least with the ball it is noise, elsewhere that of points that
        // fill the ball or of structure.
        let mut all: Vec<f32> = found.iter().map(|found| found.distance).collect();
        let now = quantile(&mut all);
        if let Some(before) = before
            && now < least_growth * before
        {
            (least_growth, plateau) = (now / before, before);
        }
        before = Some(now);
    }
    plateau
}

fn quantile(values: &mut [f32]) -> f32 {
    let at = (QUANTILE * values.len() as f32) as usize;
    *values.select_nth_unstable_by(at, f32::total_cmp).1
}
