//! What is seen through a disc, and discs that hide too much.
//!
//! A surface takes all the points that its scanner sends there, so it is about as dense as what is seen beside it. Leaves, wires,
//! and what was measured halfway between two surfaces, are few points before many. Their neighbours are far away and flat often
//! enough, and their discs would hide what is seen between them. So where far more points are seen through a disc than on it, and
//! what surrounds it is no surface, it shrinks to its share. What is close to the eye is sparse on the screen only: each point
//! behind it counts for as many as would fall there if it lay no further away.

use glam::Vec3;
use pulp::Simd;

use super::cells::{Cells, Cluster};
use super::cpu::DOT_PX;
use super::quadric::{Gathered, LEAST_CLUSTERS, Plane, Window};
use crate::camera::View;
use crate::fit::{SUPPORT, Surfel};

/// Of the points seen where a disc is at least this share has to be on it; its radius shrinks in the measure that is lacking.
pub(super) const LEAST_ON: f32 = 0.1;
/// What is this far from the disc's plane is on it, radii.
pub(super) const ON_DISC: f32 = 0.3;
/// Or this many times the noise.
pub(super) const ON_DISC_NOISE: f32 = 3.0;
/// Where the k-radius is less than this many first search radii, what is around is not so much denser.
pub(super) const DENSER: f32 = 3.0;
/// A surface is one however sparse it is, if it goes on to so many k-radii from the point: sheets of what was measured between two
/// others do not.
pub(super) const GOES_ON: f32 = 4.0;
/// It is as flat as this there, by surface variation,
pub(super) const FLAT_AROUND: f32 = 0.005;
/// as wide as this, or it is a wire: variance across over that along; at a straight border it is 0.33,
pub(super) const WIDE_AROUND: f32 = 0.25;
/// and goes on to all sides: the mean is no further from the point, radii. At a straight border it is 0.37.
pub(super) const ALL_AROUND: f32 = 0.3;
/// The disc's radius is at least so many cells, unless they are the finest: enough to count.
pub(super) const CELLS_TO_COUNT: f32 = 2.0;

/// A disc, and what is near its plane, view space.
#[derive(Clone, Copy, Debug)]
pub(super) struct Disc {
    pub(super) center: Vec3,
    /// Unit normal, of either sign.
    pub(super) axis: Vec3,
    pub(super) radius: f32,
    /// What is no further from the plane, on either side, is on the disc.
    pub(super) half_thickness: f32,
}

/// What is seen where a disc is: on it, and behind it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Seen {
    /// Cells that hold something on the disc, and others that hold something behind it.
    pub(super) cells: [f32; 2],
    /// Points on it, and behind it: each of these counts for as many as would fall there if it lay on the disc's plane.
    pub(super) points: [f32; 2],
}

/// What is seen on a `disc` and through it, in cells of which its radius is at least so many.
pub(super) fn seen(disc: &Disc, cells_per_radius: f32, cells: &Cells, view: &View) -> Seen {
    let &Disc { center, axis, radius, half_thickness } = disc;
    let of_plane = axis.dot(center);
    let mut seen = Seen::default();
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
                    // Distance from the eye on the plane over that of the point.
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

/// Shrinks a surfel, whose points scatter by `noise`, to its share of what is seen where it is, unless it is one of a surface; to
/// a dot at least. Of an ellipse the circle within is asked, and the ellipse shrinks.
#[inline(always)]
pub(super) fn open<S: Simd>(
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
    // Its own point is on it, and may have moved.
    let on = on.max(1.0);
    let share = on / (on + behind);
    if !(share < LEAST_ON) {
        return;
    }
    let len = gathered.read(simd, cells, surfel.center, GOES_ON * surfel.k_radius, view);
    let is_surface = |plane: Plane| {
        let [_, across, along] = plane.variances;
        (plane.curvature() < FLAT_AROUND) & (across > WIDE_AROUND * along) & (plane.mean.length() < ALL_AROUND)
    };
    if len < LEAST_CLUSTERS || !is_surface(gathered.plane(simd)) {
        surfel.radius = (surfel.radius * (share / LEAST_ON)).max(dot);
    }
}
