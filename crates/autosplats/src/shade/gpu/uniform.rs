//! Uniform of the shading passes.

use bytemuck::{Pod, Zeroable};

use super::super::cpu::{Scene, darkening, given_light, sample_step, shows_colors};
use super::super::edges::Edges;
use super::super::occlusion::{PAIR_COUNT, Pair, pairs};
use super::super::{ColorMode, Shading};
use super::{encode_words, pitch};
use crate::gpu::indices;
use crate::splat::{Channels, LayerBuffers};

indices! {
    /// What colours a surface; from [`Height`](Self::Height) on these are values.
    #[allow(missing_docs, reason = "the colour modes, resolved")]
    pub(crate) enum ShownQuantity in "Show" {
        Clay,
        Color,
        Normal,
        Height,
        Depth,
        Radius,
        KRadius,
        Curvature,
        Scalar,
    }
}

impl ShownQuantity {
    pub(super) fn new(mode: &ColorMode, layers: Channels) -> Self {
        match mode {
            ColorMode::Height => Self::Height,
            ColorMode::Depth => Self::Depth,
            ColorMode::Radius => Self::Radius,
            ColorMode::KRadius => Self::KRadius,
            ColorMode::Curvature => Self::Curvature,
            ColorMode::Field(_) => Self::Scalar,
            ColorMode::Normal => Self::Normal,
            mode if shows_colors(mode) && layers.color => Self::Color,
            ColorMode::Plain | ColorMode::Auto | ColorMode::Rgb | ColorMode::Classification => Self::Clay,
        }
    }
}

/// Settings of shading, in the layout of `imports/shading.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct ShadeUniform {
    pub(crate) up: [f32; 3],
    pub(crate) darkening: f32,
    pub(crate) given_light: [f32; 2],
    pub(crate) range: [f32; 2],
    pub(crate) edge_factor: f32,
    pub(crate) edge_offset: f32,
    pub(crate) find_range: u32,
    pub(crate) lighting: u32,
    pub(crate) keep_linear: u32,
    pub(crate) swap_red_blue: u32,
    pub(crate) pitch: u32,
    pub(crate) sample_step: u32,
    pub(crate) samples: u32,
    pub(crate) backgrounds: u32,
    pub(crate) measures: u32,
    pub(crate) value_noise: f32,
    pub(crate) pairs: [ShadePair; PAIR_COUNT],
}

/// A [`Pair`] of pixels, laid out as in `imports/shading.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct ShadePair {
    pub(crate) step: [f32; 2],
    pub(crate) inverse_px: f32,
    pub(crate) part: f32,
}

/// Whether the range has to be found from the values.
pub(crate) fn finds_range(shading: &Shading) -> bool {
    shading.color.usual_map().is_some() && shading.range.is_none()
}

impl ShadeUniform {
    /// The uniform for a picture from `layers`, also in linear light if `keep_linear`.
    pub(crate) fn new(scene: &Scene<'_>, shading: &Shading, layers: &LayerBuffers, keep_linear: bool) -> Self {
        let [width, height] = [scene.view.width, scene.view.height];
        let pixels = width as usize * height as usize;
        let step = sample_step(pixels);
        let colored = ShownQuantity::new(&shading.color, layers.channels) == ShownQuantity::Color;
        let edges = Edges::new(scene.view);
        Self {
            up: scene.up.as_vec3().to_array(),
            darkening: darkening(shading, colored),
            given_light: given_light(scene, shading, colored),
            range: scene.given_range(shading).unwrap_or_default(),
            edge_factor: edges.factor,
            edge_offset: edges.offset,
            find_range: finds_range(shading).into(),
            lighting: shading.lighting.into(),
            keep_linear: keep_linear.into(),
            swap_red_blue: 0,
            pitch: pitch(width),
            sample_step: step as u32,
            samples: pixels.div_ceil(step) as u32,
            backgrounds: encode_words() as u32,
            measures: if layers.channels.color { layers.size.iter().product() } else { 0 },
            value_noise: scene.value_noise(&shading.color),
            pairs: pairs(height).map(|Pair { step, inverse_px, part }| {
                let step = step.map(|side| side as f32);
                ShadePair { step, inverse_px, part }
            }),
        }
    }

    /// The uniform for a texture of this format.
    #[must_use]
    pub(crate) fn into_format(self, format: wgpu::TextureFormat) -> Self {
        let swap_red_blue = super::texture::swaps_red_blue(format).into();
        Self { swap_red_blue, ..self }
    }
}
