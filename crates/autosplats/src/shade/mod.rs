//! Shade: the visible surface in, an image out [Paper, §7].
//!
//! # How it works
//! Each covered pixel has a base colour: that of the points, one tone, or a value (height, depth, a scalar field …) looked
//! up in a colour map over its range. It is multiplied by the light that its normal catches (`light.rs`) from a key light
//! over the viewer's left shoulder, a weak fill light from the right and a sky brighter above than below; since normals
//! face the eye, both sides of a surface are lit alike; where it is known from where points were scanned, the side not seen
//! from there is darker and has less colour. Occlusion (`occlusion.rs`) takes light away in creases and from
//! what lies behind something. What would become brighter than white is bent below it. Where surfaces end, pixels show a
//! part of what is beside them (`edges.rs`); linear light, which is data, is kept without that. Colours are linear until
//! the last step, which encodes them as sRGB.
//!
//! A thread shades a band of rows: the depths of the band and of a margin lie side by side then, and occlusion is found for
//! a vector of pixels at a time.
//!
//! The range of a value, if none is given, reaches from the 1st to the 99th percentile of those in the picture, of 50,000
//! of them at most; on the device it is found before shading, so that no frame waits for the host. The legend is drawn by
//! the host in any case, into pictures in memory.

mod average;
mod classes;
mod color_map;
mod cpu;
mod depths;
mod edges;
pub(crate) mod gpu;
mod legend;
mod light;
mod occlusion;
pub(crate) mod over_time;
mod settings;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod truth;

pub(crate) use classes::class_colors;
pub(crate) use cpu::{Scene, shade};
pub use settings::{Background, Backs, ColorMap, ColorMode, Shading};

/// An image, rows from the top.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// sRGB and straight alpha, 8 bits a channel. At edges colours are mixed, and alpha is the part that is covered.
    pub pixels: Vec<[u8; 4]>,
    /// The same in linear light before any rounding, without legend and background and with nothing mixed at edges or with pictures
    /// before: zero where no surface is. Filled if all layers are asked for, otherwise empty.
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
