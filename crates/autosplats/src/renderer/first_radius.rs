//! The first radius that suits the kd-tree search best [Paper, §8.1]: found by trying, as the paper's authors did.

use autosplats_cloud::PointCloud;

use super::{PointSurfel, Renderer, Settings};
use crate::Error;
use crate::camera::Camera;
use crate::normals::exact_k_radii;
use crate::search::SearchEngine;

/// Radii tried at most; each is √2 times the one before.
const TRIALS: usize = 24;
/// Frames that a radius is timed in.
const FRAMES: usize = 2;
/// Relative difference up to which k-radii are alike.
const ALIKE: f32 = 1e-4;

/// A first radius that was tried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadiusTrial {
    /// World units.
    pub first_radius: f32,
    /// Milliseconds that building the tree and searching it took; of the whole frame on a device that times no passes.
    pub search_ms: f64,
    /// Share of the visible points whose k-radius is exact to 1e-4.
    pub accuracy: f64,
}

/// Tries first radii for [`SearchEngine::KdTree`], from one that holds the k neighbours of nine visible points of ten on,
/// and returns the fastest with which at least `accuracy` of the visible points, 0 to 1, have their exact k-radius. Where
/// none comes so far, the most accurate one: its own accuracy says that. The engine in `settings` is not looked at, nor is
/// grid culling: without, all visible points are searched for.
///
/// # Errors
/// Those of [`Renderer::render`]; [`Error::NothingVisible`] if no point is seen that has neighbours.
pub fn best_first_radius(
    renderer: &mut Renderer,
    cloud: &PointCloud,
    camera: &Camera,
    size: [u32; 2],
    settings: &Settings,
    accuracy: f64,
) -> Result<RadiusTrial, Error> {
    let mut settings = settings.clone();
    settings.reconstruction.grid_culling = false;
    let k = settings.reconstruction.k;
    let mut run = |first_radius: f32, frames: usize| {
        settings.reconstruction.engine = SearchEngine::KdTree { first_radius };
        let mut search_ms = f64::INFINITY;
        for _ in 0..frames {
            let timings = renderer.render(cloud, camera, size, &settings)?.timings;
            search_ms = search_ms.min(if timings.search > 0.0 { timings.search } else { timings.frame });
        }
        Ok::<_, Error>((search_ms, renderer.surfels()?))
    };
    // Which points are seen does not depend on the radius. Nor does what a renderer refuses.
    let (_, visible) = run(f32::MIN_POSITIVE, 1)?;
    let exact = exact_k_radii(cloud, k)?;
    let radius_of = |surfel: &PointSurfel| exact[surfel.point as usize];
    let mut radii: Vec<f32> = visible.iter().map(radius_of).filter(|radius| *radius > 0.0).collect();
    radii.sort_unstable_by(f32::total_cmp);
    let (Some(&common), Some(&largest)) = (radii.get(radii.len() / 10 * 9), radii.last()) else {
        return Err(Error::NothingVisible("no visible point has neighbours to search for".into()));
    };

    let mut best: Option<RadiusTrial> = None;
    let mut first_radius = common;
    // Trials in a row that were no better than the best.
    let mut worse = 0;
    for _ in 0..TRIALS {
        let (search_ms, surfels) = run(first_radius, FRAMES)?;
        let alike = |surfel: &&PointSurfel| (surfel.k_radius - radius_of(surfel)).abs() <= ALIKE * radius_of(surfel);
        let share = surfels.iter().filter(alike).count() as f64 / surfels.len().max(1) as f64;
        let trial = RadiusTrial { first_radius, search_ms, accuracy: share };
        let is_better = best.is_none_or(|best| match [best, trial].map(|trial| trial.accuracy >= accuracy) {
            [true, true] => trial.search_ms < best.search_ms,
            [false, false] => trial.accuracy > best.accuracy,
            [_, suffices] => suffices,
        });
        if is_better {
            best = Some(trial);
        }
        worse = if is_better { 0 } else { worse + 1 };
        first_radius *= std::f32::consts::SQRT_2;
        // Beyond searches only take longer, and bins become coarser.
        if first_radius > 4.0 * largest || worse == 2 {
            break;
        }
    }
    best.ok_or_else(|| Error::NothingVisible("no radius was tried".into()))
}
