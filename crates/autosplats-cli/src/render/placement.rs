//! What all pictures share: metres, up axis, camera and settings, fixed by the first points.

use std::sync::Arc;

use autosplats::{Camera, Renderer};
use autosplats_cloud::glam::DMat4;
use autosplats_cloud::{Axes, LocalMetres, PointCloud};

use super::job::Job;
use crate::exit::Failure;

/// Fewest finite points that a camera can be placed by.
pub(super) const MIN_POINTS: usize = 2;

/// Conversion to metres and up axis, fixed by the first points so that all pictures share them.
#[derive(Default)]
pub(super) struct SharedPlacement {
    /// Conversion of degrees to metres.
    metres: Option<LocalMetres>,
    axes: Option<Axes>,
}

impl SharedPlacement {
    /// Merges inputs with their poses.
    pub(super) fn merge(&mut self, mut parts: Vec<(Arc<PointCloud>, DMat4)>) -> Arc<PointCloud> {
        let mut cloud = match parts.pop() {
            Some((only, pose)) if parts.is_empty() && pose == DMat4::IDENTITY => only,
            Some(last) => {
                parts.push(last);
                let parts: Vec<_> = parts.iter().map(|(cloud, pose)| (&**cloud, *pose)).collect();
                Arc::new(PointCloud::merged(&parts))
            }
            None => Arc::default(),
        };
        if self.metres.is_none() && cloud.has_finite(1) {
            self.metres = cloud.local_metres(None);
        }
        if let Some(metres) = &self.metres {
            Arc::make_mut(&mut cloud).to_metres_on(metres);
        }
        cloud
    }

    /// Places the camera for `all` points. Fixes by the `first` points what all pictures must share: exposure, range of
    /// the colour map and first radius of the kd-tree.
    pub(super) fn settle(
        &mut self,
        job: &mut Job,
        renderer: &mut Renderer,
        all: &PointCloud,
        first: Arc<PointCloud>,
    ) -> Result<Camera, Failure> {
        job.check_color(all)?;
        job.settle_exposure(&first);
        let (camera, axes) = job.camera.place(all, job.inputs.only_scene(), job.size)?;
        self.axes = Some(axes);
        let first = self.upright(first);
        job.settle_first_radius(renderer, &first, &camera)?;
        job.settle(renderer, &first, &camera)?;
        Ok(camera)
    }

    /// The points with the shared up axis.
    pub(super) fn upright(&self, mut cloud: Arc<PointCloud>) -> Arc<PointCloud> {
        if let Some(axes) = self.axes
            && cloud.axes() != Some(axes)
        {
            // Other owners of the cloud keep theirs; this is a copy.
            cloud = Arc::new(Arc::unwrap_or_clone(cloud).with_axes(axes));
        }
        cloud
    }
}
