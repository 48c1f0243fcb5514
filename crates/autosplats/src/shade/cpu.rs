//! Shading on the CPU, row by row.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::color_map::Scale;
use super::{Background, ColorMap, ColorMode, Image, Shading, legend, linear, srgb};
use crate::camera::View;
use crate::splat::GBuffer;

/// One clay tone, linear.
pub(super) const CLAY: [f32; 3] = [0.53, 0.50, 0.46];
/// Direction to the key light in view space (x right, y down, z forward): over the left shoulder.
pub(super) const KEY: Vec3 = Vec3::new(-0.47, -0.62, -0.63);
pub(super) const KEY_LIGHT: f32 = 0.74;
/// How far the key light reaches around to surfaces turned away from it.
pub(super) const KEY_WRAP: f32 = 0.15;
/// Direction to the fill light.
pub(super) const FILL: Vec3 = Vec3::new(0.80, 0.05, -0.60);
pub(super) const FILL_LIGHT: f32 = 0.13;
/// Light of the sky on surfaces that face down and up.
pub(super) const SKY: [f32; 2] = [0.05, 0.18];
/// Light on points with colours, which were lit once when they were scanned: a part whatever the normal, and a share of
/// the lights above, so that a surface seen straight on keeps its colour.
pub(super) const SCANNED_LIGHT: [f32; 2] = [0.45, 0.75];
/// Light and colour left on the backs of surfaces.
pub(super) const BACK_LIGHT: f32 = 0.5;
pub(super) const BACK_COLOR: f32 = 0.4;
/// Weights of red, green and blue in how bright a linear colour is.
pub(super) const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);
/// Neighbours looked at by eye-dome lighting, in pixels.
pub(super) const EYE_DOME: [[isize; 2]; 8] = [[-2, 0], [2, 0], [0, -2], [0, 2], [-1, -1], [1, -1], [-1, 1], [1, 1]];
/// Steps of the table from linear to 8-bit sRGB: at the dark end, where sRGB is steepest, a step of it is less than one of
/// the 255.
pub(super) const ENCODE_STEPS: usize = 1 << 13;
/// Pixels looked at to find the usual range of values.
const RANGE_SAMPLES: usize = 50_000;

/// What shading knows about a frame beside its layers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scene<'a> {
    pub(crate) view: &'a View,
    /// Direction of rising height, world space.
    pub(crate) up: DVec3,
    /// The cloud's origin.
    pub(crate) origin: DVec3,
}

impl Scene<'_> {
    /// What is missing from the values that shading computes with: heights are told from the cloud's origin, because `f32`
    /// would not tell near ones apart in survey coordinates.
    pub(super) fn value_offset(&self, mode: &ColorMode) -> f64 {
        if *mode == ColorMode::Height { self.origin.dot(self.up) } else { 0.0 }
    }

    /// The range that was asked for, in values that shading computes with.
    pub(super) fn given_range(&self, shading: &Shading) -> Option<[f32; 2]> {
        let offset = self.value_offset(&shading.color);
        shading.range.map(|range| range.map(|end| (f64::from(end) - offset) as f32))
    }
}

/// Shades `layers` into `image`; also in linear light if `keep_linear`.
pub(crate) fn shade(layers: &GBuffer, scene: &Scene<'_>, shading: &Shading, keep_linear: bool, image: &mut Image) {
    let [width, height] = [layers.width as usize, layers.height as usize];
    image.width = layers.width;
    image.height = layers.height;
    image.pixels.resize(width * height, [0; 4]);
    let shader = Shader::new(layers, scene, shading);
    let table = encode_table();
    let encode = |channel| encode(&table, channel);
    image.pixels.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        let background = background(shading.background, (y as f32 + 0.5) / height as f32);
        for (x, out) in row.iter_mut().enumerate() {
            *out = match shader.pixel(x, y) {
                Some(color) => {
                    let [r, g, b] = color.map(encode);
                    [r, g, b, 255]
                }
                None => background,
            };
        }
    });
    image.linear.clear();
    if keep_linear {
        let pixels = (0..width * height).into_par_iter();
        pixels.map(|at| shader.pixel(at % width, at / width).unwrap_or_default()).collect_into_vec(&mut image.linear);
    }
    if let (true, Some(scale)) = (shading.legend, &shader.scale) {
        legend::draw(image, &title(&shading.color), scale, scene.value_offset(&shading.color), encode);
    }
}

pub(super) struct Shader<'a> {
    layers: &'a GBuffer,
    scene: &'a Scene<'a>,
    shading: &'a Shading,
    /// Whether the layer of colours is shown, which may be there though something else is.
    colored: bool,
    /// For colour modes that are a value.
    pub(super) scale: Option<Scale>,
}

impl<'a> Shader<'a> {
    pub(super) fn new(layers: &'a GBuffer, scene: &'a Scene<'a>, shading: &'a Shading) -> Self {
        let colored = shows_colors(&shading.color) && !layers.color.is_empty();
        let mut shader = Self { layers, scene, shading, colored, scale: None };
        if let Some(map) = usual_map(&shading.color) {
            let range = scene.given_range(shading).unwrap_or_else(|| shader.usual_range());
            shader.scale = Some(Scale::new(shading.color_map.unwrap_or(map), range));
        }
        shader
    }

    /// The linear colour of a pixel, if a surface covers it.
    fn pixel(&self, x: usize, y: usize) -> Option<[f32; 3]> {
        let index = self.layers.index(x, y);
        if !(self.layers.weight[index] > 0.0) {
            return None;
        }
        let light = if self.shading.lighting { self.light(index) } else { 1.0 };
        let light = light * self.eye_dome(x, y, index);
        Some(self.tone_back(self.base_color(x, y, index), index).map(|channel| channel * light))
    }

    /// The colour of a surface that shows its back as far as the pixel says.
    fn tone_back(&self, color: [f32; 3], index: usize) -> [f32; 3] {
        match self.layers.back.get(index) {
            Some(&share) if self.shading.tones_backs() => {
                let color = Vec3::from(color);
                let back = BACK_LIGHT * Vec3::splat(color.dot(LUMINANCE)).lerp(color, BACK_COLOR);
                color.lerp(back, share).to_array()
            }
            _ => color,
        }
    }

    fn base_color(&self, x: usize, y: usize, index: usize) -> [f32; 3] {
        match &self.scale {
            Some(scale) => scale.color(self.value(x, y, index)),
            None if self.shading.color == ColorMode::Normal => {
                self.world_normal(index).to_array().map(|component| linear(0.5 + 0.5 * component))
            }
            None if self.colored => self.layers.color[index],
            None => CLAY,
        }
    }

    /// The value that a colour mode shows at a pixel, but for [`Scene::value_offset`].
    fn value(&self, x: usize, y: usize, index: usize) -> f32 {
        let layers = self.layers;
        match self.shading.color {
            ColorMode::Height => {
                let view = self.scene.view;
                let position = view.unproject([x as f32 + 0.5, y as f32 + 0.5], layers.depth[index]);
                let local = view.view_from_world.transpose() * position + view.eye_local;
                local.as_dvec3().dot(self.scene.up) as f32
            }
            ColorMode::Curvature => layers.curvature[index],
            ColorMode::Radius => layers.radius[index],
            ColorMode::KRadius => layers.k_radius[index],
            ColorMode::Depth => layers.depth[index],
            _ => layers.scalar[index],
        }
    }

    /// The 1st and 99th percentile of the values in the picture.
    fn usual_range(&self) -> [f32; 2] {
        let [width, height] = [self.layers.width as usize, self.layers.height as usize];
        let step = sample_step(width * height);
        let samples = (0..width * height).step_by(step).map(|pixel| (pixel % width, pixel / width));
        let covered =
            samples.map(|(x, y)| (x, y, self.layers.index(x, y))).filter(|&(.., i)| self.layers.weight[i] > 0.0);
        let mut values: Vec<f32> =
            covered.map(|(x, y, i)| self.value(x, y, i)).filter(|value| value.is_finite()).collect();
        values.sort_unstable_by(f32::total_cmp);
        let trim = values.len() / 100;
        match values.as_slice() {
            [] => [0.0, 1.0],
            values => [values[trim], values[values.len() - 1 - trim]],
        }
    }

    fn world_normal(&self, index: usize) -> Vec3 {
        self.scene.view.view_from_world.transpose() * Vec3::from(self.layers.normal[index])
    }

    fn light(&self, index: usize) -> f32 {
        let normal = Vec3::from(self.layers.normal[index]);
        let key = ((normal.dot(KEY) + KEY_WRAP) / (1.0 + KEY_WRAP)).max(0.0);
        let fill = normal.dot(FILL).max(0.0);
        let sky = SKY[0] + (SKY[1] - SKY[0]) * (0.5 - 0.5 * normal.y);
        let light = KEY_LIGHT * key + FILL_LIGHT * fill + sky;
        let [base, share] = if self.colored { SCANNED_LIGHT } else { [0.0, 1.0] };
        base + share * light
    }

    /// How much light is left beside nearer surfaces.
    fn eye_dome(&self, x: usize, y: usize, index: usize) -> f32 {
        if !(self.shading.eye_dome > 0.0) {
            return 1.0;
        }
        let layers = self.layers;
        let depth = layers.depth[index];
        let unit = self.scene.view.pixel_size(depth);
        let mut shadow = 0.0;
        for [dx, dy] in EYE_DOME {
            let (Some(nx), Some(ny)) = (x.checked_add_signed(dx), y.checked_add_signed(dy)) else { continue };
            if nx < layers.width as usize && ny < layers.height as usize {
                let distance_px = ((dx * dx + dy * dy) as f32).sqrt();
                // How steeply the nearer neighbour rises towards the eye; slopes up to 45° are surface, not a step.
                let slope = (depth - layers.depth[layers.index(nx, ny)]) / (unit * distance_px);
                shadow += if slope > 1.0 { (slope - 1.0) / (slope + 3.0) } else { 0.0 };
            }
        }
        // Falls like the exponential at first, costs a division, and is the same on every processor.
        let shadow = self.shading.eye_dome * shadow / EYE_DOME.len() as f32;
        1.0 / (1.0 + shadow + 0.5 * shadow * shadow)
    }
}

/// Every how many of a picture's pixels is looked at to find the usual range.
pub(super) fn sample_step(pixels: usize) -> usize {
    pixels.div_ceil(RANGE_SAMPLES).max(1)
}

/// Whether a colour mode shows the colours of points, where they have any.
pub(super) fn shows_colors(mode: &ColorMode) -> bool {
    matches!(mode, ColorMode::Auto | ColorMode::Rgb | ColorMode::Classification)
}

/// The colour map that suits a colour mode, if the mode is a value.
pub(super) fn usual_map(mode: &ColorMode) -> Option<ColorMap> {
    match mode {
        ColorMode::Height | ColorMode::Depth => Some(ColorMap::Viridis),
        ColorMode::Field(name) if name.eq_ignore_ascii_case("intensity") => Some(ColorMap::Gray),
        ColorMode::Field(_) | ColorMode::Curvature => Some(ColorMap::Viridis),
        ColorMode::Radius | ColorMode::KRadius => Some(ColorMap::Reds),
        ColorMode::Auto | ColorMode::Rgb | ColorMode::Plain | ColorMode::Classification | ColorMode::Normal => None,
    }
}

/// What a legend calls a colour mode.
pub(super) fn title(mode: &ColorMode) -> String {
    match mode {
        ColorMode::Field(name) => name.clone(),
        ColorMode::KRadius => "k-radius".into(),
        other => format!("{other:?}").to_lowercase(),
    }
}

/// The background at height `t` of the picture, 0 at the top to 1 at the bottom.
pub(super) fn background(background: Background, t: f32) -> [u8; 4] {
    match background {
        Background::Transparent => [0; 4],
        Background::Color([r, g, b]) => [r, g, b, 255],
        Background::Gradient(top, bottom) => {
            let [r, g, b] = [0, 1, 2].map(|i| {
                let [top, bottom] = [f32::from(top[i]), f32::from(bottom[i])];
                (top + (bottom - top) * t).round() as u8
            });
            [r, g, b, 255]
        }
    }
}

/// The sRGB channel of a linear one.
pub(super) fn encode(table: &[u8], channel: f32) -> u8 {
    table[(channel.clamp(0.0, 1.0) * ENCODE_STEPS as f32 + 0.5) as usize]
}

/// 8-bit sRGB channels of linear ones from 0 to 1.
pub(super) fn encode_table() -> Vec<u8> {
    (0..=ENCODE_STEPS).map(|step| (srgb(step as f32 / ENCODE_STEPS as f32) * 255.0).round() as u8).collect()
}
