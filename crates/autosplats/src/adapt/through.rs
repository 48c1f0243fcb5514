//! Discs that hide too much: points seen through a disc, and the radius that they leave.
//!
//! A surface receives all the points that its scanner sends there, so it is about as dense as what is seen beside it.
//! Leaves, wires and points measured halfway between two surfaces are few points before many. Their neighbours are far
//! away and often flat, and their discs would hide what is seen between them. So a disc shrinks where far more points
//! are seen through it than on it, unless its surroundings are a surface. Points close to the eye are sparse only on
//! the screen. So each point behind the disc counts for as many as would fall there at the distance of the disc. See
//! docs/decisions/0011-seen-through.md.
// Differs from the paper: the paper draws every disc as wide as its neighbourhood calls for, whatever it hides.

use glam::Vec3;
use pulp::Simd;

use super::cells::{Cells, Cluster};
use super::quadric::{Gathered, LEAST_CLUSTERS, Plane, Window};
use super::rules::DOT_PX;
use crate::camera::View;
use crate::fit::{SUPPORT, Surfel};

/// Least share of the points seen at a disc that must lie on it. The radius shrinks in proportion to the missing share.
pub(super) const LEAST_ON: f32 = 0.1;
/// Distance from the disc's plane, in disc radii, up to which points are on the disc.
pub(super) const ON_DISC: f32 = 0.3;
/// Distance from the disc's plane, in noise levels, up to which points are on the disc, if larger than [`ON_DISC`].
pub(super) const ON_DISC_NOISE: f32 = 3.0;
/// K-radius, in first search radii, above which a disc is tested. With less, the surroundings are hardly denser.
pub(super) const MIN_TESTED_FIRST_RADII: f32 = 3.0;
/// Radius, in k-radii, to which a sparse surface must go on. Points measured between two surfaces do not.
pub(super) const SURFACE_BALL_K_RADII: f32 = 4.0;
/// Largest surface variation of a surface in the ball of [`SURFACE_BALL_K_RADII`].
pub(super) const MAX_SURFACE_VARIATION: f32 = 0.005;
/// Least variance across the ball of [`SURFACE_BALL_K_RADII`], over that along, of a surface. Wires have less, a
/// straight border 0.33.
pub(super) const MIN_SURFACE_WIDTH_RATIO: f32 = 0.25;
/// Largest distance of the mean of the ball of [`SURFACE_BALL_K_RADII`] from the point, in ball radii; borders have
/// 0.37.
pub(super) const MAX_SURFACE_MEAN_RADII: f32 = 0.3;
/// Least radius of a disc in cells, where cells are that fine: enough cells to count.
pub(super) const CELLS_TO_COUNT: f32 = 2.0;

/// A disc with a thickness, view space.
#[derive(Clone, Copy, Debug)]
pub(super) struct Disc {
    pub(super) center: Vec3,
    /// Unit normal, of either sign.
    pub(super) axis: Vec3,
    pub(super) radius: f32,
    /// Largest distance from the plane of points on the disc, to either side, world units.
    pub(super) half_thickness: f32,
}

/// Counts of what is seen where a disc is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct SeenAtDisc {
    /// Cells that hold points on the disc, and other cells that hold points behind.
    pub(super) cells: [f32; 2],
    /// Points on the disc and behind, the latter as many as would fall there at the distance of the disc's plane.
    pub(super) points: [f32; 2],
}

/// Counts what is seen on a `disc` and through it, in cells with at least `cells_per_radius` to a radius.
pub(super) fn seen(disc: &Disc, cells_per_radius: f32, cells: &Cells, view: &View) -> SeenAtDisc {
    let &Disc { center, axis, radius, half_thickness } = disc;
    let of_plane = axis.dot(center);
    let mut seen = SeenAtDisc::default();
    let Some(window) = Window::around(cells, center, radius, cells_per_radius, view) else { return seen };
    for clusters in window.clusters() {
        let mut points = [0.0; 2];
        for Cluster { mean, count } in clusters {
            let place = Vec3::from(mean);
            let off = of_plane - axis.dot(place);
            // Where the line of sight meets the plane.
            let along = if view.perspective { place } else { Vec3::Z };
            let way = off / axis.dot(along);
            if (place + along * way - center).length_squared() < radius * radius {
                if off.abs() <= half_thickness {
                    points[0] += count;
                } else if way < 0.0 {
                    // Distance of the plane from the eye over that of the point, along the line of sight.
                    let nearer = if view.perspective { (1.0 + way).max(0.0) } else { 1.0 };
                    points[1] += count * (nearer * nearer);
                }
            }
        }
        let side = usize::from(points[0] == 0.0);
        seen.cells[side] += if points[side] > 0.0 { 1.0 } else { 0.0 };
        for (sum, points) in seen.points.iter_mut().zip(points) {
            *sum += points;
        }
    }
    seen
}

/// Shrinks a surfel to its share of what is seen where it is, at least to a dot, unless it belongs to a surface.
/// `noise` is the noise level, world units. For an ellipse the inner circle is tested and the whole ellipse shrinks.
#[inline(always)]
pub(super) fn shrink_to_share<S: Simd>(
    simd: S,
    surfel: &mut Surfel,
    noise: f32,
    (cells, view): (&Cells, &View),
    gathered: &mut Gathered,
) {
    let dot = DOT_PX * view.pixel_size(surfel.center[2]);
    if !(surfel.radius > dot) {
        return;
    }
    let radius = SUPPORT * surfel.radius;
    let half_thickness = (ON_DISC * radius).max(ON_DISC_NOISE * noise);
    let disc = Disc { center: surfel.center.into(), axis: surfel.normal.into(), radius, half_thickness };
    let [on, behind] = seen(&disc, CELLS_TO_COUNT, cells, view).points;
    // The surfel's own point is on the disc, and may have moved.
    let on = on.max(1.0);
    let share = on / (on + behind);
    if !(share < LEAST_ON) {
        return;
    }
    let len = gathered.read(simd, cells, surfel.center, SURFACE_BALL_K_RADII * surfel.k_radius, view);
    let is_surface = |plane: Plane| {
        let [_, across, along] = plane.variances;
        (plane.curvature() < MAX_SURFACE_VARIATION)
            & (across > MIN_SURFACE_WIDTH_RATIO * along)
            & (plane.mean.length() < MAX_SURFACE_MEAN_RADII)
    };
    if len < LEAST_CLUSTERS || !is_surface(gathered.plane(simd)) {
        surfel.radius = (surfel.radius * (share / LEAST_ON)).max(dot);
    }
}
