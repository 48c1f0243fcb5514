//! The surface that the last frame showed.
//!
//! A surfel looks back to its place in the last frame. If the surface seen there is near and faces the same way, it
//! counts as the same one. The surfel then moves and turns towards it by a share of the way. So noise is averaged over
//! frames with fading weights, and only the last frame's picture is kept. Moving surfaces lag by as many frames.
//! Surfaces that move by more than [`MAX_SURFACE_DISTANCE_RADII`] k-radii a frame are left alone. Detail as fine as
//! pixels is blurred.

use glam::Vec3;

use crate::camera::{Reprojection, View};
use crate::fit::Surfel;
use crate::splat::GBuffer;

/// Least cosine of the angle between the surfel's normal and that of the same surface in the last frame.
pub(super) const MIN_SURFACE_COSINE: f32 = 0.7;
/// Largest distance of the same surface in the last frame, in k-radii of the surfel.
pub(super) const MAX_SURFACE_DISTANCE_RADII: f32 = 0.5;

/// A surface of the last frame, in view space.
pub(super) struct LastSurface {
    /// Unit normal, on the same side as the surfel's.
    normal: Vec3,
    /// Distance in world units by which the surfel lies in front.
    distance: f32,
}

/// The surface that the last frame showed at the surfel's place, if it is the same.
pub(super) fn seen_before(surfel: &Surfel, last: &GBuffer, past: &Reprojection) -> Option<LastSurface> {
    let pixel = past.pixel(surfel.center)?;
    let width = past.view.width as usize;
    let [x, y] = [pixel % width, pixel / width];
    let at = last.tiles.index([x, y]);
    if last.weight[at] == 0.0 {
        return None;
    }
    let seen = past.view.unproject([x as f32 + 0.5, y as f32 + 0.5], last.depth[at]);
    let normal = Vec3::from(last.normal[at]);
    let distance = normal.dot(past.position(surfel.center) - seen);
    let normal = past.rotation.transpose() * normal;
    let facing = normal.dot(surfel.normal.into());
    let is_same = distance.abs() <= MAX_SURFACE_DISTANCE_RADII * surfel.k_radius
        && facing.abs() >= MIN_SURFACE_COSINE
        && !surfel.is_dropped();
    is_same.then(|| LastSurface { normal: normal * facing.signum(), distance: distance * facing.signum() })
}

/// Moves and turns a surfel towards a surface by `share` of the way, 0 to below 1.
pub(super) fn draw_towards(surfel: &mut Surfel, surface: &LastSurface, share: f32, view: &View) {
    let center = Vec3::from(surfel.center) - share * surface.distance * surface.normal;
    draw_to(surfel, center, surface.normal, share, view);
}

/// Moves a surfel to `center` and turns it by `share` of the way towards `then`, a normal on the same side.
pub(super) fn draw_to(surfel: &mut Surfel, center: Vec3, then: Vec3, share: f32, view: &View) {
    let now = Vec3::from(surfel.normal);
    let normal = view.turned_to_eye((now + share * (then - now)).normalize(), center);
    let major_axis = Vec3::from(surfel.major_axis);
    surfel.normal = normal.to_array();
    surfel.major_axis = (major_axis - normal * normal.dot(major_axis)).normalize().to_array();
    surfel.move_to(center, view);
}
