//! Project: every point to its pixel, the nearest wins [Paper, §3, §5.1, §7].
//!
//! # How it works
//! A pixel, or each half of one, keeps the smallest of (depth, point index), so ties go to the lower index. Halves lie side by
//! side and one below the other in turn, and of two points far apart in depth only the nearer counts. The paper has one
//! point a pixel and names as a weakness what that loses: at silhouettes, in thin parts and where points are denser than
//! pixels, the neighbours that the fit would need.
//!
//! What survives, the *screen points*, is compacted into a list ordered by screen cell, for the search to read its
//! surroundings in few contiguous runs: the screen is cut into strips a few pixels high, a cell is one pixel wide and a
//! strip high, and cells follow each other along the strip. Any sixteen neighbours in that list lie close together on the
//! screen, whatever the local density.
//!
//! A coarser grid, about k screen points to a cell, counts points for the first search radius (§5.1) and holds the
//! nearest depth for grid culling (§7): points well behind the nearest of their cell are *passive*.
//!
//! Of all other points nothing is kept but the sixteenth of a pixel that they fall into: a bit, for the splatting to tell where
//! surfaces end.

mod cpu;
mod device_cloud;
pub(crate) mod gpu;
mod sixteenths;
#[cfg(test)]
mod tests;

pub(crate) use cpu::Projector;
#[cfg(test)]
pub(crate) use device_cloud::ChunkUniform;
pub(crate) use device_cloud::{Chunk, DeviceCloud, PointValues, Uploader};
pub(crate) use sixteenths::{Sixteenths, half_at};

use bytemuck::{Pod, Zeroable};

use crate::camera::View;

/// How far beside the picture points get splats, in first search radii. Those further out are neighbours, and no more.
// Differs from the paper: it ends with the picture.
pub(crate) const MARGIN_REACH: f32 = 1.5;

/// What projection keeps.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ProjectRules {
    /// Screen points that a cell of the density grid holds by mean.
    pub(crate) k: u32,
    /// Whether each half of a pixel keeps its nearest point, instead of each pixel.
    pub(crate) halves: bool,
    /// Whether points well behind the nearest of their cell become passive.
    pub(crate) grid_culling: bool,
}

#[cfg(test)]
impl ProjectRules {
    /// As pictures have it by default.
    pub(crate) fn usual(k: u32) -> Self {
        Self { k, halves: true, grid_culling: true }
    }
}

/// A projected point: one that owns its pixel, or half of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct ScreenPoint {
    /// View space (x right, y down, z forward), world units.
    pub(crate) position_view: [f32; 3],
    /// Pixel column in the low, row in the high 16 bits.
    pub(crate) pixel: u32,
}

impl ScreenPoint {
    /// Pixel column and row.
    #[inline(always)]
    pub(crate) fn pixel_xy(&self) -> [usize; 2] {
        [(self.pixel & 0xffff) as usize, (self.pixel >> 16) as usize]
    }
}

/// The screen points of one frame in cell order.
#[derive(Clone, Debug, Default)]
pub(crate) struct ScreenPoints {
    pub(crate) points: Vec<ScreenPoint>,
    /// Index in the cloud of each screen point.
    pub(crate) source: Vec<u32>,
    pub(crate) cells: ScreenCells,
    pub(crate) density: DensityGrid,
    /// Screen points to reconstruct first, ascending.
    pub(crate) active: Vec<u32>,
    /// The others, ascending: probably hidden, if there is grid culling, or too far beside the picture to matter to it.
    pub(crate) passive: Vec<u32>,
    pub(crate) sixteenths: Sixteenths,
    pub(crate) dropped: Dropped,
}

/// Points that own no pixel because they cannot, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Dropped {
    pub(crate) not_finite: usize,
    pub(crate) behind: usize,
    pub(crate) outside: usize,
}

/// Where in the list of screen points each cell begins.
#[derive(Clone, Debug, Default)]
pub(crate) struct ScreenCells {
    /// Height of a strip in pixels.
    pub(crate) strip_px: usize,
    /// Image width: cells in a strip.
    pub(crate) columns: usize,
    /// First screen point of each cell, strip by strip, and the number of points at the end.
    pub(crate) start: Vec<u32>,
}

impl ScreenCells {
    /// The screen points of strip `strip` in pixel columns `x0..=x1`: they are contiguous.
    #[inline(always)]
    pub(crate) fn run(&self, strip: usize, x0: usize, x1: usize) -> std::ops::Range<usize> {
        let row = strip * self.columns;
        self.start[row + x0] as usize..self.start[row + x1 + 1] as usize
    }
}

/// The low-resolution grid of §5.1: square cells of about k screen points.
#[derive(Clone, Debug, Default)]
pub(crate) struct DensityGrid {
    /// Side of a cell in pixels.
    pub(crate) cell_px: usize,
    pub(crate) columns: usize,
    /// Screen points in each cell.
    pub(crate) count: Vec<u32>,
    /// Depth of the nearest point in each cell; infinite in an empty one.
    pub(crate) nearest: Vec<f32>,
    /// Depth beyond which points of a cell are probably hidden: the nearest, and the width of the cell in world units
    /// there [Paper, §7, Grid Culling].
    pub(crate) culling: Vec<f32>,
}

impl DensityGrid {
    #[inline(always)]
    fn cell(&self, [x, y]: [usize; 2]) -> usize {
        y / self.cell_px * self.columns + x / self.cell_px
    }

    /// Whether a point lies behind the culling plane of its cell.
    #[inline(always)]
    pub(crate) fn culls(&self, point: &ScreenPoint) -> bool {
        point.position_view[2] > self.culling[self.cell(point.pixel_xy())]
    }

    /// Whether a point's splat may matter to the picture: it lies in it, or not far beside for how dense points are there.
    #[inline(always)]
    pub(crate) fn matters(&self, point: &ScreenPoint, k: u32, view: &View) -> bool {
        let beside_px = view.beside_picture(point.pixel_xy());
        beside_px == 0 || beside_px as f32 <= MARGIN_REACH * self.initial_radius_px(point, k)
    }

    /// First search radius of a point in world units: that of the circle which holds k points at the density of the
    /// point's cell [Paper, §5.1].
    #[inline(always)]
    pub(crate) fn initial_radius(&self, point: &ScreenPoint, k: u32, view: &View) -> f32 {
        self.initial_radius_px(point, k) * view.pixel_size(point.position_view[2])
    }

    /// The same in pixels.
    #[inline(always)]
    pub(crate) fn initial_radius_px(&self, point: &ScreenPoint, k: u32) -> f32 {
        let area_px = (self.cell_px * self.cell_px) as f32;
        let count = self.count[self.cell(point.pixel_xy())] as f32;
        (area_px * k as f32 / (std::f32::consts::PI * count)).sqrt()
    }
}
