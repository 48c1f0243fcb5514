//! Projection on the CPU.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use glam::Vec3;
use rayon::iter::Either;
use rayon::prelude::*;

pub(super) use super::blocks::OCCUPANCY_BLOCK_PX;
use super::near::{NearCells, cell, clamped_pixel, first_octave};
use super::sixteenths::{Sixteenths, half, sixteenth, sixteenths_at};
use super::{Blocks, Dropped, ProjectRules, ScreenCells, ScreenPoint, ScreenPoints, SlotTable};
use crate::camera::View;
use crate::cancel::Cancel;
use crate::points::Points;
use crate::room::{fit, fit_atomic};

/// Points projected per task.
const TASK_POINTS: usize = 16 * 1024;
/// Points transformed at a time.
const LANES: usize = 16;
/// Key of a slot that no point falls into. New memory is zero, and need not be touched where no points are.
const EMPTY_KEY: u64 = 0;
/// Height of a strip in mean distances between screen points. Sixteen points of a strip then find their ten nearest
/// neighbours among about a hundred candidates, in this strip and the ones above and below.
pub(super) const STRIP_SPACINGS: f32 = 3.0;
/// Largest depth, in widths of a pixel, of the second point of a pixel behind the first: a surface seen at 83° from
/// its normal. A point further behind belongs to another surface, which is usually hidden.
// Differs from the paper: the paper keeps the nearest point of each pixel only.
pub(super) const MAX_SECOND_DEPTH_PX: f32 = 8.0;

/// Projects clouds. All buffers but the two lists `active` and `passive` are reused from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct Projector {
    /// Key of the nearest point per pixel or half pixel. All are empty between frames.
    keys: Vec<AtomicU64>,
    near: NearCells,
    screen: ScreenPoints,
}

impl Projector {
    /// The screen points of the last projection.
    pub(crate) fn screen(&self) -> &ScreenPoints {
        &self.screen
    }

    /// Projects points, whose indices are below 2³² - 1, for `view`.
    pub(crate) fn project<'a>(
        &mut self,
        points: impl Into<Points<'a>>,
        view: &View,
        rules: &ProjectRules,
        cancel: &Cancel<'_>,
    ) -> &ScreenPoints {
        let ProjectRules { k, halves, near: lists_near, .. } = *rules;
        let Self { keys, near, screen } = self;
        let points = SlotTable::new(points.into(), view);
        near.clear(view);
        let found = (lists_near && view.perspective).then_some(&*near);
        screen.dropped = nearest_per_pixel(&points, view, halves, keys, &mut screen.sixteenths, found, cancel);
        let keys = Keys::settle(keys, screen.sixteenths.blocks(), view, halves);
        let spacing_px = keys.mean_spacing();
        compact(&points, view, &keys, spacing_px, screen);
        near.list(&points, view, k);
        append_near(&points, view, near, screen);
        measure_density(screen, view, spacing_px, k);
        split(rules, view, screen);
        screen
    }
}

/// The keys of each pixel, in one slot or two, and the points per block. Empty blocks, often the most, are skipped.
struct Keys<'a> {
    slots: &'a [AtomicU64],
    per_pixel: usize,
    /// Width of the screen in pixels.
    width: usize,
    /// Points in each block of [`OCCUPANCY_BLOCK_PX`] × [`OCCUPANCY_BLOCK_PX`] pixels.
    occupied: Vec<u32>,
}

impl<'a> Keys<'a> {
    /// Empties the slots of points far behind the other point of their pixel, and counts the rest per block.
    fn settle(slots: &'a mut [AtomicU64], blocks: &Blocks, view: &View, halves: bool) -> Self {
        let per_pixel = 1 + usize::from(halves);
        let width = view.width as usize;
        let mut occupied =
            vec![0; width.div_ceil(OCCUPANCY_BLOCK_PX) * (view.height as usize).div_ceil(OCCUPANCY_BLOCK_PX)];
        let block_rows = slots.par_chunks_mut(OCCUPANCY_BLOCK_PX * width * per_pixel);
        let block_rows = block_rows.zip(occupied.par_chunks_mut(width.div_ceil(OCCUPANCY_BLOCK_PX)));
        block_rows.enumerate().for_each(|(block_row, (rows, occupied))| {
            for row in rows.chunks_mut(width * per_pixel) {
                let parts = row.chunks_mut(OCCUPANCY_BLOCK_PX * per_pixel).zip(&mut *occupied).enumerate();
                for (_, (block, count)) in parts.filter(|&(column, _)| blocks.holds(column, block_row)) {
                    if halves {
                        block.chunks_exact_mut(2).for_each(|pair| erase_far_second(pair, view));
                    }
                    *count += block.iter().map(|key| u32::from(is_owned(key))).sum::<u32>();
                }
            }
        });
        Self { slots, per_pixel, width, occupied }
    }

    /// Blocks in a row of blocks.
    fn columns(&self) -> usize {
        self.width.div_ceil(OCCUPANCY_BLOCK_PX)
    }

    /// Whether the block in column `column` that contains pixel row `y` holds a point.
    fn is_occupied(&self, column: usize, y: usize) -> bool {
        self.occupied[y / OCCUPANCY_BLOCK_PX * self.columns() + column] > 0
    }

    /// Pixel columns of a column of blocks.
    fn columns_px(&self, column: usize) -> Range<usize> {
        column * OCCUPANCY_BLOCK_PX..((column + 1) * OCCUPANCY_BLOCK_PX).min(self.width)
    }

    /// The slots of pixel (x, y).
    fn at(&self, x: usize, y: usize) -> &'a [AtomicU64] {
        &self.slots[(y * self.width + x) * self.per_pixel..][..self.per_pixel]
    }

    /// Mean distance in pixels between screen points, over blocks that hold any.
    // Differs from the paper: the paper divides by the whole screen, and its cells are too large for a small object.
    fn mean_spacing(&self) -> f32 {
        let blocks = self.occupied.iter().filter(|&&points| points > 0).count();
        let points = self.occupied.iter().sum::<u32>();
        ((blocks * OCCUPANCY_BLOCK_PX * OCCUPANCY_BLOCK_PX) as f32 / points.max(1) as f32).sqrt()
    }
}

/// Fills `keys`, which are empty, with the nearest point of each pixel or half pixel, and `sixteenths` with all points.
fn nearest_per_pixel(
    points: &SlotTable<'_>,
    view: &View,
    halves: bool,
    keys: &mut Vec<AtomicU64>,
    sixteenths: &mut Sixteenths,
    near: Option<&NearCells>,
    cancel: &Cancel<'_>,
) -> Dropped {
    let pixels = view.width as usize * view.height as usize;
    fit_atomic(keys, pixels << u32::from(halves));
    let keys = keys.as_slice();
    sixteenths.clear(view);
    let sixteenths = &*sixteenths;
    let [not_finite, behind, outside] = [(); 3].map(|()| AtomicUsize::new(0));
    points.pieces(view, TASK_POINTS).for_each(|(ordinal, positions, view)| {
        if cancel.is_given_up() {
            return;
        }
        let dropped = match near {
            Some(near) => project_chunk::<true>(positions, ordinal, &view, halves, keys, sixteenths, near),
            None => project_chunk::<false>(positions, ordinal, &view, halves, keys, sixteenths, &NearCells::default()),
        };
        not_finite.fetch_add(dropped.not_finite, Ordering::Relaxed);
        behind.fetch_add(dropped.behind, Ordering::Relaxed);
        outside.fetch_add(dropped.outside, Ordering::Relaxed);
    });
    let [not_finite, behind, outside] = [not_finite, behind, outside].map(AtomicUsize::into_inner);
    Dropped { not_finite, behind, outside }
}

/// Values in place of a slot index for points that own no slot.
const NOT_FINITE: u32 = u32::MAX;
const BEHIND: u32 = u32::MAX - 1;
const OUTSIDE: u32 = u32::MAX - 2;

/// Projects up to [`TASK_POINTS`] points, of which the first has `ordinal`, and counts them in the cells around the eye
/// if `NEAR`. Compiled for the baseline processor: wider vectors make projection slower.
fn project_chunk<const NEAR: bool>(
    positions: &[[f32; 3]],
    ordinal: u32,
    view: &View,
    halves: bool,
    keys: &[AtomicU64],
    sixteenths: &Sixteenths,
    near: &NearCells,
) -> Dropped {
    let mut dropped = Dropped::default();
    let [mut x, mut y, mut z] = [[0f32; LANES]; 3];
    let [mut slot, mut part, mut around] = [[0u32; LANES]; 3];
    for (group, positions) in positions.chunks(LANES).enumerate() {
        if let Ok(positions) = <&[[f32; 3]; LANES]>::try_from(positions) {
            for lane in 0..LANES {
                ([x[lane], y[lane], z[lane]], slot[lane], part[lane]) = project_point(positions[lane], view, halves);
            }
        } else {
            for (lane, &position) in positions.iter().enumerate() {
                ([x[lane], y[lane], z[lane]], slot[lane], part[lane]) = project_point(position, view, halves);
            }
        }
        if NEAR {
            // In a loop of its own: one loop for all needs more vectors than there are registers.
            let first_octave = first_octave(view.near);
            for lane in 0..LANES {
                around[lane] = cell([x[lane], y[lane], z[lane]], first_octave);
            }
        }
        // Load all lanes first: plain loads wait for memory together, while atomic writes keep later loads waiting.
        let mut before = [0u64; LANES];
        let mut held = [0u16; LANES];
        for lane in 0..positions.len() {
            if slot[lane] < OUTSIDE {
                before[lane] = keys[slot[lane] as usize].load(Ordering::Relaxed);
                held[lane] = sixteenths.of((slot[lane] >> u32::from(halves)) as usize);
            }
        }
        for lane in 0..positions.len() {
            if NEAR && slot[lane] != NOT_FINITE {
                near.add(around[lane], ordinal + (group * LANES + lane) as u32);
            }
            match slot[lane] {
                NOT_FINITE => dropped.not_finite += 1,
                BEHIND => dropped.behind += 1,
                OUTSIDE => dropped.outside += 1,
                slot => {
                    let ordinal = ordinal + (group * LANES + lane) as u32;
                    let key = key(z[lane], ordinal);
                    // Most points lose in a marked sixteenth: without a write they take no cache line from other
                    // threads.
                    if key > before[lane] {
                        keys[slot as usize].fetch_max(key, Ordering::Relaxed);
                    }
                    if before[lane] == EMPTY_KEY {
                        sixteenths.blocks.hold(slot >> u32::from(halves));
                    }
                    if held[lane] >> part[lane] & 1 == 0 {
                        sixteenths.add(slot >> u32::from(halves), part[lane]);
                    }
                }
            }
        }
    }
    dropped
}

/// Position of a point in view space, its slot and its sixteenth within the pixel, without branches.
#[inline(always)]
fn project_point(position: [f32; 3], view: &View, halves: bool) -> ([f32; 3], u32, u32) {
    let [x, y, z] = view.to_view(position).to_array();
    let [px, py] = view.to_pixel(Vec3::new(x, y, z));
    // Inside the image coordinates are positive, so truncation rounds down.
    let inside = (px >= 0.0) & (py >= 0.0) & (px < view.width as f32) & (py < view.height as f32);
    let [x4, y4] = sixteenths_at([px, py]);
    let [column, row] = [x4 >> 2, y4 >> 2];
    let pixel = row.wrapping_mul(view.width).wrapping_add(column);
    let slot = if halves { half(pixel, [x4, y4]) } else { pixel };
    let slot = if inside { slot } else { OUTSIDE };
    let slot = if z > view.near { slot } else { BEHIND };
    // Finite coordinates count as not finite too if their transform overflows.
    #[allow(clippy::eq_op, reason = "three subtractions vectorise, is_finite does not")]
    let finite = (x - x == 0.0) & (y - y == 0.0) & (z - z == 0.0);
    ([x, y, z], if finite { slot } else { NOT_FINITE }, sixteenth([x4, y4]))
}

fn is_owned(key: &AtomicU64) -> bool {
    key.load(Ordering::Relaxed) != EMPTY_KEY
}

/// Key of a point, larger for nearer points, then for earlier ones. The bits of positive floats order like the floats.
#[inline(always)]
fn key(depth: f32, ordinal: u32) -> u64 {
    !(u64::from(depth.to_bits()) << 32 | u64::from(ordinal))
}

/// Depth and ordinal of a point from its key.
fn point_of(key: u64) -> (f32, u32) {
    (f32::from_bits((!key >> 32) as u32), !key as u32)
}

/// Empties the slot of a pixel's farther point if it lies far behind the nearer.
#[inline(always)]
fn erase_far_second(pair: &mut [AtomicU64], view: &View) {
    let [one, other] = [0, 1].map(|half| *pair[half].get_mut());
    let [near, far] = [one.max(other), one.min(other)];
    let ((near, _), (depth, _)) = (point_of(near), point_of(far));
    if far != EMPTY_KEY && depth > near + MAX_SECOND_DEPTH_PX * view.pixel_size(near) {
        *pair[usize::from(other == far)].get_mut() = EMPTY_KEY;
    }
}

/// Lists the owners of slots in cell order, and empties the slots.
fn compact(cloud: &SlotTable<'_>, view: &View, keys: &Keys, spacing_px: f32, screen: &mut ScreenPoints) {
    let [width, height] = [view.width as usize, view.height as usize];
    let strip_px = ((STRIP_SPACINGS * spacing_px).round() as usize).clamp(1, 256);
    let strips = height.div_ceil(strip_px);
    let ScreenPoints { points, source, cells, .. } = screen;
    *cells = ScreenCells { strip_px, columns: width, start: std::mem::take(&mut cells.start) };
    cells.start.resize(strips * width + 1, 0);

    // Count the points of each cell first, then sum the counts into the starts of cells.
    let strip_rows = |strip: usize| strip * strip_px..height.min((strip + 1) * strip_px);
    let strip_len: Vec<u32> = cells.start[..strips * width]
        .par_chunks_mut(width)
        .enumerate()
        .map(|(strip, start)| {
            start.fill(0);
            for y in strip_rows(strip) {
                for column in (0..keys.columns()).filter(|&column| keys.is_occupied(column, y)) {
                    for x in keys.columns_px(column) {
                        start[x] += keys.at(x, y).iter().map(|key| u32::from(is_owned(key))).sum::<u32>();
                    }
                }
            }
            let mut sum = 0;
            for count in start {
                sum += std::mem::replace(count, sum);
            }
            sum
        })
        .collect();
    let total = strip_len.iter().sum::<u32>() as usize;
    fit(points, total);
    fit(source, total);
    cells.start[strips * width] = total as u32;

    let mut first = 0;
    let mut tasks = Vec::with_capacity(strips);
    let (mut points, mut source) = (points.as_mut_slice(), source.as_mut_slice());
    for (strip, start) in cells.start[..strips * width].chunks_mut(width).enumerate() {
        let len = strip_len[strip] as usize;
        let strip_points = points.split_off_mut(..len).unwrap_or_default();
        let strip_source = source.split_off_mut(..len).unwrap_or_default();
        tasks.push((strip, first, start, strip_points, strip_source));
        first += len as u32;
    }
    tasks.into_par_iter().for_each(|(strip, first, start, points, source)| {
        start.iter_mut().for_each(|cell| *cell += first);
        let mut next = 0;
        let rows = strip_rows(strip);
        // Visit one pixel row per block that the strip meets: every sixteenth, and the last.
        let is_occupied = |&column: &usize| {
            rows.clone().step_by(OCCUPANCY_BLOCK_PX).chain([rows.end - 1]).any(|y| keys.is_occupied(column, y))
        };
        for x in (0..keys.columns()).filter(is_occupied).flat_map(|column| keys.columns_px(column)) {
            for (y, key) in rows.clone().flat_map(|y| keys.at(x, y).iter().map(move |key| (y, key))) {
                let (_, ordinal) = point_of(key.load(Ordering::Relaxed));
                if is_owned(key) {
                    points[next].pixel = (y << 16 | x) as u32;
                    source[next] = cloud.names.index(ordinal);
                    key.store(EMPTY_KEY, Ordering::Relaxed);
                    next += 1;
                }
            }
        }
        // A separate loop without branches lets reads of scattered positions wait for memory together.
        for (point, &index) in points.iter_mut().zip(&*source) {
            point.position_view = cloud.to_view(index, view).to_array();
        }
    });
}

/// Appends the points of sparse cells. Near points among the screen points become silent, as do those appended that are
/// not near.
fn append_near(cloud: &SlotTable<'_>, view: &View, near: &NearCells, screen: &mut ScreenPoints) {
    let ScreenPoints { points, source, near_first, .. } = screen;
    *near_first = points.len();
    if near.listed.is_empty() {
        return;
    }
    points.par_iter_mut().filter(|point| near.is_near(point.position_view)).for_each(|point| {
        point.pixel |= ScreenPoint::SILENT;
    });
    source.extend(&near.listed);
    points.extend(near.listed.iter().map(|&index| {
        let position_view = cloud.to_view(index, view).to_array();
        let silent = if near.is_near(position_view) { 0 } else { ScreenPoint::SILENT };
        ScreenPoint { position_view, pixel: clamped_pixel(position_view, view) | ScreenPoint::NEAR | silent }
    }));
}

/// Counts the screen points and finds the nearest depth of each cell of about `k` points.
fn measure_density(screen: &mut ScreenPoints, view: &View, spacing_px: f32, k: u32) {
    let ScreenPoints { points, cells, density, .. } = screen;
    let [width, height] = [view.width as usize, view.height as usize];
    let cell_px = ((spacing_px * (k as f32).sqrt()).round() as usize).max(2);
    let columns = width.div_ceil(cell_px);
    let len = columns * height.div_ceil(cell_px);
    density.cell_px = cell_px;
    density.columns = columns;
    density.count.resize(len, 0);
    density.nearest.resize(len, f32::INFINITY);
    let rows = density.count.par_chunks_mut(columns).zip(density.nearest.par_chunks_mut(columns));
    rows.enumerate().for_each(|(row, (count, nearest))| {
        count.fill(0);
        nearest.fill(f32::INFINITY);
        let rows = row * cell_px..height.min((row + 1) * cell_px);
        for strip in rows.start / cells.strip_px..=(rows.end - 1) / cells.strip_px {
            for point in &points[cells.run(strip, 0, width - 1)] {
                let [x, y] = point.pixel_xy();
                if rows.contains(&y) {
                    count[x / cell_px] += 1;
                    nearest[x / cell_px] = nearest[x / cell_px].min(point.position_view[2]);
                }
            }
        }
    });
    let cell_px = cell_px as f32;
    density.culling.clear();
    density.culling.extend(density.nearest.iter().map(|&depth| depth + cell_px * view.pixel_size(depth)));
}

/// Splits the screen points into active and passive. Passive are points behind the culling plane of their cell [Paper,
/// §7, Grid Culling] and points too far beside the picture.
fn split(&ProjectRules { k, grid_culling, .. }: &ProjectRules, view: &View, screen: &mut ScreenPoints) {
    let ScreenPoints { points, density, active, passive, .. } = screen;
    (*active, *passive) = (0..points.len() as u32).into_par_iter().partition_map(|index| {
        let point = &points[index as usize];
        let is_passive = grid_culling & density.culls(point) || !density.matters(point, k, view);
        if is_passive { Either::Right(index) } else { Either::Left(index) }
    });
}
