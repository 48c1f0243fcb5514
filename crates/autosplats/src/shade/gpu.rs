//! Shading on the GPU: one pass, and two before it that find a range which is not given.

mod finish;
mod texture;
mod uniform;

pub(crate) use finish::{ReadPicture, finish};
pub(crate) use texture::check_texture;
#[cfg(test)]
pub(crate) use uniform::ShadePair;
pub(crate) use uniform::{ShadeUniform, ShownQuantity, finds_range};

use super::color_map::{self, table};
use super::cpu::{self, LUMINANCE, sample_step};
use super::encode::{ENCODE_STEPS, background, encode_table};
use super::light::{FILL, KEY};
use super::{Background, ColorMap, Shading, edges, light, occlusion};
use crate::Error;
use crate::gpu::{Gpu, LARGE_GROUP, Library, Pass, Step, constants, files, passes};
use crate::project::gpu::Counter;
use crate::splat::LayerBuffers;

/// Imports and constants of the passes.
pub(super) const LIBRARY: Library = Library {
    files: &[files!["shading", "srgb"]],
    constants: &[
        Counter::CONSTANTS,
        ShownQuantity::CONSTANTS,
        constants!(in cpu: BACK_COLOR, BACK_LIGHT, RANGE_NOISE),
        constants!(in edges: EDGE_SEARCH_PX, INNER_NORMAL_PX, MIN_TILT_LOSS),
        constants!(in light: CLAY, FILL_LIGHT, GROUND, KEY_LIGHT, KEY_WRAP, SHOULDER, SKY),
        constants!(in occlusion: FARTHEST_RISE, MAX_FULL_RISE, MIN_RISE, PAIR_COUNT),
        constants![
            ENCODE_STEPS,
            FILL = FILL.to_array(),
            KEY = KEY.to_array(),
            LUMINANCE = LUMINANCE.to_array(),
            SHADE_GROUP,
            STRIDE_KEYS
        ],
    ],
};

passes! {
    "shade", LIBRARY;
    RANGE_VALUES = "range_values",
    RANGE = "range",
    SHADE = "shade",
}

/// Pixels that a workgroup of `shade` colours.
const SHADE_GROUP: [u32; 2] = [32, 8];
/// Keys that `range` reads at a time.
const STRIDE_KEYS: usize = 4096;
/// Alignment of the image's rows in pixels: textures are copied in rows of multiples of 256 bytes.
pub(super) const ROW_PIXELS: u32 = 64;

/// Pixels from one row of the image to the next.
pub(crate) const fn pitch(width: u32) -> u32 {
    width.next_multiple_of(ROW_PIXELS)
}

/// Words of the table from linear to sRGB.
const fn encode_words() -> usize {
    (ENCODE_STEPS + 1).div_ceil(4)
}

/// A picture on the device, and the buffers to shade it.
#[derive(Debug)]
pub(crate) struct ShadeBuffers {
    pub(crate) size: [u32; 2],
    uniform: wgpu::Buffer,
    /// Keys of the values whose range is sought.
    keys: wgpu::Buffer,
    /// Linear colours of the map, a `vec4f` per step.
    color_map: wgpu::Buffer,
    /// The table from linear to sRGB, then the background of each row.
    pub(super) tables: wgpu::Buffer,
    /// RGBA per pixel, 8 bits a channel, rows [`pitch`] apart.
    pub(crate) image: wgpu::Buffer,
    /// Linear light before any rounding, a `vec4f` per pixel, rows from the top without gaps. One element if not
    /// requested.
    pub(crate) linear: wgpu::Buffer,
    /// Contents of [`color_map`](Self::color_map) and [`tables`](Self::tables).
    map_held: Option<ColorMap>,
    background_held: Option<Background>,
}

impl ShadeBuffers {
    /// Buffers for a picture of `size`, also in linear light if `keep_linear`.
    ///
    /// # Errors
    /// [`Error::DeviceLimit`], [`Error::DeviceMemory`] if the device has too little.
    pub(crate) fn new(gpu: &Gpu, size: [u32; 2], keep_linear: bool) -> Result<Self, Error> {
        let [width, height] = size.map(|side| side as usize);
        let pixels = width * height;
        let samples = pixels.div_ceil(sample_step(pixels));
        let tables = gpu.storage::<u32>("tables of shading", encode_words() + height)?;
        let mut encode = encode_table().to_vec();
        encode.resize(4 * encode_words(), 0);
        gpu.queue.write_buffer(&tables, 0, &encode);
        Ok(Self {
            size,
            uniform: gpu.uniform::<ShadeUniform>("shading")?,
            keys: gpu.storage::<u32>("keys of values", samples.next_multiple_of(STRIDE_KEYS))?,
            color_map: gpu.storage::<[f32; 4]>("colour map", color_map::STEPS)?,
            tables,
            image: gpu.storage::<u32>("image", pitch(size[0]) as usize * height)?,
            linear: gpu.storage::<[f32; 4]>("image in linear light", if keep_linear { pixels } else { 1 })?,
            map_held: None,
            background_held: None,
        })
    }

    /// Uploads the settings of the next frame.
    pub(crate) fn write(&mut self, gpu: &Gpu, uniform: &ShadeUniform, shading: &Shading) {
        gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(uniform));
        let map = shading.color.usual_map().map(|usual| shading.color_map.unwrap_or(usual));
        if let Some(map) = map.filter(|map| self.map_held.replace(*map) != Some(*map)) {
            let colors: Vec<_> = table(map).iter().map(|&[r, g, b]| [r, g, b, 0.0]).collect();
            gpu.queue.write_buffer(&self.color_map, 0, bytemuck::cast_slice(&colors));
        }
        if self.background_held.replace(shading.background) != Some(shading.background) {
            let height = self.size[1];
            let row = |y| background(shading.background, (y as f32 + 0.5) / height as f32);
            let rows: Vec<[u8; 4]> = (0..height).map(row).collect();
            gpu.queue.write_buffer(&self.tables, 4 * encode_words() as u64, bytemuck::cast_slice(&rows));
        }
    }
}

/// The passes of shading.
#[derive(Debug)]
pub(crate) struct ShadePasses {
    range: Pass,
    /// By [`ShownQuantity`], each without and with toned backs.
    coloring: Vec<Option<ColoringPasses>>,
}

/// The passes that depend on what colours a surface.
#[derive(Debug)]
struct ColoringPasses {
    range_values: Pass,
    shade: Pass,
}

impl ColoringPasses {
    fn new(gpu: &Gpu, shown: ShownQuantity, backs: bool) -> Result<Self, Error> {
        let shown = ("SHOWN", f64::from(shown as u32));
        let shade = [shown, ("BACKS", backs.into())];
        Ok(Self { range_values: Pass::new(gpu, &RANGE_VALUES, &[shown])?, shade: Pass::new(gpu, &SHADE, &shade)? })
    }
}

impl ShadePasses {
    /// Compiles the pass common to all colour modes.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Error> {
        Ok(Self { range: Pass::new(gpu, &RANGE, &[])?, coloring: Vec::new() })
    }

    /// Steps that shade `layers` into `buffers` with the settings of [`ShadeBuffers::write`]. Another colour mode, or
    /// giving a range or not, needs other steps. A range that is found goes into `counters`. Passes of a colour mode
    /// are compiled at its first use.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(crate) fn steps(
        &mut self,
        gpu: &Gpu,
        frame: &wgpu::Buffer,
        layers: &LayerBuffers,
        counters: &wgpu::Buffer,
        buffers: &ShadeBuffers,
        shading: &Shading,
    ) -> Result<Vec<Step>, Error> {
        let LayerBuffers { surface, cover, extras, .. } = layers;
        let ShadeBuffers { uniform, keys, color_map, tables, image, linear, .. } = buffers;
        let shown = ShownQuantity::new(&shading.color, layers.channels);
        let backs = layers.channels.backs && shading.tones_backs();
        let at = 2 * shown as usize + usize::from(backs);
        if self.coloring.len() <= at {
            self.coloring.resize_with(at + 1, || None);
        }
        let passes = match &mut self.coloring[at] {
            Some(passes) => passes,
            none => none.insert(ColoringPasses::new(gpu, shown, backs)?),
        };
        let mut steps = Vec::new();
        if finds_range(shading) {
            let groups = (keys.size() / 4) as u32 / LARGE_GROUP;
            steps.push(passes.range_values.step(gpu, &[frame, uniform, surface, cover, extras, keys], groups));
            steps.push(self.range.step(gpu, &[frame, keys, counters], 1));
        }
        let shade = [frame, uniform, surface, cover, extras, counters, color_map, tables, image, linear];
        let [columns, rows] = [0, 1].map(|axis| buffers.size[axis].div_ceil(SHADE_GROUP[axis]));
        steps.push(passes.shade.step(gpu, &shade, columns * rows));
        Ok(steps)
    }
}

#[cfg(test)]
pub(crate) mod tests;
