//! OpenEXR: all layers of the surface in one file.

use std::io::{Error, Result, Seek, Write};

use autosplats::{Camera, Frame};
use exr::prelude::{Encoding, Image, SpecificChannels, Vec2, WritableImage as _};

/// Writes the picture and its layers, 32 bits per channel, under OpenEXR's customary names.
///
/// * `R G B`: linear light.
/// * `A`: 1 where there is a surface, else 0.
/// * `Z`: depth along the viewing axis, infinite without a surface.
/// * `N.X N.Y N.Z`: normal in world space.
/// * `radius`, `kradius`, `curvature`: those of the splats.
/// * `index`: index of the point, a whole number; `u32::MAX` for none.
///
/// The frame must have all layers, see [`Settings::all_layers`](autosplats::Settings::all_layers).
///
/// # Errors
/// Those of the writer, and an unusable camera.
pub fn write_exr(frame: &Frame<'_>, camera: &Camera, writer: impl Write + Seek) -> Result<()> {
    let Frame { image, layers, .. } = *frame;
    let lens = camera.lens([image.width, image.height]).map_err(Error::other)?;
    let pixel = |Vec2(x, y): Vec2<usize>| {
        let at = layers.index(x, y);
        if !layers.depth[at].is_finite() {
            return (0.0, 0.0, 0.0, 0.0, f32::INFINITY, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, u32::MAX);
        }
        let [r, g, b] = image.linear[y * image.width as usize + x];
        let [nx, ny, nz] = lens.world_normal(layers.normal[at]);
        let (radius, k_radius, curvature) = (layers.radius[at], layers.k_radius[at], layers.curvature[at]);
        let depth = layers.depth[at];
        (r, g, b, 1.0, depth, nx, ny, nz, radius, k_radius, curvature, layers.point[at])
    };
    let channels = SpecificChannels::build()
        .with_channel::<f32>("R")
        .with_channel::<f32>("G")
        .with_channel::<f32>("B")
        .with_channel::<f32>("A")
        .with_channel::<f32>("Z")
        .with_channel::<f32>("N.X")
        .with_channel::<f32>("N.Y")
        .with_channel::<f32>("N.Z")
        .with_channel::<f32>("radius")
        .with_channel::<f32>("kradius")
        .with_channel::<f32>("curvature")
        .with_channel::<u32>("index")
        .with_pixel_fn(pixel);
    let size = (image.width as usize, image.height as usize);
    let mut picture = Image::from_encoded_channels(size, Encoding::SMALL_LOSSLESS, channels);
    picture.layer_data.attributes.software_name = Some("autosplats".into());
    picture.write().to_buffered(writer).map_err(Error::other)
}
