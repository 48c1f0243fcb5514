//! Depths of a piece of a picture, row by row. Layers are stored tile by tile, which does not suit reads across.

use std::ops::Range;

use crate::splat::GBuffer;

/// Lanes of the widest vector. Rows are padded to a multiple.
pub(super) const LANES: usize = 16;

/// Depths of a piece of a picture and of a margin around it; infinite where no surface is and beyond the picture.
#[derive(Default)]
pub(super) struct Depths {
    values: Vec<f32>,
    stride: usize,
    margin: usize,
    /// Column and row in the picture of the first value here; negative beyond the picture.
    corner: [isize; 2],
}

impl Depths {
    /// Copies the pixels in these columns and rows, which may lie beyond the picture, with a margin of `margin` pixels
    /// on every side.
    pub(super) fn fill(&mut self, layers: &GBuffer, [columns, rows]: [Range<isize>; 2], margin: usize) {
        let [width, height] = [layers.width as isize, layers.height as isize];
        self.margin = margin;
        self.stride = columns.len().next_multiple_of(LANES) + 2 * margin;
        self.corner = [columns.start, rows.start].map(|first| first - margin as isize);
        self.values.clear();
        self.values.resize(self.stride * (rows.len() + 2 * margin), f32::INFINITY);
        let [left, top] = self.corner;
        let end = (columns.end + margin as isize).min(width);
        for (y, values) in (top..height).zip(self.values.chunks_mut(self.stride)).filter(|&(y, _)| y >= 0) {
            let mut x = left.max(0);
            while x < end {
                let run = layers.run(x as usize).min((end - x) as usize);
                let depths = &layers.depth[layers.index(x as usize, y as usize)..][..run];
                values[(x - left) as usize..][..run].copy_from_slice(depths);
                x += run as isize;
            }
        }
    }

    /// The depth at a pixel, which may lie in the margin.
    #[inline(always)]
    pub(super) fn at(&self, x: isize, y: isize) -> f32 {
        let [left, top] = self.corner;
        self.values[(y - top) as usize * self.stride + (x - left) as usize]
    }

    /// Row `y`, moved by `dx` columns, as long as a padded row of the piece.
    #[inline(always)]
    pub(super) fn row(&self, dx: isize, y: isize) -> &[f32] {
        let first = (y - self.corner[1]) as usize * self.stride + (self.margin as isize + dx) as usize;
        &self.values[first..][..self.stride - 2 * self.margin]
    }
}
