//! Where pictures are taken from: the whole of a subject, near it and far away.

use anyhow::{Context as _, Result};
use autosplats::cloud::glam::{DQuat, DVec3};
use autosplats::{Camera, Projection, ViewDirection, guess_axes};

use crate::subject::Subject;
use crate::surface::Surface;

/// Vertical angle of view, degrees.
const FOV_DEGREES: f64 = 40.0;
/// The same behind a sensor.
const BEHIND_FOV_DEGREES: f64 = 52.0;
/// Places tried to be near to.
const NEAR_STEPS: u32 = 40;

/// A way to look at a subject.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shot {
    /// A scene's own view.
    Own,
    /// All of it in perspective.
    Whole(ViewDirection),
    /// All of it in parallel projection.
    Parallel(ViewDirection),
    /// All of it, from so many times as far.
    Far(ViewDirection, f64),
    /// From so many times as near to the surface at a place in the picture of all of it, 0 to 1 right and down.
    Near(ViewDirection, [f64; 2], f64),
    /// From a place, to a place, with an angle of view in degrees.
    From([f64; 3], [f64; 3], f64),
    /// From so far behind the sensor of a sweep and above it, to a place.
    Behind([f64; 2], [f64; 3]),
}

impl Shot {
    /// A short name.
    pub fn name(&self) -> String {
        match self {
            Self::Own => "own".into(),
            Self::Whole(direction) => format!("{direction:?}").to_lowercase(),
            Self::Parallel(direction) => format!("parallel {direction:?}").to_lowercase(),
            Self::Far(..) => "far".into(),
            Self::Near(..) => "near".into(),
            Self::From(..) => "inside".into(),
            Self::Behind(..) => "behind".into(),
        }
    }

    /// The camera for a picture of `size` pixels.
    ///
    /// # Errors
    /// A scene's own view asked of something that is none, a place to be near to where nothing is, a sensor to be
    /// behind where there is none.
    pub fn camera(&self, subject: &Subject, size: [u32; 2]) -> Result<Camera> {
        let fit = |direction, projection| {
            let aspect = f64::from(size[0]) / f64::from(size[1]);
            Camera::fit(&subject.cloud, guess_axes(&subject.cloud), direction, aspect, projection)
        };
        let whole = |direction| fit(direction, Projection::PerspectiveFovDeg(FOV_DEGREES));
        Ok(match *self {
            Self::Own => {
                let Surface::Scene(scene) = &subject.surface else { anyhow::bail!("only scenes have their own view") };
                let view = scene.view();
                let projection = Projection::PerspectiveFovDeg(view.fov_degrees);
                Camera { eye: view.eye, look_at: view.look_at, up: view.up, projection }
            }
            Self::Whole(direction) => whole(direction)?,
            Self::Parallel(direction) => fit(direction, Projection::OrthographicHeight(1.0))?,
            Self::Far(direction, times) => {
                let camera = whole(direction)?;
                Camera { eye: camera.look_at + (camera.eye - camera.look_at) * times, ..camera }
            }
            Self::Near(direction, at, times) => {
                let camera = whole(direction)?;
                let rays = Rays::new(&camera, size)?;
                // A place beside the subject is moved towards the picture's middle until it meets it.
                let mut places = (0..=NEAR_STEPS).map(|step| {
                    let t = f64::from(step) / f64::from(NEAR_STEPS);
                    [0, 1].map(|i| (at[i] + (0.5 - at[i]) * t) * f64::from(size[i]))
                });
                let look_at = places.find_map(|place| {
                    let (origin, ray) = rays.through(place);
                    subject.surface.trace(origin, ray).map(|hit| origin + ray * hit.distance)
                });
                let look_at = look_at.context("nothing to be near to")?;
                Camera { eye: look_at + (camera.eye - look_at) / times, look_at, ..camera }
            }
            Self::From(eye, look_at, fov) => {
                let projection = Projection::PerspectiveFovDeg(fov);
                Camera { eye: eye.into(), look_at: look_at.into(), up: DVec3::Z, projection }
            }
            Self::Behind([back, above], look_at) => {
                let sensor = subject.recipe.sweep.context("no sensor to be behind")?.origin();
                let ahead = (DVec3::from(look_at) - sensor).with_z(0.0).normalize();
                let eye = sensor - ahead * back + DVec3::Z * above;
                let projection = Projection::PerspectiveFovDeg(BEHIND_FOV_DEGREES);
                Camera { eye, look_at: look_at.into(), up: DVec3::Z, projection }
            }
        })
    }
}

/// `camera` moved around what it looks at, by `degrees` about the picture's vertical.
///
/// # Errors
/// A camera that cannot see.
pub fn orbit(camera: &Camera, degrees: f64) -> Result<Camera> {
    let turn = DQuat::from_axis_angle(camera.up.normalize(), degrees.to_radians());
    Ok(Camera { eye: camera.look_at + turn * (camera.eye - camera.look_at), ..*camera })
}

/// The lines of sight of a picture.
#[derive(Clone, Copy, Debug)]
pub struct Rays {
    /// Right, down and forward.
    pub axes: [DVec3; 3],
    /// What they belong to.
    pub camera: Camera,
    perspective: bool,
    /// Size of a pixel at depth 1, or anywhere in parallel projection.
    pixel: f64,
    middle: [f64; 2],
}

impl Rays {
    /// # Errors
    /// A camera that cannot see.
    pub fn new(camera: &Camera, size: [u32; 2]) -> Result<Self> {
        let axes = camera.axes()?;
        let height = f64::from(size[1]);
        let (perspective, pixel) = match camera.projection {
            Projection::PerspectiveFovDeg(fov) => (true, (0.5 * fov.to_radians()).tan() / (0.5 * height)),
            Projection::OrthographicHeight(world) => (false, world / height),
        };
        Ok(Self { axes, camera: *camera, perspective, pixel, middle: size.map(|side| 0.5 * f64::from(side)) })
    }

    /// Origin and unit direction of the ray through a place in the picture, in pixels.
    pub fn through(&self, [x, y]: [f64; 2]) -> (DVec3, DVec3) {
        let [right, down, forward] = self.axes;
        let across = right * ((x - self.middle[0]) * self.pixel) + down * ((y - self.middle[1]) * self.pixel);
        if self.perspective {
            (self.camera.eye, (forward + across).normalize())
        } else {
            (self.camera.eye + across, forward)
        }
    }

    /// Size of a pixel at `depth`.
    pub fn pixel_size(&self, depth: f64) -> f64 {
        if self.perspective { self.pixel * depth } else { self.pixel }
    }

    /// Where a place is seen, in pixels, and its depth; nothing if it is not before the eye.
    pub fn project(&self, place: DVec3) -> Option<([f64; 2], f64)> {
        let [x, y, depth] = self.axes.map(|axis| axis.dot(place - self.camera.eye));
        let unit = self.pixel_size(depth);
        (depth > 0.0).then(|| ([self.middle[0] + x / unit, self.middle[1] + y / unit], depth))
    }

    /// A direction of the world as the picture has it: right, down, forward.
    pub fn turned(&self, direction: DVec3) -> DVec3 {
        DVec3::from(self.axes.map(|axis| axis.dot(direction)))
    }
}
