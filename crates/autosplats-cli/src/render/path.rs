//! The views that a camera flies through.

use std::path::PathBuf;
use std::time::Duration;

use autosplats::{Camera, Projection};
use autosplats_cloud::glam::DVec3;

use super::camera;
use crate::console::Console;
use crate::exit::Failure;

/// Time from one view to the next.
const USUAL_STEP: Duration = Duration::from_secs(3);

/// At least two views of one kind of projection.
#[derive(Debug)]
pub(super) struct CameraPath {
    views: Vec<Camera>,
    pub(super) duration: Duration,
}

impl CameraPath {
    /// Reads the views; `None` if there are no files.
    pub(super) fn new(
        files: &[PathBuf],
        duration: Option<Duration>,
        console: &Console,
    ) -> Result<Option<Self>, Failure> {
        if files.is_empty() {
            return Ok(None);
        }
        let views = files.iter().map(|file| camera::load(file, console)).collect::<Result<Vec<_>, _>>()?;
        let is_perspective = |view: &Camera| view.projection.fov_deg().is_some();
        if views.len() < 2 {
            return Err(Failure::usage("--camera-path: one view is no path; name two or more files"));
        }
        if views.iter().any(|view| is_perspective(view) != is_perspective(&views[0])) {
            return Err(Failure::usage("--camera-path: all views must be perspective, or all orthographic"));
        }
        let usual = USUAL_STEP * (views.len() - 1) as u32;
        Ok(Some(Self { views, duration: duration.unwrap_or(usual) }))
    }

    /// The camera at a part of the way, 0 to 1. All views are met, and nothing jumps, not even the speed.
    pub(super) fn at(&self, part: f64) -> Camera {
        let last = self.views.len() - 1;
        let place = part.clamp(0.0, 1.0) * last as f64;
        let first = (place as usize).min(last - 1);
        let view = |offset: isize| &self.views[first.saturating_add_signed(offset).min(last)];
        let near = [view(if first == 0 { 0 } else { -1 }), view(0), view(1), view(2)];
        let along = place - first as f64;
        let vector = |of: fn(&Camera) -> DVec3| curve(near.map(of), along);
        let size = |view: &Camera| match view.projection {
            Projection::OrthographicHeight(height) => height,
            perspective => perspective.fov_deg().unwrap_or(Projection::USUAL_FOV_DEG),
        };
        let sizes = near.map(size);
        // A straight line keeps within the bounds of angles and heights.
        let between = sizes[1] + (sizes[2] - sizes[1]) * along;
        Camera {
            eye: vector(|view| view.eye),
            look_at: vector(|view| view.look_at),
            up: vector(|view| view.up.normalize()),
            projection: match near[1].projection {
                Projection::OrthographicHeight(_) => Projection::OrthographicHeight(between),
                _ => Projection::PerspectiveFovDeg(between),
            },
        }
    }
}

/// The curve of Catmull and Rom from the second to the third of four points.
fn curve([a, b, c, d]: [DVec3; 4], t: f64) -> DVec3 {
    let [start, end] = [0.5 * (c - a), 0.5 * (d - b)];
    let (t2, t3) = (t * t, t * t * t);
    b * (2.0 * t3 - 3.0 * t2 + 1.0) + start * (t3 - 2.0 * t2 + t) + c * (3.0 * t2 - 2.0 * t3) + end * (t3 - t2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(eyes: &[DVec3]) -> CameraPath {
        let view = |&eye: &DVec3| Camera {
            eye,
            look_at: DVec3::new(5e5, 5e6, 0.0),
            up: DVec3::Z,
            projection: Projection::PerspectiveFovDeg(40.0 + eye.x.rem_euclid(7.0)),
        };
        CameraPath { views: eyes.iter().map(view).collect(), duration: USUAL_STEP }
    }

    #[test]
    fn views_are_met_and_nothing_jumps() {
        let eyes = [[0.0, -3.0, 9.0], [4.0, 1.0, 9.0], [6.0, 5.0, 3.0], [6.0, 9.0, 2.0]].map(DVec3::from);
        let eyes = eyes.map(|eye| eye + DVec3::new(5e5, 5e6, 0.0));
        let path = path(&eyes);
        for (number, eye) in eyes.into_iter().enumerate() {
            let met = path.at(number as f64 / 3.0);
            assert!(met.eye.abs_diff_eq(eye, 1e-6), "{} is not {eye}", met.eye);
            assert!(met.look_at.abs_diff_eq(path.views[0].look_at, 1e-6), "one place is looked at");
            assert!(met.check().is_ok(), "{met:?}");
        }
        let eye = |step: u32| path.at(f64::from(step) / 3000.0).eye;
        for step in 1..2999 {
            let bend = (eye(step + 1) - eye(step)) - (eye(step) - eye(step - 1));
            assert!(bend.length() < 2e-5, "the speed jumps by {} at {step}", bend.length());
        }
        assert_eq!(path.at(-1.0), path.at(0.0));
        assert_eq!(path.at(2.0), path.at(1.0));
    }

    #[test]
    fn two_views_are_a_line() {
        let path = path(&[DVec3::ZERO, DVec3::new(2.0, 0.0, 0.0)]);
        let middle = path.at(0.5);
        assert!(middle.eye.abs_diff_eq(DVec3::X, 1e-12), "{}", middle.eye);
        assert_eq!(middle.projection, Projection::PerspectiveFovDeg(41.0));
    }
}
