//! Which sixteenths of each pixel hold points, those that own no pixel among them: a surface ends where its outermost points
//! lie, and where many fall into a pixel those are seldom the nearest.

use std::sync::atomic::{AtomicU16, Ordering};

use rayon::prelude::*;

use crate::camera::View;

/// Sixteenths of pixels in a row of a pixel, and rows.
pub(super) const PER_SIDE: u32 = 4;

/// For each pixel, row by row, a bit for each of its sixteenths, row by row as well, the upper left one the lowest.
#[derive(Debug, Default)]
pub(crate) struct Sixteenths {
    width: usize,
    pixels: Vec<AtomicU16>,
}

impl Sixteenths {
    /// Sizes it for `view` and leaves no point in it.
    pub(crate) fn clear(&mut self, view: &View) {
        self.width = view.width as usize;
        self.pixels.resize_with(self.width * view.height as usize, AtomicU16::default);
        self.pixels.par_chunks_mut(1 << 16).for_each(|pixels| pixels.iter_mut().for_each(|pixel| *pixel.get_mut() = 0));
    }

    /// Adds a point in a sixteenth of a pixel.
    #[inline(always)]
    pub(crate) fn add(&self, pixel: u32, sixteenth: u32) {
        self.pixels[pixel as usize].fetch_or(1 << sixteenth, Ordering::Relaxed);
    }

    /// Those of a pixel, which counts row by row.
    pub(crate) fn of(&self, pixel: usize) -> u16 {
        self.pixels[pixel].load(Ordering::Relaxed)
    }

    /// Those no farther than a pixel from the middle of pixel (x, y), which lies not at the edge of the picture: eight rows of
    /// eight, a bit each, the upper left one the lowest.
    pub(crate) fn around(&self, [x, y]: [usize; 2]) -> u64 {
        // Each row of a pixel's in a byte.
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
    /// Those with points at these places, given in pixels, in a picture of this size.
    pub(crate) fn with([width, height]: [usize; 2], places: impl IntoIterator<Item = [f32; 2]>) -> Self {
        let mut sixteenths = Self { width, pixels: Vec::new() };
        sixteenths.pixels.resize_with(width * height, AtomicU16::default);
        for [x, y] in places.into_iter().map(sixteenths_at) {
            sixteenths.add(y / PER_SIDE * width as u32 + x / PER_SIDE, sixteenth([x, y]));
        }
        sixteenths
    }

    /// As the device has them.
    pub(crate) fn words(&self) -> Vec<u32> {
        let of = |pixel: &AtomicU16| u32::from(pixel.load(Ordering::Relaxed));
        self.pixels.chunks(2).map(|pair| of(&pair[0]) | pair.get(1).map_or(0, of) << 16).collect()
    }
}

impl Clone for Sixteenths {
    fn clone(&self) -> Self {
        let pixels = (0..self.pixels.len()).map(|pixel| self.of(pixel).into()).collect();
        Self { width: self.width, pixels }
    }
}

/// Column and row of sixteenths in which a place lies, given in pixels.
#[inline(always)]
pub(crate) fn sixteenths_at(place: [f32; 2]) -> [u32; 2] {
    place.map(|at| (PER_SIDE as f32 * at) as u32)
}

/// Which of its pixel's that is.
#[inline(always)]
pub(crate) fn sixteenth([column, row]: [u32; 2]) -> u32 {
    PER_SIDE * (row % PER_SIDE) + column % PER_SIDE
}

/// The half of `pixel`, which counts row by row, that such a place falls into; halves count two a pixel. They lie side by side
/// and one below the other in turn, like the black and the white squares of a chessboard: so no direction is seen better than
/// another.
#[inline(always)]
pub(crate) fn half(pixel: u32, [x4, y4]: [u32; 2]) -> u32 {
    let along = if (x4 >> 2).wrapping_add(y4 >> 2) & 1 == 1 { x4 } else { y4 };
    (pixel << 1) | (along >> 1 & 1)
}

/// The half of a pixel at a place, given in pixels; `None` beside the picture.
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
                // From the corner of the eight by eight.
                let [column, row] = [px - (x as f32 - 0.5), py - (y as f32 - 0.5)].map(|at| (4.0 * at).floor());
                if (0.0..8.0).contains(&column) && (0.0..8.0).contains(&row) {
                    expected |= 1 << (8 * row as usize + column as usize);
                }
            }
            assert_eq!(sixteenths.around([x, y]), expected, "{x}, {y}");
        }
    }
}
