//! Rules of the stage: its settings, the thresholds of all its parts, and the accuracy that fits have to reach.

use super::MIN_BASE_FIRST_RADII;
use super::quadric::EVEN_WEIGHT;
use crate::camera::View;
use crate::fit::Surfel;
use crate::project::{DensityGrid, ScreenPoint};

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
/// Smallest trace times weight, in radii, under the root of a quadric's error: that of an evenly filled round ball.
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

/// Standard error of a normal, in radians, at which no larger ball is needed: [`GOOD_NORMAL_ERROR_RAD`] +
/// [`TINY_SLOPE`] · min(([`TINY_REACH_PX`] / k-radius)², [`MOST_TINY`]) · max([`TINY_PX`] - noise, 0), with k-radius
/// and noise in pixels. Noise below [`TINY_PX`] may be fine detail, which larger balls would smooth away.
#[inline(always)]
fn good_enough(noise: f32, k_radius: f32, depth: f32, view: &View) -> f32 {
    let pixel = view.pixel_size(depth);
    let dense = TINY_REACH_PX * pixel / k_radius;
    GOOD_NORMAL_ERROR_RAD + TINY_SLOPE * (dense * dense).min(MOST_TINY) * (TINY_PX - noise / pixel).max(0.0)
}

/// Base radius of the balls around a surfel, world units.
#[inline(always)]
pub(super) fn first_radius(surfel: &Surfel, density: &DensityGrid, view: &View, k: u32) -> f32 {
    surfel.k_radius.max(MIN_BASE_FIRST_RADII * initial_radius(surfel, density, view, k))
}

/// First search radius of a surfel's point, world units.
#[inline(always)]
pub(super) fn initial_radius(surfel: &Surfel, density: &DensityGrid, view: &View, k: u32) -> f32 {
    density.initial_radius(&ScreenPoint { position_view: surfel.center, pixel: surfel.pixel }, k, view)
}
