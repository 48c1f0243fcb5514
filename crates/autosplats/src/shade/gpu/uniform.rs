//! What the passes of shading are told.

use bytemuck::{Pod, Zeroable};

use super::super::cpu::{
    CLAY, ENCODE_STEPS, EYE_DOME, FILL, FILL_LIGHT, KEY, KEY_LIGHT, KEY_WRAP, SCANNED_LIGHT, SKY, Scene, sample_step,
    shows_colors, usual_map,
};
use super::super::{ColorMode, Shading};
use super::{encode_words, pitch};
use crate::splat::{Channels, LayerBuffers};

/// What a surface is coloured by, as `shared/shading.wgsl` has it; from [`Height`](Self::Height) on these are values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the colour modes, resolved")]
pub(crate) enum Shown {
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

impl Shown {
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

/// The settings and constants of shading, as `shared/shading.wgsl` has them.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct ShadeUniform {
    pub(crate) key: [f32; 3],
    pub(crate) key_light: f32,
    pub(crate) fill: [f32; 3],
    pub(crate) fill_light: f32,
    pub(crate) clay: [f32; 3],
    pub(crate) key_wrap: f32,
    pub(crate) up: [f32; 3],
    pub(crate) eye_dome: f32,
    pub(crate) sky: [f32; 2],
    pub(crate) scanned_light: [f32; 2],
    pub(crate) range: [f32; 2],
    pub(crate) find_range: u32,
    pub(crate) lighting: u32,
    pub(crate) keep_linear: u32,
    pub(crate) swap_red_blue: u32,
    pub(crate) pitch: u32,
    pub(crate) sample_step: u32,
    pub(crate) samples: u32,
    pub(crate) encode_steps: u32,
    pub(crate) backgrounds: u32,
    pub(crate) measures: u32,
    pub(crate) neighbors: [[i32; 4]; 8],
}

/// Whether the range of values is to be found among them.
pub(crate) fn finds_range(shading: &Shading) -> bool {
    usual_map(&shading.color).is_some() && shading.range.is_none()
}

impl ShadeUniform {
    /// For a picture from `layers`; also in linear light if `keep_linear`.
    pub(crate) fn new(scene: &Scene<'_>, shading: &Shading, layers: &LayerBuffers, keep_linear: bool) -> Self {
        let [width, height] = layers.size;
        let pixels = width as usize * height as usize;
        let step = sample_step(pixels);
        let colored = Shown::new(&shading.color, layers.channels) == Shown::Color;
        Self {
            key: KEY.to_array(),
            key_light: KEY_LIGHT,
            fill: FILL.to_array(),
            fill_light: FILL_LIGHT,
            clay: CLAY,
            key_wrap: KEY_WRAP,
            up: scene.up.as_vec3().to_array(),
            eye_dome: shading.eye_dome,
            sky: SKY,
            scanned_light: if colored { SCANNED_LIGHT } else { [0.0, 1.0] },
            range: scene.given_range(shading).unwrap_or_default(),
            find_range: finds_range(shading).into(),
            lighting: shading.lighting.into(),
            keep_linear: keep_linear.into(),
            swap_red_blue: 0,
            pitch: pitch(width),
            sample_step: step as u32,
            samples: pixels.div_ceil(step) as u32,
            encode_steps: ENCODE_STEPS as u32,
            backgrounds: encode_words() as u32,
            measures: if layers.channels.color { pixels as u32 } else { 0 },
            neighbors: EYE_DOME.map(|[dx, dy]| {
                let distance_px = ((dx * dx + dy * dy) as f32).sqrt();
                [dx as i32, dy as i32, distance_px.to_bits() as i32, 0]
            }),
        }
    }

    /// The same for a texture of this format.
    #[must_use]
    pub(crate) fn into_format(self, format: wgpu::TextureFormat) -> Self {
        let swap_red_blue = super::texture::swaps_red_blue(format).into();
        Self { swap_red_blue, ..self }
    }
}
