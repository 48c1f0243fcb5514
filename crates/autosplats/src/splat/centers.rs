//! Centres of splats in each pixel: their number and mean place. Splats that refinement removed count as well, because
//! hidden points say as much about a silhouette as visible ones.
//!
//! A pixel is one integer, so centres may be added in any order by any number of threads. On the device a centre is one
//! atomic addition. The highest eight bits are the count. Twelve bits each are the sums of rows and columns, in
//! [`CENTER_STEPS`] steps a pixel. More than 255 centres in a pixel overflow, which spoils only the border beside it.
//! Projection leaves at most two, and only adaptation to noise moves centres to other pixels.

use super::bins::Run;
use super::raster::Tile;
use super::{TILE, TILE_AREA};
use crate::fit::Surfel;

/// Steps along the side of a pixel.
pub(super) const CENTER_STEPS: f32 = 16.0;
/// Bits of a sum of steps.
const SUM_BITS: u32 = 12;
const SUM_MASK: u32 = (1 << SUM_BITS) - 1;

/// The word of one centre in pixel (x, y).
pub(super) fn one([x, y]: [usize; 2], center_px: [f32; 2]) -> u32 {
    // The centre lies in the pixel up to rounding.
    let step =
        |center: f32, pixel: usize| (CENTER_STEPS * (center - pixel as f32)).clamp(0.0, CENTER_STEPS - 1.0) as u32;
    1 << (2 * SUM_BITS) | step(center_px[1], y) << SUM_BITS | step(center_px[0], x)
}

/// Number of centres in a pixel, and the offset in pixels of their mean from the pixel's middle. The offset is
/// meaningless if there are none.
pub(super) fn mean(centers: u32) -> (f32, [f32; 2]) {
    let count = (centers >> (2 * SUM_BITS)) as f32;
    let sums = [centers & SUM_MASK, centers >> SUM_BITS & SUM_MASK];
    // From the pixel's middle to the middle of the mean step.
    (count, sums.map(|sum| (sum as f32 / count.max(1.0) + 0.5) / CENTER_STEPS - 0.5))
}

/// Fills `centers` with the centres of the splats of `runs` whose pixels lie in `tile`.
pub(super) fn add_centers(runs: &[Run], surfels: &[Surfel], tile: Tile, centers: &mut [u32]) {
    centers[..TILE_AREA].fill(0);
    let [x0, y0] = tile.origin;
    for run in runs {
        for index in run.tile(tile.index).iter().map(|&index| index as usize) {
            let surfel = &surfels[run.first + index];
            let [x, y] = surfel.pixel_xy();
            // The pixel of a near point need not be that of its centre.
            if !surfel.is_near() && x / TILE == x0 / TILE && y / TILE == y0 / TILE {
                let at = (y - y0) * TILE + x - x0;
                centers[at] = centers[at].wrapping_add(one([x, y], run.splats[index].center_px));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_tell_count_and_mean() {
        assert_eq!(mean(0).0, 0.0, "none");
        let places = [[7.0, 3.0], [7.999, 3.25], [7.5, 3.9], [7.25, 3.5]];
        for count in [1, 2, 3, 4, 252] {
            let all = (0..count).map(|i| places[i % 4]);
            let centers = all.clone().fold(0, |sum, place| sum + one([7, 3], place));
            let (counted, offset) = mean(centers);
            assert_eq!(counted, count as f32, "count");
            for axis in 0..2 {
                let exact = all.clone().map(|place| place[axis]).sum::<f32>() / count as f32;
                let off = offset[axis] - (exact - [7.5, 3.5][axis]);
                // Half a step.
                assert!(off.abs() <= 0.5 / CENTER_STEPS + 1e-3, "{count} centres, axis {axis}: off by {off}");
            }
        }
        let (count, offset) = mean(one([7, 3], [-100.0, 1e9]));
        assert!(count == 1.0 && offset == [-15.0, 15.0].map(|steps| steps / 32.0), "beside its pixel: {offset:?}");
    }
}
