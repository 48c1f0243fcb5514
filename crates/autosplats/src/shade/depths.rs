//! Depths of a band of rows, side by side: layers are stored tile by tile, which reading across would have to undo.

use crate::splat::GBuffer;

/// The widest vector, in lanes: rows are as long as a whole number of them.
pub(super) const LANES: usize = 16;

/// Depths of some rows of a picture and of a margin around them; infinite where nothing is and beyond the picture.
#[derive(Default)]
pub(super) struct Depths {
    values: Vec<f32>,
    stride: usize,
    margin: usize,
    /// The row of the picture that is the first here; above the picture it is negative.
    top: isize,
}

impl Depths {
    /// Takes `rows` rows from `first` on, and `margin` pixels more on every side.
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

    /// Row `y` from column `x` on, to the end of what is there of it.
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
