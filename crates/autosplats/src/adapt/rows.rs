//! Rows: neighbourhoods that are a line, because a scanner's points are much denser along its scan lines than across.
//!
//! A lidar that spins leaves rings on the ground, ten to fifty times as far apart as their points. The nearest
//! neighbours of such a point all lie on its own ring: no plane can be fitted to them, and their discs reach no other
//! ring. So larger balls are tried, as for noise, until one holds an area. If that is flat and the row lies in it, the
//! surfel turns to its plane and becomes an ellipse across the row, as wide as the rows are apart by the points' density in
//! the ball. Where the surface bends beside the row, as it does at the foot of a wall, the points on either side of
//! the row are tried alone. Wires and bars are rows too: their areas end soon, or other things are seen through them. What
//! finds no area is drawn as the thin line that it is.

use glam::Vec3;
use pulp::Simd;

use super::cells::Cells;
use super::quadric::{CELLS_PER_RADIUS, EVEN_WEIGHT, Gathered, LEAST_CLUSTERS, Plane};
use super::through::{Disc, seen};
use super::{SCALES, STEP};
use crate::camera::View;
use crate::fit::{LONGEST, Surfel};

/// A neighbourhood is a row if its variance along is this many times that across. Of ten neighbours strewn evenly, one
/// in two thousand is, and two or three in a thousand at silhouettes.
pub(super) const ROW: f32 = 12.0;
/// A ball holds an area if the variance across is at least this part of that along: that of three rows is,
pub(super) const AREA: f32 = 0.25;
/// and has to be that part too in a ball whose radius is this many distances between rows: of three wires it is 0.18 there, of
/// four rows or the border of many 0.33. That ball also holds more points by more than its radius is larger, as areas grow with
/// its square, but a curve that the first ball held whole by less.
pub(super) const BEYOND: f32 = 4.0;
/// That radius over the first ball's, at least and at most.
pub(super) const BEYOND_RADII: [f32; 2] = [STEP, STEP * STEP * STEP];
/// Of what is on one side of the row, it is at least this part in the first ball, or it would be the row alone.
pub(super) const AREA_NEAR: f32 = 0.05;
/// Of the points on one side, those of the row itself count, to this distance on the other side; radii.
pub(super) const BESIDE: f32 = 0.1;
/// Weight of a ball over that of what counts to one side.
pub(super) const HALVES: f32 = 1.8;
/// What is this far from an area's plane is not of the area; radii.
pub(super) const OFF_AREA: f32 = 0.15;
/// An area is none where this share of its cells shows what is behind it and nothing of it.
pub(super) const SEEN_THROUGH: f32 = 0.3;
/// An area is flat if the variance of heights is at most this part of that across.
pub(super) const FLAT: f32 = 0.1;
/// Sine of the most that the row leaves the area's plane.
pub(super) const ROW_TILT: f32 = 0.25;
/// Most that the point is above or below the area, radii: more is a row in front of one.
pub(super) const OFF_ROW: f32 = 0.1;
/// Semi-axis of the ellipse across the row, in distances between rows: its support is 1.4 times as wide.
pub(super) const REACH: f32 = 0.8;
/// And at most, radii of the ball.
pub(super) const FARTHEST_REACH: f32 = 0.5;
/// Width of a row that belongs to no area, over its splats' length.
pub(super) const THIN_ROW: f32 = 0.4;

/// Whether the first neighbours of a surfel are a row.
#[inline(always)]
pub(super) fn is_row(surfel: &Surfel) -> bool {
    surfel.major_ratio > ROW
}

/// How far apart rows of points k-radius / (k/2) apart are, k-radii, if a ball of so many k-radii holds points of this `weight`.
#[inline(always)]
fn apart(in_k_radii: f32, k: f32, weight: f32) -> f32 {
    EVEN_WEIGHT * in_k_radii * in_k_radii * k / (2.0 * weight)
}

/// Turns a surfel whose `k` neighbours are a row to the area that balls around it find; `radius` is that of the ball before
/// the first, world units. Without an area it becomes thin; returns whether there is one.
pub(super) fn turn(
    surfel: &mut Surfel,
    (radius, k): (f32, u32),
    (cells, view): (&Cells, &View),
    gathered: &mut Gathered,
) -> bool {
    let k = k as f32;
    let row = Vec3::from(surfel.major_axis);
    let Some((plane, radius)) = area(surfel, (radius, k), (cells, view), gathered) else {
        surfel.radius *= THIN_ROW;
        surfel.major_ratio = 1.0 / THIN_ROW;
        return false;
    };
    let normal = view.turned_to_eye(plane.axis, surfel.center.into());
    surfel.normal = normal.to_array();
    // Not zero: the row is nearly in the plane.
    surfel.major_axis = normal.cross(row).normalize().to_array();
    surfel.curvature = plane.curvature();
    // The splat radius is 2/√k k-radii.
    let in_k_radii = radius / surfel.k_radius;
    let reach = (REACH * apart(in_k_radii, k, plane.weight)).min(FARTHEST_REACH * in_k_radii);
    let ratio = reach * (0.5 * k.sqrt());
    surfel.radius *= (ratio / LONGEST).max(1.0);
    surfel.major_ratio = ratio.clamp(1.0, LONGEST);
    true
}

/// Plane of the first ball around a `surfel` of a row that holds an area with the row in it, and the ball's radius.
fn area(
    surfel: &Surfel,
    (mut radius, k): (f32, f32),
    (cells, view): (&Cells, &View),
    gathered: &mut Gathered,
) -> Option<(Plane, f32)> {
    let &Surfel { center, k_radius, .. } = surfel;
    let row = Vec3::from(surfel.major_axis);
    let mut plane = |radius: f32, side: Option<Vec3>| plane_within(center, radius, side, cells, view, gathered);
    let is_area = |plane: &Plane, least: f32| plane.variances[1] > least * plane.variances[2];
    let is_flat = |plane: &Plane| {
        let [least, middle, _] = plane.variances;
        (least <= FLAT * middle)
            & (plane.axis.dot(row).abs() <= ROW_TILT)
            & (plane.axis.dot(plane.mean).abs() <= OFF_ROW)
    };
    let first = (0..SCALES).find_map(|_| {
        radius *= STEP;
        plane(radius, None).filter(|plane| is_area(plane, AREA))
    })?;
    let [least, most] = BEYOND_RADII.map(|radii| radii * radius);
    let beyond = (BEYOND * k_radius * apart(radius / k_radius, k, first.weight)).clamp(least, most);
    let goes_on = |near: &Plane, far: Option<Plane>| {
        far.is_some_and(|far| is_area(&far, AREA) & (far.weight * radius > near.weight * beyond))
    };
    let mut found = (is_flat(&first) && goes_on(&first, plane(beyond, None))).then_some(first);
    if found.is_none() {
        let eye = if view.perspective { Vec3::from(center) } else { Vec3::Z };
        let across = row.cross(eye).normalize_or_zero();
        let mut least_bend = f32::INFINITY;
        for side in [across, -across].map(Some) {
            let beside = plane(radius, side).filter(|plane| is_area(plane, AREA_NEAR) & is_flat(plane));
            let Some(beside) = beside else { continue };
            let bend = beside.variances[0] / beside.variances[1];
            if (bend < least_bend) && goes_on(&beside, plane(beyond, side)) {
                // As if the other side were as full.
                found = Some(Plane { weight: HALVES * beside.weight, ..beside });
                least_bend = bend;
            }
        }
    }
    let is_opaque = |plane: &Plane| {
        let disc = Disc { center: center.into(), axis: plane.axis, radius, half_thickness: OFF_AREA * radius };
        let [on, through] = seen(&disc, CELLS_PER_RADIUS, cells, view).cells;
        through <= SEEN_THROUGH * (through + on)
    };
    found.filter(is_opaque).map(|plane| (plane, radius))
}

/// The plane through what is within a `radius`, on the side if one is given.
///
/// Dispatched here and not by the caller: inlined, each of the calls would be a copy for each width of vectors, and within a closure
/// it would lose these.
#[pulp::with_simd(plane_within = pulp::Arch::new())]
#[inline(always)]
fn plane_within_with<'a, S: Simd>(
    simd: S,
    center: [f32; 3],
    radius: f32,
    side: Option<Vec3>,
    cells: &'a Cells,
    view: &'a View,
    gathered: &'a mut Gathered,
) -> Option<Plane> {
    let mut len = gathered.read(simd, cells, center, radius, view);
    if let Some(side) = side {
        len = gathered.keep_beside(side, -BESIDE);
    }
    (len >= LEAST_CLUSTERS).then(|| gathered.plane(simd))
}
