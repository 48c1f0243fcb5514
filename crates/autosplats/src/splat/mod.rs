//! Splat: surfels in, the visible surface per pixel out [Paper, §7].
//!
//! # How it works
//! The kernel of a splat is nearly a Gaussian over its disc, and each splat is drawn at least as a dot a pixel wide.
//! First every splat writes its depth, pushed back by ε, and the nearest stays (*visibility*). A splat whose own point
//! this map hides comes from a neighbourhood that occlusion cut short. The map is drawn twice more without such splats
//! (*refinement*). The splats left add their weighted attributes wherever they lie in front of the map, that is within
//! ε of the surface (*attributes*). The sums are divided by the weights (*normalize*). Last, tails that stick out of a
//! silhouette are removed (*trim*).
//!
//! Splats are sorted into tiles of [`TILE`]² pixels. One thread draws a tile in its cache, splat after splat in list
//! order. So sums are the same for any number of threads.

mod attributes;
mod bins;
mod centers;
mod cpu;
pub(crate) mod gpu;
mod layers;
pub(crate) mod over_time;
mod raster;
mod rows;
mod setup;
#[cfg(test)]
mod tests;
mod tiles;
mod trim;

use std::ops::Range;

use autosplats_cloud::ValueOrigin;

pub(crate) use attributes::{Attributes, PointColors};
pub(crate) use cpu::Splatter;
pub(crate) use layers::{Channels, LayerBuffers};
#[cfg(test)]
pub(crate) use layers::{Cover, upload_layers};
pub(crate) use over_time::{OverTime, STEADY_FRAMES};
pub(crate) use tiles::Tiles;
pub(crate) use trim::TrimRules;

/// Side of a screen tile in pixels: the unit of splatting, and the layout of every screen-sized layer.
pub const TILE: usize = 64;
/// Pixels in a tile.
pub(crate) const TILE_AREA: usize = TILE * TILE;

/// The visible surface, a value per pixel and layer.
///
/// Layers are stored tile by tile, [`TILE`]×[`TILE`] pixels each, so that a tile is one piece of cache and of work.
/// [`index`](Self::index) finds a pixel of the picture. A frame's tiles without any splat share one piece, so change
/// only layers from [`new`](Self::new). Layers may have a margin around the picture, whose pixels may be covered too. A
/// layer that was not requested is empty.
///
/// # Examples
///
/// ```
/// use autosplats::{Renderer, Settings, cloud::glam::DVec2};
/// # use autosplats::{Camera, Projection, cloud::{PointCloud, glam::DVec3}};
/// # let floor = (0..10_000).map(|i| [(i % 100) as f32, (i / 100) as f32, 0.0]).collect();
/// # let cloud = PointCloud::new(DVec3::ZERO, floor);
/// # let (eye, look_at) = (DVec3::new(50.0, 50.0, 100.0), DVec3::new(50.0, 50.0, 0.0));
/// # let projection = Projection::PerspectiveFovDeg(40.0);
/// # let camera = Camera { eye, look_at, up: DVec3::Y, projection };
///
/// // The cloud is a floor at height 0, seen from above.
/// let (size, settings) = ([64, 48], Settings { all_layers: true, ..Settings::default() });
/// let mut renderer = Renderer::new();
/// let layers = renderer.render(&cloud, &camera, size, &settings)?.layers;
/// let index = layers.index(20, 10);
/// let pixel = DVec2::new(20.5, 10.5);
/// let place = camera.unproject(pixel, layers.depth[index].into(), size)?;
/// assert!(place.z.abs() < 0.01);
/// assert!(layers.k_radius[index] > 1.0);
/// # Ok::<(), autosplats::Error>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct GBuffer {
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// Sum of kernel weights; 0 where no surface is.
    pub weight: Vec<f32>,
    /// Depth along the viewing axis in world units; infinite where no surface is.
    pub depth: Vec<f32>,
    /// Unit normal towards the eye, whichever side the sensor saw; view space (x right, y down, z forward). Zero where
    /// no surface is.
    pub normal: Vec<[f32; 3]>,
    /// Index of the source point of the heaviest splat; `u32::MAX` where no surface is.
    pub point: Vec<u32>,
    /// Colour of the points, linear RGB, 0 to 1.
    pub color: Vec<[f32; 3]>,
    /// Mean of the requested scalar field, relative to [`scalar_about`](Self::scalar_about).
    pub scalar: Vec<f32>,
    /// What values of the scalar field are relative to.
    pub scalar_about: ValueOrigin,
    /// Mean splat radius in world units.
    pub radius: Vec<f32>,
    /// Mean k-radius in world units.
    pub k_radius: Vec<f32>,
    /// Mean surface variation, 0 to 1/3.
    pub curvature: Vec<f32>,
    /// Share of the visible surface that shows its back, the side that the sensor did not see; 0 to 1. Empty if the
    /// cloud does not say where its sensors stood.
    pub back: Vec<f32>,
    /// Width in pixels of the margin that layers have on every side of the picture.
    pub(crate) margin: u32,
    pub(crate) tiles: Tiles,
}

impl GBuffer {
    /// Layers of a picture without any surface. Optional layers are empty.
    pub fn new(width: u32, height: u32) -> Self {
        let tiles = Tiles::all([width, height].map(|side| side as usize));
        let mut layers = Self { width, height, tiles, ..Self::default() };
        let area = layers.area();
        layers.weight = vec![0.0; area];
        layers.depth = vec![f32::INFINITY; area];
        layers.normal = vec![[0.0; 3]; area];
        layers.point = vec![u32::MAX; area];
        layers
    }

    /// Number of values in a layer that is not empty.
    pub(crate) fn area(&self) -> usize {
        self.tiles.area()
    }

    /// Index of pixel (x, y) in each layer.
    #[inline(always)]
    pub fn index(&self, x: usize, y: usize) -> usize {
        let margin = self.margin as usize;
        self.tiles.index([x + margin, y + margin])
    }

    /// Whether a splat touches any tile in these columns and rows of the picture, beyond which they may reach.
    pub(crate) fn is_drawn(&self, [columns, rows]: [Range<isize>; 2]) -> bool {
        let margin = self.margin as isize;
        let on_screen = |range: Range<isize>, side: u32| {
            let [first, end] = [range.start, range.end].map(|at| (at + margin).clamp(0, side as isize + 2 * margin));
            first as usize..end as usize
        };
        self.tiles.any_stored([on_screen(columns, self.width), on_screen(rows, self.height)])
    }

    /// Number of pixels from column `x` to the end of its tile, which lie side by side in memory. The row may end
    /// earlier.
    pub(crate) fn run(&self, x: usize) -> usize {
        TILE - (x + self.margin as usize) % TILE
    }
}

/// Number of tiles in a row of a screen `width` pixels wide.
pub(crate) const fn tile_columns(width: usize) -> usize {
    width.div_ceil(TILE)
}
