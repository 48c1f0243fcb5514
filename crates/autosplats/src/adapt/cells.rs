//! Screen points summed up in cells: the finest level is filled, coarser levels are merged from it.

use std::ops::Range;

use rayon::prelude::*;

use crate::camera::View;
use crate::cancel::Cancel;
use crate::project::ScreenPoints;

/// Most slabs of depth in a cell, each as thick as the cell is wide. A surface tilted by up to 82° fills no more. A
/// fuller cell, such as one with noise seen from the side, has thicker slabs. These cut clusters along lines of sight
/// that nearly lie in the surface, and fits lean. See docs/decisions/0008-eight-slabs.md.
pub(super) const SLABS: usize = 8;
/// Most finest cells. Pictures with as many cells of two pixels are larger than 3200×1800.
pub(crate) const MOST_FINEST: usize = 1_500_000;
/// Most levels of cells. No ball needs coarser ones.
pub(super) const MOST_LEVELS: usize = 9;
/// Padding after the last value of a row of cells. Values are copied in runs of this length.
pub(super) const COPY_PADDING: usize = 8;

/// The mean (view space) and the number of some neighbouring screen points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cluster {
    pub(crate) mean: [f32; 3],
    /// Above 0.
    pub(crate) count: f32,
}

/// The clusters of a row of cells, cell after cell, with one array per coordinate for SIMD. Most cells are empty and
/// others hold one or two clusters, so clusters are stored without gaps.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct CellRow {
    /// First cluster of each cell, then the number of all.
    starts: Vec<u32>,
    /// X, y and z of the means, and the counts; each followed by [`COPY_PADDING`] zeros.
    values: [Vec<f32>; 4],
}

impl CellRow {
    /// A row of cells with these clusters, first cell to last.
    #[cfg(test)]
    pub(crate) fn of(cells: impl Iterator<Item = impl Iterator<Item = Cluster>>) -> Self {
        let mut row = Self::default();
        row.fill(|row| {
            for clusters in cells {
                clusters.for_each(|cluster| row.push(cluster));
                row.end_cell();
            }
        });
        row
    }

    /// Replaces the content by what `cells` pushes.
    #[inline(always)]
    fn fill(&mut self, cells: impl FnOnce(&mut Self)) {
        self.starts.clear();
        self.starts.push(0);
        self.values.iter_mut().for_each(Vec::clear);
        cells(self);
        self.values.iter_mut().for_each(|values| values.extend([0.0; COPY_PADDING]));
    }

    #[inline(always)]
    fn push(&mut self, Cluster { mean: [x, y, z], count }: Cluster) {
        for (values, value) in self.values.iter_mut().zip([x, y, z, count]) {
            values.push(value);
        }
    }

    /// Ends the current cell.
    #[inline(always)]
    fn end_cell(&mut self) {
        self.starts.push(self.values[0].len() as u32);
    }

    /// Range in [`values`](Self::values) of the clusters of a range of cells.
    #[inline(always)]
    pub(super) fn run(&self, columns: Range<usize>) -> Range<usize> {
        self.starts[columns.start] as usize..self.starts[columns.end] as usize
    }

    /// Copies a run of each array to `into`, from `at` on. Writes less than [`COPY_PADDING`] values beyond the end.
    #[inline(always)]
    pub(super) fn copy(&self, run: Range<usize>, into: &mut [Vec<f32>; 4], at: usize) {
        for (into, from) in into.iter_mut().zip(&self.values) {
            for offset in (0..run.len()).step_by(COPY_PADDING) {
                // A fixed length compiles to one load and one store.
                let from = &from[run.start + offset..][..COPY_PADDING];
                into[at + offset..][..COPY_PADDING].copy_from_slice(from);
            }
        }
    }

    #[inline(always)]
    fn clusters(&self, columns: Range<usize>) -> impl Iterator<Item = Cluster> {
        let [x, y, z, count] = &self.values;
        self.run(columns).map(move |at| Cluster { mean: [x[at], y[at], z[at]], count: count[at] })
    }
}

/// Cells of one size.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Level {
    /// Side of a cell in pixels.
    pub(crate) side_px: usize,
    pub(crate) columns: usize,
    pub(crate) rows: Vec<CellRow>,
}

impl Level {
    /// The clusters of a cell, one per slab of depth.
    #[inline(always)]
    pub(crate) fn clusters(&self, [column, row]: [usize; 2]) -> impl Iterator<Item = Cluster> {
        self.rows[row].clusters(column..column + 1)
    }

    #[inline(always)]
    pub(super) fn is_empty(&self, [column, row]: [usize; 2]) -> bool {
        self.rows[row].run(column..column + 1).is_empty()
    }
}

/// All screen points of a frame in cells of several sizes, finest first, each level twice as wide as the one before.
#[derive(Clone, Debug, Default)]
pub(crate) struct Cells {
    pub(crate) levels: Vec<Level>,
}

/// A cell being filled. Its slabs are as thin as their number allows, whatever the order of points.
#[derive(Clone, Copy, Debug)]
struct CellInProgress {
    sum: [[f32; 3]; SLABS],
    count: [f32; SLABS],
    /// Slab of each cluster, in slabs of the cell's current thickness.
    slab: [u32; SLABS],
    used: usize,
    /// How often the slabs' thickness has doubled.
    doubled: u32,
}

impl CellInProgress {
    const EMPTY: Self = Self { sum: [[0.0; 3]; SLABS], count: [0.0; SLABS], slab: [0; SLABS], used: 0, doubled: 0 };

    /// Adds `count` points with this mean.
    #[inline(always)]
    fn add(&mut self, mean: [f32; 3], count: f32, slab: u32) {
        let sum = mean.map(|coordinate| coordinate * count);
        while !self.put(sum, count, slab >> self.doubled) {
            self.double();
        }
    }

    /// Adds a sum to its slab. Returns false if a new slab is needed and there is no room.
    #[inline(always)]
    fn put(&mut self, sum: [f32; 3], count: f32, slab: u32) -> bool {
        let at = self.slab[..self.used].iter().position(|&other| other == slab).unwrap_or(self.used);
        if at == SLABS {
            return false;
        }
        if at == self.used {
            (self.sum[at], self.count[at], self.slab[at]) = (sum, count, slab);
            self.used += 1;
        } else {
            self.count[at] += count;
            for axis in 0..3 {
                self.sum[at][axis] += sum[axis];
            }
        }
        true
    }

    /// Doubles the thickness of slabs.
    #[cold]
    fn double(&mut self) {
        let full = *self;
        (self.used, self.doubled) = (0, full.doubled + 1);
        for at in 0..full.used {
            self.put(full.sum[at], full.count[at], full.slab[at] >> 1);
        }
    }

    /// Pushes the clusters to a row of cells, ends the cell there and becomes empty.
    #[inline(always)]
    fn finish(&mut self, row: &mut CellRow) {
        for at in 0..self.used {
            let count = self.count[at];
            row.push(Cluster { mean: self.sum[at].map(|sum| sum / count), count });
        }
        row.end_cell();
        // Values beyond `used` are never read.
        (self.used, self.doubled) = (0, 0);
    }
}

/// Cuts depth into slabs about as thick as a cell is wide.
#[derive(Clone, Copy, Debug)]
struct Slabs {
    perspective: bool,
    /// Perspective: low bits of a depth that are dropped. Slabs thus get thicker with depth, as cells get wider.
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
    /// Sums up the screen points of a frame. `k` is the number of points per cell of the density grid.
    pub(crate) fn fill(&mut self, screen: &ScreenPoints, view: &View, k: u32, cancel: &Cancel<'_>) {
        let side_px = finest_side_px(screen.density.cell_px, k, [view.width, view.height]);
        let [mut columns, mut rows] = [view.width, view.height].map(|side| (side as usize).div_ceil(side_px));
        let levels = 1 + (columns.max(rows) / 4).max(1).ilog2() as usize;
        self.levels.resize_with(levels.min(MOST_LEVELS), Level::default);
        for (index, level) in self.levels.iter_mut().enumerate() {
            (level.side_px, level.columns) = (side_px << index, columns);
            level.rows.resize_with(rows, CellRow::default);
            (columns, rows) = (columns.div_ceil(2), rows.div_ceil(2));
        }
        let Some((finest, coarser)) = self.levels.split_first_mut() else { return };
        fill_finest(screen, view, finest, cancel);
        let mut below = &*finest;
        for level in coarser {
            merge(below, view, level);
            below = level;
        }
    }
}

/// Side of a picture's finest cells in pixels: about the distance between its screen points.
pub(crate) fn finest_side_px(density_cell_px: usize, k: u32, size: [u32; 2]) -> usize {
    ((density_cell_px as f32 / (k as f32).sqrt()).round() as usize).max(least_side_px(size, MOST_FINEST))
}

/// Least side of a picture's finest cells in pixels: 2, or more to have at most `most` cells.
pub(crate) fn least_side_px(size: [u32; 2], most: usize) -> usize {
    let [width, height] = size.map(|side| side as usize);
    let mut side_px = 2;
    while width.div_ceil(side_px) * height.div_ceil(side_px) > most {
        side_px += 1;
    }
    side_px
}

/// Fills the finest cells with points.
fn fill_finest(screen: &ScreenPoints, view: &View, level: &mut Level, cancel: &Cancel<'_>) {
    let Level { side_px, columns, .. } = *level;
    let slabs = Slabs::new(side_px, view);
    let strip_px = screen.cells.strip_px;
    let last_x = screen.cells.columns - 1;
    level.rows.par_iter_mut().enumerate().for_each_init(
        || vec![CellInProgress::EMPTY; columns],
        |filling, (row, out)| {
            let [y0, y1] = [row * side_px, ((row + 1) * side_px).min(view.height as usize) - 1];
            // Rows stay empty if the frame is given up.
            let strips = y0 / strip_px..y1 / strip_px + 1;
            for strip in strips.filter(|_| !cancel.is_given_up()) {
                for point in &screen.points[screen.cells.run(strip, 0, last_x)] {
                    let [x, y] = point.pixel_xy();
                    if (y0..=y1).contains(&y) {
                        filling[x / side_px].add(point.position_view, 1.0, slabs.of(point.position_view[2]));
                    }
                }
            }
            out.fill(|out| filling.iter_mut().for_each(|filling| filling.finish(out)));
        },
    );
}

/// Fills a level from the clusters of the next finer one, `below`.
fn merge(below: &Level, view: &View, level: &mut Level) {
    let slabs = Slabs::new(level.side_px, view);
    let columns = level.columns;
    level.rows.par_iter_mut().zip(below.rows.par_chunks(2)).for_each(|(out, below_rows)| {
        let mut filling = CellInProgress::EMPTY;
        out.fill(|out| {
            for column in 0..columns {
                for row in below_rows {
                    for Cluster { mean, count } in row.clusters(2 * column..(2 * column + 2).min(below.columns)) {
                        filling.add(mean, count, slabs.of(mean[2]));
                    }
                }
                filling.finish(out);
            }
        });
    });
}

#[cfg(test)]
mod tests;
