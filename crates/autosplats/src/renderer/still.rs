//! Still pictures, which may take longer than frames.

use autosplats_cloud::check_memory;

use crate::MAX_SIDE;

/// Most memory in bytes that stages and layers take per pixel of a picture: 100, and 170 for each visible point. A
/// dense scan has up to 0.7 of these a pixel (measured on the CPU, docs/decisions/0053-stills.md). Where a picture is
/// empty, next to none of it is taken.
pub const BYTES_PER_PIXEL: u64 = 220;
/// Most pixels of a still that is supersampled. In larger pictures details are larger too, and the rendered pictures
/// stay within common screen sizes.
const MAX_SUPERSAMPLED_PIXELS: u64 = 1920 * 1080;

/// Factor on both sides of a still picture of `size` pixels at which it is best rendered, then [averaged
/// down](crate::Image::averaged). The factor is 2 for up to 1920x1080 pixels if memory suffices, else 1.
///
/// Supersampling takes two to four times as long. For pictures without noise it improves the accuracy most.
///
/// # Examples
///
/// ```
/// use autosplats::{Renderer, Settings, still_supersample};
/// # use autosplats::{Camera, Projection, cloud::{PointCloud, glam::DVec3}};
/// # let floor = (0..10_000).map(|i| [(i % 100) as f32, (i / 100) as f32, 0.0]).collect();
/// # let cloud = PointCloud::new(DVec3::ZERO, floor);
/// # let (eye, look_at) = (DVec3::new(50.0, 50.0, 100.0), DVec3::new(50.0, 50.0, 0.0));
/// # let projection = Projection::PerspectiveFovDeg(40.0);
/// # let camera = Camera { eye, look_at, up: DVec3::Y, projection };
///
/// let factor = still_supersample([64, 48]);
/// let mut renderer = Renderer::new();
/// let size = [64 * factor, 48 * factor];
/// let frame = renderer.render(&cloud, &camera, size, &Settings::default())?;
/// let image = frame.image.averaged(factor);
/// assert_eq!([image.width, image.height], [64, 48]);
/// # Ok::<(), autosplats::Error>(())
/// ```
#[must_use]
pub fn still_supersample(size: [u32; 2]) -> u32 {
    let [width, height] = size.map(|side| 2 * u64::from(side));
    let fits = width.max(height) <= u64::from(MAX_SIDE) && width * height <= 4 * MAX_SUPERSAMPLED_PIXELS;
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
