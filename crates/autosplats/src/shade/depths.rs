//! Depths of a band of rows, side by side. Layers are stored tile by tile, which does not suit reads across.

use crate::splat::GBuffer;

/// Lanes of the widest vector. Rows are padded to a multiple.
pub(super) const LANES: usize = 16;

/// Depths of some rows of a picture and of a margin around them; infinite where no surface is and beyond the picture.
#[derive(Default)]
pub(super) struct Depths {
    values: Vec<f32>,
    stride: usize,
    margin: usize,
    /// Picture row of the first row here; negative above the picture.
    top: isize,
}

impl Depths {
    /// Copies `rows` rows from row `first` on, with a margin of `margin` pixels on every side.
    pub(super) fn fill(&mut self, layers: &GBuffer, first: usize, rows: usize, margin: usize) {
        let [width, height] = [layers.width as usize, layers.height as usize];
        self.margin = margin;
        self.stride = width.next_multiple_of(LANES) + 2 * margin;
        self.top = first as isize - margin as isize;
        self.values.clear();
        self.values.resize(self.stride * (rows + 2 * margin), f32::INFINITY);
        for (row, values) in self.values.chunks_mut(self.stride).enumerate() {
            let Some(y) = self.top.checked_add_unsigned(row).and_then(|y| usize::try_from(y).ok()) else { continue };
            if y >= height {
                break;
            }
            let mut x = 0;
            while x < width {
                let run = layers.run(x).min(width - x);
                values[margin + x..][..run].copy_from_slice(&layers.depth[layers.index(x, y)..][..run]);
                x += run;
            }
        }
    }

    /// The depth at a pixel, which may lie in the margin.
    #[inline(always)]
    pub(super) fn at(&self, x: isize, y: isize) -> f32 {
        self.values[self.start(x, y)]
    }

    /// Row `y` from column `x` on, as long as a padded row of the picture.
    #[inline(always)]
    pub(super) fn row(&self, x: isize, y: isize) -> &[f32] {
        let length = self.stride - 2 * self.margin;
        &self.values[self.start(x, y)..][..length]
    }

    #[inline(always)]
    fn start(&self, x: isize, y: isize) -> usize {
        (y - self.top) as usize * self.stride + (x + self.margin as isize) as usize
    }
}
