//! Screen points summed up in cells, coarse to fine.

use rayon::prelude::*;

use crate::camera::View;
use crate::project::ScreenPoints;

/// Most slabs of depth in a cell, each as thick as a cell is wide: a surface seen at 82° or less from its normal fills no
/// more. A cell with more to hold has thicker ones, which noise seen from the side does: then clusters are cut along lines of
/// sight that nearly lie in the surface, and fits lean.
pub(crate) const SLABS: usize = 8;
/// Clusters of a cell that lie side by side. Most cells have no more, and those that are after them are not looked at.
pub(crate) const BUNCH: usize = 4;
const BUNCHES: usize = SLABS / BUNCH;
/// Most finest cells: the pictures that have as many at two pixels are larger than 3200×1800.
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

/// Some clusters of a cell, by slabs of depth, those that hold points first: a coordinate of all of them side by side, for SIMD.
/// A cache line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(64))]
pub(crate) struct Bunch {
    /// X, y and z of the means.
    pub(crate) mean: [[f32; BUNCH]; 3],
    /// 0 where there is no cluster.
    pub(crate) count: [f32; BUNCH],
}

impl Bunch {
    pub(crate) fn put(&mut self, at: usize, Cluster { mean, count }: Cluster) {
        for axis in 0..3 {
            self.mean[axis][at] = mean[axis];
        }
        self.count[at] = count;
    }

    /// Whether others may follow.
    #[inline(always)]
    pub(crate) fn is_full(&self) -> bool {
        self.count[BUNCH - 1] > 0.0
    }

    #[inline(always)]
    fn clusters(&self) -> impl Iterator<Item = Cluster> {
        let Self { mean: [x, y, z], count } = *self;
        let all = (0..BUNCH).map(move |at| Cluster { mean: [x[at], y[at], z[at]], count: count[at] });
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
    /// The first clusters of all cells, row by row, then those that follow in cells where the first are full.
    pub(crate) bunches: [Vec<Bunch>; BUNCHES],
}

impl Level {
    /// Of `side_px` wide cells, all empty or as they were.
    pub(crate) fn resize(&mut self, side_px: usize, [columns, rows]: [usize; 2]) {
        (self.side_px, self.columns, self.rows) = (side_px, columns, rows);
        self.bunches.iter_mut().for_each(|bunches| bunches.resize(columns * rows, Bunch::default()));
    }

    /// The clusters of a cell.
    #[inline(always)]
    pub(crate) fn clusters(&self, cell: usize) -> impl Iterator<Item = Cluster> {
        let [first, more] = &self.bunches;
        let more = first[cell].is_full().then(|| more[cell].clusters());
        first[cell].clusters().chain(more.into_iter().flatten())
    }

    /// Cells that are filled at a time, row by row.
    fn rows_mut(&mut self) -> impl IndexedParallelIterator<Item = [&mut [Bunch]; BUNCHES]> {
        let [first, more] = &mut self.bunches;
        let rows = first.par_chunks_mut(self.columns).zip(more.par_chunks_mut(self.columns));
        rows.map(|(first, more)| [first, more])
    }
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

    /// Writes what it holds to a cell of a row.
    #[inline(always)]
    fn finish(&self, row: &mut [&mut [Bunch]; BUNCHES], column: usize) {
        // What is empty, and was in the frame before, need be neither written nor, but for the first bunch, read: that is most of
        // many pictures, and of nearly all the second bunches. A bunch whose first count is 0 is all 0.
        let mut had_some = true;
        for (index, bunches) in row.iter_mut().enumerate() {
            let held = index * BUNCH..self.used.min((index + 1) * BUNCH);
            if held.is_empty() && !had_some {
                return;
            }
            let bunch = &mut bunches[column];
            had_some = bunch.is_full();
            if !held.is_empty() || bunch.count[0] > 0.0 {
                *bunch = Bunch::default();
            }
            for at in held {
                let count = self.count[at];
                bunch.put(at % BUNCH, Cluster { mean: self.sum[at].map(|sum| sum / count), count });
            }
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
            level.resize(side_px << index, [columns, rows]);
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
    ((density_cell_px as f32 / (k as f32).sqrt()).round() as usize).max(least_side_px(size, MOST_FINEST))
}

/// Least side of the finest cells of a picture: two pixels, more if there would be more cells than `most`.
pub(crate) fn least_side_px(size: [u32; 2], most: usize) -> usize {
    let [width, height] = size.map(|side| side as usize);
    let mut side_px = 2;
    while width.div_ceil(side_px) * height.div_ceil(side_px) > most {
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
    level.rows_mut().enumerate().for_each_init(Vec::new, |filling, (row, mut out)| {
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
        for (column, filling) in filling.iter_mut().enumerate() {
            filling.finish(&mut out, column);
            if filling.used > 0 {
                *filling = Filling::EMPTY;
            }
        }
    });
}

/// Fills a level with what the one below it holds.
fn merge(below: &Level, view: &View, level: &mut Level) {
    let slabs = Slabs::new(level.side_px, view);
    let columns = level.columns;
    level.rows_mut().enumerate().for_each(|(row, mut out)| {
        for column in 0..columns {
            let mut filling = Filling::EMPTY;
            for y in 2 * row..(2 * row + 2).min(below.rows) {
                for x in 2 * column..(2 * column + 2).min(below.columns) {
                    for Cluster { mean, count } in below.clusters(y * below.columns + x) {
                        filling.add(mean, count, slabs.of(mean[2]));
                    }
                }
            }
            filling.finish(&mut out, column);
        }
    });
}

#[cfg(test)]
mod tests;
