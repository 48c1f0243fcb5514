//! PNG: the picture for viewing, 8 bits per channel.

use std::io::{Error, Result, Write};

use autosplats::Image;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _};

/// Writes an image, with an alpha channel if `alpha`.
///
/// All image rows use the Paeth filter. Choosing the best filter for each row takes longer and does not make files of
/// such pictures smaller.
///
/// # Errors
/// Those of the writer.
///
/// # Examples
///
/// ```
/// use autosplats_output::write_png;
///
/// let image = autosplats::Image { width: 1, height: 1, pixels: vec![[9, 9, 9, 255]], ..Default::default() };
/// let mut file = Vec::new();
/// write_png(&image, false, &mut file)?;
/// assert!(file.starts_with(b"\x89PNG"));
/// # Ok::<(), std::io::Error>(())
/// ```
pub fn write_png(image: &Image, alpha: bool, writer: impl Write) -> Result<()> {
    let encoder = PngEncoder::new_with_quality(writer, CompressionType::Fast, FilterType::Paeth);
    let Image { width, height, pixels, .. } = image;
    let written = if alpha {
        encoder.write_image(pixels.as_flattened(), *width, *height, ExtendedColorType::Rgba8)
    } else {
        let mut bytes = vec![[0; 3]; pixels.len()];
        for (rgb, [red, green, blue, _]) in bytes.iter_mut().zip(pixels) {
            *rgb = [*red, *green, *blue];
        }
        encoder.write_image(bytes.as_flattened(), *width, *height, ExtendedColorType::Rgb8)
    };
    written.map_err(Error::other)
}
