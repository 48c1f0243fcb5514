//! Folds space onto a part of itself, so that a building is modelled once per half bay.

use glam::DVec3;

/// Maps world space to the space of the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Fold {
    /// The identity.
    None,
    /// Mirrored at y = 0, at x = 0, and at the middle and end of every bay. A bay is `2 * half_bay` long, and x = 0 is
    /// the middle of one. Outward of `last`, the middle of the last bay, space is not folded, since the ends of the
    /// building are there.
    ///
    /// Mirroring never brings surfaces nearer than they look, so a distance bound in folded space holds in the world.
    Bays { half_bay: f64, last: f64 },
}

impl Fold {
    /// Folded position, and the signs by which directions are multiplied.
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

    /// Level of the tree from which on folds lie on cell borders.
    pub(super) fn least_level(self) -> u32 {
        match self {
            Self::None => 0,
            Self::Bays { .. } => 3,
        }
    }

    /// Box in the world whose folded image is a box, given by its corners.
    pub(super) fn unfolded(self, low: DVec3, high: DVec3) -> (DVec3, DVec3) {
        match self {
            Self::None => (low, high),
            Self::Bays { last, .. } => {
                (DVec3::new(-last - high.x, -high.y, low.z), DVec3::new(last + high.x, high.y, high.z))
            }
        }
    }
}
