//! Shading on the CPU, row by row.

use std::ops::Range;

use autosplats_cloud::ValueOrigin;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::color_map::Scale;
use super::depths::{Depths, LANES};
use super::edges::{EDGE_SEARCH_PX, Edges, INNER_NORMAL_PX, MIN_TILT_LOSS};
use super::encode::{background, encode, encode_table};
use super::light::{CLAY, SCANNED_LIGHT, light, tone};
use super::occlusion::{DARKENING, PAIR_COUNT, Pair, light_left, pairs, reach};
use super::{ColorMode, Image, Shading, legend, linear, linear_steps};
use crate::camera::View;
use crate::cancel::Cancel;
use crate::room::fit;
use crate::splat::GBuffer;

/// Shares of light and of colour left on the backs of surfaces.
pub(super) const BACK_LIGHT: f32 = 0.5;
pub(super) const BACK_COLOR: f32 = 0.4;
/// Weights of red, green and blue in the brightness of a linear colour.
pub(super) const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);
/// Least rows that a thread shades at a time; occlusion that reaches further raises the number.
const BAND_ROWS: usize = 32;
/// Columns that a thread shades at a time: its buffers stay in its cache. With a pixel on either side they are whole
/// vectors.
const PIECE_COLUMNS: usize = 16 * LANES - 2;
/// Largest number of pixels sampled to find the usual range of values.
const RANGE_SAMPLES: usize = 50_000;
/// Steps of `f32` or of the field's type that rounding and averaging may be off by.
const NOISE_STEPS: f32 = 16.0;
/// Least width of a range of values that is found, as a share of the largest value.
pub(super) const RANGE_NOISE: f32 = NOISE_STEPS * f32::EPSILON;

/// Frame data that shading needs beside the layers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scene<'a> {
    /// View of the picture, without a margin.
    pub(crate) view: &'a View,
    /// Direction of rising height, world space.
    pub(crate) up: DVec3,
    /// The cloud's origin.
    pub(crate) origin: DVec3,
    /// World units per unit of the view, of which the layers are too.
    pub(crate) unit: f64,
    /// Factor on the brightness of the points' own colours.
    pub(crate) exposure: f32,
    /// What the values of the scalar field are relative to.
    pub(crate) values: ValueOrigin,
}

impl Scene<'_> {
    /// Offset from the values that shading computes with to those of the world. Heights are relative to the cloud's
    /// origin, because `f32` cannot resolve them in survey coordinates.
    pub(super) fn value_offset(&self, mode: &ColorMode) -> f64 {
        match mode {
            ColorMode::Height => self.origin.dot(self.up),
            ColorMode::Field(_) => self.values.origin,
            _ => 0.0,
        }
    }

    /// Least width of a range of values that is found, beside [`RANGE_NOISE`]: a few steps of the numbers from which
    /// the values are computed.
    pub(super) fn value_noise(&self, mode: &ColorMode) -> f32 {
        match mode {
            ColorMode::Height => RANGE_NOISE * self.view.eye_local.length(),
            ColorMode::Curvature => RANGE_NOISE,
            ColorMode::Field(_) => NOISE_STEPS * self.values.precision as f32,
            _ => 0.0,
        }
    }

    /// A range as found, or its middle twice if it is as narrow as noise: then all values are the same.
    pub(super) fn range_above_noise(&self, mode: &ColorMode, [low, high]: [f32; 2]) -> [f32; 2] {
        let noise = self.value_noise(mode).max(RANGE_NOISE * low.abs().max(high.abs()));
        if high - low > noise { [low, high] } else { [low + 0.5 * (high - low); 2] }
    }

    /// World units per unit of the values that shading computes with.
    pub(super) fn value_unit(&self, mode: &ColorMode) -> f64 {
        let is_length = matches!(mode, ColorMode::Height | ColorMode::Depth | ColorMode::Radius | ColorMode::KRadius);
        if is_length { self.unit } else { 1.0 }
    }

    /// The requested range, in values that shading computes with.
    pub(super) fn given_range(&self, shading: &Shading) -> Option<[f32; 2]> {
        let (offset, unit) = (self.value_offset(&shading.color), self.value_unit(&shading.color));
        shading.range.map(|range| range.map(|end| (end / unit - offset) as f32))
    }

    /// Converts a range of values that shading computes with to values of the world.
    pub(super) fn world_range(&self, mode: &ColorMode, range: [f32; 2]) -> [f64; 2] {
        range.map(|end| (f64::from(end) + self.value_offset(mode)) * self.value_unit(mode))
    }
}

/// Shades `layers` into `image`, also in linear light if `keep_linear`. `average` then mixes the last picture in,
/// before the legend is drawn. Returns the range of the colour map in world values, if the colour mode has one.
pub(crate) fn shade(
    layers: &GBuffer,
    scene: &Scene<'_>,
    shading: &Shading,
    keep_linear: bool,
    average: Option<&mut dyn FnMut(&mut Image)>,
    image: &mut Image,
    cancel: &Cancel<'_>,
) -> Option<[f64; 2]> {
    let [width, height] = [layers.width as usize, layers.height as usize];
    image.width = layers.width;
    image.height = layers.height;
    fit(&mut image.pixels, width * height);
    fit(&mut image.linear, if keep_linear { width * height } else { 0 });
    let shader = Shader::new(layers, scene, shading);
    let inks = &SrgbTables { table: encode_table(), linear: linear_steps() };
    let rows = BAND_ROWS.max(reach(&shader.pairs));
    let bands = image.pixels.par_chunks_mut(width * rows).enumerate();
    if keep_linear {
        bands.zip(image.linear.par_chunks_mut(width * rows)).for_each_init(
            Band::default,
            |band, ((i, pixels), linear)| {
                if !cancel.is_given_up() {
                    band.shade(&shader, inks, i * rows, pixels, linear);
                }
            },
        );
    } else {
        bands.for_each_init(Band::default, |band, (i, pixels)| {
            if !cancel.is_given_up() {
                band.shade(&shader, inks, i * rows, pixels, &mut []);
            }
        });
    }
    if let Some(average) = average {
        average(image);
    }
    if let (true, Some(scale)) = (shading.legend, &shader.scale) {
        let encode = |channel| encode(inks.table, channel);
        legend::draw(image, shading, scale, |range| scene.world_range(&shading.color, range), encode);
    }
    shader.scale.as_ref().map(|scale| scene.world_range(&shading.color, scale.range()))
}

/// Tables from linear light to 8-bit sRGB and back.
struct SrgbTables {
    table: &'static [u8],
    linear: [f32; 256],
}

impl SrgbTables {
    fn encode(&self, color: [f32; 3]) -> [u8; 4] {
        let [r, g, b] = color.map(|channel| encode(self.table, channel));
        [r, g, b, 255]
    }

    /// Colour of a pixel of which `part` is covered in one colour and the rest is background.
    fn over(&self, color: [f32; 3], part: f32, background: [u8; 4]) -> [u8; 4] {
        if background[3] == 0 {
            let [r, g, b, _] = self.encode(color);
            return [r, g, b, (part * 255.0 + 0.5) as u8];
        }
        let behind = [0, 1, 2].map(|i| self.linear[background[i] as usize]);
        self.encode(mix(behind, color, part))
    }
}

/// Linear interpolation from `a` to `b`.
fn mix(a: [f32; 3], b: [f32; 3], part: f32) -> [f32; 3] {
    std::array::from_fn(|i| a[i] + (b[i] - a[i]) * part)
}

/// Buffers to shade a band of rows piece by piece, kept from one band to the next.
#[derive(Default)]
struct Band {
    /// Depths of the piece and of a pixel on every side.
    depths: Depths,
    /// Light left by occlusion in the piece and a pixel on every side; 0 to 1.
    left: Vec<f32>,
    edges: Vec<bool>,
}

impl Band {
    /// Shades the band that begins at row `first`.
    fn shade(
        &mut self,
        shader: &Shader<'_>,
        inks: &SrgbTables,
        first: usize,
        pixels: &mut [[u8; 4]],
        linear: &mut [[f32; 3]],
    ) {
        let width = shader.layers.width as usize;
        for column in (0..width).step_by(PIECE_COLUMNS) {
            let columns = column..width.min(column + PIECE_COLUMNS);
            self.shade_piece(shader, inks, columns, first, pixels, linear);
        }
    }

    /// Shades these columns of the band.
    fn shade_piece(
        &mut self,
        shader: &Shader<'_>,
        inks: &SrgbTables,
        columns: Range<usize>,
        first: usize,
        pixels: &mut [[u8; 4]],
        linear: &mut [[f32; 3]],
    ) {
        let Self { depths, left, edges } = self;
        let layers = shader.layers;
        let [width, height] = [layers.width as usize, layers.height as usize];
        let rows = first..first + pixels.len() / width;
        let background = |y: usize| background(shader.shading.background, (y as f32 + 0.5) / height as f32);
        let out = rows.clone().zip(pixels.chunks_mut(width)).map(|(y, row)| (y, &mut row[columns.clone()]));
        let around = [&columns, &rows].map(|range| range.start as isize - 1..range.end as isize + 1);
        if !layers.is_drawn(around.clone()) {
            out.for_each(|(y, row)| row.fill(background(y)));
            linear.chunks_mut(width).for_each(|row| row[columns.clone()].fill([0.0; 3]));
            return;
        }
        depths.fill(layers, around.clone(), reach(&shader.pairs).max(EDGE_SEARCH_PX as usize) + 1);
        let stride = around[0].len().next_multiple_of(LANES);
        left.clear();
        left.resize(stride * around[1].len(), 1.0);
        let darkening = darkening(shader.shading, shader.colored);
        if darkening > 0.0 {
            for (y, left) in around[1].clone().zip(left.chunks_mut(stride)) {
                light_left(depths, y, &shader.pairs, shader.scene.view, darkening, left);
            }
        }
        let left = |x: usize, y: usize| left[(y + 1 - rows.start) * stride + x + 1 - columns.start];
        edges.resize(around[0].len(), false);
        for (y, out) in out {
            let background = background(y);
            shader.edges.mark(depths, y as isize, edges);
            for ((x, out), &edge) in columns.clone().zip(out).zip(&edges[1..]) {
                let color = shader.pixel(depths, x, y, left(x, y), edge);
                *out = color.map_or(background, |color| inks.encode(color));
                if let Some(linear) = linear.get_mut((y - rows.start) * width + x) {
                    *linear = color.unwrap_or_default();
                }
                if !edge {
                    continue;
                }
                let Some(blend) = shader.edges.blend(depths, [width, height], x, y) else { continue };
                let other = shader.pixel(depths, blend.x, blend.y, left(blend.x, blend.y), true);
                *out = match (color, other) {
                    (Some(color), Some(other)) => inks.encode(mix(color, other, blend.part)),
                    (Some(color), None) => inks.over(color, 1.0 - blend.part, background),
                    (None, Some(other)) => inks.over(other, blend.part, background),
                    (None, None) => background,
                };
            }
        }
    }
}

pub(super) struct Shader<'a> {
    layers: &'a GBuffer,
    scene: &'a Scene<'a>,
    shading: &'a Shading,
    /// Whether the layer of colours is shown; the layer may exist in other modes too.
    colored: bool,
    /// Constant light on every normal, and the factor on the lights.
    given_light: [f32; 2],
    pairs: [Pair; PAIR_COUNT],
    edges: Edges,
    /// Colour map and range, for colour modes that are a value.
    pub(super) scale: Option<Scale>,
}

impl<'a> Shader<'a> {
    pub(super) fn new(layers: &'a GBuffer, scene: &'a Scene<'a>, shading: &'a Shading) -> Self {
        let colored = shows_colors(&shading.color) && !layers.color.is_empty();
        let (pairs, edges) = (pairs(layers.height), Edges::new(scene.view));
        let given_light = given_light(scene, shading, colored);
        let mut shader = Self { layers, scene, shading, colored, given_light, pairs, edges, scale: None };
        if let Some(map) = shading.color.usual_map() {
            let found = || scene.range_above_noise(&shading.color, shader.usual_range());
            let range = scene.given_range(shading).unwrap_or_else(found);
            shader.scale = Some(Scale::new(shading.color_map.unwrap_or(map), range));
        }
        shader
    }

    /// The linear colour of a pixel, if a surface covers it. `left` is the light left by occlusion, `edge` whether the
    /// pixel is at an edge.
    fn pixel(&self, depths: &Depths, x: usize, y: usize, left: f32, edge: bool) -> Option<[f32; 3]> {
        let index = self.layers.index(x, y);
        if !(self.layers.weight[index] > 0.0) {
            return None;
        }
        let base = self.tone_back(self.base_color(x, y, index), index);
        if !self.shading.lighting {
            return Some(base.map(|channel| channel * left));
        }
        let normal = if edge { self.outward_normal(depths, x, y, index) } else { self.layers.normal[index].into() };
        let light = light(normal, self.given_light);
        Some(std::array::from_fn(|i| tone(base[i] * light[i] * left)))
    }

    /// The colour toned by the pixel's share of back.
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

    /// The normal that light falls on at an edge. Some points close to a silhouette are seen although their surface
    /// looks away. Their normals, turned to the eye, catch the light of the other side, and mixed with right ones
    /// belong to no surface. The normal further in is taken where the surface falls back towards its border, but its
    /// normal there is tilted clearly less.
    fn outward_normal(&self, depths: &Depths, x: usize, y: usize, index: usize) -> Vec3 {
        let normal = Vec3::from(self.layers.normal[index]);
        let size = [self.layers.width as usize, self.layers.height as usize];
        let [out_x, out_y] = self.edges.outward(depths, size, x, y);
        let [inner_x, inner_y] = [x as isize - INNER_NORMAL_PX * out_x, y as isize - INNER_NORMAL_PX * out_y];
        if !(depths.at(inner_x, inner_y) < self.layers.depth[index]) {
            return normal;
        }
        let inner = Vec3::from(self.layers.normal[self.layers.index(inner_x as usize, inner_y as usize)]);
        let tilt = |normal: Vec3| normal.x * out_x as f32 + normal.y * out_y as f32;
        if tilt(normal) < tilt(inner) - MIN_TILT_LOSS { inner } else { normal }
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

    /// The value that the colour mode shows at a pixel, relative to [`Scene::value_offset`].
    fn value(&self, x: usize, y: usize, index: usize) -> f32 {
        let layers = self.layers;
        match self.shading.color {
            ColorMode::Height => {
                let view = self.scene.view;
                let position = view.unproject([x as f32 + 0.5, y as f32 + 0.5], layers.depth[index]);
                let local = view.to_world(position) + view.eye_local;
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
    pub(super) fn usual_range(&self) -> [f32; 2] {
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
}

/// Constant light on every normal, and the factor on the lights, for the points' own colours or for other ones.
pub(super) fn given_light(scene: &Scene<'_>, shading: &Shading, colored: bool) -> [f32; 2] {
    // Class colours carry meaning, so exposure does not change them.
    let exposure = if shading.color == ColorMode::Classification { 1.0 } else { scene.exposure };
    if colored { SCANNED_LIGHT.map(|part| part * exposure) } else { [0.0, 1.0] }
}

/// Strength of occlusion's darkening, for the points' own colours or for other ones.
pub(super) fn darkening(shading: &Shading, colored: bool) -> f32 {
    shading.occlusion * DARKENING[usize::from(colored)]
}

/// Step between the pixels that are sampled to find the usual range.
pub(super) fn sample_step(pixels: usize) -> usize {
    pixels.div_ceil(RANGE_SAMPLES).max(1)
}

/// Whether a colour mode shows the points' colours where there are any.
pub(super) fn shows_colors(mode: &ColorMode) -> bool {
    matches!(mode, ColorMode::Auto | ColorMode::Rgb | ColorMode::Classification)
}
