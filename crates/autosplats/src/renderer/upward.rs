//! The up direction of a cloud that does not state its axes.

use autosplats_cloud::PointCloud;
use glam::DVec3;

use crate::camera::guess_axes;
use crate::shade::ColorMode;

/// Cache of the last guess, because guessing sorts the coordinates of 100,000 points.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Upward {
    guessed: Option<(u64, DVec3)>,
}

impl Upward {
    /// Unit vector upward in world coordinates; zero where `color` does not show heights, which alone need it.
    pub(super) fn of(&mut self, cloud: &PointCloud, color: &ColorMode) -> DVec3 {
        if *color != ColorMode::Height {
            return DVec3::ZERO;
        }
        // Stated axes are not part of a cloud's identity, so they are not cached.
        if let Some(axes) = cloud.axes() {
            return axes.up();
        }
        let identity = cloud.identity();
        match self.guessed {
            Some((known, upward)) if known == identity => upward,
            _ => {
                let upward = guess_axes(cloud).up();
                self.guessed = Some((identity, upward));
                upward
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use autosplats_cloud::Axes;

    use super::*;

    #[test]
    fn what_is_stated_counts_more_than_what_was_guessed() {
        let cloud = |z: f32| PointCloud::new(DVec3::ZERO, vec![[0.0; 3], [1.0, 0.0, z], [0.0, 1.0, 0.5 * z]]);
        let mut upwards = Upward::default();
        let mut upward = |cloud: &PointCloud| upwards.of(cloud, &ColorMode::Height);
        assert_eq!(upward(&cloud(5.0)), DVec3::Y, "a tall thing is a model");
        let flat = cloud(0.1);
        assert_eq!(upward(&flat), DVec3::Z, "another cloud, another guess");
        assert_eq!(upward(&flat.clone().with_axes(Axes::YUp)), DVec3::Y, "stated of the same points");
        assert_eq!(upward(&flat), DVec3::Z, "and guessed again");
        assert_eq!(upwards.of(&flat, &ColorMode::Auto), DVec3::ZERO, "no height is shown");
    }
}
