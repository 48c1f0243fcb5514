//! Screen points summed up in cells, coarse to fine.

use rayon::prelude::*;

use crate::camera::View;
use crate::project::ScreenPoints;

/// Most slabs of depth in a cell, each as thick as a cell is wide: a surface seen at 76° or less from its normal fills no
/// more. A cell with more to hold has thicker ones.
pub(crate) const SLABS: usize = 4;
/// Most finest cells: with the coarser ones they are just below the 128 MiB that every device binds at once. The pictures that
/// have as many at two pixels are larger than 3200×1800.
pub(crate) const MOST_FINEST: usize = 1_500_000;
/// Coarser levels are of no use to any ball.
pub(super) const MOST_LEVELS: usize = 9;

/// The mean of some screen points near each other, view space, and their number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cluster {
    pub(crate) mean: [f32; 3],
    /// Not 0.
    pub(crate) count: f32,
}

/// The clusters of a cell by slabs of depth, those that hold points first: a coordinate of all of them side by side, for SIMD.
/// A cache line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(64))]
pub(crate) struct Cell {
    /// X, y and z of the means.
    pub(crate) mean: [[f32; SLABS]; 3],
    /// 0 where there is no cluster.
    pub(crate) count: [f32; SLABS],
}

impl Cell {
    pub(crate) fn put(&mut self, at: usize, Cluster { mean, count }: Cluster) {
        for axis in 0..3 {
            self.mean[axis][at] = mean[axis];
        }
        self.count[at] = count;
    }

    pub(crate) fn clusters(&self) -> impl Iterator<Item = Cluster> {
        let Self { mean: [x, y, z], count } = *self;
        let all = (0..SLABS).map(move |at| Cluster { mean: [x[at], y[at], z[at]], count: count[at] });
        all.take_while(|cluster| cluster.count > 0.0)
    }
}

/// Cells of one size.
#[derive(Clone, Debug, Default)]
pub(crate) struct Level {
    /// Side of a cell in pixels.
    pub(crate) side_px: usize,
    pub(crate) columns: usize,
    pub(crate) rows: usize,
    pub(crate) cells: Vec<Cell>,
}

/// All screen points of a frame in cells of several sizes, finest first, each level's twice as wide as those before.
#[derive(Clone, Debug, Default)]
pub(crate) struct Cells {
    pub(crate) levels: Vec<Level>,
}

/// A cell being filled. Its slabs are as thin as the number of them allows, whatever the order of its points.
#[derive(Clone, Copy, Debug)]
struct Filling {
    sum: [[f32; 3]; SLABS],
    count: [f32; SLABS],
    /// Slab of depth of each cluster, in slabs of this cell.
    slab: [u32; SLABS],
    used: usize,
    /// How often the thickness of this cell's slabs was doubled.
    doubled: u32,
}

impl Filling {
    const EMPTY: Self = Self { sum: [[0.0; 3]; SLABS], count: [0.0; SLABS], slab: [0; SLABS], used: 0, doubled: 0 };

    /// Adds `count` points with this mean.
    #[inline(always)]
    fn add(&mut self, mean: [f32; 3], count: f32, slab: u32) {
        let sum = mean.map(|coordinate| coordinate * count);
        while !self.put(sum, count, slab >> self.doubled) {
            self.double();
        }
    }

    /// Adds a sum to its slab, unless there is none and no room for one.
    #[inline(always)]
    fn put(&mut self, sum: [f32; 3], count: f32, slab: u32) -> bool {
        let at = self.slab[..self.used].iter().position(|&other| other == slab).unwrap_or(self.used);
        if at == SLABS {
            return false;
        }
        self.used = self.used.max(at + 1);
        self.slab[at] = slab;
        self.count[at] += count;
        for axis in 0..3 {
            self.sum[at][axis] += sum[axis];
        }
        true
    }

    /// Makes slabs twice as thick.
    #[cold]
    fn double(&mut self) {
        let full = *self;
        *self = Self { doubled: full.doubled + 1, ..Self::EMPTY };
        for at in 0..full.used {
            self.put(full.sum[at], full.count[at], full.slab[at] >> 1);
        }
    }

    /// Writes what it holds to a cell.
    #[inline(always)]
    fn finish(&self, cell: &mut Cell) {
        // Most of many pictures is empty, and was in the frame before: that need not be written. A cell whose first count is 0
        // is all 0.
        if self.used > 0 || cell.count[0] > 0.0 {
            *cell = Cell::default();
        }
        for at in 0..self.used {
            let count = self.count[at];
            cell.put(at, Cluster { mean: self.sum[at].map(|sum| sum / count), count });
        }
    }
}

/// How depth is cut into slabs about as thick as a cell is wide.
#[derive(Clone, Copy, Debug)]
struct Slabs {
    perspective: bool,
    /// Perspective: low bits of a depth that do not count, so that slabs get thicker as cells get wider with depth.
    shift: u32,
    /// Parallel: slabs per world unit.
    per_unit: f32,
}

impl Slabs {
    fn new(side_px: usize, view: &View) -> Self {
        // Depths between two powers of two share 2²³ steps.
        let side = side_px as f32;
        // The difference of bits is the logarithm rounded down, the same on every device.
        let doublings = (view.focal_px.max(side).to_bits() - side.to_bits()) >> 23;
        let shift = 23 - doublings.min(23);
        Self { perspective: view.perspective, shift, per_unit: view.focal_px / side_px as f32 }
    }

    /// Slab of a depth above 0.
    #[inline(always)]
    fn of(&self, depth: f32) -> u32 {
        if self.perspective { depth.to_bits() >> self.shift } else { (depth * self.per_unit) as u32 }
    }
}

impl Cells {
    /// Sums up the screen points of a frame whose cells in the density grid hold about `k` points.
    pub(crate) fn fill(&mut self, screen: &ScreenPoints, view: &View, k: u32) {
        let side_px = finest_side_px(screen.density.cell_px, k, [view.width, view.height]);
        let [mut columns, mut rows] = [view.width, view.height].map(|side| (side as usize).div_ceil(side_px));
        let levels = 1 + (columns.max(rows) / 4).max(1).ilog2() as usize;
        self.levels.resize_with(levels.min(MOST_LEVELS), Level::default);
        for (index, level) in self.levels.iter_mut().enumerate() {
            level.side_px = side_px << index;
            (level.columns, level.rows) = (columns, rows);
            level.cells.resize(columns * rows, Cell::default());
            (columns, rows) = (columns.div_ceil(2), rows.div_ceil(2));
        }
        let Some((finest, coarser)) = self.levels.split_first_mut() else { return };
        fill_finest(screen, view, finest);
        let mut below = &*finest;
        for level in coarser {
            merge(below, view, level);
            below = level;
        }
    }
}

/// Side of the finest cells of a picture: about the distance between its screen points.
pub(crate) fn finest_side_px(density_cell_px: usize, k: u32, size: [u32; 2]) -> usize {
    ((density_cell_px as f32 / (k as f32).sqrt()).round() as usize).max(least_side_px(size))
}

/// Least side of the finest cells of a picture: two pixels, more if there would be more than [`MOST_FINEST`].
pub(crate) fn least_side_px(size: [u32; 2]) -> usize {
    let [width, height] = size.map(|side| side as usize);
    let mut side_px = 2;
    while width.div_ceil(side_px) * height.div_ceil(side_px) > MOST_FINEST {
        side_px += 1;
    }
    side_px
}

/// Fills the finest cells with points.
fn fill_finest(screen: &ScreenPoints, view: &View, level: &mut Level) {
    let Level { side_px, columns, .. } = *level;
    let slabs = Slabs::new(side_px, view);
    let strip_px = screen.cells.strip_px;
    let last_x = screen.cells.columns - 1;
    level.cells.par_chunks_mut(columns).enumerate().for_each_init(Vec::new, |filling, (row, out)| {
        filling.resize(columns, Filling::EMPTY);
        let [y0, y1] = [row * side_px, ((row + 1) * side_px).min(view.height as usize) - 1];
        for strip in y0 / strip_px..=y1 / strip_px {
            for point in &screen.points[screen.cells.run(strip, 0, last_x)] {
                let [x, y] = point.pixel_xy();
                if (y0..=y1).contains(&y) {
                    filling[x / side_px].add(point.position_view, 1.0, slabs.of(point.position_view[2]));
                }
            }
        }
        for (out, filling) in out.iter_mut().zip(filling) {
            filling.finish(out);
            if filling.used > 0 {
                *filling = Filling::EMPTY;
            }
        }
    });
}

/// Fills a level with what the one below it holds.
fn merge(below: &Level, view: &View, level: &mut Level) {
    let slabs = Slabs::new(level.side_px, view);
    level.cells.par_chunks_mut(level.columns).enumerate().for_each(|(row, out)| {
        for (column, out) in out.iter_mut().enumerate() {
            let mut filling = Filling::EMPTY;
            for y in 2 * row..(2 * row + 2).min(below.rows) {
                for x in 2 * column..(2 * column + 2).min(below.columns) {
                    for Cluster { mean, count } in below.cells[y * below.columns + x].clusters() {
                        filling.add(mean, count, slabs.of(mean[2]));
                    }
                }
            }
            filling.finish(out);
        }
    });
}

#[cfg(test)]
mod tests;
