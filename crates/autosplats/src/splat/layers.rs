//! Layers on the host, tile by tile; layers on the device; and the conversion of these to the host's form.

use autosplats_cloud::ValueOrigin;

use super::{GBuffer, TILE_AREA, Tiles};
use crate::Error;
use crate::camera::View;
use crate::gpu::Gpu;
use crate::project::COUNTED_BLOCK_PX;
use crate::room::fit;

/// Optional attributes that splats carry beside depth and normal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Channels {
    pub(crate) color: bool,
    pub(crate) scalar: bool,
    /// Splat radius, k-radius and curvature.
    pub(crate) measures: bool,
    /// Share of the surface's back.
    pub(crate) backs: bool,
}

impl Channels {
    /// Number of planes of [`LayerBuffers::extras`].
    fn planes(self) -> usize {
        (usize::from(self.color) + usize::from(self.measures)).max(self.backs.into())
    }
}

/// Visible surface at a pixel before trimming.
#[derive(Clone, Copy, Debug)]
pub(super) struct PixelSurface {
    pub(super) depth: f32,
    /// Unit normal, view space.
    pub(super) normal: [f32; 3],
}

/// The part of each layer that belongs to one tile; empty for a layer that is empty.
#[derive(Debug)]
pub(super) struct TileLayers<'a> {
    pub(super) weight: &'a mut [f32],
    pub(super) depth: &'a mut [f32],
    pub(super) normal: &'a mut [[f32; 3]],
    pub(super) point: &'a mut [u32],
    pub(super) color: &'a mut [[f32; 3]],
    pub(super) scalar: &'a mut [f32],
    pub(super) radius: &'a mut [f32],
    pub(super) k_radius: &'a mut [f32],
    pub(super) curvature: &'a mut [f32],
    pub(super) back: &'a mut [f32],
}

impl TileLayers<'_> {
    /// Whether there is a surface at pixel `at` of the tile.
    pub(super) fn covers(&self, at: usize) -> bool {
        self.weight[at] > 0.0
    }

    /// The surface at pixel `at` of the tile.
    pub(super) fn shown(&self, at: usize) -> PixelSurface {
        PixelSurface { depth: self.depth[at], normal: self.normal[at] }
    }

    /// Empties pixel `at` of the tile.
    pub(super) fn clear(&mut self, at: usize) {
        self.weight[at] = 0.0;
        self.depth[at] = f32::INFINITY;
        self.normal[at] = [0.0; 3];
        self.point[at] = u32::MAX;
        if let Some(color) = self.color.get_mut(at) {
            *color = [0.0; 3];
        }
        if let Some(scalar) = self.scalar.get_mut(at) {
            *scalar = f32::NAN;
        }
        for measure in [&mut self.radius, &mut self.k_radius, &mut self.curvature, &mut self.back] {
            if let Some(value) = measure.get_mut(at) {
                *value = 0.0;
            }
        }
    }
}

impl GBuffer {
    /// Sizes the layers for a frame that is drawn in these tiles. Values are undefined.
    pub(super) fn resize(&mut self, view: &View, tiles: &Tiles, channels: Channels) {
        self.tiles.clone_from(tiles);
        let area = self.area();
        let wanted = |wanted: bool| if wanted { area } else { 0 };
        [self.width, self.height] = view.picture_size();
        self.margin = view.margin;
        fit(&mut self.weight, area);
        fit(&mut self.depth, area);
        fit(&mut self.normal, area);
        fit(&mut self.point, area);
        fit(&mut self.color, wanted(channels.color));
        fit(&mut self.scalar, wanted(channels.scalar));
        fit(&mut self.radius, wanted(channels.measures));
        fit(&mut self.k_radius, wanted(channels.measures));
        fit(&mut self.curvature, wanted(channels.measures));
        fit(&mut self.back, wanted(channels.backs));
    }

    /// Cuts all layers into their tiles.
    pub(super) fn cut(&mut self) -> Vec<TileLayers<'_>> {
        fn cut<'a, T>(rest: &mut &'a mut [T]) -> &'a mut [T] {
            rest.split_off_mut(..TILE_AREA).unwrap_or_default()
        }
        let tiles = self.weight.len() / TILE_AREA;
        let mut weight = self.weight.as_mut_slice();
        let mut depth = self.depth.as_mut_slice();
        let mut normal = self.normal.as_mut_slice();
        let mut point = self.point.as_mut_slice();
        let mut color = self.color.as_mut_slice();
        let mut scalar = self.scalar.as_mut_slice();
        let mut radius = self.radius.as_mut_slice();
        let mut k_radius = self.k_radius.as_mut_slice();
        let mut curvature = self.curvature.as_mut_slice();
        let mut back = self.back.as_mut_slice();
        let tile = |_| TileLayers {
            weight: cut(&mut weight),
            depth: cut(&mut depth),
            normal: cut(&mut normal),
            point: cut(&mut point),
            color: cut(&mut color),
            scalar: cut(&mut scalar),
            radius: cut(&mut radius),
            k_radius: cut(&mut k_radius),
            curvature: cut(&mut curvature),
            back: cut(&mut back),
        };
        (0..tiles).map(tile).collect()
    }
}

/// Columns and rows of a patch of pixels, which a workgroup of the device draws.
pub(super) const PATCH: [u32; 2] = [16, 32];

/// [`GBuffer`] on the device, row by row.
#[derive(Debug)]
pub(crate) struct LayerBuffers {
    /// Size of the screen in pixels.
    pub(crate) size: [u32; 2],
    pub(crate) channels: Channels,
    /// Normal and depth, four `f32` per pixel.
    pub(crate) surface: wgpu::Buffer,
    /// Per pixel sum of weights, rim, point (`u32`) and scalar: `Cover` in `shared/layers.wgsl`. Then an element for
    /// each patch (`splat/imports/patches.wgsl`) and for each block (`splat/imports/blocks.wgsl`).
    pub(crate) cover: wgpu::Buffer,
    /// Planes of four `f32` per pixel, one after the other. A plane of linear RGB if there are colours, then one of
    /// splat radius, k-radius and curvature if there are measures. With backs alone there is one plane, otherwise
    /// empty. The last number of the first plane is the share of the back. One element if there is no plane.
    pub(crate) extras: wgpu::Buffer,
}

/// `Cover` in `shared/layers.wgsl`.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct Cover {
    pub(crate) weight: f32,
    pub(crate) rim: f32,
    pub(crate) point: u32,
    pub(crate) scalar: f32,
}

impl LayerBuffers {
    /// Whether the device can bind the buffers of [`new`](Self::new).
    pub(crate) fn has_room(gpu: &Gpu, size: [u32; 2], channels: Channels) -> bool {
        let pixels = size[0] as usize * size[1] as usize;
        gpu.binds::<[f32; 4]>((channels.planes() * pixels).max(pixels + mark_count(size)))
    }

    /// Buffers for a screen of `size`.
    ///
    /// # Errors
    /// [`Error::DeviceLimit`], [`Error::DeviceMemory`] if the device has too little.
    pub(crate) fn new(gpu: &Gpu, size: [u32; 2], channels: Channels) -> Result<Self, Error> {
        let pixels = size[0] as usize * size[1] as usize;
        Ok(Self {
            size,
            channels,
            surface: gpu.storage::<[f32; 4]>("normals and depths", pixels)?,
            cover: gpu.storage::<Cover>("cover of pixels", pixels + mark_count(size))?,
            extras: gpu.storage::<[f32; 4]>("colours and measures", channels.planes() * pixels)?,
        })
    }

    /// The host's form of the layers of a picture with this margin, from the bytes of `surface`, `cover` and `extras`.
    pub(crate) fn to_host(&self, margin: u32, surface: &[u8], cover: &[u8], extras: &[u8]) -> GBuffer {
        let [width, height] = self.size.map(|side| side as usize);
        let Channels { color, scalar, measures, backs } = self.channels;
        let tiles = Tiles::all([width, height]);
        let area = tiles.area();
        let wanted = |wanted: bool| if wanted { area } else { 0 };
        let mut layers = GBuffer {
            width: self.size[0] - 2 * margin,
            height: self.size[1] - 2 * margin,
            weight: vec![0.0; area],
            depth: vec![f32::INFINITY; area],
            normal: vec![[0.0; 3]; area],
            point: vec![u32::MAX; area],
            color: vec![[0.0; 3]; wanted(color)],
            scalar: vec![f32::NAN; wanted(scalar)],
            scalar_about: ValueOrigin::default(),
            radius: vec![0.0; wanted(measures)],
            k_radius: vec![0.0; wanted(measures)],
            curvature: vec![0.0; wanted(measures)],
            back: vec![0.0; wanted(backs)],
            margin,
            tiles,
        };
        let surface: &[[f32; 4]] = bytemuck::cast_slice(surface);
        let cover: &[Cover] = bytemuck::cast_slice(cover);
        let extras: &[[f32; 4]] = bytemuck::cast_slice(extras);
        let pixels = width * height;
        let (colors, measured) = extras.split_at(if color { pixels } else { 0 });
        for (pixel, (&[x, y, z, depth], cover)) in surface[..pixels].iter().zip(cover).enumerate() {
            let at = layers.tiles.index([pixel % width, pixel / width]);
            layers.weight[at] = cover.weight;
            layers.depth[at] = depth;
            layers.normal[at] = [x, y, z];
            layers.point[at] = cover.point;
            if color {
                let [r, g, b, _] = colors[pixel];
                layers.color[at] = [r, g, b];
            }
            if scalar {
                layers.scalar[at] = cover.scalar;
            }
            if measures {
                [layers.radius[at], layers.k_radius[at], layers.curvature[at], _] = measured[pixel];
            }
            if backs {
                layers.back[at] = extras[pixel][3];
            }
        }
        layers
    }
}

/// Patches and blocks of a screen of `size`.
fn mark_count(size: [u32; 2]) -> usize {
    let count = |side: [u32; 2]| size[0].div_ceil(side[0]) as usize * size[1].div_ceil(side[1]) as usize;
    count(PATCH) + count([COUNTED_BLOCK_PX as u32; 2])
}

/// Uploads the host's layers.
#[cfg(test)]
pub(crate) fn upload_layers(gpu: &Gpu, layers: &GBuffer) -> LayerBuffers {
    let channels = Channels {
        color: !layers.color.is_empty(),
        scalar: !layers.scalar.is_empty(),
        measures: !layers.radius.is_empty(),
        backs: !layers.back.is_empty(),
    };
    let size = [layers.width, layers.height];
    let buffers = LayerBuffers::new(gpu, size, channels).expect("room");
    let [width, height] = size.map(|side| side as usize);
    let pixels = || (0..width * height).map(|pixel| layers.index(pixel % width, pixel / width));
    let surface: Vec<[f32; 4]> = pixels()
        .map(|at| {
            let [x, y, z] = layers.normal[at];
            [x, y, z, layers.depth[at]]
        })
        .collect();
    let cover = |at: usize| Cover {
        weight: layers.weight[at],
        rim: 0.0,
        point: layers.point[at],
        scalar: layers.scalar.get(at).copied().unwrap_or(f32::NAN),
    };
    let cover: Vec<_> = pixels().map(cover).collect();
    let mut extras: Vec<[f32; 4]> = Vec::new();
    if channels.color {
        extras.extend(pixels().map(|at| {
            let [r, g, b] = layers.color[at];
            [r, g, b, 0.0]
        }));
    }
    if channels.measures {
        extras.extend(pixels().map(|at| [layers.radius[at], layers.k_radius[at], layers.curvature[at], 0.0]));
    }
    if channels.backs {
        extras.resize(extras.len().max(width * height), [0.0; 4]);
        extras.iter_mut().zip(pixels()).for_each(|(extra, at)| extra[3] = layers.back[at]);
    }
    gpu.queue.write_buffer(&buffers.surface, 0, bytemuck::cast_slice(&surface));
    gpu.queue.write_buffer(&buffers.cover, 0, bytemuck::cast_slice(&cover));
    gpu.queue.write_buffer(&buffers.extras, 0, bytemuck::cast_slice(&extras));
    buffers
}
