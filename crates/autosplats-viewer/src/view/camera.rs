//! The camera's place: chosen for the first points, fitted to points, or given.

use autosplats::cloud::PointCloud;
use autosplats::cloud::glam::DVec3;
use autosplats::{Camera, Projection, ViewDirection};
use autosplats_sources::Source;

use super::View;
use crate::session::{Arrival, Session, ViewFrame};

impl View {
    /// Receives that points have arrived. The camera moves to show them if they are the first ones, or if the user has
    /// not moved it yet.
    pub(crate) fn follow(&mut self, session: &Session, arrival: Arrival) {
        let mut fitted = false;
        if arrival == Arrival::First {
            self.first_camera = None;
            fitted = !std::mem::take(&mut self.camera_given);
        }
        // Points may arrive and be removed at once.
        if arrival == Arrival::Nothing || session.document().layers.is_empty() {
            return;
        }
        if fitted || self.is_first_view() {
            self.first_view(session);
        } else {
            self.measure_scene(session);
        }
    }

    /// Places the camera; the first input then does not move it.
    pub(crate) fn set_camera(&mut self, camera: &Camera) {
        self.navigation.go_to(camera, true);
        self.camera_given = true;
    }

    /// What the first view depends on besides the points.
    pub(super) fn frame(&self, session: &Session) -> ViewFrame {
        ViewFrame { aspect: self.aspect, up: session.up_axis }
    }

    /// Passes the extent of the document and the up axis to the navigation.
    pub(crate) fn measure_scene(&mut self, session: &Session) {
        let bounds = session.glance().map_or_else(|| session.document().shown_bounds(), |glance| glance.bounds);
        if let Some([low, high]) = bounds {
            self.navigation.set_scene(low.midpoint(high), 0.5 * low.distance(high), session.up());
        }
    }

    /// Whether the user has not moved since the program chose the camera.
    pub(super) fn is_first_view(&self) -> bool {
        self.first_camera.is_some_and(|(camera, _)| camera == self.navigation.goal_camera())
    }

    /// Moves to the first view: that of the scene, or the one that a render without a camera uses.
    pub(crate) fn first_view(&mut self, session: &Session) {
        let scene = match session.document().layers.as_slice() {
            [only] => session.inputs.get(&only.id).and_then(|input| match &input.source {
                Source::Scene(scene, _) => Some(scene.view()),
                _ => None,
            }),
            _ => None,
        };
        match scene {
            Some(view) => {
                let projection = Projection::PerspectiveFovDeg(view.fov_degrees);
                let camera = Camera { eye: view.eye, look_at: view.look_at, up: view.up, projection };
                self.measure_scene(session);
                self.navigation.go_to(&camera, true);
            }
            None => self.look_from(session, ViewDirection::Auto, true),
        }
        self.first_camera = Some((self.navigation.goal_camera(), self.aspect));
    }

    /// Looks at everything from one side.
    pub(crate) fn look_from(&mut self, session: &Session, direction: ViewDirection, at_once: bool) {
        self.measure_scene(session);
        let known = session.glance().filter(|glance| {
            let usual = direction == ViewDirection::Auto && !self.navigation.is_orthographic();
            usual && glance.frame == self.frame(session)
        });
        if let Some(camera) = known.and_then(|glance| glance.camera) {
            self.navigation.go_to(&camera, at_once);
            return;
        }
        let cloud = session.document().overview();
        let fov = if direction == ViewDirection::Auto { Projection::USUAL_FOV_DEG } else { self.navigation.fov_deg() };
        let projection = if self.navigation.is_orthographic() {
            Projection::OrthographicHeight(1.0)
        } else {
            Projection::PerspectiveFovDeg(fov)
        };
        match Camera::fit(&cloud, session.axes(), direction, self.aspect, projection) {
            Ok(camera) => self.navigation.go_to(&camera, at_once),
            Err(error) => session.messages.note(error.to_string()),
        }
    }

    /// Moves the camera to show all points of a cloud, in the same direction.
    pub(crate) fn fit(&mut self, session: &Session, cloud: &PointCloud) {
        self.measure_scene(session);
        match self.navigation.goal_camera().showing(cloud, self.aspect) {
            Ok(camera) => self.navigation.go_to(&camera, false),
            Err(error) => session.messages.note(error.to_string()),
        }
    }

    /// Looks from the opposite side.
    pub(crate) fn turn_round(&mut self, session: &Session) {
        let camera = opposite(&self.navigation.goal_camera(), session.up());
        self.navigation.go_to(&camera, false);
    }
}

/// The camera turned by half a turn about the vertical through the point it looks at. A view straight down becomes one
/// straight up.
fn opposite(camera: &Camera, up: DVec3) -> Camera {
    let Camera { eye, look_at, .. } = *camera;
    let away = eye - look_at;
    let turned = |vector: DVec3| 2.0 * vector.project_onto(up) - vector;
    if away.reject_from(up).length() > 1e-3 * away.length() {
        Camera { eye: look_at + turned(away), up: turned(camera.up), ..*camera }
    } else {
        Camera { eye: look_at - away, ..*camera }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_opposite_view_is_upright() {
        for degrees in [-60.0_f64, 0.0, 30.0, 45.0, 60.0, 89.0] {
            let (sine, cosine) = degrees.to_radians().sin_cos();
            let look_at = DVec3::new(3.0, 4.0, 5.0);
            let eye = look_at + 10.0 * DVec3::new(0.0, -cosine, sine);
            let up = DVec3::new(0.0, sine, cosine);
            let camera = Camera { eye, look_at, up, projection: Projection::PerspectiveFovDeg(40.0) };
            let there = opposite(&camera, DVec3::Z);
            assert!(there.eye.distance(look_at + 10.0 * DVec3::new(0.0, cosine, sine)) < 1e-9, "{degrees}: {there:?}");
            let [before, after] = [camera, there].map(|camera| camera.axes().expect("a camera that sees"));
            assert!(before[0].distance(-after[0]) < 1e-9, "{degrees}: right is left");
            assert!(after[1].z < 0.0, "{degrees}: down is down, {:?}", after[1]);
            let back = opposite(&there, DVec3::Z);
            assert!(back.eye.distance(eye) < 1e-9 && back.up.distance(up) < 1e-9, "{degrees}: twice is none");
        }
        let above = Camera {
            eye: DVec3::Z,
            look_at: DVec3::ZERO,
            up: DVec3::Y,
            projection: Projection::OrthographicHeight(1.0),
        };
        assert_eq!(opposite(&above, DVec3::Z).eye, DVec3::NEG_Z, "from above is from below");
    }
}
