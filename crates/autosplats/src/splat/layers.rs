//! The visible surface on the device.

use crate::Error;
use crate::gpu::Gpu;

/// Which layers there are beside depth and normal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct LayerSet {
    pub(crate) colors: bool,
    pub(crate) scalar: bool,
    /// Splat radius, k-radius and curvature.
    pub(crate) measures: bool,
}

/// [`GBuffer`](super::GBuffer) on the device, rows from the top; layers that are not wanted have one element.
#[derive(Debug)]
pub(crate) struct LayerBuffers {
    pub(crate) size: [u32; 2],
    pub(crate) set: LayerSet,
    /// `vec4f` per pixel: normal in view space, and depth, which is infinite where no surface is and nowhere else.
    pub(crate) surface: wgpu::Buffer,
    /// `vec2u` per pixel: bits of the sum of weights, an `f32`, 0 where no surface is; index of the source point of the
    /// heaviest splat.
    pub(crate) weights: wgpu::Buffer,
    /// `vec4f` per pixel: linear colour, and the scalar, NaN where it is unknown.
    pub(crate) colors: wgpu::Buffer,
    /// `vec4f` per pixel: splat radius, k-radius, curvature, 0.
    pub(crate) measures: wgpu::Buffer,
}

impl LayerBuffers {
    /// Room for a picture of `size` with these layers.
    ///
    /// # Errors
    /// [`Error::DeviceLimit`], [`Error::DeviceMemory`] if the device has too little.
    pub(crate) fn new(gpu: &Gpu, size: [u32; 2], set: LayerSet) -> Result<Self, Error> {
        let pixels = size[0] as usize * size[1] as usize;
        let wanted = |wanted: bool| if wanted { pixels } else { 1 };
        Ok(Self {
            size,
            set,
            surface: gpu.storage::<[f32; 4]>("normals and depths", pixels)?,
            weights: gpu.storage::<[u32; 2]>("weights", pixels)?,
            colors: gpu.storage::<[f32; 4]>("colours of pixels", wanted(set.colors || set.scalar))?,
            measures: gpu.storage::<[f32; 4]>("measures", wanted(set.measures))?,
        })
    }
}

/// The host's layers on the device.
#[cfg(test)]
pub(crate) fn upload_layers(gpu: &Gpu, layers: &super::GBuffer) -> LayerBuffers {
    let set = LayerSet {
        colors: !layers.color.is_empty(),
        scalar: !layers.scalar.is_empty(),
        measures: !layers.radius.is_empty(),
    };
    let size = [layers.width, layers.height];
    let buffers = LayerBuffers::new(gpu, size, set).expect("room");
    let [width, height] = size.map(|side| side as usize);
    let pixels = || (0..width * height).map(|pixel| layers.index(pixel % width, pixel / width));
    let vectors = |buffer: &wgpu::Buffer, vector: &dyn Fn(usize) -> [f32; 4]| {
        let vectors: Vec<_> = pixels().map(vector).collect();
        gpu.queue.write_buffer(buffer, 0, bytemuck::cast_slice(&vectors));
    };
    vectors(&buffers.surface, &|at| {
        let [x, y, z] = layers.normal[at];
        [x, y, z, layers.depth[at]]
    });
    if set.colors || set.scalar {
        vectors(&buffers.colors, &|at| {
            let [r, g, b] = layers.color.get(at).copied().unwrap_or_default();
            [r, g, b, layers.scalar.get(at).copied().unwrap_or(f32::NAN)]
        });
    }
    if set.measures {
        vectors(&buffers.measures, &|at| [layers.radius[at], layers.k_radius[at], layers.curvature[at], 0.0]);
    }
    let weights: Vec<_> = pixels().map(|at| [layers.weight[at].to_bits(), layers.point[at]]).collect();
    gpu.queue.write_buffer(&buffers.weights, 0, bytemuck::cast_slice(&weights));
    buffers
}
