//! The camera and its movement: orbit, pan, zoom, fly, fit.
//!
//! # How it works
//! Input moves a *goal*. The shown camera approaches the goal exponentially in time, so that movement looks the same at
//! any frame rate. A pose is a pivot, a distance and an orientation: the camera looks at the pivot. Distances stay
//! above 0 and the pitch within straight down and straight up, so that the picture never turns upside down.

use autosplats::cloud::glam::{DMat3, DQuat, DVec2, DVec3};
use autosplats::{Camera, Projection};

/// Time in which the camera covers 63 % of its way, seconds.
const LAG_S: f64 = 0.06;
/// Fraction of the distance, or radians, below which the camera has arrived: a twentieth of a pixel.
const ARRIVAL_TOLERANCE: f64 = 5e-5;
/// Radians turned by a drag over the picture's height.
const DRAG_TURN_RAD: f64 = std::f64::consts::PI;
/// Radians turned by the arrow keys per second.
const KEY_TURN_RAD_PER_S: f64 = 1.2;
/// Distances to the pivot that keys fly per second.
const FLY_DISTANCES_PER_S: f64 = 0.8;
/// Factor by which Shift flies faster.
const FAST_FACTOR: f64 = 5.0;
/// Smallest and largest distance from the pivot, in radii of the scene.
const DISTANCE_BOUNDS_RADII: [f64; 2] = [1e-6, 1e3];

/// Place and direction of the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Pose {
    /// The point that the camera looks at and turns about, world space.
    pivot: DVec3,
    /// Distance from the eye to the pivot. An orthographic camera keeps that of the perspective one with the same
    /// height at the pivot.
    distance: f64,
    /// Rotation from view space (x right, y down, z forward) to world space.
    world_from_view: DQuat,
}

/// The camera that the user moves.
#[derive(Clone, Debug)]
pub(crate) struct Navigation {
    shown: Pose,
    goal: Pose,
    fov_deg: f64,
    orthographic: bool,
    /// Unit vector upward, world space.
    up: DVec3,
    /// Middle and radius of a ball around the scene.
    scene: (DVec3, f64),
}

/// Movement by keys, each component -1, 0 or 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Flight {
    /// D minus A.
    pub(crate) right: f64,
    /// E minus Q.
    pub(crate) up: f64,
    /// W minus S.
    pub(crate) forward: f64,
    /// Turn to the right, by arrow keys.
    pub(crate) turn_right: f64,
    /// Turn upward, by arrow keys.
    pub(crate) turn_up: f64,
    /// Whether Shift is held.
    pub(crate) fast: bool,
}

impl Flight {
    fn still(&self) -> bool {
        [self.right, self.up, self.forward, self.turn_right, self.turn_up] == [0.0; 5]
    }
}

impl Pose {
    fn axis(&self, axis: DVec3) -> DVec3 {
        self.world_from_view * axis
    }

    fn forward(&self) -> DVec3 {
        self.axis(DVec3::Z)
    }

    fn eye(&self) -> DVec3 {
        self.pivot - self.forward() * self.distance
    }

    /// Whether the two poses look the same.
    fn is_near(&self, other: &Self) -> bool {
        // Rounding of coordinates far from the origin.
        let coarse = 4.0 * f64::EPSILON * other.pivot.abs().max_element();
        self.pivot.distance(other.pivot) < ARRIVAL_TOLERANCE * other.distance + coarse
            && (self.distance / other.distance).ln().abs() < ARRIVAL_TOLERANCE
            && self.world_from_view.angle_between(other.world_from_view) < ARRIVAL_TOLERANCE
    }

    /// The pose a fraction `part`, 0 to 1, of the way to `goal`.
    fn toward(&self, goal: &Self, part: f64) -> Self {
        Self {
            pivot: self.pivot.lerp(goal.pivot, part),
            distance: self.distance * (goal.distance / self.distance).powf(part),
            world_from_view: self.world_from_view.slerp(goal.world_from_view, part).normalize(),
        }
    }
}

impl Navigation {
    /// A camera that looks at the origin from 3 units away.
    pub(crate) fn new() -> Self {
        let pose = Pose { pivot: DVec3::ZERO, distance: 3.0, world_from_view: orientation(DVec3::Y, DVec3::Z) };
        Self {
            shown: pose,
            goal: pose,
            fov_deg: Projection::USUAL_FOV_DEG,
            orthographic: false,
            up: DVec3::Z,
            scene: (DVec3::ZERO, 1.0),
        }
    }

    /// Sets the ball around the scene, by its middle and radius, and the up direction.
    pub(crate) fn set_scene(&mut self, middle: DVec3, radius: f64, up: DVec3) {
        if middle.is_finite() && radius.is_finite() {
            self.scene = (middle, if radius > 0.0 { radius } else { 1e-9 });
        }
        self.up = up.try_normalize().unwrap_or(DVec3::Z);
    }

    /// Moves to `camera`, at once or smoothly.
    pub(crate) fn go_to(&mut self, camera: &Camera, at_once: bool) {
        let Ok([right, down, forward]) = camera.axes() else { return };
        let world_from_view = DQuat::from_mat3(&DMat3::from_cols(right, down, forward)).normalize();
        let mut distance = camera.eye.distance(camera.look_at);
        match camera.projection {
            Projection::OrthographicHeight(height) => {
                distance = height / self.height_at_one();
                self.orthographic = true;
            }
            perspective => {
                self.fov_deg = perspective.fov_deg().unwrap_or(Projection::USUAL_FOV_DEG);
                self.orthographic = false;
            }
        }
        self.goal = Pose { pivot: camera.look_at, distance, world_from_view };
        if at_once {
            self.shown = self.goal;
        }
    }

    /// The camera as shown.
    pub(crate) fn camera(&self) -> Camera {
        self.camera_at(&self.shown)
    }

    /// The camera that the shown one approaches.
    pub(crate) fn goal_camera(&self) -> Camera {
        self.camera_at(&self.goal)
    }

    fn camera_at(&self, pose: &Pose) -> Camera {
        let forward = pose.forward();
        let (distance, projection) = if self.orthographic {
            // An orthographic camera has to stand in front of the whole scene, or its image plane cuts the scene.
            let (middle, radius) = self.scene;
            let before_all = forward.dot(pose.pivot - middle) + 1.5 * radius;
            let height = pose.distance * self.height_at_one();
            (pose.distance.max(before_all), Projection::OrthographicHeight(height))
        } else {
            (pose.distance, Projection::PerspectiveFovDeg(self.fov_deg))
        };
        Camera { eye: pose.pivot - forward * distance, look_at: pose.pivot, up: pose.axis(DVec3::NEG_Y), projection }
    }

    /// Height of the picture at a distance of 1, world units.
    fn height_at_one(&self) -> f64 {
        2.0 * (0.5 * self.fov_deg).to_radians().tan()
    }

    pub(crate) fn is_orthographic(&self) -> bool {
        self.orthographic
    }

    /// Switches between perspective and orthographic. The size of the pivot's surroundings stays.
    pub(crate) fn toggle_projection(&mut self) {
        self.orthographic = !self.orthographic;
    }

    /// Vertical field of view, degrees.
    pub(crate) fn fov_deg(&self) -> f64 {
        self.fov_deg
    }

    /// Sets the field of view, degrees. The size of the pivot's surroundings stays.
    pub(crate) fn set_fov_deg(&mut self, fov_deg: f64) {
        let before = self.height_at_one();
        self.fov_deg = fov_deg.clamp(1.0, 150.0);
        let factor = before / self.height_at_one();
        if !self.orthographic {
            self.goal.distance *= factor;
            self.shown.distance *= factor;
        }
    }

    /// Advances by `seconds`. Returns whether the camera has changed.
    pub(crate) fn advance(&mut self, seconds: f64, flight: Flight) -> bool {
        let seconds = seconds.clamp(0.0, 0.25);
        if !flight.still() {
            let step = seconds * FLY_DISTANCES_PER_S * self.goal.distance * if flight.fast { FAST_FACTOR } else { 1.0 };
            let [right, forward] = [DVec3::X, DVec3::Z].map(|axis| self.goal.axis(axis));
            self.goal.pivot += (right * flight.right + forward * flight.forward + self.up * flight.up) * step;
            let eye = self.goal.eye();
            self.turn(DVec2::new(flight.turn_right, -flight.turn_up) * (seconds * KEY_TURN_RAD_PER_S / DRAG_TURN_RAD));
            self.goal.pivot = eye + self.goal.forward() * self.goal.distance;
        }
        if self.shown == self.goal {
            return false;
        }
        let next = self.shown.toward(&self.goal, 1.0 - (-seconds / LAG_S).exp());
        self.shown = if next.is_near(&self.goal) { self.goal } else { next };
        true
    }

    /// Whether the camera is moving.
    #[cfg(test)]
    pub(crate) fn is_moving(&self) -> bool {
        self.shown != self.goal
    }

    /// Turns about the pivot. `drag` is in picture heights, right and down.
    pub(crate) fn orbit(&mut self, drag: DVec2) {
        self.turn(drag);
    }

    /// Turns the view direction: the eye stays and the pivot moves. `drag` is in picture heights.
    pub(crate) fn look(&mut self, drag: DVec2) {
        let eye = self.goal.eye();
        // The drag pulls the world: opposite to an orbit, by the angle that the dragged pixels cover.
        let scale = self.fov_deg.to_radians() / DRAG_TURN_RAD;
        self.turn(-drag * scale.min(1.0));
        self.goal.pivot = eye + self.goal.forward() * self.goal.distance;
    }

    fn turn(&mut self, drag: DVec2) {
        if !drag.is_finite() {
            return;
        }
        let turn = drag * DRAG_TURN_RAD;
        // Both components, so that a step beyond the pole is detected and undone.
        let pitch = self.goal.forward().dot(self.up).atan2(self.goal.axis(DVec3::NEG_Y).dot(self.up));
        // A drag down raises the eye, which then looks further down.
        let most = std::f64::consts::FRAC_PI_2;
        let tilt = (pitch - turn.y).clamp(-most, most) - pitch;
        let right = self.goal.axis(DVec3::X);
        let about_up = DQuat::from_axis_angle(self.up, -turn.x);
        let about_right = DQuat::from_axis_angle(right, tilt);
        self.goal.world_from_view = (about_up * about_right * self.goal.world_from_view).normalize();
    }

    /// Moves eye and pivot so that the point at `depth` follows the drag. `drag` is in picture heights.
    pub(crate) fn pan(&mut self, drag: DVec2, depth: Option<f64>) {
        let depth = if self.orthographic { self.goal.distance } else { depth.unwrap_or(self.goal.distance) };
        let step = drag * (depth * self.height_at_one());
        if step.is_finite() {
            self.goal.pivot -= self.goal.axis(DVec3::X) * step.x + self.goal.axis(DVec3::Y) * step.y;
        }
    }

    /// Divides the distance by `factor`: above 1 moves closer. `target` stays where it is in the picture.
    pub(crate) fn zoom(&mut self, factor: f64, target: Option<DVec3>) {
        let scale = 1.0 / factor;
        let [least, most] = DISTANCE_BOUNDS_RADII.map(|part| part * self.scene.1);
        let distance = (self.goal.distance * scale).clamp(least, most);
        let scale = distance / self.goal.distance;
        if !(scale > 0.0 && scale.is_finite()) {
            return;
        }
        let target = target.filter(|target| target.is_finite()).unwrap_or(self.goal.pivot);
        let fixed = if self.orthographic { self.goal.pivot } else { self.goal.eye() };
        let moved = target + (fixed - target) * scale;
        self.goal.distance = distance;
        self.goal.pivot = if self.orthographic { moved } else { moved + self.goal.forward() * distance };
    }

    /// Sets the pivot. The eye moves sideways until the pivot is in the middle of the picture.
    pub(crate) fn set_pivot(&mut self, pivot: DVec3) {
        if !pivot.is_finite() {
            return;
        }
        if !self.orthographic {
            let depth = self.goal.forward().dot(pivot - self.goal.eye());
            if depth > 0.0 {
                self.goal.distance = depth;
            }
        }
        self.goal.pivot = pivot;
    }

    /// Makes the horizon level again, after a tilted camera or a change of the up axis.
    pub(crate) fn level(&mut self) {
        let forward = self.goal.forward();
        if forward.cross(self.up).length() > 1e-3 {
            self.goal.world_from_view = orientation(forward, self.up);
        }
    }

    /// View-space directions of the world's x, y and z axis, for the axes in the corner.
    pub(crate) fn world_axes_in_view(&self) -> [DVec3; 3] {
        let view_from_world = self.shown.world_from_view.inverse();
        [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| view_from_world * axis)
    }

    /// Height of the picture at the pivot, world units.
    pub(crate) fn height_at_pivot(&self) -> f64 {
        self.shown.distance * self.height_at_one()
    }
}

/// The orientation that looks along `forward` with `up` upward.
fn orientation(forward: DVec3, up: DVec3) -> DQuat {
    let forward = forward.try_normalize().unwrap_or(DVec3::Y);
    let right = forward.cross(up).try_normalize().unwrap_or_else(|| forward.any_orthonormal_vector());
    DQuat::from_mat3(&DMat3::from_cols(right, forward.cross(right), forward)).normalize()
}

#[cfg(test)]
mod tests;
