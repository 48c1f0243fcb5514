//! Moves surfels onto sheets or onto a quadric of their own, and chooses the scale of a quadric.

use glam::Vec3;
use pulp::Simd;
use rayon::prelude::*;

use super::cells::Cells;
use super::depth::{DepthNoise, KnownNoise};
use super::noise::{FrameStatistics, Noise, measure};
use super::quadric::{EVEN_WEIGHT, Gathered, LEAST_CLUSTERS, LEAST_OF_PLANE, Quadric};
use super::rows::{is_row, turn};
use super::sheets::{Blend, NearbySheets, Sheets, Surface};
use super::through::{MIN_TESTED_FIRST_RADII, shrink_to_share};
use super::{MIN_BASE_FIRST_RADII, SCALES, STEP};
use crate::camera::View;
use crate::cancel::Cancel;
use crate::fit::Surfel;
use crate::project::{DensityGrid, ScreenPoint, ScreenPoints};

/// Surfels per task.
const TASK: usize = 256;
/// Standard error of a normal, in radians, that is good enough where the noise is at least [`TINY_PX`].
pub(super) const GOOD_NORMAL_ERROR_RAD: f32 = 0.025;
/// Noise level in pixels, in [`good_enough`], below which noise may be detail finer than pixels.
pub(super) const TINY_PX: f32 = 0.5;
/// Added error in [`good_enough`], in radians per pixel that the noise is below [`TINY_PX`].
pub(super) const TINY_SLOPE: f32 = 0.5;
/// K-radius in pixels, in [`good_enough`], at which density does not change the added error.
pub(super) const TINY_REACH_PX: f32 = 2.0;
/// Largest factor of density in [`good_enough`]. In far views points are dense and all detail looks like noise.
pub(super) const MOST_TINY: f32 = 3.0;
/// Largest standard error of a normal, in radians, with which the normal is held against others.
pub(super) const MAX_RELIABLE_ERROR_RAD: f32 = 0.12;
/// Largest noise level, in ball radii, at which the points of a ball are a surface at all.
pub(super) const MAX_NOISE_BALL_RADII: f32 = 0.3;
/// Largest noise level, in k-radii, at which the first neighbours' normal is reliable; their plane states no error.
pub(super) const MAX_NOISE_K_RADII: f32 = 0.085;
/// Smallest trace times weight, in radii, under the root of [`Quadric::error`]: that of an evenly filled round ball.
/// Where even this trace gives no reliable error, the fit is skipped, which saves most first balls.
pub(super) const LEAST_TRACE: f32 = 8.0;
/// Largest scatter of a larger ball's points about their quadric, in noise levels.
pub(super) const MAX_SCATTER_NOISES: f32 = 1.9;
/// [`MAX_SCATTER_NOISES`] for known noise of depth cameras; lower, as that level is raised to account for equal errors
/// of neighbours.
pub(super) const MAX_SCATTER_KNOWN_NOISES: f32 = 0.8;
/// Largest difference of agreeing normals, in standard errors. Agreement falls from 1 for equal normals to 0 there.
pub(super) const AGREE_ERRORS: f32 = 3.0;

/// Largest k-radius, in first search radii, that the splat radius of a depth camera's point may follow. The k-radius of
/// a point between two surfaces is its distance to one of them.
pub(super) const MAX_K_RADIUS_FIRST_RADII: f32 = 3.0;
/// Largest move of a surfel, in noise levels. A quadric further away is another surface.
pub(super) const MAX_MOVE_NOISES: f32 = 9.0;
/// Distance from its surface, in noise levels, beyond which a surfel is an outlier and drawn as a dot. Moved there at
/// full size, the wide disc would hide the surfels that belong to the surface.
pub(super) const OUTLIER_OFFSET_NOISES: f32 = 3.0;
/// [`OUTLIER_OFFSET_NOISES`] of depth cameras. A pixel on two surfaces lies anywhere between, nearly always this far
/// from both.
pub(super) const OUTLIER_OFFSET_KNOWN_NOISES: f32 = 2.0;
/// Least surface variation, times the squared ratio of k-radius to median k-radius, of a point drawn as a dot. Surface
/// variation is up to 0.15 at edges and corners, which therefore stay where points are up to four times sparser than
/// usual. In a cloud that fills space the mean is 0.2, and much less for some points.
pub(super) const DOT_OUTLIER_SCORE: f32 = 2.5;
/// Outlier score, as defined for [`DOT_OUTLIER_SCORE`], above which a point is dropped.
pub(super) const DROPPED_OUTLIER_SCORE: f32 = 5.0;
/// K-radius, in median k-radii, beyond which a wider ball is checked: few neighbours lie flat by chance or are cut off.
pub(super) const SPARSE_MEDIAN_K_RADII: f32 = 2.5;
/// Surface variation, times the squared k-radius in first search radii, beyond which a wider ball is checked. A point
/// before a surface is sparser than its surroundings, and its neighbours are hardly flat.
pub(super) const ISOLATED_SCORE: f32 = 0.5;
/// Radius of the wider ball, in k-radii. A sparse point is no surface if this ball weighs less than k points.
pub(super) const WIDER_BALL_K_RADII: f32 = 2.0;
/// Distance from the wider ball's plane, in k-radii, beyond which a point is an outlier if the ball is over- or
/// under-populated. Its disc would hide the neighbours. Ridges and corners reach this distance with normal populations.
pub(super) const MAX_PLANE_DISTANCE_K_RADII: f32 = 0.4;
/// Distance from the wider ball's mean, in k-radii, beyond which a point is an outlier if the ball is over-populated.
/// Such a point lies beside a border. Straight borders have 0.75 and square corners 1.05, with normal populations.
pub(super) const MAX_MEAN_DISTANCE_K_RADII: f32 = 1.0;
/// Weight of an over-populated ball per neighbour: 1.4 times that of even points. See docs/decisions/0010-outliers.md.
pub(super) const CROWD_WEIGHT_PER_NEIGHBOR: f32 =
    1.4 * WIDER_BALL_K_RADII * WIDER_BALL_K_RADII * EVEN_WEIGHT / std::f32::consts::PI;
/// Radius of a dot, in pixels.
pub(super) const DOT_PX: f32 = 1.0;

/// Settings of the stage.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AdaptRules {
    /// Neighbours that the fit took.
    pub(crate) k: u32,
    /// Longest ellipse of surfels that stay as fitted: semi-major over semi-minor axis.
    pub(crate) longest: f32,
    /// Whether outliers are kept instead of dropped.
    pub(crate) keep_outliers: bool,
}

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
        sheets.level = usual.sheet_level;
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

/// Base radius of the balls around a surfel, world units.
#[inline(always)]
pub(super) fn first_radius(surfel: &Surfel, density: &DensityGrid, view: &View, k: u32) -> f32 {
    surfel.k_radius.max(MIN_BASE_FIRST_RADII * initial_radius(surfel, density, view, k))
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

/// The accuracy that a fit has to reach.
#[derive(Clone, Copy)]
pub(super) struct Goal {
    /// Standard deviation of points from their surface, world units.
    pub(super) noise: f32,
    /// Standard error of a normal that is good enough, radians.
    pub(super) enough: f32,
    /// Largest scatter of points about the quadrics of larger balls, world units.
    pub(super) scatter: f32,
}

impl Goal {
    /// Goal for points with this k-radius and depth. `known` says that the noise is the known noise of a depth camera.
    #[inline(always)]
    pub(super) fn new(noise: f32, known: bool, k_radius: f32, depth: f32, view: &View) -> Self {
        let scatter = if known { MAX_SCATTER_KNOWN_NOISES } else { MAX_SCATTER_NOISES };
        Self { noise, enough: good_enough(noise, k_radius, depth, view), scatter: scatter * noise }
    }
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
        if surfel.is_dropped() {
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

/// Standard error of a normal, in radians, at which no larger ball is needed: [`GOOD_NORMAL_ERROR_RAD`] +
/// [`TINY_SLOPE`] · min(([`TINY_REACH_PX`] / k-radius)², [`MOST_TINY`]) · max([`TINY_PX`] - noise, 0), with k-radius
/// and noise in pixels. Noise below [`TINY_PX`] may be fine detail, which larger balls would smooth away.
#[inline(always)]
pub(super) fn good_enough(noise: f32, k_radius: f32, depth: f32, view: &View) -> f32 {
    let pixel = view.pixel_size(depth);
    let dense = TINY_REACH_PX * pixel / k_radius;
    GOOD_NORMAL_ERROR_RAD + TINY_SLOPE * (dense * dense).min(MOST_TINY) * (TINY_PX - noise / pixel).max(0.0)
}

/// The upright quadric around `center`, from balls that grow until the error is small enough. Ball radii are powers of
/// [`STEP`] times `radius`. Where `first` is given, a normal and its standard error, the smallest ball has to agree
/// with that normal. Returns `None` if no quadric is better than the first neighbours.
///
/// Each ball counts by how far it agrees with the result of the smaller ones. A ball that disagrees, or scatters too
/// much, ends the search (stagewise aggregation, Belomestny and Spokoiny 2007). An all-or-nothing choice would depend
/// on chance and flicker from picture to picture. See docs/decisions/0006-scale-by-agreement.md.
#[inline(always)]
pub(super) fn choose<S: Simd>(
    simd: S,
    center: [f32; 3],
    mut radius: f32,
    first: Option<(Vec3, f32)>,
    &Goal { noise, enough, scatter }: &Goal,
    (cells, view): (&Cells, &View),
    gathered: &mut Gathered,
) -> Option<Quadric> {
    // A normal to agree with, and its standard error.
    let mut reliable = first;
    let mut best: Option<Quadric> = None;
    // The quadric of least error, for when none is reliable.
    let mut fallback: Option<Quadric> = None;
    // The first ball's heights run along its plane's normal, those of larger balls along the normal found so far.
    let mut axis = None;
    for scale in 0..SCALES {
        radius *= STEP;
        // Points of a ball that the noise fills are no surface; the largest ball is taken if there is no better one.
        let thin = noise < MAX_NOISE_BALL_RADII * radius;
        if !thin & (scale + 1 < SCALES) {
            continue;
        }
        if gathered.read(simd, cells, center, radius, view) < LEAST_CLUSTERS {
            continue;
        }
        if axis.is_none() && scale + 1 < SCALES {
            let least = noise * (1.0 / (MAX_RELIABLE_ERROR_RAD * radius));
            if gathered.weight() < LEAST_TRACE * least * least {
                continue;
            }
        }
        let (along, curvature) = axis.unwrap_or_else(|| {
            let plane = gathered.plane(simd);
            (plane.axis, plane.curvature())
        });
        let quadric = gathered.quadric(simd, radius, along, curvature);
        let error = quadric.error * noise;
        if !(thin & (error < MAX_RELIABLE_ERROR_RAD)) {
            if fallback.is_none_or(|other| quadric.error < other.error) {
                fallback = Some(quadric);
            }
            continue;
        }
        let mut share = 1.0;
        if let Some((normal, other)) = reliable {
            let across = quadric.normal.cross(normal).length_squared();
            share = 1.0 - across / (AGREE_ERRORS * AGREE_ERRORS * (error * error + other * other));
            if !((share > 0.0) & (quadric.scatter <= scatter)) {
                break;
            }
        }
        let found = best.map_or(quadric, |smaller| smaller.towards(&quadric, share)).upright();
        let error = found.error * noise;
        reliable = Some((found.normal, error));
        axis = Some((found.normal, curvature));
        best = Some(found);
        if error < enough {
            break;
        }
    }
    let quadric = if reliable.is_none() { fallback.map(|quadric| quadric.upright()) } else { best };
    quadric.filter(|quadric| quadric.height.abs() <= MAX_MOVE_NOISES * noise)
}

/// First search radius of a surfel's point, world units.
#[inline(always)]
fn initial_radius(surfel: &Surfel, density: &DensityGrid, view: &View, k: u32) -> f32 {
    density.initial_radius(&ScreenPoint { position_view: surfel.center, pixel: surfel.pixel }, k, view)
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
