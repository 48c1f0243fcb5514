//! What is written: pictures.

use std::path::Path;

use autosplats::Image;

use crate::app::App;
use crate::files;

/// Writes a picture and says so.
pub(crate) fn save_picture(app: &mut App, picture: &Image, path: &Path) {
    let pixels: Vec<u8> = picture.pixels.iter().flatten().copied().collect();
    let written = files::write(path, |writer| {
        let encoder = image::codecs::png::PngEncoder::new(writer);
        image::ImageEncoder::write_image(
            encoder,
            &pixels,
            picture.width,
            picture.height,
            image::ExtendedColorType::Rgba8,
        )
        .map_err(std::io::Error::other)
    });
    match written {
        Ok(()) => app.messages.note(format!("{} was written", path.display())),
        Err(error) => app.messages.error(format!("{}: {error}", path.display())),
    }
}
