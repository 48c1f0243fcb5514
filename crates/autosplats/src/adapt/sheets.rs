//! Quadrics that surfels share: some for each cell, a fifth as many as there are surfels, each of which blends several.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use glam::Vec3;
use pulp::Simd;
use rayon::prelude::*;

use self::blend::Stack;
pub(super) use self::blend::{Around, Blend, Surface};
use super::cells::{Cells, Cluster, Level, SLABS};
use super::cpu::{Goal, choose};
use super::quadric::{Gathered, Quadric, tangents};
use crate::camera::View;
use crate::fit::Surfel;

mod blend;
#[cfg(test)]
mod tests;

/// Levels of the cells that may have sheets. Their width is about two distances between points, that of the smallest balls
/// three; or twice as much.
pub(super) const SHEET_LEVELS: [usize; 2] = [1, 2];
/// A cluster within this many times the noise of a sheet needs none of its own,
pub(super) const COVERED: f32 = 2.0;
/// if it is no further from the sheet's centre than this part of its squared radius: at a grazing angle a cell
/// is a long strip of surface. The wider, the worse normals are along silhouettes.
pub(super) const COVERED_REACH: f32 = 0.12;
/// Most sheets of a cell.
pub(crate) const SHEETS: usize = 4;
/// K-radii are summed up in these parts of a pixel, as integers, so that their order does not matter.
pub(super) const PARTS: f32 = 64.0;
/// Larger k-radii, in pixels, count as this: of the nine cells of 32 pixels that are summed up, with two points in each pixel,
/// that is below 2³².
pub(super) const MOST_PX: f32 = 2048.0;

/// An upright quadric over the balls that it was fitted to.
#[derive(Clone, Copy, Debug)]
struct Sheet {
    center: Vec3,
    /// Of the quadric.
    radius: f32,
    /// Unit normal at the centre, and direction of the heights.
    axis: Vec3,
    /// At the centre; radii, as `bend`.
    height: f32,
    /// Heights by the square of an offset, as a symmetric matrix, xx, xy, xz, yy, yz and zz; of the axis it makes 0. The device has
    /// its three coefficients along tangents, which is the same but for rounding.
    bend: [f32; 6],
    /// Standard error of its normal, radians.
    error: f32,
    curvature: f32,
    /// Standard deviation of points from it, world units.
    scatter: f32,
    /// How much it counts beside others, by its error and its scatter.
    trust: f32,
}

impl Sheet {
    fn new(center: Vec3, quadric: &Quadric, noise: f32) -> Self {
        let &Quadric { radius, axis, height, bend: [uu, uv, vv], curvature, scatter, .. } = quadric;
        let (u, v) = tangents(axis);
        // Each term of the sum counts twice off the diagonal.
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
            // One over the error's power of three quarters.
            trust: 1.0 / (error.sqrt() * error.sqrt().sqrt() * (beyond * beyond * beyond)),
        }
    }

    /// How far the sheet is above a place, along its axis, world units, and how near the place is to the ball's axis: 1 on it, 0 at
    /// the border, negative beyond.
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

/// Noise at a place in view space, of a cloud's point with a k-radius, world units, and whether it is known as that of a depth
/// camera.
type NoiseAt<'a> = dyn Fn(Vec3, f32, u32) -> (f32, bool) + Sync + 'a;

/// Who asks for the sheets of a cell.
#[derive(Debug)]
struct Asked {
    /// How many surfels, in the upper half, and the sum of their k-radii.
    k_radii: AtomicU64,
    /// The first of their points: noise may depend on the scan that points belong to.
    point: AtomicU32,
}

impl Default for Asked {
    fn default() -> Self {
        Self { k_radii: AtomicU64::new(0), point: AtomicU32::new(u32::MAX) }
    }
}

/// The sheets of all cells of a level that surfels ask for.
#[derive(Debug, Default)]
pub(super) struct Sheets {
    /// Of the cells.
    pub(super) level: usize,
    stacks: Vec<Stack>,
    /// Whether each stack is of this frame: nobody may have asked for it.
    fitted: Vec<bool>,
    asked: Vec<Asked>,
}

impl Sheets {
    /// Forgets those of the frame before.
    pub(super) fn clear(&mut self, cells: &Cells) {
        let len = cells.levels.get(SHEET_LEVELS[0]).map_or(0, |level| level.columns * level.rows.len());
        self.stacks.resize(len, Stack::default());
        self.fitted.clear();
        self.fitted.resize(len, false);
        self.asked.clear();
        self.asked.resize_with(len, Asked::default);
    }

    /// Asks for sheets where a surfel is.
    #[inline(always)]
    pub(super) fn ask(&self, surfel: &Surfel, cells: &Cells, view: &View) {
        let Some(level) = cells.levels.get(self.level) else { return };
        let [column, row] = surfel.pixel_xy().map(|at| at / level.side_px);
        let asked = &self.asked[row * level.columns + column];
        let k_radius_px = surfel.k_radius / view.pixel_size(surfel.center[2]);
        let parts = (k_radius_px.min(MOST_PX) * PARTS) as u64;
        asked.k_radii.fetch_add(1 << 32 | parts, Ordering::Relaxed);
        asked.point.fetch_min(surfel.source, Ordering::Relaxed);
    }

    /// Fits those that were asked for and are not there yet.
    pub(super) fn fit(&mut self, cells: &Cells, noise: &NoiseAt, view: &View) {
        let Some(level) = cells.levels.get(self.level) else { return };
        let Self { stacks, fitted, asked, .. } = self;
        let task = Task { cells, level, asked, noise, view };
        let rows = (stacks.par_chunks_mut(level.columns), fitted.par_chunks_mut(level.columns));
        // There is room for finer ones.
        rows.into_par_iter().take(level.rows.len()).enumerate().for_each_init(
            Gathered::default,
            |gathered, (row, (stacks, fitted))| {
                fit_row(row, stacks, fitted, &task, gathered);
            },
        );
    }
}

/// What all cells share.
#[derive(Clone, Copy)]
struct Task<'a> {
    cells: &'a Cells,
    level: &'a Level,
    asked: &'a [Asked],
    noise: &'a NoiseAt<'a>,
    view: &'a View,
}

impl Task<'_> {
    /// Mean k-radius, pixels, of the surfels that ask for a cell or one beside it, which may blend its sheets, and the first
    /// of their points.
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
        (count > 0).then(|| (parts as f32 / (count as f32 * PARTS), point))
    }
}

#[pulp::with_simd(fit_row = pulp::Arch::new())]
#[inline(always)]
fn fit_row_with<'a, S: Simd>(
    simd: S,
    row: usize,
    stacks: &'a mut [Stack],
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

/// Fits sheets to a cell's clusters, largest first, until each has one or is near one, or there are as many as a cell may have.
#[inline(always)]
fn fit_cell<S: Simd>(
    simd: S,
    stack: &mut Stack,
    cell: [usize; 2],
    (k_radius_px, point): (f32, u32),
    task: &Task,
    gathered: &mut Gathered,
) {
    let Task { cells, level, noise, view, .. } = *task;
    let mut left = [Cluster { mean: [0.0; 3], count: 0.0 }; SLABS];
    left.iter_mut().zip(level.clusters(cell)).for_each(|(left, cluster)| *left = cluster);
    *stack = Stack::default();
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
                if height.abs() < COVERED * noise && near > 1.0 - COVERED_REACH {
                    *count = 0.0;
                }
            }
        }
        stack.put(len, &sheet);
        len += 1;
    }
}
