//! Images of known size, decoded within bounds.

use std::io::Cursor;

use autosplats_cloud::printable;
use image::{DynamicImage, ImageFormat, ImageReader, Limits};

/// Largest number of bytes that one compressed byte of a PNG can expand to.
pub(super) const MAX_RATIO: usize = 1032;

/// Decodes an image whose size has been compared with the length of its file.
pub(super) fn decode(bytes: &[u8], format: ImageFormat, width: usize, height: usize) -> Result<DynamicImage, String> {
    let mut limits = Limits::default();
    limits.max_image_width = u32::try_from(width).ok();
    limits.max_image_height = u32::try_from(height).ok();
    // At most four channels of 16 bits, and as much again for the decoder.
    limits.max_alloc = Some((width as u64 * height as u64).saturating_mul(16).saturating_add(1 << 24));
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(limits);
    reader.decode().map_err(|error| printable(&error.to_string()))
}
