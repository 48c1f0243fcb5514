//! Coarse depths of a picture, for a wheel or a drag that cannot wait for the renderer.

use autosplats::cloud::glam::{DVec2, DVec3};
use autosplats::{Camera, GBuffer};

/// Stride of the kept pixels, in both directions.
const PIXEL_STRIDE: usize = 4;

/// Depths of every fourth pixel of a picture, in both directions.
#[derive(Clone, Debug, Default)]
pub(crate) struct Depths {
    /// Size of the picture, pixels.
    size: [u32; 2],
    columns: usize,
    rows: usize,
    depths: Vec<f32>,
}

impl Depths {
    /// The depths of a picture; empty if `layers` has none.
    pub(super) fn new(layers: &GBuffer) -> Self {
        let size = [layers.width, layers.height];
        if layers.depth.is_empty() {
            return Self::default();
        }
        let [columns, rows] = size.map(|side| (side as usize).div_ceil(PIXEL_STRIDE));
        let pixels =
            (0..rows).flat_map(|row| (0..columns).map(move |column| (column * PIXEL_STRIDE, row * PIXEL_STRIDE)));
        let depths = pixels.map(|(x, y)| layers.depth[layers.index(x, y)]).collect();
        Self { size, columns, rows, depths }
    }

    /// World position of the surface at `place` in a picture taken by `camera`. `place` is in shares of the picture's
    /// sides, 0 to 1. If the pixel is empty, its eight kept neighbours are tried; `None` if all are empty.
    pub(crate) fn world(&self, camera: &Camera, place: DVec2) -> Option<DVec3> {
        let pixel = place * DVec2::new(self.size[0].into(), self.size[1].into());
        let [column, row] = [pixel.x, pixel.y].map(|pixel| (pixel / PIXEL_STRIDE as f64).floor() as isize);
        let near = [(0, 0), (1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1)];
        let depth = near.into_iter().find_map(|(dx, dy)| {
            let column = usize::try_from(column + dx).ok().filter(|&column| column < self.columns)?;
            let row = usize::try_from(row + dy).ok().filter(|&row| row < self.rows)?;
            let depth = f64::from(self.depths[row * self.columns + column]);
            depth.is_finite().then_some(depth)
        })?;
        camera.unproject(pixel, depth, self.size).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use autosplats::Projection;

    #[test]
    fn what_is_under_a_place_is_found() {
        let camera = Camera {
            eye: DVec3::new(0.0, -10.0, 0.0),
            look_at: DVec3::ZERO,
            up: DVec3::Z,
            projection: Projection::PerspectiveFovDeg(60.0),
        };
        let mut layers = GBuffer::new(120, 80);
        for y in 0..40 {
            for x in 0..120 {
                let at = layers.index(x, y);
                layers.depth[at] = 10.0;
            }
        }
        let depths = Depths::new(&layers);
        let middle = depths.world(&camera, DVec2::new(0.5, 0.45)).expect("the upper half is covered");
        assert!(middle.y.abs() < 1e-6 && middle.x.abs() < 1e-6 && middle.z > 0.0, "before the eye: {middle}");
        assert_eq!(depths.world(&camera, DVec2::new(0.5, 0.8)), None, "nothing is in the lower half");
        assert!(Depths::default().world(&camera, DVec2::new(0.5, 0.5)).is_none(), "no layers, no depth");
    }
}
