//! Which axis points up.

use glam::DVec3;

/// Which axis points up, and from where a viewer looks first.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{Axes, glam::DVec3};
///
/// assert_eq!(Axes::from_name("y-down"), Some(Axes::YDown));
/// assert_eq!(Axes::YDown.up(), DVec3::NEG_Y);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axes {
    /// Z up, seen first from -Y. Usual for surveys and robots.
    ZUp,
    /// Y up, seen first from +Z. Usual for models.
    YUp,
    /// X up, seen first from -Z.
    XUp,
    /// Z down, seen first from +Y.
    ZDown,
    /// Y down, seen first from -Z.
    YDown,
    /// X down, seen first from +Z.
    XDown,
    /// A camera's own frame: x right, y down, z forward. The points were seen from the origin and look right only from
    /// there.
    Camera,
}

impl Axes {
    /// All of them.
    pub const ALL: [Self; 7] = [Self::ZUp, Self::YUp, Self::XUp, Self::ZDown, Self::YDown, Self::XDown, Self::Camera];

    /// Name in files and reports, such as `z-up`.
    pub fn name(self) -> &'static str {
        match self {
            Self::ZUp => "z-up",
            Self::YUp => "y-up",
            Self::XUp => "x-up",
            Self::ZDown => "z-down",
            Self::YDown => "y-down",
            Self::XDown => "x-down",
            Self::Camera => "camera",
        }
    }

    /// The axes with this [name](Self::name).
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|axes| axes.name() == name)
    }

    /// Unit vectors right, front (towards a viewer) and up.
    pub fn frame(self) -> [DVec3; 3] {
        let [x, y, z] = DVec3::AXES;
        match self {
            Self::ZUp => [x, -y, z],
            Self::YUp => [x, z, y],
            Self::XUp => [y, -z, x],
            Self::ZDown => [x, y, -z],
            Self::YDown | Self::Camera => [x, -z, -y],
            Self::XDown => [y, z, -x],
        }
    }

    /// Unit vector up.
    pub fn up(self) -> DVec3 {
        self.frame()[2]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_frame_is_a_rotation_of_the_usual_one() {
        let mut ups = Vec::new();
        for axes in Axes::ALL {
            assert_eq!(Axes::from_name(axes.name()), Some(axes));
            let [right, front, up] = axes.frame();
            assert_eq!(right.cross(-front), up, "{axes:?} mirrors nothing");
            ups.push(up);
        }
        assert_eq!(ups[..6], [DVec3::Z, DVec3::Y, DVec3::X, DVec3::NEG_Z, DVec3::NEG_Y, DVec3::NEG_X]);
        assert_eq!(Axes::from_name("up"), None);
    }
}
