//! Views of a subject: the whole of it, near to it and far away.

use anyhow::{Context as _, Result};
use autosplats::cloud::glam::{DQuat, DVec3};
use autosplats::{Camera, Projection, ViewDirection, guess_axes};

use crate::rays::Rays;
use crate::subject::Subject;
use crate::surface::Surface;

/// Vertical angle of view, degrees.
const FOV_DEGREES: f64 = 40.0;
/// Vertical angle of view behind a sensor, degrees.
const BEHIND_FOV_DEGREES: f64 = 52.0;
/// Number of steps from a wanted place in the picture to its middle, at which the surface is looked for.
const NEAR_STEPS: u32 = 40;

/// A view of a subject.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shot {
    /// The view that a scene defines.
    Own,
    /// The whole subject in perspective.
    Whole(ViewDirection),
    /// The whole subject in parallel projection.
    Parallel(ViewDirection),
    /// A [`Whole`](Self::Whole) view with the eye this many times as far.
    Far(ViewDirection, f64),
    /// A place of a [`Whole`](Self::Whole) view, 0 to 1 right and down, with the eye this many times as near.
    Near(ViewDirection, [f64; 2], f64),
    /// From one place towards another, with this vertical angle of view in degrees.
    From([f64; 3], [f64; 3], f64),
    /// From behind a lidar and above it, by these distances in metres, towards a place.
    Behind([f64; 2], [f64; 3]),
}

impl Shot {
    /// The name, as the last word of a case's name.
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
    /// The subject has no view of its own, no surface to be near to or no lidar to be behind.
    pub fn camera(&self, subject: &Subject, size: [u32; 2]) -> Result<Camera> {
        let fit = |direction, projection| {
            let aspect = f64::from(size[0]) / f64::from(size[1]);
            Camera::fit(&subject.cloud, guess_axes(&subject.cloud), direction, aspect, projection)
        };
        let whole = |direction| fit(direction, Projection::PerspectiveFovDeg(FOV_DEGREES));
        Ok(match *self {
            Self::Own => {
                let Surface::Scene(scene) = &subject.surface else { anyhow::bail!("only scenes define a view") };
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
                // A place beside the subject moves towards the picture's middle until a ray hits the subject.
                let mut places = (0..=NEAR_STEPS).map(|step| {
                    let t = f64::from(step) / f64::from(NEAR_STEPS);
                    [0, 1].map(|i| (at[i] + (0.5 - at[i]) * t) * f64::from(size[i]))
                });
                let look_at = places.find_map(|place| {
                    let (origin, ray) = rays.through(place);
                    subject.surface.trace(origin, ray).map(|hit| origin + ray * hit.distance)
                });
                let look_at = look_at.context("no surface to be near to")?;
                Camera { eye: look_at + (camera.eye - look_at) / times, look_at, ..camera }
            }
            Self::From(eye, look_at, fov) => {
                let projection = Projection::PerspectiveFovDeg(fov);
                Camera { eye: eye.into(), look_at: look_at.into(), up: DVec3::Z, projection }
            }
            Self::Behind([back, above], look_at) => {
                let sensor = subject.recipe.sweep.context("no lidar to be behind")?.origin();
                let ahead = (DVec3::from(look_at) - sensor).with_z(0.0).normalize();
                let eye = sensor - ahead * back + DVec3::Z * above;
                let projection = Projection::PerspectiveFovDeg(BEHIND_FOV_DEGREES);
                Camera { eye, look_at: look_at.into(), up: DVec3::Z, projection }
            }
        })
    }
}

/// `camera` moved around its target by `degrees`, about its up vector.
pub fn orbit(camera: &Camera, degrees: f64) -> Camera {
    let turn = DQuat::from_axis_angle(camera.up.normalize(), degrees.to_radians());
    Camera { eye: camera.look_at + turn * (camera.eye - camera.look_at), ..*camera }
}
