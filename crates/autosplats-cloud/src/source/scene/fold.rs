//! Space folded onto a part of itself, so that a building is modelled once per half bay.

use glam::DVec3;

/// How world space maps to the space a body is modelled in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Fold {
    /// Not at all.
    None,
    /// Mirrored at y = 0, at x = 0, and at every bay's middle and end. A bay is `2 * half_bay` long, x = 0 is the middle
    /// of one. From `last`, the middle of the last bay, outwards nothing is folded any more: there the ends are.
    ///
    /// Mirroring never brings anything nearer than it looks, so a distance bound in folded space is one in the world.
    Bays { half_bay: f64, last: f64 },
}

impl Fold {
    /// Folded position, and the signs with which directions follow.
    #[inline]
    pub(super) fn apply(self, p: DVec3) -> (DVec3, DVec3) {
        match self {
            Self::None => (p, DVec3::ONE),
            Self::Bays { half_bay, last } => {
                let x = p.x.abs();
                let bay = 2.0 * half_bay;
                let along = if x >= last { x - last } else { x - bay * f64::from((x / bay + 0.5) as u32) };
                let signs = DVec3::new(1.0_f64.copysign(p.x * along), 1.0_f64.copysign(p.y), 1.0);
                (DVec3::new(along.abs(), p.y.abs(), p.z), signs)
            }
        }
    }

    /// Folds lie on cell borders from this level of the tree on.
    pub(super) fn least_level(self) -> u32 {
        match self {
            Self::None => 0,
            Self::Bays { .. } => 3,
        }
    }

    /// The world's box, of which the cube at `min` with sides of `size` is the folded image.
    pub(super) fn bounds(self, min: DVec3, size: f64) -> (DVec3, DVec3) {
        match self {
            Self::None => (min, min + DVec3::splat(size)),
            Self::Bays { last, .. } => {
                (DVec3::new(-last - size, -size, min.z), DVec3::new(last + size, size, min.z + size))
            }
        }
    }
}
