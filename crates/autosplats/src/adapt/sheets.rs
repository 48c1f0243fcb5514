//! Quadrics that surfels share: some for each cell, a fifth as many as there are surfels, each of which blends several.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use glam::Vec3;
use pulp::Simd;
use rayon::prelude::*;

use super::cells::{Cell, Cells, Level, SLABS};
use super::cpu::{AGREE, FARTHEST, Goal, choose};
use super::quadric::{Gathered, tangents};
use crate::camera::View;
use crate::fit::Surfel;

/// Levels of the cells that may have sheets. Their width is about two distances between points, that of the smallest balls
/// three; or twice as much.
pub(super) const SHEET_LEVELS: [usize; 2] = [1, 2];
/// A cluster within this many times the noise of a sheet needs none of its own,
pub(super) const COVERED: f32 = 2.0;
/// if it is no further from the sheet's centre than this part of its squared radius: at a grazing angle a cell
/// is a long strip of surface. The wider, the worse normals are along silhouettes.
pub(super) const COVERED_REACH: f32 = 0.12;
/// K-radii are summed up in these parts of a pixel, as integers, so that their order does not matter.
pub(super) const PARTS: f32 = 64.0;
/// Larger k-radii, in pixels, count as this: of the nine cells of 32 pixels that are summed up, with two points in each pixel,
/// that is below 2³².
pub(super) const MOST_PX: f32 = 2048.0;

/// An upright quadric over the balls that it was fitted to.
#[derive(Clone, Copy, Debug, Default)]
struct Sheet {
    center: Vec3,
    /// Of the quadric.
    radius: f32,
    /// Unit normal at the centre, and direction of the heights.
    axis: Vec3,
    /// At the centre; radii, as `bend`.
    height: f32,
    bend: [f32; 3],
    /// Standard error of its normal, radians.
    error: f32,
    curvature: f32,
    /// Standard deviation of points from it, world units.
    scatter: f32,
    /// How much it counts beside others, by its error and its scatter.
    trust: f32,
}

/// Where a place is over a sheet.
struct Over {
    u: Vec3,
    v: Vec3,
    /// Along `u` and `v`, in radii.
    x: f32,
    y: f32,
    /// Of the sheet above the place, along its axis; world units.
    height: f32,
    /// 1 above the ball's centre, 0 at its border, negative beyond.
    near: f32,
}

impl Sheet {
    #[inline(always)]
    fn under(&self, place: Vec3) -> Over {
        let (u, v) = tangents(self.axis);
        let offset = (place - self.center) * (1.0 / self.radius);
        let (x, y) = (u.dot(offset), v.dot(offset));
        let [xx, xy, yy] = self.bend;
        let height = self.height + x * (xx * x + xy * y) + y * (yy * y);
        let height = (height - self.axis.dot(offset)) * self.radius;
        Over { u, v, x, y, height, near: 1.0 - (x * x + y * y) }
    }

    /// Unit normal.
    #[inline(always)]
    fn normal(&self, over: &Over) -> Vec3 {
        let &Over { u, v, x, y, .. } = over;
        let [xx, xy, yy] = self.bend;
        let slope_x = 2.0 * xx * x + xy * y;
        let slope_y = 2.0 * yy * y + xy * x;
        (self.axis - u * slope_x - v * slope_y).normalize()
    }
}

/// The surface beside a surfel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surface {
    /// From the surfel to the surface.
    pub(super) offset: Vec3,
    /// Unit normal, of either sign.
    pub(super) normal: Vec3,
    pub(super) curvature: f32,
}

/// What the sheets around a surfel say.
#[derive(Clone, Copy, Debug)]
pub(super) enum Blend {
    Surface(Surface),
    /// There are some, but each is unlike the surfel's first normal or scatters too much: it is at an edge, or of detail finer than
    /// sheets.
    Disagrees,
    /// There are none.
    Nothing,
}

/// Noise at a place in view space, of a cloud's point with a k-radius, world units, and whether it is known as that of a depth
/// camera.
type NoiseAt<'a> = dyn Fn(Vec3, f32, u32) -> (f32, bool) + Sync + 'a;

/// Sheets of a cell.
type Stack = [Sheet; SLABS];

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
    /// Of each stack; [`UNKNOWN`] before anyone has asked.
    len: Vec<u8>,
    asked: Vec<Asked>,
}

const UNKNOWN: u8 = u8::MAX;

impl Sheets {
    /// Forgets those of the frame before.
    pub(super) fn clear(&mut self, cells: &Cells) {
        let len = cells.levels.get(SHEET_LEVELS[0]).map_or(0, |level| level.cells.len());
        self.stacks.resize(len, Stack::default());
        self.len.clear();
        self.len.resize(len, UNKNOWN);
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
        let Self { stacks, len, asked, .. } = self;
        let task = Task { cells, level, asked, noise, view };
        let rows = (stacks.par_chunks_mut(level.columns), len.par_chunks_mut(level.columns));
        // There is room for finer ones.
        rows.into_par_iter().take(level.rows).enumerate().for_each_init(
            Gathered::default,
            |gathered, (row, (stacks, len))| {
                fit_row(row, stacks, len, &task, gathered);
            },
        );
    }

    /// The surface beside `center`, from the sheets of the four cells around it that agree with the `first` normal, where
    /// its standard error is known.
    #[inline(always)]
    pub(super) fn blend(
        &self,
        center: [f32; 3],
        first: Option<(Vec3, f32)>,
        goal: &Goal,
        cells: &Cells,
        view: &View,
    ) -> Blend {
        let Some(level) = cells.levels.get(self.level) else { return Blend::Nothing };
        let per_side = 1.0 / level.side_px as f32;
        let [x, y] = view.to_pixel(center.into()).map(|at| at * per_side - 0.5);
        // Casts from float saturate at 0.
        let [x0, y0] = [x, y].map(|at| at.floor() as usize);
        let x1 = ((x + 1.0) as usize).min(level.columns - 1);
        let y1 = ((y + 1.0) as usize).min(level.rows - 1);
        let center = Vec3::from(center);
        let per_farthest = 1.0 / (FARTHEST * goal.noise);
        let mut sum = Surface { offset: Vec3::ZERO, normal: Vec3::ZERO, curvature: 0.0 };
        let mut total = 0.0;
        let mut disagrees = false;
        for row in y0..=y1 {
            for column in x0..=x1 {
                let cell = row * level.columns + column;
                let len = self.len[cell];
                if len == UNKNOWN {
                    continue;
                }
                // Falls to 0 where the next cells come in.
                let share = (1.0 - (x - column as f32).abs()) * (1.0 - (y - row as f32).abs());
                for sheet in &self.stacks[cell][..len.into()] {
                    let over = sheet.under(center);
                    let away = over.height * per_farthest;
                    let likely = 1.0 - away * away;
                    if !((over.near > 0.0) & (likely > 0.0)) {
                        continue;
                    }
                    let normal = sheet.normal(&over);
                    if let Some((first, error)) = first {
                        let across = normal.cross(first).length_squared();
                        // The smallest of a sheet's balls was held against nothing.
                        let agrees = across <= AGREE * AGREE * (sheet.error * sheet.error + error * error);
                        if !(agrees & (sheet.scatter <= goal.scatter)) {
                            disagrees = true;
                            continue;
                        }
                    }
                    // To the eighth: about as likely as noise puts a point there.
                    let likely = likely * likely;
                    let likely = likely * likely;
                    let likely = likely * likely;
                    let weight = share * (over.near * over.near) * likely * sheet.trust;
                    sum.normal += normal * if normal.dot(sum.normal) < 0.0 { -weight } else { weight };
                    sum.offset += sheet.axis * (over.height * weight);
                    sum.curvature += sheet.curvature * weight;
                    total += weight;
                }
            }
        }
        if !(total > 0.0) {
            return if disagrees { Blend::Disagrees } else { Blend::Nothing };
        }
        let per_total = 1.0 / total;
        Blend::Surface(Surface {
            offset: sum.offset * per_total,
            normal: sum.normal.normalize(),
            curvature: sum.curvature * per_total,
        })
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
        for y in row.saturating_sub(1)..=(row + 1).min(level.rows - 1) {
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
    len: &'a mut [u8],
    task: &'a Task<'a>,
    gathered: &'a mut Gathered,
) {
    let level = task.level;
    for (column, cell) in level.cells[row * level.columns..][..level.columns].iter().enumerate() {
        if len[column] == UNKNOWN
            && cell.count[0] > 0.0
            && let Some(asked) = task.asked_around(row, column)
        {
            len[column] = fit_cell(simd, &mut stacks[column], cell, asked, task, gathered);
        }
    }
}

/// Fits sheets to a cell's clusters, largest first, until each has one or is near one; returns their number.
#[inline(always)]
fn fit_cell<S: Simd>(
    simd: S,
    sheets: &mut Stack,
    cell: &Cell,
    (k_radius_px, point): (f32, u32),
    task: &Task,
    gathered: &mut Gathered,
) -> u8 {
    let Task { cells, noise, view, .. } = *task;
    let mut left = cell.count;
    let mut len = 0;
    loop {
        let mut largest = 0;
        for index in 1..SLABS {
            if left[index] > left[largest] {
                largest = index;
            }
        }
        if left[largest] == 0.0 {
            return len;
        }
        left[largest] = 0.0;
        let center = cell.mean.map(|of| of[largest]);
        let radius = k_radius_px * view.pixel_size(center[2]);
        let (noise, known) = noise(center.into(), radius, point);
        let goal = Goal::new(noise, known, radius, center[2], view);
        let Some(quadric) = choose(simd, center, radius, None, &goal, (cells, view), gathered) else {
            continue;
        };
        let error = quadric.error * noise;
        // Points of two surfaces scatter more than noise does.
        let beyond = (quadric.scatter / noise).max(1.0);
        let sheet = Sheet {
            center: center.into(),
            radius: quadric.radius,
            axis: quadric.axis,
            height: quadric.height / quadric.radius,
            bend: quadric.bend,
            error,
            curvature: quadric.curvature,
            scatter: quadric.scatter,
            // One over the error's power of three quarters.
            trust: 1.0 / (error.sqrt() * error.sqrt().sqrt() * (beyond * beyond * beyond)),
        };
        for (left, cluster) in left.iter_mut().zip(cell.clusters()) {
            if *left > 0.0 {
                let over = sheet.under(cluster.mean.into());
                if over.height.abs() < COVERED * noise && over.near > 1.0 - COVERED_REACH {
                    *left = 0.0;
                }
            }
        }
        sheets[usize::from(len)] = sheet;
        len += 1;
    }
}
