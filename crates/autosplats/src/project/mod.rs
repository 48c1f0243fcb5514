//! Project: every point goes to its pixel, and the nearest point of a pixel wins [Paper, §3, §5.1, §7].
//!
//! # How it works
//! A pixel, or each of its two halves, keeps the smallest pair (depth, ordinal): a tie goes to the first of the runs.
//! Pixels are split left/right and top/bottom like the squares of a chessboard. If the two points of a pixel lie far
//! apart in depth, only the nearer counts. The paper keeps one point a pixel and names the loss as a weakness:
//! silhouettes, thin parts and dense regions lack neighbours for the fit.
//!
//! The surviving *screen points* are compacted into a list in cell order, so that the search reads the surroundings of
//! a point in a few contiguous runs. The screen is cut into strips a few pixels high. A cell is one pixel wide and one
//! strip high, and the cells of a strip follow each other. Any sixteen consecutive points of the list lie close
//! together on the screen, whatever the local density.
//!
//! A coarser grid, with about k screen points to a cell, counts points for the first search radius (§5.1). The grid
//! also holds the nearest depth for grid culling (§7): points well behind the nearest of their cell are *passive*.
//!
//! The points come in runs, each about an origin of its own (`slots`); all that leaves the stage is in view space.
//! Points of surfaces that the eye almost touches are listed once more, also beside the screen (`near`).
//!
//! Every point on the screen marks the sixteenth of its pixel that it falls into, with one bit that points there share.
//! The splatting finds the borders of surfaces from these bits.

mod blocks;
mod cpu;
mod device_cloud;
pub(crate) mod gpu;
mod near;
mod sixteenths;
mod slots;
#[cfg(test)]
mod tests;

pub(crate) use blocks::{Blocks, COUNTED_BLOCK_PX, OCCUPANCY_BLOCK_PX};
pub(crate) use cpu::Projector;
#[cfg(test)]
pub(crate) use device_cloud::ChunkUniform;
pub(crate) use device_cloud::{Chunk, DeviceCloud, PointValues, Uploader};
pub(crate) use sixteenths::{Sixteenths, half_at};
pub(crate) use slots::SlotTable;

use bytemuck::{Pod, Zeroable};

use crate::camera::View;

/// Largest distance beside the picture, in first search radii, at which a screen point gets a splat. Points further
/// out serve as neighbours only.
// Differs from the paper: the paper's points end with the picture.
pub(crate) const MARGIN_REACH: f32 = 1.5;

/// A set of screen points that search, fit, adapt and splatting process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Round {
    /// The active points.
    Active,
    /// The passive points that turned out not to be hidden.
    Recovered,
}

/// Settings of the projection.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ProjectRules {
    /// Mean number of screen points in a cell of the density grid.
    pub(crate) k: u32,
    /// Whether each half of a pixel keeps its nearest point, instead of each pixel. See
    /// docs/decisions/0001-two-points-a-pixel.md.
    pub(crate) halves: bool,
    /// Whether points well behind the nearest of their cell become passive.
    pub(crate) grid_culling: bool,
    /// Whether points near the eye are listed (`near`); in parallel projection there is no eye to be near to.
    pub(crate) near: bool,
}

#[cfg(test)]
impl ProjectRules {
    /// Default rules.
    pub(crate) fn usual(k: u32) -> Self {
        Self { k, halves: true, grid_culling: true, near: false }
    }
}

/// A projected point: the owner of a pixel or of half a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct ScreenPoint {
    /// Position in view space (x right, y down, z forward), world units.
    pub(crate) position_view: [f32; 3],
    /// Pixel column in the low, row in the high 16 bits, and two flags: [`NEAR`](Self::NEAR) and
    /// [`SILENT`](Self::SILENT). No screen is wider than 32767 pixels.
    pub(crate) pixel: u32,
}

impl ScreenPoint {
    /// Flag: the point is in the list of [`ScreenPoints::near_first`].
    pub(crate) const NEAR: u32 = 1 << 15;
    /// Flag: the point serves as a neighbour only.
    pub(crate) const SILENT: u32 = 1 << 31;

    /// Column and row of the pixel; of a near point beside the screen, the one at the edge in its direction.
    #[inline(always)]
    pub(crate) fn pixel_xy(&self) -> [usize; 2] {
        pixel_xy(self.pixel)
    }

    #[inline(always)]
    pub(crate) fn is_near(&self) -> bool {
        self.pixel & Self::NEAR != 0
    }

    #[inline(always)]
    pub(crate) fn is_silent(&self) -> bool {
        self.pixel & Self::SILENT != 0
    }
}

/// Column and row of a pixel with flags.
#[inline(always)]
pub(crate) fn pixel_xy(pixel: u32) -> [usize; 2] {
    [(pixel & 0x7fff) as usize, (pixel >> 16 & 0x7fff) as usize]
}

/// Whole part of a number from 0 to below 2²³; some number for any other. Unlike a cast, which saturates, this is done
/// for several numbers at a time on every processor.
#[inline(always)]
fn whole(number: f32) -> u32 {
    /// Numbers from here on are whole: the addition rounds to the nearest.
    const WHOLE: f32 = (1 << 23) as f32;
    let rounded = number + WHOLE;
    let is_above = rounded - WHOLE > number;
    rounded.to_bits().wrapping_sub(WHOLE.to_bits()).wrapping_sub(u32::from(is_above))
}

/// The screen points of one frame in cell order, then the points of sparse cells around the eye.
#[derive(Clone, Debug, Default)]
pub(crate) struct ScreenPoints {
    pub(crate) points: Vec<ScreenPoint>,
    /// Index in the cloud of each screen point.
    pub(crate) source: Vec<u32>,
    /// Index of the first point of the sparse cells (`near`), among which near points have their neighbours. The number
    /// of points if there are none.
    pub(crate) near_first: usize,
    pub(crate) cells: ScreenCells,
    pub(crate) density: DensityGrid,
    /// Indices of the screen points to reconstruct first, ascending.
    pub(crate) active: Vec<u32>,
    /// Indices of the other screen points, ascending: culled by the grid, or too far beside the picture to matter.
    pub(crate) passive: Vec<u32>,
    pub(crate) sixteenths: Sixteenths,
    pub(crate) dropped: Dropped,
}

/// Numbers of points that own no pixel, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Dropped {
    pub(crate) not_finite: usize,
    pub(crate) behind: usize,
    pub(crate) outside: usize,
}

/// Start of each cell in the list of screen points.
#[derive(Clone, Debug, Default)]
pub(crate) struct ScreenCells {
    /// Height of a strip in pixels.
    pub(crate) strip_px: usize,
    /// Cells in a strip: the screen's width in pixels.
    pub(crate) columns: usize,
    /// Index of the first screen point of each cell, strip by strip, then the number of points.
    pub(crate) start: Vec<u32>,
}

impl ScreenCells {
    /// Range of the screen points of strip `strip` in pixel columns `x0..=x1`, which are contiguous.
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
    /// Depth of the nearest point in each cell, infinite in an empty cell.
    pub(crate) nearest: Vec<f32>,
    /// Depth beyond which a cell's points are probably hidden: its nearest depth plus the cell's width in world units
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
        !point.is_near() & (point.position_view[2] > self.culling[self.cell(point.pixel_xy())])
    }

    /// Whether a point's splat can matter: the point is near and not silent, or lies at most `MARGIN_REACH` first
    /// search radii beside the picture.
    #[inline(always)]
    pub(crate) fn matters(&self, point: &ScreenPoint, k: u32, view: &View) -> bool {
        if point.is_near() | point.is_silent() {
            return !point.is_silent();
        }
        let beside_px = view.beside_picture(point.pixel_xy());
        beside_px == 0 || beside_px as f32 <= MARGIN_REACH * self.initial_radius_px(point, k)
    }

    /// First search radius of a point in world units: the radius of a circle that holds k points at the density of the
    /// point's cell [Paper, §5.1]. Infinite for a near point, to which no rule about density applies.
    #[inline(always)]
    pub(crate) fn initial_radius(&self, point: &ScreenPoint, k: u32, view: &View) -> f32 {
        if point.is_near() {
            return f32::INFINITY;
        }
        self.initial_radius_px(point, k) * view.pixel_size(point.position_view[2])
    }

    /// First search radius in pixels; see [`initial_radius`](Self::initial_radius).
    #[inline(always)]
    pub(crate) fn initial_radius_px(&self, point: &ScreenPoint, k: u32) -> f32 {
        let area_px = (self.cell_px * self.cell_px) as f32;
        let count = self.count[self.cell(point.pixel_xy())] as f32;
        (area_px * k as f32 / (std::f32::consts::PI * count)).sqrt()
    }
}
