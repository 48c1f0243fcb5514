//! Layers in the order of the picture.

use rayon::prelude::*;

use super::GBuffer;
use crate::Error;
use crate::camera::Camera;

impl GBuffer {
    /// The values of a layer of this surface in the order of the picture: row by row from the top, without margin.
    /// `empty` stands where no surface is.
    ///
    /// # Panics
    /// If the layer was not requested, or is not of this surface.
    ///
    /// # Examples
    ///
    /// ```
    /// use autosplats::GBuffer;
    ///
    /// let mut layers = GBuffer::new(100, 2);
    /// let index = layers.index(70, 1);
    /// layers.depth[index] = 5.0;
    /// let rows = layers.rows(&layers.depth, f32::INFINITY);
    /// assert_eq!((rows.len(), rows[100 + 70]), (200, 5.0));
    /// ```
    pub fn rows<T: Copy + Send + Sync>(&self, layer: &[T], empty: T) -> Vec<T> {
        self.rows_of(empty, |index| layer[index])
    }

    /// World-space unit normals in the order of the picture, towards the eye of `camera`; zero where no surface is.
    ///
    /// # Errors
    /// [`Error::Camera`] if the camera is invalid.
    pub fn world_normals(&self, camera: &Camera) -> Result<Vec<[f32; 3]>, Error> {
        let lens = camera.lens([self.width, self.height])?;
        Ok(self.rows_of([0.0; 3], |index| lens.world_normal(self.normal[index])))
    }

    /// Values in the order of the picture, of indices in layers; `empty` where no surface is.
    fn rows_of<T: Copy + Send + Sync>(&self, empty: T, value: impl Fn(usize) -> T + Sync) -> Vec<T> {
        let width = self.width as usize;
        let mut rows = vec![empty; width * self.height as usize];
        let fill = |(y, row): (usize, &mut [T])| {
            for (x, place) in row.iter_mut().enumerate() {
                let index = self.index(x, y);
                if self.depth[index].is_finite() {
                    *place = value(index);
                }
            }
        };
        rows.par_chunks_mut(width.max(1)).enumerate().for_each(fill);
        rows
    }
}
