//! The uniform that all passes of a frame share.

use bytemuck::{Pod, Zeroable};

use crate::camera::{Reprojection, View};

/// The camera and the settings, in the layout of `shared/frame.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct FrameUniform {
    /// Columns, each padded to four numbers.
    pub(crate) view_from_world: [[f32; 4]; 3],
    pub(crate) eye_local: [f32; 3],
    pub(crate) focal_px: f32,
    pub(crate) size: [u32; 2],
    pub(crate) near: f32,
    pub(crate) perspective: u32,
    pub(crate) k: u32,
    pub(crate) halves: u32,
    pub(crate) grid_culling: u32,
    /// 1 if the search is lenient towards gaps after one neighbour and towards outliers.
    pub(crate) lenient: u32,
    pub(crate) keep_outliers: u32,
    pub(crate) splat_scale: f32,
    /// Radius within which a point must have a neighbour, in first search radii.
    pub(crate) outlier_growth: f32,
    /// √λ; infinite if all gaps are bridged.
    pub(crate) gap_growth: f32,
    /// First radius of the kd-tree search, world units.
    pub(crate) first_radius: f32,
    /// Longest ellipse, semi-major over semi-minor axis; 1 for circles.
    pub(crate) longest: f32,
    /// Number of frames over which surfels are averaged.
    pub(crate) frames_averaged: f32,
    /// 1 if the last frame showed the same points.
    pub(crate) same_points: u32,
    pub(crate) picture: [u32; 2],
    /// The half of the kept k-radii with those of the last frame; 0 or 1.
    pub(crate) past_half: u32,
    /// 1 if the last picture showed the same points with the same settings and is averaged with this one.
    pub(crate) same_picture: u32,
    /// Columns, each padded to four numbers.
    pub(crate) past_rotation: [[f32; 4]; 3],
    pub(crate) past_shift: [f32; 3],
    /// Focal length of the last frame in pixels; 0 without a last frame.
    pub(crate) past_focal_px: f32,
    /// Radius in pixels if all points are drawn as dots; 0 if they form a surface.
    pub(crate) dot_px: f32,
    /// 1 if surfels on scan lines keep their full length.
    pub(crate) scan_lines: u32,
    /// 1 if outliers are held against the density around them.
    pub(crate) compares_density: u32,
    /// 1 if points near the eye are listed.
    pub(crate) near_cells: u32,
    /// Where the optical axis meets the screen, pixels.
    pub(crate) middle: [f32; 2],
    pub(crate) past_middle: [f32; 2],
    /// Factors on a view-space vector before the transposed rotation turns it into world axes; the fourth is 0.
    pub(crate) unstretched: [f32; 4],
    /// The parts of the eye's position in world coordinates, each padded to four numbers.
    pub(crate) eye_parts: [[f32; 4]; 2],
}

impl FrameUniform {
    /// The camera with the simplest settings.
    pub(crate) fn new(view: &View, k: u32) -> Self {
        Self {
            view_from_world: columns(view.view_from_world),
            eye_local: view.eye_local.to_array(),
            focal_px: view.focal_px,
            size: [view.width, view.height],
            near: view.near,
            perspective: view.perspective.into(),
            k,
            halves: 0,
            grid_culling: 0,
            lenient: 0,
            keep_outliers: 0,
            splat_scale: 1.0,
            outlier_growth: f32::INFINITY,
            gap_growth: f32::INFINITY,
            first_radius: 1.0,
            longest: 1.0,
            frames_averaged: 1.0,
            same_points: 0,
            picture: view.picture_size(),
            past_half: 0,
            same_picture: 0,
            past_rotation: [[0.0; 4]; 3],
            past_shift: [0.0; 3],
            past_focal_px: 0.0,
            dot_px: 0.0,
            scan_lines: 0,
            compares_density: 0,
            near_cells: 0,
            middle: view.middle,
            past_middle: view.middle,
            unstretched: {
                let [x, y, z] = view.unstretched();
                [x, y, z, 0.0]
            },
            eye_parts: view.eye_parts().map(|part| [part.x, part.y, part.z, 0.0]),
        }
    }

    /// Adds the last frame for reprojection.
    pub(crate) fn after(self, past: &Reprojection) -> Self {
        let Reprojection { rotation, shift, view } = past;
        Self {
            past_rotation: columns(*rotation),
            past_shift: shift.to_array(),
            past_focal_px: view.focal_px,
            past_middle: view.middle,
            ..self
        }
    }
}

/// A matrix in the layout of uniforms.
fn columns(matrix: glam::Mat3) -> [[f32; 4]; 3] {
    [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(|axis| [axis.x, axis.y, axis.z, 0.0])
}
