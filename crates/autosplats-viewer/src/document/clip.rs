//! The box outside of which nothing is shown.

use autosplats::cloud::glam::{DQuat, DVec3};

/// A box in world coordinates. Points outside are not shown, so that no edit reaches them; they are not changed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ClipBox {
    /// The lowest corner, before the box is turned.
    pub(crate) min: DVec3,
    /// The highest corner, before the box is turned.
    pub(crate) max: DVec3,
    /// How it is turned about its centre.
    pub(crate) rotation: DQuat,
    /// Whether it clips.
    pub(crate) enabled: bool,
}

impl ClipBox {
    /// A box along the axes that clips.
    pub(crate) fn new(min: DVec3, max: DVec3) -> Self {
        Self { min, max, rotation: DQuat::IDENTITY, enabled: true }
    }

    /// What it turns about.
    pub(crate) fn centre(&self) -> DVec3 {
        self.min.midpoint(self.max)
    }

    /// Whether a place is in the box, its faces included. What is not finite is outside.
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

    /// The corners, the first axis changing fastest.
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
