//! Scan lines: neighbourhoods that are a line, because a scanner's points are much denser along its scan lines than
//! across.
//!
//! A spinning lidar leaves rings on the ground, ten to fifty times as far apart as the points along them. The nearest
//! neighbours of such a point all lie on the point's own ring. No plane can be fitted to them, and their discs reach no
//! other ring. So larger balls are tried, as for noise, until one holds an area. If that area is flat and contains the
//! scan line, the surfel turns to the area's plane. It becomes an ellipse across the scan line, as wide as the distance
//! between scan lines, which follows from the density in the ball. Where the surface bends at the scan line, as at the
//! foot of a wall, the points on either side are tried alone. Wires and bars are lines too: their areas end soon, or
//! other points are seen through them. A scan line without an area is drawn as a thin line. See
//! docs/decisions/0012-scan-lines.md.

use glam::Vec3;
use pulp::Simd;

use super::cells::Cells;
use super::quadric::{CELLS_PER_RADIUS, EVEN_WEIGHT, Gathered, LEAST_CLUSTERS, Plane};
use super::through::{Disc, seen};
use super::{SCALES, STEP};
use crate::camera::View;
use crate::fit::{LONGEST, Surfel};

/// Least variance along a neighbourhood, over that across, of a scan line. Ten evenly random neighbours reach this
/// ratio once in two thousand cases, at silhouettes in two or three of a thousand.
pub(super) const MIN_SCAN_LINE_ANISOTROPY: f32 = 12.0;
/// Least variance across a ball, over that along, of an area. Three scan lines reach this ratio.
pub(super) const MIN_AREA_RATIO: f32 = 0.25;
/// Radius of the ball in which an area has to go on, in distances between scan lines. The ratio of variances has to
/// reach [`MIN_AREA_RATIO`] there: three wires have 0.18, four scan lines or the border of many 0.33. The ball's weight
/// has to grow more than its radius: that of areas grows with the square, that of a closed curve less.
pub(super) const BEYOND_LINE_DISTANCES: f32 = 4.0;
/// Least and largest radius of the ball of [`BEYOND_LINE_DISTANCES`], in radii of the first ball.
pub(super) const BEYOND_RADII: [f32; 2] = [STEP, STEP * STEP * STEP];
/// Least variance across one side of a first ball, over that along. With less, the side holds the scan line alone.
pub(super) const MIN_SIDE_AREA_RATIO: f32 = 0.05;
/// Slack by which one side of a ball reaches beyond the scan line, in ball radii, so that the line's own points count.
pub(super) const SIDE_SLACK_RADII: f32 = 0.1;
/// Estimated weight of a whole ball over that of one side with its slack.
pub(super) const BALL_OVER_SIDE_WEIGHT: f32 = 1.8;
/// Distance from an area's plane, in ball radii, beyond which points are not part of the area.
pub(super) const AREA_HALF_THICKNESS_RADII: f32 = 0.15;
/// Share of an area's cells that may show only points behind the area. With more, there is no area.
pub(super) const MAX_SEEN_THROUGH_SHARE: f32 = 0.3;
/// Largest variance of an area's heights, over the variance across.
pub(super) const MAX_AREA_HEIGHT_RATIO: f32 = 0.1;
/// Largest sine of the angle between a scan line and the area's plane.
pub(super) const MAX_SCAN_LINE_TILT_SINE: f32 = 0.25;
/// Largest distance of the point from the area's plane, in ball radii. Beyond, the scan line lies in front of the area.
pub(super) const MAX_POINT_HEIGHT_RADII: f32 = 0.1;
/// Semi-axis of the ellipse across the scan line, in distances between scan lines. The support is 1.4 times as wide.
pub(super) const SEMI_AXIS_LINE_DISTANCES: f32 = 0.8;
/// Largest semi-axis of the ellipse across the scan line, in ball radii.
pub(super) const MAX_SEMI_AXIS_RADII: f32 = 0.5;
/// Width over length of splats on a scan line without an area.
pub(super) const THIN_LINE_ASPECT: f32 = 0.4;

/// Whether the first neighbours of a surfel form a scan line.
#[inline(always)]
pub(super) fn is_row(surfel: &Surfel) -> bool {
    surfel.major_ratio > MIN_SCAN_LINE_ANISOTROPY
}

/// Distance between scan lines, in k-radii, if a ball of `in_k_radii` k-radii has this `weight`. Points along a scan
/// line are assumed k-radius / (k/2) apart.
#[inline(always)]
fn apart(in_k_radii: f32, k: f32, weight: f32) -> f32 {
    EVEN_WEIGHT * in_k_radii * in_k_radii * k / (2.0 * weight)
}

/// Turns a surfel whose `k` neighbours form a scan line to the area around it. `radius` is the base radius of the
/// balls, world units. Without an area the surfel becomes thin. Returns whether there is an area.
pub(super) fn turn(
    surfel: &mut Surfel,
    (radius, k): (f32, u32),
    (cells, view): (&Cells, &View),
    gathered: &mut Gathered,
) -> bool {
    let k = k as f32;
    let row = Vec3::from(surfel.major_axis);
    let Some((plane, radius)) = area(surfel, (radius, k), (cells, view), gathered) else {
        surfel.radius *= THIN_LINE_ASPECT;
        surfel.major_ratio = 1.0 / THIN_LINE_ASPECT;
        return false;
    };
    let normal = view.turned_to_eye(plane.axis, surfel.center.into());
    surfel.normal = normal.to_array();
    // Not zero, as the scan line lies nearly in the plane.
    surfel.major_axis = normal.cross(row).normalize().to_array();
    surfel.curvature = plane.curvature();
    // The splat radius is 2/√k k-radii.
    let in_k_radii = radius / surfel.k_radius;
    let reach = (SEMI_AXIS_LINE_DISTANCES * apart(in_k_radii, k, plane.weight)).min(MAX_SEMI_AXIS_RADII * in_k_radii);
    let ratio = reach * (0.5 * k.sqrt());
    surfel.radius *= (ratio / LONGEST).max(1.0);
    surfel.major_ratio = ratio.clamp(1.0, LONGEST);
    true
}

/// The plane of the first ball that holds an area containing the scan line of `surfel`, and the ball's radius.
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
        (least <= MAX_AREA_HEIGHT_RATIO * middle)
            & (plane.axis.dot(row).abs() <= MAX_SCAN_LINE_TILT_SINE)
            & (plane.axis.dot(plane.mean).abs() <= MAX_POINT_HEIGHT_RADII)
    };
    let first = (0..SCALES).find_map(|_| {
        radius *= STEP;
        plane(radius, None).filter(|plane| is_area(plane, MIN_AREA_RATIO))
    })?;
    let [least, most] = BEYOND_RADII.map(|radii| radii * radius);
    let beyond = (BEYOND_LINE_DISTANCES * k_radius * apart(radius / k_radius, k, first.weight)).clamp(least, most);
    let goes_on = |near: &Plane, far: Option<Plane>| {
        far.is_some_and(|far| is_area(&far, MIN_AREA_RATIO) & (far.weight * radius > near.weight * beyond))
    };
    let mut found = (is_flat(&first) && goes_on(&first, plane(beyond, None))).then_some(first);
    if found.is_none() {
        let eye = if view.perspective { Vec3::from(center) } else { Vec3::Z };
        let across = row.cross(eye).normalize_or_zero();
        let mut least_bend = f32::INFINITY;
        for side in [across, -across].map(Some) {
            let beside = plane(radius, side).filter(|plane| is_area(plane, MIN_SIDE_AREA_RATIO) & is_flat(plane));
            let Some(beside) = beside else { continue };
            let bend = beside.variances[0] / beside.variances[1];
            if (bend < least_bend) && goes_on(&beside, plane(beyond, side)) {
                // Assumes that the other side has as many points.
                found = Some(Plane { weight: BALL_OVER_SIDE_WEIGHT * beside.weight, ..beside });
                least_bend = bend;
            }
        }
    }
    let is_opaque = |plane: &Plane| {
        let disc = Disc {
            center: center.into(),
            axis: plane.axis,
            radius,
            half_thickness: AREA_HALF_THICKNESS_RADII * radius,
        };
        let [on, through] = seen(&disc, CELLS_PER_RADIUS, cells, view).cells;
        through <= MAX_SEEN_THROUGH_SHARE * (through + on)
    };
    found.filter(is_opaque).map(|plane| (plane, radius))
}

/// The plane through the clusters within `radius`, on one side only if `side` is given; `None` with too few clusters.
///
/// Dispatched here: inlined in callers, each call would be copied per vector width, and closures would lose the
/// dispatch.
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
        len = gathered.keep_beside(side, -SIDE_SLACK_RADII);
    }
    (len >= LEAST_CLUSTERS).then(|| gathered.plane(simd))
}
