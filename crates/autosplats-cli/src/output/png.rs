//! PNG: the picture as it is looked at, 8 bits a channel.

use std::io::{Error, Result, Write};

use autosplats::Image;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _};

/// Writes an image, with an alpha channel if `alpha`.
pub(crate) fn write_png(image: &Image, alpha: bool, writer: &mut impl Write) -> Result<()> {
    let encoder = PngEncoder::new_with_quality(writer, CompressionType::Fast, FilterType::Adaptive);
    let Image { width, height, pixels, .. } = image;
    let written = if alpha {
        encoder.write_image(pixels.as_flattened(), *width, *height, ExtendedColorType::Rgba8)
    } else {
        let bytes: Vec<u8> = pixels.iter().flat_map(|&[red, green, blue, _]| [red, green, blue]).collect();
        encoder.write_image(&bytes, *width, *height, ExtendedColorType::Rgb8)
    };
    written.map_err(Error::other)
}
