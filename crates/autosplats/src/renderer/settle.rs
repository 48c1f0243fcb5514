//! What the pictures of one recording share.

use super::{Counts, Renderer, Settings, usual_exposure};
use crate::Error;
use crate::camera::Camera;
use crate::points::Points;
use crate::shade::ColorMode;

impl Renderer {
    /// Fixes what all pictures of a recording share, by one picture: the exposure, and the ends of the colour map.
    /// Values that are set already stay. A recording without that flickers, as each picture has values of its own.
    ///
    /// # Errors
    /// Those of [`render_while`](Self::render_while), which is given `go_on`.
    ///
    /// # Examples
    ///
    /// ```
    /// use autosplats::{Camera, ColorMode, Projection, Renderer, Settings, ViewDirection, guess_axes};
    /// # use autosplats::cloud::{PointCloud, glam::DVec3};
    /// # let grid = (0..40_000).map(|i| [(i % 200) as f32, (i / 200) as f32, (i % 7) as f32]);
    /// # let cloud = PointCloud::new(DVec3::ZERO, grid.collect());
    /// let projection = Projection::PerspectiveFovDeg(40.0);
    /// let camera = Camera::fit(&cloud, guess_axes(&cloud), ViewDirection::Iso, 1.0, projection)?;
    /// let mut settings = Settings::default();
    /// settings.shading.color = ColorMode::Height;
    /// Renderer::new().settle(&mut settings, &cloud, &camera, [64, 64], &|| true)?;
    /// assert_eq!(settings.shading.exposure, Some(1.0));
    /// assert!(settings.shading.range.is_some_and(|[low, high]| low < high));
    /// # Ok::<(), autosplats::Error>(())
    /// ```
    pub fn settle<'a>(
        &mut self,
        settings: &mut Settings,
        points: impl Into<Points<'a>>,
        camera: &Camera,
        size: [u32; 2],
        go_on: &(dyn Fn() -> bool + Sync),
    ) -> Result<(), Error> {
        let points = points.into();
        settings.shading.exposure.get_or_insert_with(|| usual_exposure(points.scene()));
        let has_no_range = matches!(settings.shading.color, ColorMode::Plain | ColorMode::Rgb | ColorMode::Normal);
        if settings.shading.range.is_none() && !has_no_range {
            let mut trial = settings.clone();
            // No later frame may be averaged with this one.
            trial.reconstruction.frames_averaged = 1;
            settings.shading.range = self.render_while(points, camera, size, &trial, go_on)?.counts.range();
        }
        Ok(())
    }
}

impl Counts {
    /// The ends of the colour map in this picture, as [`Shading::range`](crate::Shading::range) takes them for others.
    /// `None` without values, or if all are the same.
    #[must_use]
    pub fn range(&self) -> Option<[f64; 2]> {
        self.value_range.filter(|[low, high]| low < high)
    }
}
