//! Sheets: quadrics that surfels share. There are several in a cell and a fifth as many as surfels, each of which
//! blends several. See docs/decisions/0007-shared-sheets.md.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use glam::Vec3;
use pulp::Simd;
use rayon::prelude::*;

use self::blend::CellSheets;
pub(super) use self::blend::{Blend, NearbySheets, Surface};
use super::cells::{Cells, Cluster, Level, SLABS};
use super::choose::choose;
use super::quadric::{Gathered, Quadric, tangents};
use super::rules::Goal;
use crate::camera::View;
use crate::cancel::Cancel;
use crate::fit::Surfel;
use crate::room::fit;

mod blend;
#[cfg(test)]
mod tests;

/// Levels of the cells that may have sheets, for normal and for thick noise. These cells are two and four point
/// distances wide; the smallest balls have a radius of three.
pub(super) const SHEET_LEVELS: [usize; 2] = [1, 2];
/// Distance from a sheet, in noise levels, up to which a cluster needs no sheet of its own.
pub(super) const COVERED_NOISES: f32 = 2.0;
/// Squared distance from a sheet's axis, in squared radii, up to which [`COVERED_NOISES`] applies. At a grazing angle a
/// cell is a long strip of surface. A larger value makes normals along silhouettes worse.
pub(super) const COVERED_REACH: f32 = 0.12;
/// Most sheets of a cell.
pub(super) const SHEETS: usize = 4;
/// Parts of a pixel in which k-radii are summed up. Integer sums do not depend on their order.
pub(super) const K_RADIUS_PARTS_PER_PX: f32 = 64.0;
/// Cap of a summed k-radius, in pixels. Sums over nine cells of 32 pixels with two points per pixel stay below 2³².
pub(super) const MAX_SUMMED_K_RADIUS_PX: f32 = 2048.0;

/// An upright quadric over the balls that it was fitted to.
#[derive(Clone, Copy, Debug)]
struct Sheet {
    center: Vec3,
    /// Radius of the quadric, world units.
    radius: f32,
    /// Unit normal at the centre, and direction of the heights.
    axis: Vec3,
    /// Height at the centre, in radii.
    height: f32,
    /// Second-order heights in radii, as a symmetric matrix: xx, xy, xz, yy, yz and zz. The matrix maps the axis to 0.
    /// The GPU stores the three coefficients along tangents; both forms differ by rounding only.
    bend: [f32; 6],
    /// Standard error of the normal, radians.
    error: f32,
    curvature: f32,
    /// Standard deviation of points from the sheet, world units.
    scatter: f32,
    /// Weight beside other sheets, by error and scatter.
    trust: f32,
}

impl Sheet {
    fn new(center: Vec3, quadric: &Quadric, noise: f32) -> Self {
        let &Quadric { radius, axis, height, bend: [uu, uv, vv], curvature, scatter, .. } = quadric;
        let (u, v) = tangents(axis);
        // Each off-diagonal term of the sum counts twice.
        let across = u * (0.5 * uv) + v * vv;
        let along = u * uu + v * (0.5 * uv);
        let bend = |a: usize, b: usize| along[a] * u[b] + across[a] * v[b];
        let error = quadric.error * noise;
        // Points of two surfaces scatter more than noise does.
        let beyond = (scatter / noise).max(1.0);
        Self {
            center,
            radius,
            axis,
            height: height / radius,
            bend: [bend(0, 0), bend(0, 1), bend(0, 2), bend(1, 1), bend(1, 2), bend(2, 2)],
            error,
            curvature,
            scatter,
            // error^-¾, times the excess of scatter to the power of -3.
            trust: 1.0 / (error.sqrt() * error.sqrt().sqrt() * (beyond * beyond * beyond)),
        }
    }

    /// Height of the sheet above `place` along the sheet's axis, world units, and nearness of `place` to that axis.
    /// Nearness is 1 on the axis, 0 at the ball's border and negative beyond.
    #[inline(always)]
    fn over(&self, place: Vec3) -> (f32, f32) {
        let offset = (place - self.center) * (1.0 / self.radius);
        let [xx, xy, xz, yy, yz, zz] = self.bend;
        let Vec3 { x, y, z } = offset;
        let slope = Vec3::new(xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z);
        let up = self.axis.dot(offset);
        let height = (self.height + slope.dot(offset) - up) * self.radius;
        (height, 1.0 - (offset.length_squared() - up * up))
    }
}

/// Noise level, world units, for a place in view space, a k-radius and a point's index; and whether it is the known
/// noise of a depth camera.
type NoiseAt<'a> = dyn Fn(Vec3, f32, u32) -> (f32, bool) + Sync + 'a;

/// Demand for the sheets of a cell.
#[derive(Debug)]
struct SheetDemand {
    /// Number of asking surfels in the upper half, sum of their k-radii in the lower half.
    k_radii: AtomicU64,
    /// Smallest point index of the asking surfels. Noise may depend on the scan that a point belongs to.
    point: AtomicU32,
}

impl Default for SheetDemand {
    fn default() -> Self {
        Self { k_radii: AtomicU64::new(0), point: AtomicU32::new(u32::MAX) }
    }
}

/// The sheets of one level's cells, fitted on demand.
#[derive(Debug, Default)]
pub(super) struct Sheets {
    /// Level of the cells.
    pub(super) level: usize,
    stacks: Vec<CellSheets>,
    /// Whether each stack is fitted for this frame.
    fitted: Vec<bool>,
    asked: Vec<SheetDemand>,
}

impl Sheets {
    /// Discards the sheets of the last frame.
    pub(super) fn clear(&mut self, cells: &Cells) {
        let len = cells.levels.get(SHEET_LEVELS[0]).map_or(0, |level| level.columns * level.rows.len());
        fit(&mut self.stacks, len);
        self.fitted.clear();
        self.fitted.resize(len, false);
        self.asked.clear();
        self.asked.resize_with(len, SheetDemand::default);
    }

    /// Asks for sheets where a surfel is.
    #[inline(always)]
    pub(super) fn ask(&self, surfel: &Surfel, cells: &Cells, view: &View) {
        let Some(level) = cells.levels.get(self.level) else { return };
        let [column, row] = surfel.pixel_xy().map(|at| at / level.side_px);
        let asked = &self.asked[row * level.columns + column];
        let k_radius_px = surfel.k_radius / view.pixel_size(surfel.center[2]);
        let parts = (k_radius_px.min(MAX_SUMMED_K_RADIUS_PX) * K_RADIUS_PARTS_PER_PX) as u64;
        asked.k_radii.fetch_add(1 << 32 | parts, Ordering::Relaxed);
        asked.point.fetch_min(surfel.source, Ordering::Relaxed);
    }

    /// Fits the sheets that were asked for and are not fitted yet.
    pub(super) fn fit(&mut self, cells: &Cells, noise: &NoiseAt, view: &View, cancel: &Cancel<'_>) {
        let Some(level) = cells.levels.get(self.level) else { return };
        let Self { stacks, fitted, asked, .. } = self;
        let task = Task { cells, level, asked, noise, view };
        let rows = (stacks.par_chunks_mut(level.columns), fitted.par_chunks_mut(level.columns));
        // The vectors have room for the finer level.
        rows.into_par_iter().take(level.rows.len()).enumerate().for_each_init(
            Gathered::default,
            |gathered, (row, (stacks, fitted))| {
                if !cancel.is_given_up() {
                    fit_row(row, stacks, fitted, &task, gathered);
                }
            },
        );
    }
}

/// Input that all cells share.
#[derive(Clone, Copy)]
struct Task<'a> {
    cells: &'a Cells,
    level: &'a Level,
    asked: &'a [SheetDemand],
    noise: &'a NoiseAt<'a>,
    view: &'a View,
}

impl Task<'_> {
    /// Mean k-radius (pixels) and smallest point index of the surfels that ask for this cell or a neighbour.
    #[inline(always)]
    fn asked_around(&self, row: usize, column: usize) -> Option<(f32, u32)> {
        let level = self.level;
        let (mut sum, mut point) = (0, u32::MAX);
        for y in row.saturating_sub(1)..=(row + 1).min(level.rows.len() - 1) {
            for x in column.saturating_sub(1)..=(column + 1).min(level.columns - 1) {
                let asked = &self.asked[y * level.columns + x];
                sum += asked.k_radii.load(Ordering::Relaxed);
                point = point.min(asked.point.load(Ordering::Relaxed));
            }
        }
        let (count, parts) = (sum >> 32, sum & u64::from(u32::MAX));
        (count > 0).then(|| (parts as f32 / (count as f32 * K_RADIUS_PARTS_PER_PX), point))
    }
}

#[pulp::with_simd(fit_row = pulp::Arch::new())]
#[inline(always)]
fn fit_row_with<'a, S: Simd>(
    simd: S,
    row: usize,
    stacks: &'a mut [CellSheets],
    fitted: &'a mut [bool],
    task: &'a Task<'a>,
    gathered: &'a mut Gathered,
) {
    let level = task.level;
    for (column, (stack, fitted)) in stacks.iter_mut().zip(fitted).enumerate() {
        let cell = [column, row];
        if !*fitted
            && !level.is_empty(cell)
            && let Some(asked) = task.asked_around(row, column)
        {
            fit_cell(simd, stack, cell, asked, task, gathered);
            *fitted = true;
        }
    }
}

/// Fits sheets to a cell's clusters, largest first, until all are covered or [`SHEETS`] is reached.
#[inline(always)]
fn fit_cell<S: Simd>(
    simd: S,
    stack: &mut CellSheets,
    cell: [usize; 2],
    (k_radius_px, point): (f32, u32),
    task: &Task,
    gathered: &mut Gathered,
) {
    let Task { cells, level, noise, view, .. } = *task;
    let mut left = [Cluster { mean: [0.0; 3], count: 0.0 }; SLABS];
    left.iter_mut().zip(level.clusters(cell)).for_each(|(left, cluster)| *left = cluster);
    *stack = CellSheets::default();
    let mut len = 0;
    while len < SHEETS {
        let mut largest = 0;
        for index in 1..SLABS {
            if left[index].count > left[largest].count {
                largest = index;
            }
        }
        let Cluster { mean: center, ref mut count } = left[largest];
        if *count == 0.0 {
            return;
        }
        *count = 0.0;
        let radius = k_radius_px * view.pixel_size(center[2]);
        let (noise, known) = noise(center.into(), radius, point);
        let goal = Goal::new(noise, known, radius, center[2], view);
        let Some(quadric) = choose(simd, center, radius, None, &goal, (cells, view), gathered) else {
            continue;
        };
        let sheet = Sheet::new(center.into(), &quadric, noise);
        for Cluster { mean, count } in &mut left {
            if *count > 0.0 {
                let (height, near) = sheet.over((*mean).into());
                if height.abs() < COVERED_NOISES * noise && near > 1.0 - COVERED_REACH {
                    *count = 0.0;
                }
            }
        }
        stack.put(len, &sheet);
        len += 1;
    }
}
