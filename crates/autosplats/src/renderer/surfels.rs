//! Results of the last frame for each visible point.

use glam::{Mat3A, Vec3A};

use crate::camera::View;
use crate::fit::Surfel;

/// The disc that a visible point was drawn as: the result of search and fit.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct PointSurfel {
    /// Index of the point in the cloud or [pool](autosplats_cloud::PointPool).
    pub point: u32,
    /// Unit normal in the cloud's axes. The normal faces the sensor if the cloud contains the point's
    /// [scan](autosplats_cloud::PointCloud::scans), unless the sensor or the eye looks along the surface. Otherwise,
    /// and with given normals, it faces the eye.
    pub normal: [f32; 3],
    /// Semi-minor axis in the cloud's unit; 0 if the point was discarded as an outlier.
    pub radius: f32,
    /// Distance to the furthest neighbour in the cloud's unit; 0 without neighbours.
    pub k_radius: f32,
    /// Surface variation, 0 (flat) to 1/3.
    pub curvature: f32,
}

/// Surfels of a frame for the caller: those whose centres are in the picture.
pub(super) fn point_surfels(surfels: &[Surfel], view: &View) -> Vec<PointSurfel> {
    let world_from_view = Mat3A::from(view.view_from_world).transpose();
    let is_seen = |surfel: &&Surfel| view.beside_picture(surfel.pixel_xy()) == 0;
    let surfel = |surfel: &Surfel| PointSurfel {
        point: surfel.source,
        normal: {
            let towards_eye = world_from_view * Vec3A::from(surfel.normal);
            if surfel.shows_back() { -towards_eye } else { towards_eye }.to_array()
        },
        radius: surfel.radius,
        k_radius: surfel.k_radius,
        curvature: surfel.curvature,
    };
    surfels.iter().filter(is_seen).map(surfel).collect()
}
