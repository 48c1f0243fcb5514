//! Surfels turned and moved onto sheets, or onto a quadric of their own; the choice of a quadric's scale.

use glam::Vec3;
use pulp::Simd;
use rayon::prelude::*;

use super::cells::Cells;
use super::depth::{DepthNoise, Known};
use super::noise::{Noise, Usual, measure};
use super::quadric::{EVEN_WEIGHT, Gathered, LEAST_CLUSTERS, LEAST_OF_PLANE, Quadric};
use super::rows::{is_row, turn};
use super::sheets::{Around, Blend, Sheets, Surface};
use super::through::{DENSER, open};
use super::{LEAST_REACH, SCALES, STEP};
use crate::camera::View;
use crate::fit::Surfel;
use crate::project::{DensityGrid, ScreenPoint, ScreenPoints};

/// Surfels per task.
const TASK: usize = 256;
/// Standard error of a normal, radians, that is good enough where noise is many pixels.
pub(super) const ENOUGH: f32 = 0.025;
/// Noise that is smaller than this, in pixels, may as well be detail too small for the pixels: the less there is, the larger
/// an error is good enough.
pub(super) const TINY_PX: f32 = 0.5;
/// By how much, in radians a pixel, where k-radii are [`TINY_REACH_PX`] pixels.
pub(super) const TINY_SLOPE: f32 = 0.5;
/// And the more, the denser points are on the screen, with the square of that over the k-radius,
pub(super) const TINY_REACH_PX: f32 = 2.0;
/// up to so many times: in far views all detail looks like noise.
pub(super) const MOST_TINY: f32 = 3.0;
/// Largest standard error of a normal that others are held against.
pub(super) const RELIABLE: f32 = 0.12;
/// Most noise, as a part of a ball's radius, with which its points are a surface at all.
pub(super) const THICKEST: f32 = 0.3;
/// The same of the first neighbourhood, whose plane has no error of its own to tell.
pub(super) const THICKEST_FIRST: f32 = 0.085;
/// Least trace, times weight, of what [`Quadric::error`] is the root of, in radii: that of a round ball, evenly filled. Where
/// even that is no reliable error the quadric need not be fitted: true of most first balls.
pub(super) const LEAST_TRACE: f32 = 8.0;
/// Larger balls may scatter this many times the noise,
pub(super) const SCATTER: f32 = 1.9;
/// or that of depth cameras, which is known for what it does to normals: neighbours err alike.
pub(super) const SCATTER_KNOWN: f32 = 0.8;
/// Normals agree within this many standard errors: not at all beyond, and in full where they are the same.
pub(super) const AGREE: f32 = 3.0;

/// The k-radius of a point that lies between surfaces counts as at most this many first search radii.
pub(super) const WIDEST: f32 = 3.0;
/// A surfel moves at most this many times the noise; a quadric further away is another surface.
pub(super) const FARTHEST: f32 = 9.0;
/// One further from that surface than this many times the noise hardly belongs to it, and is drawn as a dot: moved there, its disc,
/// as wide as its neighbours are far, would hide those that belong.
pub(super) const STRAY_OFFSET: f32 = 3.0;
/// The same of depth cameras. A pixel of theirs that sees two surfaces lies anywhere between, nearly always that far from both.
pub(super) const STRAY_OFFSET_KNOWN: f32 = 2.0;
/// Points whose surface variation, times the square of the k-radius in usual ones, is at least this are drawn as dots. Surface
/// variation is up to 0.15 at edges and corners, which stay where points are up to four times as far apart as usual; in a
/// cloud that fills space it is 0.2 by mean, and much less for some.
pub(super) const STRAY_DOT: f32 = 2.5;
/// And above this they are outliers.
pub(super) const STRAY_DROPPED: f32 = 5.0;
/// Where k-radii are this many usual ones, a ball is asked as well: few neighbours lie flat by chance, or are cut off by gaps.
pub(super) const SPARSE: f32 = 2.5;
/// The same where surface variation times the square of the k-radius in first search radii is this: what stands before a surface
/// is sparser than what surrounds it, and its neighbours are hardly flat.
pub(super) const LONE: f32 = 0.5;
/// Radius of the ball in k-radii. With less weight of points in it than there are neighbours to be, it is no surface.
pub(super) const AROUND_SPARSE: f32 = 2.0;
/// Nor is a point this far from the plane through a ball that is a crowd or holds hardly anything, in k-radii: it stands by itself,
/// and its disc would hide what its neighbours are. On ridges and at corners it may be as far, but there is no crowd.
pub(super) const ASIDE: f32 = 0.4;
/// Nor one this far from the middle of a crowd, as it is beside the border of a surface. On a straight border it is 0.75, at a
/// square corner 1.05, but there is no crowd either.
pub(super) const OFF_MIDDLE: f32 = 1.0;
/// A ball is a crowd if it holds more than so many times the neighbours, 1.4 times what it does where points are even.
pub(super) const CROWD: f32 = 1.4 * AROUND_SPARSE * AROUND_SPARSE * EVEN_WEIGHT / std::f32::consts::PI;
/// Radius of such a dot in pixels.
pub(super) const DOT_PX: f32 = 1.0;

/// What the stage may be asked for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AdaptRules {
    /// Neighbours that the fit had.
    pub(crate) k: u32,
    /// Longest ellipse of those that stay as they were, semi-major over semi-minor axis.
    pub(crate) longest: f32,
    /// Keep what is no surface at all.
    pub(crate) keep_outliers: bool,
}

/// What all surfels share.
#[derive(Clone, Copy)]
struct Task<'a> {
    cells: &'a Cells,
    density: &'a DensityGrid,
    view: &'a View,
    rules: &'a AdaptRules,
    usual: Usual,
    /// In view space.
    known: &'a DepthNoise,
}

/// Fits surfels anew where noise calls for it; keeps its buffers from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct Adapter {
    cells: Cells,
    sheets: Sheets,
    /// Measured by the first surfels of a frame.
    usual: Option<Usual>,
}

impl Adapter {
    /// Sums up the screen points of a new frame, whose cells in the density grid hold about `k` points.
    pub(crate) fn begin(&mut self, screen: &ScreenPoints, view: &View, k: u32) {
        self.cells.fill(screen, view, k);
        self.sheets.clear(&self.cells);
        self.usual = None;
    }

    /// The noise of this frame's points, known once surfels were adapted.
    pub(crate) fn noise(&self) -> Noise {
        self.usual.map_or(Noise::NONE, |usual| usual.noise)
    }

    /// Fits each of `surfels` anew at the scale that the frame's noise calls for, and what are rows. The fit has left their
    /// ellipses as long as they are.
    pub(crate) fn adapt(
        &mut self,
        surfels: &mut [Surfel],
        density: &DensityGrid,
        view: &View,
        rules: &AdaptRules,
        known: &DepthNoise,
    ) {
        let Self { cells, sheets, usual } = self;
        let usual = *usual.get_or_insert_with(|| measure(surfels, cells, density, view, rules.k));
        sheets.level = usual.sheet_level;
        let known = &known.seen_by(view);
        let task = Task { cells, density, view, rules, usual, known };
        let asks = |surfel: &&Surfel| matches!(task.call(surfel), Call::Noise(_));
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
            sheets.fit(cells, &noise, view);
        }
        let sheets = &*sheets;
        surfels.par_chunks_mut(TASK).for_each_init(Default::default, |(gathered, around), surfels| {
            adapt_all(surfels, &task, sheets, gathered, around);
        });
    }
}

/// Radius that the balls around a surfel are multiples of.
#[inline(always)]
pub(super) fn first_radius(surfel: &Surfel, density: &DensityGrid, view: &View, k: u32) -> f32 {
    surfel.k_radius.max(LEAST_REACH * initial_radius(surfel, density, view, k))
}

/// What calls for more than the first neighbours of a surfel.
#[derive(Clone, Copy)]
enum Call {
    Nothing,
    Noise(Noisy),
    /// They are a row of points.
    Row,
}

#[derive(Clone, Copy)]
struct Noisy {
    goal: Goal,
    /// Where it is the noise of a depth camera.
    known: Option<Known>,
}

/// What a fit has to reach.
#[derive(Clone, Copy)]
pub(super) struct Goal {
    /// Standard deviation of points from their surface, world units.
    pub(super) noise: f32,
    /// Standard error of a normal that is good enough, radians.
    pub(super) enough: f32,
    /// Most that points may scatter about larger balls' quadrics, world units.
    pub(super) scatter: f32,
}

impl Goal {
    /// Of points with a k-radius at a depth, whose noise is `known` as that of a depth camera.
    #[inline(always)]
    pub(super) fn new(noise: f32, known: bool, k_radius: f32, depth: f32, view: &View) -> Self {
        let scatter = if known { SCATTER_KNOWN } else { SCATTER };
        Self { noise, enough: good_enough(noise, k_radius, depth, view), scatter: scatter * noise }
    }
}

impl Task<'_> {
    /// Noise at a place in view space, of a cloud's point with a k-radius: the larger of what was measured and what is known.
    #[inline(always)]
    fn noise(&self, place: Vec3, k_radius: f32, point: u32) -> (f32, Option<Known>) {
        let measured = self.usual.noise.at(k_radius);
        let known = self.known.at(place, point).filter(|known| known.noise > measured);
        (known.map_or(measured, |known| known.noise), known)
    }

    #[inline(always)]
    fn call(&self, surfel: &Surfel) -> Call {
        // The first neighbourhood's error is about that of its k points over the k-radius.
        let (noise, known) = self.noise(surfel.center.into(), surfel.k_radius, surfel.source);
        let goal = Goal::new(noise, known.is_some(), surfel.k_radius, surfel.center[2], self.view);
        if surfel.radius == 0.0 {
            Call::Nothing
        } else if is_row(surfel) && known.is_none() {
            // Steps of a depth camera's depths are rows too, but the surface is not in them.
            Call::Row
        } else if noise > goal.enough * surfel.k_radius {
            Call::Noise(Noisy { goal, known })
        } else {
            Call::Nothing
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
    around: &'a mut [Around; 2],
) {
    let Task { cells, density, view, rules: &AdaptRules { k, longest, .. }, .. } = *task;
    for surfel in surfels {
        let call = task.call(surfel);
        // K-radius in first search radii.
        let sparser = surfel.k_radius / initial_radius(surfel, density, view, k);
        if !matches!(call, Call::Row) {
            // A line has no width to draw.
            let is_line = surfel.major_ratio == f32::MAX;
            surfel.major_ratio = if is_line { 1.0 } else { surfel.major_ratio.min(longest) };
        }
        match call {
            Call::Nothing => shrink(simd, surfel, sparser, task, gathered),
            Call::Row => {
                let radius = first_radius(surfel, density, view, k);
                if !turn(surfel, (radius, k), (cells, view), gathered) {
                    shrink(simd, surfel, sparser, task, gathered);
                }
            }
            Call::Noise(Noisy { goal, known }) => {
                let is_reliable = goal.noise < THICKEST_FIRST * surfel.k_radius;
                let first = is_reliable.then(|| (surfel.normal.into(), goal.noise / surfel.k_radius));
                let mut alone = || {
                    let radius = first_radius(surfel, density, view, k);
                    let quadric = choose(simd, surfel.center, radius, first, &goal, (cells, view), gathered)?;
                    let Quadric { normal, height, curvature, .. } = quadric;
                    Some(Surface { offset: normal * height, normal, curvature })
                };
                let surface = match sheets.blend(simd, surfel.center, first, &goal, (cells, view), around) {
                    Blend::Surface(surface) => Some(surface),
                    // So would nine of ten quadrics of its own, each at the cost of a sheet.
                    Blend::Disagrees => None,
                    Blend::Nothing => alone(),
                };
                match surface {
                    Some(surface) => {
                        if known.is_some() {
                            // Between two surfaces the k-radius is the way to one of them.
                            surfel.radius *= (WIDEST / sparser).min(1.0);
                        }
                        place(surfel, &surface, goal.noise, known.as_ref(), view);
                    }
                    None => shrink(simd, surfel, sparser, task, gathered),
                }
            }
        }
        if sparser > DENSER {
            let noise = if let Call::Noise(Noisy { goal, .. }) = call { goal.noise } else { 0.0 };
            open(simd, surfel, noise, (cells, view), gathered);
        }
    }
}

/// Standard error of a normal, radians, that no larger ball need better.
#[inline(always)]
pub(super) fn good_enough(noise: f32, k_radius: f32, depth: f32, view: &View) -> f32 {
    let pixel = view.pixel_size(depth);
    let dense = TINY_REACH_PX * pixel / k_radius;
    ENOUGH + TINY_SLOPE * (dense * dense).min(MOST_TINY) * (TINY_PX - noise / pixel).max(0.0)
}

/// The upright quadric around `center` from balls that grow until its error is small enough; `None` if none is better than the
/// first neighbours. Radii are multiples of `radius`. The smallest ball has to agree with the `first` normal, where its standard
/// error is known.
///
/// Each ball counts as far as it agrees with what the smaller ones gave, and one that does not, or scatters more, is the last
/// (stagewise aggregation, Belomestny and Spokoiny 2007): if one or the other were taken, chance would decide, differently in
/// each picture.
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
    // A normal to agree with, and its error.
    let mut reliable = first;
    let mut best: Option<Quadric> = None;
    // Where nothing is reliable, the least error.
    let mut fallback: Option<Quadric> = None;
    // Heights of the first ball are along its plane's normal, those of larger ones along the normal found before.
    let mut axis = None;
    for scale in 0..SCALES {
        radius *= STEP;
        // Points of a ball that the noise fills are no surface. The largest ball has to do where there is no better.
        let thin = noise < THICKEST * radius;
        if !thin & (scale + 1 < SCALES) {
            continue;
        }
        if gathered.read(simd, cells, center, radius, view) < LEAST_CLUSTERS {
            continue;
        }
        if axis.is_none() && scale + 1 < SCALES {
            let least = noise * (1.0 / (RELIABLE * radius));
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
        if !(thin & (error < RELIABLE)) {
            if fallback.is_none_or(|other| quadric.error < other.error) {
                fallback = Some(quadric);
            }
            continue;
        }
        let mut share = 1.0;
        if let Some((normal, other)) = reliable {
            let across = quadric.normal.cross(normal).length_squared();
            share = 1.0 - across / (AGREE * AGREE * (error * error + other * other));
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
    quadric.filter(|quadric| quadric.height.abs() <= FARTHEST * noise)
}

/// First search radius of a surfel's point.
#[inline(always)]
fn initial_radius(surfel: &Surfel, density: &DensityGrid, view: &View, k: u32) -> f32 {
    density.initial_radius(&ScreenPoint { position_view: surfel.center, pixel: surfel.pixel }, k, view)
}

/// Shrinks or drops a surfel that is no surface: its neighbours are far away and fill the space between, or are cut off from
/// all others. Its k-radius is `sparser` first search radii.
#[inline(always)]
fn shrink<S: Simd>(simd: S, surfel: &mut Surfel, sparser: f32, task: &Task, gathered: &mut Gathered) {
    // A handful of points has nothing that is usual.
    if surfel.radius == 0.0 || task.usual.k_radius == 0.0 {
        return;
    }
    let ratio = surfel.k_radius / task.usual.k_radius;
    let mut stray = surfel.curvature * ratio * ratio;
    let is_sparse = ratio > SPARSE;
    if is_sparse | (surfel.curvature * sparser * sparser > LONE) {
        let len = gathered.read(simd, task.cells, surfel.center, AROUND_SPARSE * surfel.k_radius, task.view);
        let plane = (len >= LEAST_OF_PLANE).then(|| gathered.plane(simd));
        if let Some(plane) = plane
            && is_sparse
            && len >= LEAST_CLUSTERS
        {
            stray = stray.max(plane.curvature() * ratio * ratio);
        } else if is_sparse && gathered.weight() < task.rules.k as f32 {
            stray = stray.max(STRAY_DOT);
        }
        if let Some(plane) = plane {
            let is_crowd = plane.weight > CROWD * task.rules.k as f32;
            let is_aside = plane.axis.dot(plane.mean).abs() * AROUND_SPARSE > ASIDE;
            let is_outside = plane.mean.length() * AROUND_SPARSE > OFF_MIDDLE;
            if is_crowd & (is_aside | is_outside) {
                // Beside a surface is an outlier; beside a handful nobody knows.
                stray = f32::INFINITY;
            } else if (len < LEAST_CLUSTERS) & is_aside {
                stray = stray.max(STRAY_DOT);
            }
        }
    }
    if stray > STRAY_DROPPED && !task.rules.keep_outliers {
        surfel.radius = 0.0;
    } else if stray >= STRAY_DOT {
        make_dot(surfel, task.view);
    }
}

/// Leaves of a surfel what its point covers.
#[inline(always)]
fn make_dot(surfel: &mut Surfel, view: &View) {
    surfel.radius = surfel.radius.min(DOT_PX * view.pixel_size(surfel.center[2]));
}

/// Turns and moves a surfel onto a surface, along the ray along which its noise was made if that is known. Where `noise` does not
/// explain how far it is from there, it becomes a dot.
#[inline(always)]
fn place(surfel: &mut Surfel, surface: &Surface, noise: f32, known: Option<&Known>, view: &View) {
    let &Surface { offset, normal, curvature } = surface;
    let most = if known.is_some() { STRAY_OFFSET_KNOWN } else { STRAY_OFFSET };
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
