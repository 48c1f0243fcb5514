//! Copying pictures into the caller's textures.

use wgpu::TextureFormat::{Bgra8Unorm, Bgra8UnormSrgb, Rgba8Unorm, Rgba8UnormSrgb};

use super::{ShadeBuffers, pitch};
use crate::Error;

/// Whether the bytes of a format are in the order blue, green, red.
pub(super) fn swaps_red_blue(format: wgpu::TextureFormat) -> bool {
    matches!(format, Bgra8Unorm | Bgra8UnormSrgb)
}

/// Checks that a picture of `size` can be copied into `texture`.
///
/// # Errors
/// [`Error::Texture`] with the reason.
pub(crate) fn check_texture(texture: &wgpu::Texture, size: [u32; 2]) -> Result<(), Error> {
    let wrong = |what: String| Err(Error::Texture(what));
    let format = texture.format();
    if !matches!(format, Rgba8Unorm | Rgba8UnormSrgb | Bgra8Unorm | Bgra8UnormSrgb) {
        return wrong(format!("{format:?} is none of Rgba8Unorm, Rgba8UnormSrgb, Bgra8Unorm, Bgra8UnormSrgb"));
    }
    if texture.dimension() != wgpu::TextureDimension::D2 || texture.sample_count() != 1 {
        return wrong("it must be two-dimensional, with one sample a pixel".into());
    }
    if !texture.usage().contains(wgpu::TextureUsages::COPY_DST) {
        return wrong("its usage lacks COPY_DST".into());
    }
    let [width, height] = size;
    if [texture.width(), texture.height()] != size {
        return wrong(format!("{}x{} pixels, the picture has {width}x{height}", texture.width(), texture.height()));
    }
    Ok(())
}

impl ShadeBuffers {
    /// Copies the picture into a texture whose format was given to
    /// [`ShadeUniform::into_format`](super::ShadeUniform::into_format). The picture's bytes are sRGB; sRGB and plain
    /// formats get the same bytes.
    ///
    /// # Errors
    /// Those of [`check_texture`].
    pub(crate) fn copy_to_texture(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        texture: &wgpu::Texture,
    ) -> Result<(), Error> {
        check_texture(texture, self.size)?;
        let [width, height] = self.size;
        let layout =
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * pitch(width)), rows_per_image: None };
        encoder.copy_buffer_to_texture(
            wgpu::TexelCopyBufferInfo { buffer: &self.image, layout },
            texture.as_image_copy(),
            wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        );
        Ok(())
    }
}
