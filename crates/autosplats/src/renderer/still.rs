//! Pictures that have time.

use autosplats_cloud::check_memory;

use super::MAX_SIDE;

/// Memory in bytes that stages and layers take for each pixel of a picture, about.
pub const BYTES_PER_PIXEL: u64 = 100;
/// Pixels of the largest still that is averaged down: in larger ones details are larger as well, and what is rendered is no larger
/// than screens are.
const MOST_PIXELS: u64 = 1920 * 1080;

/// How many times as wide and high a still picture of `size` pixels is best rendered, to be
/// [averaged down](crate::Image::averaged): 2 of up to 1920x1080 pixels, if memory is there for it, else 1. It takes two to four
/// times as long, and nothing else brings pictures without noise as much nearer to the true surface.
#[must_use]
pub fn still_supersample(size: [u32; 2]) -> u32 {
    let [width, height] = size.map(|side| 2 * u64::from(side));
    let fits = width.max(height) <= u64::from(MAX_SIDE) && width * height <= 4 * MOST_PIXELS;
    if fits && check_memory("a picture", width * height * BYTES_PER_PIXEL).is_ok() { 2 } else { 1 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_screens_show_is_supersampled() {
        let factors = [[1, 1], [1760, 900], [1920, 1080], [1921, 1080], [MAX_SIDE / 2, 8], [MAX_SIDE / 2 + 1, 8]];
        assert_eq!(factors.map(still_supersample), [2, 2, 2, 1, 2, 1]);
        assert_eq!(still_supersample([u32::MAX; 2]), 1, "no overflow");
    }
}
