//! The clipping box, outside of which nothing is shown.

use autosplats::cloud::glam::{DQuat, DVec3};

/// Smallest side of a box, as a share of its longest side. A face pushed through the opposite face stops there.
const MIN_SIDE_SHARE: f64 = 1e-4;

/// A box in world coordinates. Points outside are not shown, so that no edit reaches them; they stay unchanged.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ClipBox {
    /// The lowest corner, before rotation.
    pub(crate) min: DVec3,
    /// The highest corner, before rotation.
    pub(crate) max: DVec3,
    /// Rotation about the centre of the box.
    pub(crate) rotation: DQuat,
    /// Whether the box clips.
    pub(crate) enabled: bool,
}

impl ClipBox {
    /// An enabled box along the world axes.
    pub(crate) fn new(min: DVec3, max: DVec3) -> Self {
        Self { min, max, rotation: DQuat::IDENTITY, enabled: true }
    }

    /// Whether the values are a valid box; a file may hold any.
    pub(crate) fn is_box(&self) -> bool {
        let corners = self.min.is_finite() && self.max.is_finite() && self.min.cmple(self.max).all();
        corners && self.rotation.is_normalized()
    }

    /// Centre of the box and of its rotation.
    pub(crate) fn centre(&self) -> DVec3 {
        self.min.midpoint(self.max)
    }

    /// World direction of an axis of the box.
    pub(crate) fn axis(&self, axis: usize) -> DVec3 {
        self.rotation * DVec3::AXES[axis]
    }

    /// Middle of a face of the box: the one at the low or the high end of `axis`.
    pub(crate) fn face(&self, axis: usize, high: bool) -> DVec3 {
        let half = 0.5 * (self.max - self.min)[axis];
        self.centre() + self.axis(axis) * if high { half } else { -half }
    }

    /// The box with one face moved by `way` along its axis. The other faces keep their places in the world, and the box
    /// keeps its smallest side.
    #[must_use]
    pub(crate) fn with_face(&self, axis: usize, high: bool, way: f64) -> Self {
        if !way.is_finite() {
            return *self;
        }
        let size = self.max - self.min;
        let least = MIN_SIDE_SHARE * size.max_element();
        let way = if high { way.max(least - size[axis]) } else { way.min(size[axis] - least) };
        if self.rotation == DQuat::IDENTITY {
            // A direct change keeps all digits of the other faces.
            let mut moved = *self;
            let end = if high { &mut moved.max } else { &mut moved.min };
            end[axis] += way;
            return moved;
        }
        let mut half = 0.5 * size;
        half[axis] += 0.5 * if high { way } else { -way };
        let centre = self.centre() + self.axis(axis) * (0.5 * way);
        Self { min: centre - half, max: centre + half, ..*self }
    }

    /// Angle of the rotation about `up`, radians, -π to π.
    pub(crate) fn angle_about(&self, up: DVec3) -> f64 {
        let DQuat { x, y, z, w } = self.rotation;
        let angle = 2.0 * DVec3::new(x, y, z).dot(up).atan2(w);
        // Normalizes to -π to π.
        angle - std::f64::consts::TAU * (angle / std::f64::consts::TAU).round()
    }

    /// Whether a place is in the box or on a face. A place that is not finite is outside.
    #[inline]
    pub(crate) fn contains(&self, place: DVec3) -> bool {
        let place = if self.rotation == DQuat::IDENTITY {
            place
        } else {
            let centre = self.centre();
            centre + self.rotation.conjugate() * (place - centre)
        };
        place.cmpge(self.min).all() && place.cmple(self.max).all() && place.is_finite()
    }

    /// The corners, with the first axis changing fastest.
    pub(crate) fn corners(&self) -> [DVec3; 8] {
        let centre = self.centre();
        std::array::from_fn(|corner| {
            let pick = |axis: usize| if corner >> axis & 1 == 0 { self.min[axis] } else { self.max[axis] };
            centre + self.rotation * (DVec3::new(pick(0), pick(1), pick(2)) - centre)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_move_alone() {
        let far = DVec3::new(5e5, 5e6, 100.0);
        for rotation in [DQuat::IDENTITY, DQuat::from_rotation_z(0.7)] {
            let clip = ClipBox { rotation, ..ClipBox::new(far, far + DVec3::new(2.0, 3.0, 4.0)) };
            for (axis, high) in [0, 1, 2].into_iter().flat_map(|axis| [(axis, false), (axis, true)]) {
                let moved = clip.with_face(axis, high, 0.25);
                for other in 0..3 {
                    for end in [false, true] {
                        let off = (moved.face(other, end) - clip.face(other, end)).dot(clip.axis(other));
                        let wanted = if (other, end) == (axis, high) { 0.25 } else { 0.0 };
                        // Some steps of f64 at 5e6.
                        assert!((off - wanted).abs() < 1e-8, "{axis} {high}: face {other} {end} moved by {off}");
                    }
                }
                for way in [-100.0, 100.0] {
                    let least = clip.with_face(axis, high, way);
                    assert!(least.min.cmplt(least.max).all(), "{axis} {high} by {way} is no box: {least:?}");
                }
                assert_eq!(clip.with_face(axis, high, f64::NAN), clip, "no way, no move");
            }
        }
    }

    #[test]
    fn boxes_tell_their_angle() {
        let up = DVec3::NEG_Y;
        for angle in [-3.0, -0.5, 0.0, 1.0, 3.0] {
            let clip = ClipBox { rotation: DQuat::from_axis_angle(up, angle), ..ClipBox::new(DVec3::ZERO, DVec3::ONE) };
            assert!((clip.angle_about(up) - angle).abs() < 1e-12, "{} is not {angle}", clip.angle_about(up));
            let turned = ClipBox { rotation: -clip.rotation, ..clip };
            assert!((turned.angle_about(up) - angle).abs() < 1e-12, "whichever sign the numbers have");
        }
    }

    #[test]
    fn turned_boxes_hold_what_is_in_them() {
        let far = DVec3::new(5e5, 5e6, 100.0);
        let mut clip = ClipBox::new(far - DVec3::new(2.0, 1.0, 1.0), far + DVec3::new(2.0, 1.0, 1.0));
        assert!(clip.contains(far + DVec3::new(1.9, 0.0, 0.0)), "along x");
        assert!(!clip.contains(far + DVec3::new(0.0, 1.9, 0.0)), "not along y");
        assert!(clip.contains(clip.min) && clip.contains(clip.max), "faces are inside");
        clip.rotation = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
        assert!(!clip.contains(far + DVec3::new(1.9, 0.0, 0.0)), "turned: not along x");
        assert!(clip.contains(far + DVec3::new(0.0, 1.9, 0.0)), "but along y");
        for corner in clip.corners() {
            assert!(clip.contains(clip.centre() + 0.999 * (corner - clip.centre())), "within {corner}");
            assert!(!clip.contains(clip.centre() + 1.001 * (corner - clip.centre())), "beyond {corner}");
        }
        let all = ClipBox::new(DVec3::NEG_INFINITY, DVec3::INFINITY);
        assert!(!all.contains(DVec3::NAN) && !all.contains(DVec3::INFINITY), "no place is in no box");
    }
}
