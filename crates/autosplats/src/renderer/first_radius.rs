//! The best first radius for the kd-tree search [Paper, §8.1], found by trials as in the paper.

use autosplats_cloud::PointCloud;

use super::{PointSurfel, Renderer, Settings};
use crate::Error;
use crate::camera::Camera;
use crate::cancel::Cancel;
use crate::normals::exact_k_radii;
use crate::search::SearchEngine;

/// Largest number of trials. Each radius is √2 times the one of the trial before.
const MAX_TRIALS: usize = 24;
/// Frames timed per radius.
const FRAMES_PER_TRIAL: usize = 2;
/// Relative difference up to which k-radii count as equal.
const K_RADIUS_TOLERANCE: f32 = 1e-4;

/// Result of one first radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadiusTrial {
    /// First radius in world units.
    pub first_radius: f32,
    /// Milliseconds to build and search the tree, or for the whole frame if the device does not time passes.
    pub search_ms: f64,
    /// Fraction of the visible points whose k-radius is exact to a relative difference of 1e-4.
    pub accuracy: f64,
}

/// Finds the fastest first radius of [`SearchEngine::KdTree`] with an `accuracy`, 0 to 1, or the most accurate if none
/// reaches it. Accuracy is the fraction of visible points with their exact k-radius.
///
/// The first trial's radius contains the k neighbours of nine in ten visible points. The engine in `settings` is
/// ignored. Grid culling is off, so that all visible points are searched.
///
/// # Errors
/// Those of [`Renderer::render_while`], which is given `go_on`; [`Error::NothingVisible`] if no visible point has
/// neighbours.
///
/// # Examples
///
/// ```no_run
/// use autosplats::{Backend, Renderer, Settings, best_first_radius};
/// # use autosplats::{Camera, Projection, cloud::{PointCloud, glam::DVec3}};
/// # let cloud = PointCloud::new(DVec3::ZERO, Vec::new());
/// # let (eye, projection) = (DVec3::X, Projection::PerspectiveFovDeg(40.0));
/// # let camera = Camera { eye, look_at: DVec3::ZERO, up: DVec3::Z, projection };
///
/// let mut renderer = Renderer::with_backend(Backend::Gpu)?;
/// let (size, settings) = ([1920, 1080], Settings::default());
/// let best = best_first_radius(&mut renderer, &cloud, &camera, size, &settings, 0.99, &|| true)?;
/// println!("{} takes {} ms", best.first_radius, best.search_ms);
/// # Ok::<(), autosplats::Error>(())
/// ```
pub fn best_first_radius(
    renderer: &mut Renderer,
    cloud: &PointCloud,
    camera: &Camera,
    size: [u32; 2],
    settings: &Settings,
    accuracy: f64,
    go_on: &(dyn Fn() -> bool + Sync),
) -> Result<RadiusTrial, Error> {
    let mut settings = settings.clone();
    settings.reconstruction.grid_culling = false;
    let k = settings.reconstruction.k;
    let mut run = |first_radius: f32, frames: usize| {
        settings.reconstruction.engine = SearchEngine::KdTree { first_radius };
        let mut search_ms = f64::INFINITY;
        for _ in 0..frames {
            let timings = renderer.render_while(cloud, camera, size, &settings, go_on)?.timings;
            search_ms = search_ms.min(if timings.search > 0.0 { timings.search } else { timings.frame });
        }
        Ok::<_, Error>((search_ms, renderer.surfels()?))
    };
    // The visible points do not depend on the radius. This run also fails early if the renderer cannot render.
    let (_, visible) = run(f32::MIN_POSITIVE, 1)?;
    let exact = exact_k_radii(cloud, k, &Cancel::new(go_on))?;
    let radius_of = |surfel: &PointSurfel| exact[surfel.point as usize];
    let mut radii: Vec<f32> = visible.iter().map(radius_of).filter(|radius| *radius > 0.0).collect();
    radii.sort_unstable_by(f32::total_cmp);
    let (Some(&common), Some(&largest)) = (radii.get(radii.len() / 10 * 9), radii.last()) else {
        return Err(Error::NothingVisible("no visible point has neighbours to search for".into()));
    };

    let mut best: Option<RadiusTrial> = None;
    let mut first_radius = common;
    // Number of successive trials without an improvement.
    let mut worse = 0;
    for _ in 0..MAX_TRIALS {
        let (search_ms, surfels) = run(first_radius, FRAMES_PER_TRIAL)?;
        let alike = |surfel: &&PointSurfel| {
            (surfel.k_radius - radius_of(surfel)).abs() <= K_RADIUS_TOLERANCE * radius_of(surfel)
        };
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
        // Larger radii only take longer, and bins become coarser.
        if first_radius > 4.0 * largest || worse == 2 {
            break;
        }
    }
    best.ok_or_else(|| Error::NothingVisible("no radius was tried".into()))
}
