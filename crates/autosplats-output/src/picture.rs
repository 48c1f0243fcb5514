//! Pictures for viewing, 8 bits per channel: PNG and JPEG.

use std::io::{Error, Result, Write};
use std::path::Path;

use autosplats::Image;
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _};

/// Quality of JPEG pictures, of 100. The artefacts at the edges of splats are below what an eye sees.
const JPEG_QUALITY: u8 = 95;

/// File format of a picture.
///
/// # Examples
///
/// ```
/// use autosplats_output::PictureFormat;
///
/// assert_eq!(PictureFormat::of("scan.JPG".as_ref()), Some(PictureFormat::Jpeg));
/// assert_eq!(PictureFormat::of("scan.gif".as_ref()), None);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureFormat {
    /// Without loss, and with transparency if asked for.
    Png,
    /// Smaller, with a loss that is hardly visible. Has no transparency.
    Jpeg,
}

impl PictureFormat {
    /// The format of a file name's extension, in any letter case.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_string_lossy().to_lowercase().as_str() {
            "png" => Some(Self::Png),
            "jpg" | "jpeg" => Some(Self::Jpeg),
            _ => None,
        }
    }
}

/// Writes an image. PNG has an alpha channel if `alpha`, JPEG never.
///
/// # Errors
/// Those of the writer.
///
/// # Examples
///
/// ```
/// use autosplats_output::{PictureFormat, write_picture};
///
/// let image = autosplats::Image { width: 1, height: 1, pixels: vec![[9, 9, 9, 255]], ..Default::default() };
/// let mut file = Vec::new();
/// write_picture(&image, PictureFormat::Jpeg, false, &mut file)?;
/// assert!(file.starts_with(b"\xff\xd8"));
/// # Ok::<(), std::io::Error>(())
/// ```
pub fn write_picture(image: &Image, format: PictureFormat, alpha: bool, writer: impl Write) -> Result<()> {
    match format {
        PictureFormat::Png => write_png(image, alpha, writer),
        PictureFormat::Jpeg => {
            // The encoder keeps colours at full resolution, so that coloured edges stay sharp.
            let encoder = JpegEncoder::new_with_quality(writer, JPEG_QUALITY);
            encoder
                .write_image(rgb(image).as_flattened(), image.width, image.height, ExtendedColorType::Rgb8)
                .map_err(Error::other)
        }
    }
}

/// Writes an image as PNG, with an alpha channel if `alpha`.
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
        encoder.write_image(rgb(image).as_flattened(), *width, *height, ExtendedColorType::Rgb8)
    };
    written.map_err(Error::other)
}

/// The pixels without alpha.
fn rgb(image: &Image) -> Vec<[u8; 3]> {
    image.pixels.iter().map(|&[red, green, blue, _]| [red, green, blue]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coloured_edges_stay_sharp_in_a_jpeg() {
        // Stripes of one pixel in colours of equal lightness, which halved colour resolution would mix to grey.
        let pixels = (0..64 * 64).map(|i| if i % 2 == 0 { [220, 40, 40, 255] } else { [20, 130, 20, 255] }).collect();
        let image = Image { width: 64, height: 64, pixels, linear: Vec::new() };
        let mut file = Vec::new();
        write_picture(&image, PictureFormat::Jpeg, true, &mut file).expect("a picture");
        let read = image::load_from_memory(&file).expect("a JPEG").into_rgb8();
        let off = |(read, own): (&image::Rgb<u8>, &[u8; 4])| {
            (0..3).map(|i| read.0[i].abs_diff(own[i])).max().unwrap_or_default()
        };
        let worst = read.pixels().zip(&image.pixels).map(off).max();
        assert!(worst < Some(40), "off by {worst:?}");
    }
}
