//! Fit: moments to surfels, by the eigenvectors of the covariance [Paper, §6].
//!
//! # How it works
//! The covariance of a point and its neighbours is diagonalised by cyclic Jacobi rotations, one SIMD vector of
//! matrices at a time. The number of operations is fixed and free of branches; the rotations converge from any start
//! and keep the axes orthogonal. The axis of the least eigenvalue is the normal, turned towards the eye. The splat
//! radius is 2·√(r_k²/k), twice the radius of the circle that each neighbour covers on average. A point that is no
//! part of its neighbours' surface gets radius 0 (`alone`). Where a point's sensor is known, surfels seen from the
//! other side are marked (`orient/`).

mod alone;
mod cpu;
mod eigen;
mod given;
pub(crate) mod gpu;
pub(crate) mod orient;
#[cfg(test)]
pub(crate) mod tests;

pub(crate) use alone::MIN_SURFACE_POINTS;
pub(crate) use cpu::{FitRules, Fitted, LONGEST, fit};
pub(crate) use eigen::{SWEEPS, eigenvectors};
pub(crate) use given::{GivenPlanes, place};

use glam::Vec3;

use crate::camera::View;
use crate::project::{ScreenPoint, pixel_xy};

/// Radius to which a splat is drawn, in splat radii; the weight falls to nearly 0 there. With random samples, 1 in 50
/// places of a surface lies in no disc of the splat radius, 1 in 3000 in no disc of this radius.
// Differs from the paper: the paper cuts the Gaussian at the splat radius.
pub(crate) const SUPPORT: f32 = 1.4;

/// An oriented disc in view space.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct Surfel {
    /// The point itself, or the surface fitted to noisy points there, in view space.
    pub(crate) center: [f32; 3],
    /// Semi-minor axis, world units; a [dropped](Self::is_dropped) surfel has none.
    pub(crate) radius: f32,
    /// Unit normal towards the eye, view space.
    pub(crate) normal: [f32; 3],
    /// Distance to the furthest neighbour, world units.
    pub(crate) k_radius: f32,
    /// Unit direction of the semi-major axis, view space, in the disc's plane.
    pub(crate) major_axis: [f32; 3],
    /// Semi-major over semi-minor axis; 1 for circles. Until `adapt` limits it, the ratio of variances of a scan line.
    pub(crate) major_ratio: f32,
    /// Surface variation λ0/(λ0+λ1+λ2), 0 to 1/3.
    pub(crate) curvature: f32,
    /// Pixel of the centre, with the flags of the point: see [`ScreenPoint::pixel`].
    pub(crate) pixel: u32,
    /// Index in the cloud.
    pub(crate) source: u32,
    /// Index among the screen points, which stays below 2³⁰ with at most two points a pixel, and two flags:
    /// [`BACK`](Self::BACK) and [`LINE`](Self::LINE).
    pub(crate) screen_and_flags: u32,
}

impl Surfel {
    /// Flag: the eye sees the side that the point's sensor did not see.
    pub(crate) const BACK: u32 = 1 << 31;
    /// Flag: the neighbourhood is a line, which has no width to draw.
    pub(crate) const LINE: u32 = 1 << 30;

    /// Index among the screen points.
    #[inline(always)]
    pub(crate) fn screen(&self) -> u32 {
        self.screen_and_flags & !(Self::BACK | Self::LINE)
    }

    #[inline(always)]
    pub(crate) fn shows_back(&self) -> bool {
        self.screen_and_flags & Self::BACK != 0
    }

    #[inline(always)]
    pub(crate) fn is_line(&self) -> bool {
        self.screen_and_flags & Self::LINE != 0
    }

    /// Drops the point: nothing is drawn.
    #[inline(always)]
    pub(crate) fn discard(&mut self) {
        self.radius = 0.0;
    }

    /// Whether the point is dropped: as an outlier, or because it has no neighbours or all lie at its own place.
    #[inline(always)]
    pub(crate) fn is_dropped(&self) -> bool {
        self.radius == 0.0
    }

    /// Whether the point is near the eye: see [`ScreenPoints`](crate::project::ScreenPoints).
    #[inline(always)]
    pub(crate) fn is_near(&self) -> bool {
        self.pixel & ScreenPoint::NEAR != 0
    }

    /// Column and row of the centre's pixel.
    #[inline(always)]
    pub(crate) fn pixel_xy(&self) -> [usize; 2] {
        pixel_xy(self.pixel)
    }

    /// Moves the centre, unless it would leave the screen: there is no pixel outside to test its visibility at.
    #[inline(always)]
    pub(crate) fn move_to(&mut self, center: Vec3, view: &View) {
        let [x, y] = view.to_pixel(center);
        if center.z > view.near && x >= 0.0 && y >= 0.0 && x < view.width as f32 && y < view.height as f32 {
            self.center = center.to_array();
            self.pixel = self.pixel & ScreenPoint::NEAR | (y as u32) << 16 | x as u32;
        }
    }
}

/// The surfels of a list of screen points, in the order of the list. In a frame `fit` writes them; then `adapt` moves,
/// turns and resizes them, `orient` marks backs, and `splat/over_time` averages them, all in place.
pub(crate) type Surfels = Vec<Surfel>;
