//! Shading of layers that a caller has.

use glam::DVec3;

use crate::Error;
use crate::camera::Camera;
use crate::shade::{ColorMode, Image, Scene, Shading, shade};
use crate::splat::GBuffer;

use super::{MAX_SIDE, Settings};

/// Shades `layers` as a frame would be, on the CPU: another look at a frame's surface without rendering it again, or a
/// picture of a surface that comes from elsewhere, begun with [`GBuffer::new`]. Heights are told along the camera's up axis;
/// without an [exposure](Shading::exposure) colours are shown as bright as they are, whatever cloud they were of.
///
/// # Errors
/// [`Error::ImageSize`], [`Error::Camera`], [`Error::Setting`]; [`Error::Layers`] if a layer that is needed has not one value
/// for each pixel.
pub fn shade_layers(layers: &GBuffer, camera: &Camera, shading: &Shading) -> Result<Image, Error> {
    let GBuffer { width, height, .. } = *layers;
    let sides = 1..=MAX_SIDE;
    if !sides.contains(&width) || !sides.contains(&height) {
        return Err(Error::ImageSize { width, height });
    }
    Settings { shading: shading.clone(), ..Settings::default() }.check()?;
    let view = camera.view(DVec3::ZERO, [width, height])?;
    let needed = match shading.color {
        ColorMode::Field(_) => Some(("scalar", layers.scalar.len())),
        ColorMode::Curvature => Some(("curvature", layers.curvature.len())),
        ColorMode::Radius => Some(("radius", layers.radius.len())),
        ColorMode::KRadius => Some(("k-radius", layers.k_radius.len())),
        _ => None,
    };
    let area = layers.area();
    let always =
        [("weight", layers.weight.len()), ("depth", layers.depth.len()), ("normal", layers.normal.len())].into_iter();
    let optional = [("color", layers.color.len()), ("back", layers.back.len())].into_iter().filter(|(_, len)| *len > 0);
    if let Some((layer, values)) = always.chain(optional).chain(needed).find(|(_, len)| *len != area) {
        return Err(Error::Layers { layer, values, wanted: area });
    }
    // Whose colours these are is not known.
    let exposure = shading.exposure.unwrap_or(1.0);
    let scene = Scene { view: &view, up: camera.up.normalize(), origin: DVec3::ZERO, exposure };
    let mut image = Image::default();
    shade(layers, &scene, shading, true, None, &mut image);
    Ok(image)
}
