//! Surfels of points whose planes are given.

use glam::Vec3;

use super::{FitRules, Surfel, Surfels};
use crate::camera::View;
use crate::project::ScreenPoints;

/// Planes of all points of a cloud, in the order of the points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GivenPlanes<'a> {
    /// Unit normals in the cloud's axes, on either side of the surface.
    pub(crate) normals: &'a [[f32; 3]],
    /// Splat radii in world units, before scaling.
    pub(crate) radius: &'a [f32],
    pub(crate) curvature: &'a [f32],
}

/// Appends the surfels of `queries`, indices of screen points, to `surfels`: the given circles, turned towards the
/// eye. A surfel whose normal or radius is not finite gets radius 0 and is not drawn.
pub(crate) fn place(
    screen: &ScreenPoints,
    queries: &[u32],
    planes: &GivenPlanes<'_>,
    view: &View,
    rules: &FitRules,
    surfels: &mut Surfels,
) {
    surfels.extend(queries.iter().map(|&query| {
        let point = &screen.points[query as usize];
        let source = screen.source[query as usize];
        let normal = view.view_from_world * Vec3::from(planes.normals[source as usize]);
        let normal = view.turned_to_eye(normal, point.position_view.into());
        // Splat set-up draws a NaN radius as wide as a splat can be.
        let is_drawn = normal.is_finite() && planes.radius[source as usize].is_finite();
        let radius = if is_drawn { planes.radius[source as usize].max(0.0) } else { 0.0 };
        Surfel {
            center: point.position_view,
            radius: rules.splat_scale * radius,
            normal: normal.to_array(),
            // The radius is 2·√(r_k²/k).
            k_radius: 0.5 * radius * (rules.k as f32).sqrt(),
            major_axis: normal.any_orthonormal_vector().to_array(),
            major_ratio: 1.0,
            curvature: planes.curvature[source as usize],
            pixel: point.pixel,
            source,
            screen_and_flags: query,
        }
    }));
}
