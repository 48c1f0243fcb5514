//! Shade: the visible surface in, an image out [Paper, §7].
//!
//! # How it works
//! Each covered pixel has a base colour: the points' own, one tone, or that of a value in a colour map. Values are
//! height, depth, a scalar field and others. The base colour is multiplied by the light that the pixel's normal catches
//! (`light.rs`). A key light comes from over the viewer's left shoulder, a weak fill light from the right, and the sky
//! is brighter above than below. Normals face the eye, so both sides of a surface are lit alike. Where the sensors'
//! places are known, the side that they did not see is darker and has less colour.
//!
//! Occlusion (`occlusion.rs`) takes light away in creases and behind things. Brightness above white is bent below it.
//! Where surfaces end, pixels show a part of what lies beside them (`edges.rs`). Linear light, which is data, is stored
//! without that. Colours are linear until the last step, which encodes them as sRGB.
//!
//! A thread shades a band of rows. The depths of the band and of a margin lie side by side, so occlusion is computed
//! for a vector of pixels at a time.
//!
//! A range that is not given reaches from the 1st to the 99th percentile of at most 50,000 values of the picture. On
//! the device the range is found before shading, so no frame waits for the host. The host draws the legend, into
//! pictures in memory only.

mod average;
mod background;
mod classes;
mod color_map;
mod cpu;
mod depths;
mod edges;
mod encode;
pub(crate) mod gpu;
mod legend;
mod light;
mod occlusion;
pub(crate) mod over_time;
mod settings;
#[cfg(test)]
mod tests;

pub use background::Background;
pub(crate) use classes::class_colors;
pub(crate) use cpu::{Scene, shade};
pub use settings::{Backs, ColorMap, ColorMode, Shading};

/// An image, rows from the top.
///
/// # Examples
///
/// ```
/// use autosplats::Image;
///
/// let pixels = [0, 255, 255, 0].map(|grey| [grey, grey, grey, 255]).to_vec();
/// let image = Image { width: 2, height: 2, pixels, ..Image::default() };
/// // Half the light of white is brighter than half its number, 128.
/// assert_eq!(image.averaged(2).pixels, [[188, 188, 188, 255]]);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// sRGB with straight alpha, 8 bits a channel. Edges are blended; alpha is the covered part of a pixel.
    pub pixels: Vec<[u8; 4]>,
    /// Linear light before any rounding; zero where no surface is. Without legend, background, blended edges and
    /// averaging with earlier pictures. Empty unless all layers are requested.
    pub linear: Vec<[f32; 3]>,
}

/// Linear value, 0 to 1, of an sRGB value 0 to 1.
pub(crate) fn linear(srgb: f32) -> f32 {
    if srgb <= 0.04045 { srgb / 12.92 } else { ((srgb + 0.055) / 1.055).powf(2.4) }
}

/// sRGB value, 0 to 1, of a linear value 0 to 1.
fn srgb(linear: f32) -> f32 {
    if linear <= 0.0031308 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Linear values of the 256 steps of an 8-bit sRGB channel.
pub(crate) fn linear_steps() -> [f32; 256] {
    std::array::from_fn(|step| linear(step as f32 / 255.0))
}
