//! Projection between world and picture in `f64`, for overlays and picking.
//!
//! The stages use the crate's own `View` instead, in `f32` about a cloud's origin. A `View` is made from a [`Lens`].

use std::ops::RangeInclusive;

use glam::{DVec2, DVec3};

use super::{Camera, Projection};
use crate::Error;

/// A [`Camera`] prepared for pictures of one size.
///
/// Pixel coordinates are those of the picture: (0, 0) is the outer corner of the top-left pixel, whose centre is at
/// (0.5, 0.5). Depth is the distance in world units from the plane through the eye parallel to the picture, as in
/// [`GBuffer`](crate::GBuffer).
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
///     projection: Projection::OrthographicHeight(48.0),
/// };
/// let lens = camera.lens([64, 48])?;
/// assert_eq!(lens.pixel_size(10.0), 1.0);
/// assert_eq!(lens.unproject(DVec2::new(33.0, 24.0), 10.0), DVec3::X);
/// assert_eq!(lens.ray(DVec2::new(32.0, 24.0)), (camera.eye, DVec3::Y));
/// # Ok::<(), autosplats::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    pub(crate) eye: DVec3,
    /// Unit vectors right, down and forward, world coordinates.
    pub(super) axes: [DVec3; 3],
    /// Middle of the picture in pixels.
    pub(crate) middle: DVec2,
    /// Pixels per unit of y/z (perspective) or of y (orthographic).
    pub(super) focal_px: f64,
    /// Focal length along x over that along y.
    pub(crate) stretch: f64,
    /// Whether all lines of sight meet in the eye.
    pub(crate) perspective: bool,
    /// Near plane: points at this depth or nearer are not in the picture.
    pub(crate) near: f64,
}

impl Camera {
    /// Prepares the camera for pictures of `size` pixels. A [`Lens`] is the quick way to project many points.
    ///
    /// # Errors
    /// [`Error::Camera`] if the camera is invalid.
    pub fn lens(&self, size: [u32; 2]) -> Result<Lens, Error> {
        let axes = self.axes()?;
        let [width, height] = size.map(f64::from);
        let (mut middle, mut stretch) = (0.5 * DVec2::new(width, height), 1.0);
        let (focal_px, perspective) = match self.projection {
            Projection::PerspectiveFovDeg(fov) if (0.01..=170.0).contains(&fov) => {
                (0.5 * height / (0.5 * fov.to_radians()).tan(), true)
            }
            Projection::Pinhole { focal: [along_x, along_y], center } => {
                middle = DVec2::from(center) * DVec2::new(width, height);
                stretch = along_x * width / (along_y * height);
                check_pinhole([along_x, along_y], center, stretch)?;
                (along_y * height, true)
            }
            Projection::PerspectiveFovDeg(fov) => {
                return Err(Error::Camera(format!("field of view {fov} is not within 0.01 to 170 degrees")));
            }
            Projection::OrthographicHeight(world) if world > 0.0 && world.is_finite() => (height / world, false),
            Projection::OrthographicHeight(world) => {
                return Err(Error::Camera(format!("orthographic height {world} is not above 0")));
            }
        };
        // An orthographic camera drops what is behind the plane of the eye; a perspective one divides by depth.
        let near = if perspective { (self.look_at - self.eye).length() * 1e-5 } else { 0.0 };
        Ok(Lens { eye: self.eye, axes, middle, focal_px, stretch, perspective, near })
    }

    /// Pixel coordinates and depth of `world` in a picture of `size` pixels; see [`Lens::to_pixel`].
    ///
    /// # Errors
    /// [`Error::Camera`] if the camera is invalid.
    pub fn to_pixel(&self, world: DVec3, size: [u32; 2]) -> Result<Option<(DVec2, f64)>, Error> {
        Ok(self.lens(size)?.to_pixel(world))
    }

    /// World coordinates of the point at `pixel` and `depth` in a picture of `size` pixels; see [`Lens::unproject`].
    ///
    /// # Errors
    /// [`Error::Camera`] if the camera is invalid.
    pub fn unproject(&self, pixel: DVec2, depth: f64, size: [u32; 2]) -> Result<DVec3, Error> {
        Ok(self.lens(size)?.unproject(pixel, depth))
    }
}

/// Largest part by which the focal lengths of a camera may differ in pixels.
const MAX_STRETCH: f64 = 0.05;
/// Focal lengths, as parts of the picture, and parts of it by which the optical axis may miss its middle.
const FOCAL_LENGTHS: RangeInclusive<f64> = 0.04..=6000.0;
const MAX_ASIDE: f64 = 10.0;

fn check_pinhole(focal: [f64; 2], center: [f64; 2], stretch: f64) -> Result<(), Error> {
    if focal.iter().any(|focal| !FOCAL_LENGTHS.contains(focal)) {
        return Err(Error::Camera(format!(
            "focal lengths {focal:?} are not within 0.04 to 6000 of the picture's sides"
        )));
    }
    if !((stretch - 1.0).abs() <= MAX_STRETCH) {
        let what = "focal lengths in pixels may differ by 5 %";
        return Err(Error::Camera(format!("the one along x is {stretch:.3} times that along y; {what}")));
    }
    if center.iter().any(|center| !((center - 0.5).abs() <= MAX_ASIDE)) {
        return Err(Error::Camera(format!("the optical axis is at {center:?}, far from the picture")));
    }
    Ok(())
}

#[allow(clippy::wrong_self_convention, reason = "the lens maps; it is not converted")]
impl Lens {
    /// Pixel coordinates and depth of `world`, also beyond the picture's edges; `None` if the point is not in front of
    /// the eye or not finite.
    pub fn to_pixel(&self, world: DVec3) -> Option<(DVec2, f64)> {
        let from_eye = world - self.eye;
        let [x, y, depth] = self.axes.map(|axis| axis.dot(from_eye));
        if !(depth > self.near && depth < f64::INFINITY) {
            return None;
        }
        Some((self.middle + DVec2::new(x * self.stretch, y) / self.pixel_size(depth), depth))
            .filter(|(pixel, _)| pixel.is_finite())
    }

    /// World coordinates of the point at `pixel` and `depth`.
    pub fn unproject(&self, pixel: DVec2, depth: f64) -> DVec3 {
        let [right, down, forward] = self.axes;
        let aside = (pixel - self.middle) * self.pixel_size(depth);
        self.eye + right * (aside.x / self.stretch) + down * aside.y + forward * depth
    }

    /// Line of sight through `pixel`: its start and its direction as a unit vector, both in world coordinates.
    pub fn ray(&self, pixel: DVec2) -> (DVec3, DVec3) {
        if self.perspective {
            (self.eye, (self.unproject(pixel, 1.0) - self.eye).normalize())
        } else {
            (self.unproject(pixel, 0.0), self.axes[2])
        }
    }

    /// World-space unit vector of a normal of a picture's [surface](crate::GBuffer).
    #[must_use]
    pub fn world_normal(&self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        let [right, down, forward] = self.axes.map(|axis| axis.as_vec3());
        if self.stretch == 1.0 {
            return (right * x + down * y + forward * z).to_array();
        }
        // Normals are perpendicular to what is stretched, so the stretch acts on them in reverse.
        (right * (x * self.stretch as f32) + down * y + forward * z).normalize_or_zero().to_array()
    }

    /// Height of a pixel in world units at `depth`.
    pub fn pixel_size(&self, depth: f64) -> f64 {
        if self.perspective { depth / self.focal_px } else { 1.0 / self.focal_px }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [u32; 2] = [640, 360];
    /// A position where `f32` resolves half metres.
    const FAR: DVec3 = DVec3::new(512_000.0, 5_400_000.0, 300.0);

    /// Lengths of a calibrated camera.
    const PINHOLE: Projection = Projection::Pinhole { focal: [0.61, 1.07], center: [0.43, 0.56] };

    fn cameras() -> [Camera; 3] {
        [Projection::PerspectiveFovDeg(50.0), Projection::OrthographicHeight(8.0), PINHOLE].map(|projection| Camera {
            eye: FAR + DVec3::new(3.0, -9.0, 4.0),
            look_at: FAR + DVec3::new(0.25, 0.5, -0.125),
            up: DVec3::new(0.1, 0.0, 2.0),
            projection,
        })
    }

    /// Offsets from `FAR` on a lattice that is not aligned with the cameras' axes.
    fn places() -> impl Iterator<Item = DVec3> {
        (0..1000).map(|i| DVec3::new(f64::from(i % 10), f64::from(i / 10 % 10), f64::from(i / 100)) * 0.75 - 3.0)
    }

    #[test]
    fn pixels_are_those_of_the_stages() {
        for camera in cameras() {
            let (lens, view) = (camera.lens(SIZE).expect("a lens"), camera.view(FAR, SIZE).expect("a view"));
            for place in places() {
                let (pixel, depth) = lens.to_pixel(FAR + place).expect("in front of the eye");
                let position_view = view.to_view(place.as_vec3().to_array());
                let [x, y] = view.to_pixel(position_view).map(f64::from);
                // `f32` at some hundred pixels and about ten units.
                assert!((pixel - DVec2::new(x, y)).abs().max_element() < 1e-3, "{place}: {pixel} is not {x}, {y}");
                assert!((depth - f64::from(position_view.z)).abs() < 1e-5, "{place}: depth {depth}");
                assert!((lens.pixel_size(depth) / f64::from(view.pixel_size(depth as f32)) - 1.0).abs() < 1e-5, "size");
                assert_eq!(camera.to_pixel(FAR + place, SIZE).expect("sees"), Some((pixel, depth)), "the same at once");
            }
        }
    }

    #[test]
    fn a_margin_leaves_the_picture_where_it_is() {
        for camera in cameras() {
            let picture = camera.view(FAR, SIZE).expect("a view");
            let screen = picture.with_margin(30);
            assert_eq!([screen.width, screen.height], [700, 420]);
            assert_eq!([screen.picture_size(), picture.picture_size()], [SIZE; 2]);
            assert_eq!(screen.with_margin(0), picture, "and back");
            for place in places() {
                let position_view = picture.to_view(place.as_vec3().to_array());
                let [a, b] = [picture, screen].map(|view| view.to_pixel(position_view));
                assert!((0..2).all(|axis| (b[axis] - a[axis] - 30.0).abs() < 1e-3), "{a:?} and {b:?}");
            }
            let beside = [[30, 30], [669, 389], [29, 30], [670, 100], [3, 20], [699, 419], [300, 395]];
            assert_eq!(beside.map(|pixel| screen.beside_picture(pixel)), [0, 0, 1, 1, 27, 30, 6]);
        }
    }

    #[test]
    fn there_and_back() {
        for camera in cameras() {
            let lens = camera.lens(SIZE).expect("a lens");
            for place in places() {
                let (pixel, depth) = lens.to_pixel(FAR + place).expect("in front of the eye");
                let back = camera.unproject(pixel, depth, SIZE).expect("sees") - FAR;
                // The step of `f64` at 5e6 is 1e-9.
                assert!(back.abs_diff_eq(place, 1e-8), "{place}: {back}");
                let (from, direction) = lens.ray(pixel);
                let way = FAR + place - from;
                assert!(way.cross(direction).length() < 1e-7 * way.length(), "{place} is on its line of sight");
                assert!(way.dot(direction) > 0.0, "and ahead");
            }
            let (middle, depth) = lens.to_pixel(camera.look_at).expect("looked at");
            let axis = if camera.projection == PINHOLE { [0.43 * 640.0, 0.56 * 360.0] } else { [320.0, 180.0] };
            assert!(middle.abs_diff_eq(axis.into(), 1e-6), "on the optical axis: {middle}");
            assert!((depth - camera.look_at.distance(camera.eye)).abs() < 1e-8, "at its distance: {depth}");
        }
    }

    #[test]
    fn what_is_not_ahead_has_no_pixel() {
        for camera in cameras() {
            let lens = camera.lens(SIZE).expect("a lens");
            let behind = camera.eye - (camera.look_at - camera.eye);
            for place in [behind, camera.eye, DVec3::NAN, DVec3::INFINITY, DVec3::NEG_INFINITY] {
                assert_eq!(lens.to_pixel(place), None, "{place}");
            }
        }
    }

    #[test]
    fn calibrated_cameras_are_those_of_their_matrix() {
        // A pinhole in the middle of square pixels is a field of view.
        let [fov, ..] = cameras();
        let focal = 0.5 / 25.0_f64.to_radians().tan();
        let projection = Projection::Pinhole { focal: [focal * 360.0 / 640.0, focal], center: [0.5; 2] };
        let (lens, pinhole) = (fov.lens(SIZE).expect("a lens"), Camera { projection, ..fov }.lens(SIZE).expect("one"));
        for place in places() {
            let [a, b] = [&lens, &pinhole].map(|lens| lens.to_pixel(FAR + place).expect("in front").0);
            assert!(a.abs_diff_eq(b, 1e-9), "{a} and {b}");
        }
        assert!((projection.fov_deg().expect("perspective") - 50.0).abs() < 1e-12);
        // fx = 500, fy = 510, cx = 300.25, cy = 170.5 by the corner, of a point at (0.3, -0.2, 2) in the camera's axes.
        let projection =
            Projection::Pinhole { focal: [500.0 / 640.0, 510.0 / 360.0], center: [300.25 / 640.0, 170.5 / 360.0] };
        let camera = Camera { eye: DVec3::ZERO, look_at: DVec3::Y, up: DVec3::Z, projection };
        let (pixel, depth) = camera.to_pixel(DVec3::new(0.3, 2.0, 0.2), SIZE).expect("valid").expect("seen");
        assert!(pixel.abs_diff_eq(DVec2::new(300.25 + 75.0, 170.5 - 51.0), 1e-9) && depth == 2.0, "{pixel}, {depth}");
        for (focal, center) in [([0.0, 1.0], [0.5; 2]), ([1.0, 1.0], [0.5; 2]), ([0.5625, 1.0], [f64::NAN, 0.5])] {
            let camera = Camera { projection: Projection::Pinhole { focal, center }, ..camera };
            assert!(matches!(camera.lens(SIZE), Err(Error::Camera(_))), "{focal:?} {center:?}");
        }
    }
}
