//! Cameras: which part of the world a picture shows.
//!
//! All stages work in view space: the eye is the origin, x points right, y down and z forward. Depth is z, so it grows
//! away from the eye. Distances are in world units. Pixel (0, 0) is the top-left pixel and covers `0.0..1.0` in both
//! directions; its centre is at (0.5, 0.5).

mod body;
mod fit;
mod lens;
mod reproject;
mod upright;

pub use fit::ViewDirection;

pub use lens::Lens;
pub(crate) use reproject::{PlacedView, Reprojection};
pub use upright::guess_axes;

use glam::{DVec3, Mat3, Vec3};
use serde::{Deserialize, Serialize};

use crate::Error;

/// Shorter side of the picture over the width of its margin.
pub(crate) const PICTURE_SIDE_PER_MARGIN: u32 = 12;

/// A camera in world coordinates.
///
/// # Examples
///
/// ```
/// use autosplats::{Camera, Projection, cloud::glam::{DVec2, DVec3}};
///
/// let camera = Camera {
///     eye: DVec3::new(0.0, -10.0, 0.0),
///     look_at: DVec3::ZERO,
///     up: DVec3::Z,
///     projection: Projection::PerspectiveFovDeg(40.0),
/// };
/// let middle = camera.to_pixel(DVec3::ZERO, [640, 480])?;
/// assert_eq!(middle, Some((DVec2::new(320.0, 240.0), 10.0)));
/// # Ok::<(), autosplats::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Position of the eye, world coordinates.
    pub eye: DVec3,
    /// Point in the middle of the picture, world coordinates; differs from the eye.
    pub look_at: DVec3,
    /// Direction that is upward in the picture, world coordinates, any length; not along the line of sight.
    pub up: DVec3,
    /// Kind of projection and size of what is seen.
    pub projection: Projection,
}

/// How points are projected onto the image plane.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Projection {
    /// Perspective, with the vertical field of view in degrees, 0.01 to 170.
    PerspectiveFovDeg(f64),
    /// Orthographic, with the height of the picture in world units, above 0.
    OrthographicHeight(f64),
    /// Perspective of a calibrated camera. The line of sight to [`look_at`](Camera::look_at) is its optical axis, which
    /// may meet the picture anywhere. Lengths are parts of the picture's width and height.
    Pinhole {
        /// Focal lengths along x and y, as parts of width and height, above 0. In pixels they may differ by a
        /// twentieth: surfaces are reconstructed in a space that is stretched by that.
        focal: [f64; 2],
        /// Where the optical axis meets the picture, from the outer corner of its first pixel.
        center: [f64; 2],
    },
}

impl Projection {
    /// Usual vertical field of view of a picture, degrees.
    pub const USUAL_FOV_DEG: f64 = 40.0;

    /// Vertical field of view in degrees, for a picture about the optical axis; `None` without perspective.
    #[must_use]
    pub fn fov_deg(self) -> Option<f64> {
        match self {
            Self::PerspectiveFovDeg(fov) => Some(fov),
            Self::OrthographicHeight(_) => None,
            Self::Pinhole { focal: [_, focal], .. } => Some(2.0 * (0.5 / focal).atan().to_degrees()),
        }
    }
}

/// A [`Camera`] prepared for one picture of one cloud, with rotation and focal length in `f32`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct View {
    /// Width of the screen in pixels: the picture and the margin on both sides.
    pub(crate) width: u32,
    /// Height of the screen in pixels: the picture and the margin on both sides.
    pub(crate) height: u32,
    /// Width in pixels of the margin on every side of the picture.
    pub(crate) margin: u32,
    /// Rotation from world to view space; then x is multiplied by `stretch`.
    pub(crate) view_from_world: Mat3,
    /// Focal length along x over that along y. View space is stretched by it, so that pixels are square there.
    pub(crate) stretch: f32,
    /// Where the optical axis meets the screen, in pixels.
    pub(crate) middle: [f32; 2],
    /// Position of the eye, world coordinates.
    pub(crate) eye: DVec3,
    /// Position of the eye relative to the cloud's origin, in world orientation.
    pub(crate) eye_local: Vec3,
    /// Pixels per unit of x/z (perspective) or of x (orthographic).
    pub(crate) focal_px: f32,
    /// Whether all lines of sight meet in the eye.
    pub(crate) perspective: bool,
    /// Near plane: points at this depth or nearer are dropped.
    pub(crate) near: f32,
}

impl Camera {
    /// Unit vectors right, down and forward in world coordinates.
    ///
    /// # Errors
    /// [`Error::Camera`] if `eye` and `look_at` are the same point, `up` is zero or along the line of sight, or a value
    /// is not finite.
    pub fn axes(&self) -> Result<[DVec3; 3], Error> {
        let invalid = |what: &str| Error::Camera(what.into());
        if !(self.eye.is_finite() && self.look_at.is_finite() && self.up.is_finite()) {
            return Err(invalid("eye, look-at and up must be finite numbers"));
        }
        let forward =
            (self.look_at - self.eye).try_normalize().ok_or_else(|| invalid("eye and look-at are the same point"))?;
        let up = self.up.try_normalize().ok_or_else(|| invalid("up must not be zero"))?;
        let right = forward.cross(up);
        if right.length() < 1e-6 {
            return Err(invalid("up must not lie along the line of sight"));
        }
        let right = right.normalize();
        Ok([right, forward.cross(right), forward])
    }

    /// Checks that the camera is valid.
    ///
    /// # Errors
    /// [`Error::Camera`] names what is wrong with its directions or its projection.
    pub fn check(&self) -> Result<(), Error> {
        // Of what shape pixels are depends on the size of the picture.
        let size = match self.projection {
            Projection::Pinhole { focal: [x, y], .. } => [(4096.0 * y / x).clamp(1.0, 1e9) as u32, 4096],
            _ => [1, 1],
        };
        self.lens(size).map(|_| ())
    }

    /// Prepares the camera for a picture of `size` pixels, without a margin, of a cloud about `origin`.
    pub(crate) fn view(&self, origin: DVec3, size: [u32; 2]) -> Result<View, Error> {
        let Lens { axes: [right, down, forward], focal_px, perspective, near, middle, stretch, .. } =
            self.lens(size)?;
        let right = right * stretch;
        Ok(View {
            width: size[0],
            height: size[1],
            margin: 0,
            view_from_world: Mat3::from_cols(right.as_vec3(), down.as_vec3(), forward.as_vec3()).transpose(),
            stretch: stretch as f32,
            middle: middle.as_vec2().to_array(),
            eye: self.eye,
            eye_local: (self.eye - origin).as_vec3(),
            focal_px: focal_px as f32,
            perspective,
            near: near as f32,
        })
    }
}

#[allow(clippy::wrong_self_convention, reason = "a view is too large to be handed over for every point")]
impl View {
    /// The same view of points about another origin.
    pub(crate) fn about(self, origin: DVec3) -> Self {
        Self { eye_local: (self.eye - origin).as_vec3(), ..self }
    }

    /// The same picture with a margin of `margin` pixels on every side.
    pub(crate) fn with_margin(self, margin: u32) -> Self {
        let [width, height] = self.picture_size().map(|side| side + 2 * margin);
        let middle = self.middle.map(|at| at - self.margin as f32 + margin as f32);
        Self { width, height, margin, middle, ..self }
    }

    /// Width and height of the picture in pixels, without the margin.
    pub(crate) fn picture_size(&self) -> [u32; 2] {
        [self.width, self.height].map(|side| side - 2 * self.margin)
    }

    /// Distance in pixels of a screen pixel from the picture, along the axis where it is larger; 0 in the picture.
    #[inline(always)]
    pub(crate) fn beside_picture(&self, [x, y]: [usize; 2]) -> usize {
        let margin = self.margin as usize;
        let beside =
            |at: usize, side: u32| margin.saturating_sub(at).max((at + margin + 1).saturating_sub(side as usize));
        beside(x, self.width).max(beside(y, self.height))
    }

    /// View-space position of a point given relative to the cloud's origin.
    #[inline(always)]
    pub(crate) fn to_view(&self, position: [f32; 3]) -> Vec3 {
        self.view_from_world * (Vec3::from(position) - self.eye_local)
    }

    /// Pixel coordinates on the screen of a view-space position in front of the eye.
    #[inline(always)]
    pub(crate) fn to_pixel(&self, position_view: Vec3) -> [f32; 2] {
        let scale = if self.perspective { self.focal_px / position_view.z } else { self.focal_px };
        [position_view.x * scale + self.middle[0], position_view.y * scale + self.middle[1]]
    }

    /// Size of a pixel in world units at `depth`.
    #[inline(always)]
    pub(crate) fn pixel_size(&self, depth: f32) -> f32 {
        if self.perspective { depth / self.focal_px } else { 1.0 / self.focal_px }
    }

    /// Direction from a view-space position towards the eye, of any length.
    #[inline(always)]
    pub(crate) fn to_eye(&self, position: Vec3) -> Vec3 {
        if self.perspective { -position } else { Vec3::NEG_Z }
    }

    /// The normal of a surface at a view-space position, flipped if it faces away from the eye.
    #[inline(always)]
    pub(crate) fn turned_to_eye(&self, normal: Vec3, position: Vec3) -> Vec3 {
        if normal.dot(self.to_eye(position)) < 0.0 { -normal } else { normal }
    }

    /// View-space position that projects to screen coordinates `pixel` at `depth`.
    #[inline(always)]
    pub(crate) fn unproject(&self, pixel: [f32; 2], depth: f32) -> Vec3 {
        let scale = self.pixel_size(depth);
        Vec3::new((pixel[0] - self.middle[0]) * scale, (pixel[1] - self.middle[1]) * scale, depth)
    }

    /// The eye in world coordinates as two parts: the nearest `f32`, and what they lack.
    pub(crate) fn eye_parts(&self) -> [Vec3; 2] {
        let high = self.eye.as_vec3();
        [high, (self.eye - high.as_dvec3()).as_vec3()]
    }

    /// A view-space vector in world axes.
    #[inline(always)]
    pub(crate) fn to_world(&self, vector_view: Vec3) -> Vec3 {
        self.view_from_world.transpose() * (vector_view * Vec3::from(self.unstretched()))
    }

    /// Factors on a view-space vector before the transposed rotation turns it into world axes.
    pub(crate) fn unstretched(&self) -> [f32; 3] {
        [1.0 / (self.stretch * self.stretch), 1.0, 1.0]
    }
}
