//! What is seen through a disc, and discs that hide too much.
//!
//! A surface hides what is behind it: from the scanner, so that it is as dense as what lies around it, and from the eye. Leaves,
//! wires, and what a scanner measured halfway between two surfaces, are few points before many. Their neighbours are far away and
//! flat often enough, and their discs would hide what is seen between them. So where far more points are seen through a disc
//! than on it, and what surrounds it is no surface, it shrinks to what is its share. Points in front that are sparse on the screen alone, because the eye is close
//! to them, have as many behind them only if these are no further from the eye: hence each counts as if it lay as close as the disc.

use glam::Vec3;
use pulp::Simd;

use super::cells::{Cells, Cluster};
use super::cpu::DOT_PX;
use super::quadric::{Gathered, LEAST_CLUSTERS, Plane, Window};
use crate::camera::View;
use crate::fit::{SUPPORT, Surfel};

/// A disc on which less than this share is of the points seen where it is shrinks in the same measure.
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
/// and lies on all sides: the mean is no further from the point, radii. On a straight border it is 0.37.
pub(super) const ALL_AROUND: f32 = 0.3;
/// The disc's radius is at least so many cells, unless they are the finest: enough to count.
pub(super) const CELLS_TO_COUNT: f32 = 2.0;

/// A flat cylinder, view space.
#[derive(Clone, Copy, Debug)]
pub(super) struct Disc {
    pub(super) center: Vec3,
    /// Unit normal, of either sign.
    pub(super) axis: Vec3,
    pub(super) radius: f32,
    /// What is no further from the plane on either side is on the disc.
    pub(super) thickness: f32,
}

/// What is seen where a disc is: on it, and behind it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Seen {
    /// Cells that hold something on the disc, and others that hold something behind it.
    pub(super) cells: [f32; 2],
    /// Points on it, and behind it: these count as many as there were if they lay no further from the eye than the disc's centre.
    pub(super) points: [f32; 2],
}

/// What is seen on a `disc` and through it, in cells of which its radius is at least so many.
pub(super) fn seen(disc: &Disc, cells_per_radius: f32, cells: &Cells, view: &View) -> Seen {
    let &Disc { center, axis, radius, thickness } = disc;
    let of_plane = axis.dot(center);
    let mut seen = Seen::default();
    let Some(window) = Window::around(cells, center, radius, cells_per_radius, view) else { return seen };
    for cell in window.rows().flatten() {
        let mut points = [0.0; 2];
        for Cluster { mean, count } in cell.clusters() {
            let place = Vec3::from(mean);
            let off = of_plane - axis.dot(place);
            // Where the line of sight meets the plane.
            let along = if view.perspective { place } else { Vec3::Z };
            let way = off / axis.dot(along);
            if (place + along * way - center).length_squared() < radius * radius {
                if off.abs() <= thickness {
                    points[0] += count;
                } else if way < 0.0 {
                    let nearer = if view.perspective { center.z / place.z } else { 1.0 };
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
/// a dot at least.
#[inline(always)]
pub(super) fn open<S: Simd>(
    simd: S,
    surfel: &mut Surfel,
    noise: f32,
    (cells, view): (&Cells, &View),
    gathered: &mut Gathered,
) {
    let dot = DOT_PX * view.pixel_size(surfel.center[2]);
    if surfel.radius <= dot {
        return;
    }
    let radius = SUPPORT * surfel.radius;
    let thickness = (ON_DISC * radius).max(ON_DISC_NOISE * noise);
    let disc = Disc { center: surfel.center.into(), axis: surfel.normal.into(), radius, thickness };
    let [on, behind] = seen(&disc, CELLS_TO_COUNT, cells, view).points;
    // Its own point is on it, and may have moved.
    let on = on.max(1.0);
    let share = on / (on + behind);
    if share >= LEAST_ON {
        return;
    }
    let len = gathered.read(simd, cells, surfel.center, GOES_ON * surfel.k_radius, view);
    let is_surface = |plane: Plane| (plane.curvature() < FLAT_AROUND) & (plane.mean.length() < ALL_AROUND);
    if len < LEAST_CLUSTERS || !is_surface(gathered.plane(simd)) {
        surfel.radius = (surfel.radius * (share / LEAST_ON)).max(dot);
    }
}
