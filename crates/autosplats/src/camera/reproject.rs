//! Reprojection: from one frame into an earlier one.

use glam::{DMat3, DVec3, Mat3, Vec3};

use super::View;

/// View and origin of a frame's cloud, for later frames to look back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PlacedView {
    pub(crate) view: View,
    /// The cloud's origin, world coordinates.
    pub(crate) origin: DVec3,
}

/// Maps view-space positions of a frame to the view space of an earlier frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reprojection {
    pub(crate) rotation: Mat3,
    /// Translation after the rotation, world units.
    pub(crate) shift: Vec3,
    /// View of the earlier frame, with the near plane of this one.
    pub(crate) view: View,
}

impl Reprojection {
    /// Reprojection from the frame `now` into the frame `past`; `None` if only one of them is in perspective.
    pub(crate) fn new(now: &PlacedView, past: &PlacedView) -> Option<Self> {
        if now.view.perspective != past.view.perspective {
            return None;
        }
        let rotation = past.view.view_from_world.as_dmat3();
        // In f64: if two clouds are far apart, an eye is far from the other cloud's origin.
        let between = now.view.eye_local.as_dvec3() + (now.origin - past.origin) - past.view.eye_local.as_dvec3();
        Some(Self {
            rotation: (rotation * world_from_view(&now.view)).as_mat3(),
            shift: (rotation * between).as_vec3(),
            view: View { near: now.view.near, ..past.view },
        })
    }

    /// Position in the earlier view space.
    #[inline(always)]
    pub(crate) fn position(&self, position_view: [f32; 3]) -> Vec3 {
        self.rotation * Vec3::from(position_view) + self.shift
    }

    /// Pixel coordinates on the earlier screen; `None` if the position is outside that screen or not in front of that
    /// eye.
    #[inline(always)]
    pub(crate) fn place(&self, position_view: Vec3) -> Option<[f32; 2]> {
        let position = self.position(position_view.to_array());
        let [x, y] = self.view.to_pixel(position);
        // NaN fails these comparisons.
        let inside = (x >= 0.0) & (x < self.view.width as f32) & (y >= 0.0) & (y < self.view.height as f32);
        (inside & (position.z > self.view.near)).then_some([x, y])
    }

    /// Index, row by row, of the pixel on the earlier screen that a view-space position projects to.
    #[inline(always)]
    pub(crate) fn pixel(&self, position_view: [f32; 3]) -> Option<usize> {
        self.place(position_view.into()).map(|[x, y]| y as usize * self.view.width as usize + x as usize)
    }
}

fn world_from_view(view: &View) -> DMat3 {
    let [x, y, z] = view.unstretched().map(f64::from);
    view.view_from_world.as_dmat3().transpose() * DMat3::from_diagonal(DVec3::new(x, y, z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Projection};

    fn seen(eye: DVec3, origin: DVec3, projection: Projection) -> PlacedView {
        let camera = Camera { eye, look_at: DVec3::new(1e6, 0.0, 0.0), up: DVec3::Z, projection };
        PlacedView { view: camera.view(origin, [320, 200]).expect("a view"), origin }
    }

    #[test]
    fn a_point_is_found_where_it_was_seen() {
        let corner = DVec3::new(1e6, 0.0, 0.0);
        for projection in [Projection::PerspectiveFovDeg(40.0), Projection::OrthographicHeight(6.0)] {
            let past = seen(corner + DVec3::new(-7.0, 1.0, 2.0), corner + 3.0, projection);
            let now = seen(corner + DVec3::new(-6.0, -2.0, 1.0), corner - 1.0, projection);
            let reprojection = Reprojection::new(&now, &past).expect("the same kind of projection");
            for point in
                [DVec3::ZERO, DVec3::new(0.5, 0.7, -0.3), DVec3::new(-1.0, 0.1, 1.2)].map(|point| corner + point)
            {
                let [now, past] = [now, past].map(|seen| seen.view.to_view((point - seen.origin).as_vec3().to_array()));
                let found = reprojection.position(now.to_array());
                assert!(found.distance(past) < 1e-5, "{projection:?}, {point}: {found}, not {past}");
                let [x, y] = reprojection.view.to_pixel(past);
                let pixel = reprojection.pixel(now.to_array());
                assert_eq!(pixel, Some(y as usize * 320 + x as usize), "{projection:?}, {point}");
            }
        }
    }

    #[test]
    fn what_was_outside_or_behind_has_no_pixel() {
        let corner = DVec3::new(1e6, 0.0, 0.0);
        let projection = Projection::PerspectiveFovDeg(40.0);
        let past = seen(corner + DVec3::new(-2.0, 0.0, 0.0), corner, projection);
        let now = seen(corner + DVec3::new(-9.0, 0.0, 0.0), corner, projection);
        let reprojection = Reprojection::new(&now, &past).expect("the same kind of projection");
        let pixel = |point: [f64; 3]| {
            let local = DVec3::from(point).as_vec3().to_array();
            reprojection.pixel(now.view.to_view(local).to_array())
        };
        assert!(pixel([0.0; 3]).is_some(), "in the middle of both");
        assert_eq!(pixel([0.0, 2.0, 0.0]), None, "beside the picture");
        assert_eq!(pixel([-5.0, 0.0, 0.0]), None, "behind the earlier eye");
        assert_eq!(reprojection.pixel([f32::NAN; 3]), None, "nowhere");
    }
}
