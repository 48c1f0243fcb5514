//! The lines of sight of a picture, and the projection onto its pixels.

use anyhow::{Result, bail};
use autosplats::cloud::glam::DVec3;
use autosplats::{Camera, Projection};

/// The lines of sight of a picture.
#[derive(Clone, Copy, Debug)]
pub struct Rays {
    /// Unit vectors in the world: right, down and forward.
    pub axes: [DVec3; 3],
    /// The camera of the picture.
    pub camera: Camera,
    perspective: bool,
    /// Size of a pixel in the world: at depth 1 in perspective, at any depth in parallel projection.
    pixel: f64,
    /// The picture's middle, pixels.
    middle: [f64; 2],
}

impl Rays {
    /// Lines of sight of a picture of `size` pixels.
    ///
    /// # Errors
    /// An invalid camera.
    pub fn new(camera: &Camera, size: [u32; 2]) -> Result<Self> {
        let axes = camera.axes()?;
        let height = f64::from(size[1]);
        let (perspective, pixel) = match camera.projection {
            Projection::PerspectiveFovDeg(fov) => (true, (0.5 * fov.to_radians()).tan() / (0.5 * height)),
            Projection::OrthographicHeight(world) => (false, world / height),
            Projection::Pinhole { .. } => bail!("no case has a calibrated camera"),
        };
        Ok(Self { axes, camera: *camera, perspective, pixel, middle: size.map(|side| 0.5 * f64::from(side)) })
    }

    /// Origin and unit direction of the ray through a place in the picture, given in pixels.
    pub fn through(&self, [x, y]: [f64; 2]) -> (DVec3, DVec3) {
        let [right, down, forward] = self.axes;
        let across = right * ((x - self.middle[0]) * self.pixel) + down * ((y - self.middle[1]) * self.pixel);
        if self.perspective {
            (self.camera.eye, (forward + across).normalize())
        } else {
            (self.camera.eye + across, forward)
        }
    }

    /// Size of a pixel in the world at `depth`.
    pub fn pixel_size(&self, depth: f64) -> f64 {
        if self.perspective { self.pixel * depth } else { self.pixel }
    }

    /// Pixel coordinates and depth of a place in the world. `None` if the depth is not above 0.
    pub fn project(&self, place: DVec3) -> Option<([f64; 2], f64)> {
        let [x, y, depth] = self.axes.map(|axis| axis.dot(place - self.camera.eye));
        let unit = self.pixel_size(depth);
        (depth > 0.0).then(|| ([self.middle[0] + x / unit, self.middle[1] + y / unit], depth))
    }

    /// A direction of the world in the picture's axes: right, down, forward.
    pub fn turned(&self, direction: DVec3) -> DVec3 {
        DVec3::from(self.axes.map(|axis| axis.dot(direction)))
    }
}
