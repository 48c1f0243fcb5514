//! Bits that say which sixteenths of each pixel hold points, whether or not these own a pixel. A surface ends at its
//! outermost points, and where points are dense the outermost are seldom the nearest of a pixel. See
//! docs/decisions/0002-borders-by-sixteenths.md.

use std::sync::atomic::{AtomicU16, Ordering};

use super::{Blocks, whole};
use crate::camera::View;
use crate::room::fit_atomic;

/// Sixteenths along each side of a pixel.
pub(super) const PER_SIDE: u32 = 4;

/// Sixteen bits per pixel, pixels row by row. A pixel's sixteenths are row by row too, the upper left the lowest bit.
#[derive(Debug, Default)]
pub(crate) struct Sixteenths {
    width: usize,
    pixels: Vec<AtomicU16>,
    pub(super) blocks: Blocks,
}

impl Sixteenths {
    /// Resizes to `view` and clears all bits.
    pub(crate) fn clear(&mut self, view: &View) {
        let size = [view.width, view.height].map(|side| side as usize);
        self.blocks.change(&mut self.pixels, |pixels| pixels.iter_mut().for_each(|pixel| *pixel.get_mut() = 0));
        self.blocks = Blocks::new(size);
        self.width = size[0];
        fit_atomic(&mut self.pixels, size[0] * size[1]);
    }

    /// The blocks that hold points.
    pub(crate) fn blocks(&self) -> &Blocks {
        &self.blocks
    }

    /// Marks a sixteenth of a pixel as holding a point.
    #[inline(always)]
    pub(crate) fn add(&self, pixel: u32, sixteenth: u32) {
        self.pixels[pixel as usize].fetch_or(1 << sixteenth, Ordering::Relaxed);
    }

    /// The sixteen bits of a pixel, by its row-by-row index.
    pub(crate) fn of(&self, pixel: usize) -> u16 {
        self.pixels[pixel].load(Ordering::Relaxed)
    }

    /// The 8 × 8 sixteenths within one pixel of the middle of pixel (x, y), row by row, the upper left the lowest bit.
    /// The pixel must not lie at the edge of the screen.
    pub(crate) fn around(&self, [x, y]: [usize; 2]) -> u64 {
        // Spread each row of four bits to a byte.
        let bytes = |x: usize, y: usize| {
            let pixel = u32::from(self.of(y * self.width + x));
            let pairs = (pixel | pixel << 8) & 0x00ff_00ff;
            (pairs | pairs << 4) & 0x0f0f_0f0f
        };
        let rows = |y: usize| {
            let [left, own, right] = [x - 1, x, x + 1].map(|x| bytes(x, y));
            u64::from((left >> 2 & 0x0303_0303) | own << 2 | (right & 0x0303_0303) << 6)
        };
        rows(y - 1) >> 16 | rows(y) << 16 | rows(y + 1) << 48
    }
}

#[cfg(test)]
impl Sixteenths {
    /// Sixteenths of a screen of this size with points at `places`, in pixels.
    pub(crate) fn with([width, height]: [usize; 2], places: impl IntoIterator<Item = [f32; 2]>) -> Self {
        let mut sixteenths = Self { width, pixels: Vec::new(), blocks: Blocks::new([width, height]) };
        sixteenths.pixels.resize_with(width * height, AtomicU16::default);
        for [x, y] in places.into_iter().map(sixteenths_at) {
            let pixel = y / PER_SIDE * width as u32 + x / PER_SIDE;
            sixteenths.add(pixel, sixteenth([x, y]));
            sixteenths.blocks.hold(pixel);
        }
        sixteenths
    }

    /// The bits as the device stores them: two pixels to a word, the first in the low half.
    pub(crate) fn words(&self) -> Vec<u32> {
        let of = |pixel: &AtomicU16| u32::from(pixel.load(Ordering::Relaxed));
        self.pixels.chunks(2).map(|pair| of(&pair[0]) | pair.get(1).map_or(0, of) << 16).collect()
    }
}

impl Clone for Sixteenths {
    fn clone(&self) -> Self {
        let pixels = (0..self.pixels.len()).map(|pixel| self.of(pixel).into()).collect();
        Self { width: self.width, pixels, blocks: self.blocks.clone() }
    }
}

/// Column and row, in sixteenths of the screen, of a place in pixels.
#[inline(always)]
pub(crate) fn sixteenths_at(place: [f32; 2]) -> [u32; 2] {
    place.map(|at| whole(PER_SIDE as f32 * at))
}

/// Index of a sixteenth, by column and row on the screen, within its pixel.
#[inline(always)]
pub(crate) fn sixteenth([column, row]: [u32; 2]) -> u32 {
    PER_SIDE * (row % PER_SIDE) + column % PER_SIDE
}

/// Index of the half of `pixel` that holds the sixteenth at column `x4` and row `y4`. Pixels count row by row, and
/// halves count two a pixel. Pixels are split left/right and top/bottom like the squares of a chessboard, so that no
/// direction is favoured.
#[inline(always)]
pub(crate) fn half(pixel: u32, [x4, y4]: [u32; 2]) -> u32 {
    let along = if (x4 >> 2).wrapping_add(y4 >> 2) & 1 == 1 { x4 } else { y4 };
    (pixel << 1) | (along >> 1 & 1)
}

/// Index of the half pixel at a place in pixels; `None` outside the screen.
#[inline(always)]
pub(crate) fn half_at([x, y]: [f32; 2], view: &View) -> Option<usize> {
    let inside = (x >= 0.0) & (y >= 0.0) & (x < view.width as f32) & (y < view.height as f32);
    let [x4, y4] = sixteenths_at([x, y]);
    inside.then(|| half((y4 >> 2) * view.width + (x4 >> 2), [x4, y4]) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_clouds::Random;

    #[test]
    fn around_a_pixel_are_those_no_farther_than_a_pixel() {
        let size = [7, 5];
        let mut random = Random::new(81);
        let places: Vec<[f32; 2]> = (0..120).map(|_| size.map(|side| random.unit() * side as f32)).collect();
        let sixteenths = Sixteenths::with(size, places.iter().copied());
        for (x, y) in (1..size[0] - 1).flat_map(|x| (1..size[1] - 1).map(move |y| (x, y))) {
            let mut expected = 0u64;
            for [px, py] in &places {
                // Offset from the corner of the eight by eight.
                let [column, row] = [px - (x as f32 - 0.5), py - (y as f32 - 0.5)].map(|at| (4.0 * at).floor());
                if (0.0..8.0).contains(&column) && (0.0..8.0).contains(&row) {
                    expected |= 1 << (8 * row as usize + column as usize);
                }
            }
            assert_eq!(sixteenths.around([x, y]), expected, "{x}, {y}");
        }
    }
}
