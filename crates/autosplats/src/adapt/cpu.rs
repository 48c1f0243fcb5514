//! Moves surfels onto sheets or onto a quadric of their own, and shrinks those that are no surface.

use glam::Vec3;
use pulp::Simd;
use rayon::prelude::*;

use super::cells::Cells;
use super::choose::choose;
use super::depth::{DepthNoise, KnownNoise};
use super::noise::{FrameStatistics, Noise, measure};
use super::quadric::{Gathered, LEAST_CLUSTERS, LEAST_OF_PLANE, Quadric};
use super::rows::{is_row, turn};
use super::rules::{
    AdaptRules, CROWD_WEIGHT_PER_NEIGHBOR, DOT_OUTLIER_SCORE, DOT_PX, DROPPED_OUTLIER_SCORE, Goal, ISOLATED_SCORE,
    MAX_K_RADIUS_FIRST_RADII, MAX_MEAN_DISTANCE_K_RADII, MAX_NOISE_K_RADII, MAX_PLANE_DISTANCE_K_RADII,
    OUTLIER_OFFSET_KNOWN_NOISES, OUTLIER_OFFSET_NOISES, SPARSE_MEDIAN_K_RADII, WIDER_BALL_K_RADII, first_radius,
    initial_radius,
};
use super::sheets::{Blend, NearbySheets, Sheets, Surface};
use super::through::{MIN_TESTED_FIRST_RADII, shrink_to_share};
use crate::camera::View;
use crate::cancel::Cancel;
use crate::fit::Surfel;
use crate::project::{DensityGrid, ScreenPoints};

/// Surfels per task.
const TASK: usize = 256;

/// Input that all surfels share.
#[derive(Clone, Copy)]
struct Task<'a> {
    cells: &'a Cells,
    density: &'a DensityGrid,
    view: &'a View,
    rules: &'a AdaptRules,
    usual: FrameStatistics,
    /// The known noise of depth cameras, in view space.
    known: &'a DepthNoise,
}

/// Fits surfels again where noise calls for it. Keeps its buffers from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct Adapter {
    cells: Cells,
    sheets: Sheets,
    /// Measured from the first surfels of a frame.
    usual: Option<FrameStatistics>,
}

impl Adapter {
    /// Sums up the screen points of a new frame in cells. `k` is the number of points per cell of the density grid.
    pub(crate) fn begin(&mut self, screen: &ScreenPoints, view: &View, k: u32, cancel: &Cancel<'_>) {
        self.cells.fill(screen, view, k, cancel);
        self.sheets.clear(&self.cells);
        self.usual = None;
    }

    /// The noise of this frame's points, [`Noise::NONE`] until surfels are adapted.
    pub(crate) fn noise(&self) -> Noise {
        self.usual.map_or(Noise::NONE, |usual| usual.noise)
    }

    /// Fits `surfels` again at the scale that the noise calls for, and turns those on scan lines. Ellipses must have
    /// full length.
    pub(crate) fn adapt(
        &mut self,
        surfels: &mut [Surfel],
        density: &DensityGrid,
        view: &View,
        rules: &AdaptRules,
        known: &DepthNoise,
        cancel: &Cancel<'_>,
    ) {
        let Self { cells, sheets, usual } = self;
        let usual = *usual.get_or_insert_with(|| measure(surfels, cells, density, view, rules.k));
        sheets.level = usual.sheet_level as usize;
        let known = &known.seen_by(view);
        let task = Task { cells, density, view, rules, usual, known };
        // A noisy surfel asks for the sheets of the cells around it, which are then fitted.
        let asks = |surfel: &&Surfel| matches!(task.call(surfel), RefitReason::Noise(_));
        let ask_all = |surfels: &[Surfel]| {
            let mut is_any = false;
            for surfel in surfels.iter().filter(asks) {
                sheets.ask(surfel, cells, view);
                is_any = true;
            }
            is_any
        };
        let is_any_asked = surfels.par_chunks(TASK).map(ask_all).reduce(|| false, |a, b| a | b);
        let noise = |place, k_radius, point| {
            let (noise, known) = task.noise(place, k_radius, point);
            (noise, known.is_some())
        };
        if is_any_asked {
            sheets.fit(cells, &noise, view, cancel);
        }
        let sheets = &*sheets;
        surfels.par_chunks_mut(TASK).for_each_init(Default::default, |(gathered, around), surfels| {
            if !cancel.is_given_up() {
                adapt_all(surfels, &task, sheets, gathered, around);
            }
        });
    }
}

/// Why the first neighbours of a surfel do not suffice.
#[derive(Clone, Copy)]
enum RefitReason {
    Nothing,
    Noise(NoiseRefit),
    /// The neighbours form a scan line.
    Row,
}

#[derive(Clone, Copy)]
struct NoiseRefit {
    goal: Goal,
    /// Set if the noise is the known noise of a depth camera.
    known: Option<KnownNoise>,
}

impl Task<'_> {
    /// Noise level at `place` in view space for the cloud's point `point`: the larger of measured and known noise.
    #[inline(always)]
    fn noise(&self, place: Vec3, k_radius: f32, point: u32) -> (f32, Option<KnownNoise>) {
        let measured = self.usual.noise.at(k_radius);
        let known = self.known.at(place, point).filter(|known| known.noise > measured);
        (known.map_or(measured, |known| known.noise), known)
    }

    /// What a surfel calls for: whether and why larger balls replace its first neighbours.
    #[inline(always)]
    fn call(&self, surfel: &Surfel) -> RefitReason {
        // The standard error of the first plane is about noise over k-radius.
        let (noise, known) = self.noise(surfel.center.into(), surfel.k_radius, surfel.source);
        let goal = Goal::new(noise, known.is_some(), surfel.k_radius, surfel.center[2], self.view);
        if surfel.is_dropped() || surfel.is_near() {
            RefitReason::Nothing
        } else if is_row(surfel) && known.is_none() {
            // The depth steps of a depth camera form lines too, but the surface does not run along them.
            RefitReason::Row
        } else if noise > goal.enough * surfel.k_radius {
            RefitReason::Noise(NoiseRefit { goal, known })
        } else {
            RefitReason::Nothing
        }
    }
}

#[pulp::with_simd(adapt_all = pulp::Arch::new())]
#[inline(always)]
fn adapt_all_with<'a, S: Simd>(
    simd: S,
    surfels: &'a mut [Surfel],
    task: &'a Task<'a>,
    sheets: &'a Sheets,
    gathered: &'a mut Gathered,
    around: &'a mut [NearbySheets; 2],
) {
    let Task { cells, density, view, rules: &AdaptRules { k, longest, .. }, .. } = *task;
    for surfel in surfels {
        let call = task.call(surfel);
        // K-radius in first search radii.
        let sparser = surfel.k_radius / initial_radius(surfel, density, view, k);
        if !matches!(call, RefitReason::Row) {
            // A line has no width to draw.
            surfel.major_ratio = if surfel.is_line() { 1.0 } else { surfel.major_ratio.min(longest) };
        }
        if surfel.is_near() {
            // Cells lack the neighbours of near points.
            continue;
        }
        match call {
            RefitReason::Nothing => shrink(simd, surfel, sparser, task, gathered),
            RefitReason::Row => {
                let radius = first_radius(surfel, density, view, k);
                if !turn(surfel, (radius, k), (cells, view), gathered) {
                    shrink(simd, surfel, sparser, task, gathered);
                }
            }
            RefitReason::Noise(NoiseRefit { goal, known }) => {
                let is_reliable = goal.noise < MAX_NOISE_K_RADII * surfel.k_radius;
                let first = is_reliable.then(|| (surfel.normal.into(), goal.noise / surfel.k_radius));
                let mut alone = || {
                    let radius = first_radius(surfel, density, view, k);
                    let quadric = choose(simd, surfel.center, radius, first, &goal, (cells, view), gathered)?;
                    let Quadric { normal, height, curvature, .. } = quadric;
                    Some(Surface { offset: normal * height, normal, curvature })
                };
                let surface = match sheets.blend(simd, surfel.center, first, &goal, (cells, view), around) {
                    Blend::Surface(surface) => Some(surface),
                    // A quadric of its own would disagree as well in nine of ten cases, at the cost of a sheet.
                    Blend::Disagrees => None,
                    Blend::Nothing => alone(),
                };
                match surface {
                    Some(surface) => {
                        if known.is_some() {
                            // Between two surfaces the k-radius is the distance to one of them.
                            surfel.radius *= (MAX_K_RADIUS_FIRST_RADII / sparser).min(1.0);
                        }
                        place(surfel, &surface, goal.noise, known.as_ref(), view);
                    }
                    None => shrink(simd, surfel, sparser, task, gathered),
                }
            }
        }
        if sparser > MIN_TESTED_FIRST_RADII {
            let noise = if let RefitReason::Noise(NoiseRefit { goal, .. }) = call { goal.noise } else { 0.0 };
            shrink_to_share(simd, surfel, noise, (cells, view), gathered);
        }
    }
}

/// Shrinks or drops a surfel that is no surface: its neighbours are far away and fill space, or are cut off from all
/// others. `sparser` is the k-radius in first search radii.
#[inline(always)]
fn shrink<S: Simd>(simd: S, surfel: &mut Surfel, sparser: f32, task: &Task, gathered: &mut Gathered) {
    // Too few surfels have no median k-radius.
    if surfel.is_dropped() || task.usual.k_radius == 0.0 {
        return;
    }
    let ratio = surfel.k_radius / task.usual.k_radius;
    let mut stray = surfel.curvature * ratio * ratio;
    let is_sparse = ratio > SPARSE_MEDIAN_K_RADII;
    if is_sparse | (surfel.curvature * sparser * sparser > ISOLATED_SCORE) {
        let len = gathered.read(simd, task.cells, surfel.center, WIDER_BALL_K_RADII * surfel.k_radius, task.view);
        let plane = (len >= LEAST_OF_PLANE).then(|| gathered.plane(simd));
        if let Some(plane) = plane
            && is_sparse
            && len >= LEAST_CLUSTERS
        {
            stray = stray.max(plane.curvature() * ratio * ratio);
        } else if is_sparse && gathered.weight() < task.rules.k as f32 {
            stray = stray.max(DOT_OUTLIER_SCORE);
        }
        if let Some(plane) = plane {
            let is_crowd = plane.weight > CROWD_WEIGHT_PER_NEIGHBOR * task.rules.k as f32;
            let is_aside = plane.axis.dot(plane.mean).abs() * WIDER_BALL_K_RADII > MAX_PLANE_DISTANCE_K_RADII;
            let is_outside = plane.mean.length() * WIDER_BALL_K_RADII > MAX_MEAN_DISTANCE_K_RADII;
            if is_crowd & (is_aside | is_outside) {
                // Beside a surface a point is an outlier; beside a few points that is undecidable.
                stray = f32::INFINITY;
            } else if (len < LEAST_CLUSTERS) & is_aside {
                stray = stray.max(DOT_OUTLIER_SCORE);
            }
        }
    }
    if stray > DROPPED_OUTLIER_SCORE && !task.rules.keep_outliers {
        surfel.discard();
    } else if stray >= DOT_OUTLIER_SCORE {
        make_dot(surfel, task.view);
    }
}

/// Shrinks a surfel to the size of its point.
#[inline(always)]
fn make_dot(surfel: &mut Surfel, view: &View) {
    surfel.radius = surfel.radius.min(DOT_PX * view.pixel_size(surfel.center[2]));
}

/// Turns and moves a surfel onto a surface, along the sensor's ray where the noise is known. The surfel becomes a dot
/// where `noise` does not explain its distance from the surface.
#[inline(always)]
fn place(surfel: &mut Surfel, surface: &Surface, noise: f32, known: Option<&KnownNoise>, view: &View) {
    let &Surface { offset, normal, curvature } = surface;
    let most = if known.is_some() { OUTLIER_OFFSET_KNOWN_NOISES } else { OUTLIER_OFFSET_NOISES };
    let is_stray = offset.length() > most * noise;
    let center = Vec3::from(surfel.center) + known.map_or(offset, |known| known.onto(normal, offset));
    let normal = view.turned_to_eye(normal, center);
    let circle = (normal.any_orthonormal_vector(), 1.0);
    let (major_axis, major_ratio) =
        known.filter(|_| !is_stray).and_then(|known| known.shadow(surfel.normal.into(), normal)).unwrap_or(circle);
    surfel.normal = normal.to_array();
    surfel.major_axis = major_axis.to_array();
    surfel.major_ratio = major_ratio;
    surfel.curvature = curvature;
    surfel.move_to(center, view);
    if is_stray {
        make_dot(surfel, view);
    }
}
