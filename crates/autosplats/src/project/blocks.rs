//! Blocks of pixels that hold points. Most blocks of many pictures hold none, and are neither read nor written.

use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

/// Side of a block in pixels.
pub(crate) const OCCUPANCY_BLOCK_PX: usize = 16;
/// Side in pixels of the small blocks whose sixteenths with points are counted.
pub(crate) const COUNTED_BLOCK_PX: usize = 4;

/// The blocks of a screen that hold points.
#[derive(Debug, Default)]
pub(crate) struct Blocks {
    /// Width of the screen in pixels.
    width: usize,
    /// Whether each block holds points, row by row.
    held: Vec<AtomicBool>,
}

impl Blocks {
    /// The blocks of a screen without points.
    pub(super) fn new([width, height]: [usize; 2]) -> Self {
        let mut held = Vec::new();
        held.resize_with(columns(width) * height.div_ceil(OCCUPANCY_BLOCK_PX), AtomicBool::default);
        Self { width, held }
    }

    /// Marks the block of a pixel, by its row-by-row index.
    #[inline(always)]
    pub(super) fn hold(&self, pixel: u32) {
        let [x, y] = [pixel as usize % self.width, pixel as usize / self.width].map(|at| at / OCCUPANCY_BLOCK_PX);
        self.held[y * columns(self.width) + x].store(true, Ordering::Relaxed);
    }

    /// Whether the block in this column and row of blocks holds points.
    #[inline(always)]
    pub(crate) fn holds(&self, column: usize, row: usize) -> bool {
        self.held[row * columns(self.width) + column].load(Ordering::Relaxed)
    }

    /// Calls `change` for the part of each row of pixels that lies in a block with points.
    pub(crate) fn change<T: Send>(&self, pixels: &mut [T], change: impl Fn(&mut [T]) + Sync) {
        if self.held.is_empty() {
            return;
        }
        let rows = pixels.par_chunks_mut(OCCUPANCY_BLOCK_PX * self.width).enumerate();
        rows.for_each(|(block_row, pixels)| {
            for row in pixels.chunks_mut(self.width) {
                let parts = row.chunks_mut(OCCUPANCY_BLOCK_PX).enumerate();
                parts.filter(|&(column, _)| self.holds(column, block_row)).for_each(|(_, part)| change(part));
            }
        });
    }
}

/// Blocks in a row of blocks.
fn columns(width: usize) -> usize {
    width.div_ceil(OCCUPANCY_BLOCK_PX)
}

impl Clone for Blocks {
    fn clone(&self) -> Self {
        let held = self.held.iter().map(|held| held.load(Ordering::Relaxed).into()).collect();
        Self { width: self.width, held }
    }
}
