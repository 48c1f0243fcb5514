//! Shading of layers that the caller provides.

use glam::DVec3;

use crate::camera::Camera;
use crate::cancel::NEVER;
use crate::shade::{ColorMode, Image, Scene, Shading, shade};
use crate::splat::GBuffer;
use crate::{Error, MAX_SIDE};

use super::Settings;

/// Shades `layers` like a frame, on the CPU: a frame's surface with other settings, or a surface from elsewhere. Create
/// layers with [`GBuffer::new`].
///
/// Heights are measured along the camera's up axis. Without an [exposure](Shading::exposure), colours are shown as they
/// are.
///
/// # Errors
/// [`Error::ImageSize`], [`Error::Camera`], [`Error::Setting`]; [`Error::Layers`] if a required layer does not have one
/// value per pixel.
///
/// # Examples
///
/// ```
/// use autosplats::{
///     Background, Camera, GBuffer, Projection, Shading, cloud::glam::DVec3, shade_layers,
/// };
///
/// // A wall in the left half of the picture, 5 units from the eye.
/// let mut layers = GBuffer::new(64, 48);
/// for (x, y) in (0..32).flat_map(|x| (0..48).map(move |y| (x, y))) {
///     let index = layers.index(x, y);
///     layers.weight[index] = 1.0;
///     layers.depth[index] = 5.0;
///     layers.normal[index] = [0.0, 0.0, -1.0];
/// }
/// let camera = Camera {
///     eye: DVec3::ZERO,
///     look_at: DVec3::Y,
///     up: DVec3::Z,
///     projection: Projection::PerspectiveFovDeg(40.0),
/// };
/// let shading = Shading { background: Background::Transparent, ..Shading::default() };
/// let image = shade_layers(&layers, &camera, &shading)?;
/// assert_eq!([image.pixels[0][3], image.pixels[63][3]], [255, 0]);
/// # Ok::<(), autosplats::Error>(())
/// ```
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
    // The cloud of these colours is unknown.
    let exposure = shading.exposure.unwrap_or(1.0);
    let scene = Scene {
        view: &view,
        up: camera.up.normalize(),
        origin: DVec3::ZERO,
        unit: 1.0,
        exposure,
        values: layers.scalar_about,
    };
    let mut image = Image::default();
    shade(layers, &scene, shading, true, None, &mut image, &NEVER);
    Ok(image)
}
