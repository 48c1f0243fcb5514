//! Drawing splats into one tile, a SIMD vector of pixels at a time.

use pulp::Simd;

use super::attributes::{Attributes, CHANNELS, TileSums};
use super::bins::Run;
use super::setup::{DOT_RADIUS_PX, Splat};
use super::{TILE, TILE_AREA};
use crate::camera::View;
use crate::fit::Surfel;
use crate::simd::F32s;

/// A tile of the screen.
#[derive(Clone, Copy)]
pub(super) struct Tile {
    pub(super) index: usize,
    /// Its upper left pixel.
    pub(super) origin: [usize; 2],
}

/// Slope of the [`kernel`].
pub(super) const KERNEL_SLOPE: f32 = 0.52;

/// Splats whose attributes are read at a time.
const BATCH: usize = 32;

/// Offsets of the pixels of a vector from its first pixel.
const LANE_OFFSETS: [f32; 16] = [0., 1., 2., 3., 4., 5., 6., 7., 8., 9., 10., 11., 12., 13., 14., 15.];

/// Draws the depth, pushed back by ε, of the living splats of `run` that touch `tile` [Paper, §7].
pub(super) fn draw_depth(run: &Run, tile: Tile, view: &View, depth: &mut [f32]) {
    if !run.tile(tile.index).is_empty() {
        draw_depth_entries(run, tile, view, depth);
    }
}

#[pulp::with_simd(draw_depth_entries = pulp::Arch::new())]
#[inline(always)]
fn draw_depth_entries_with<'a, S: Simd>(simd: S, run: &'a Run, tile: Tile, view: &'a View, depth: &'a mut [f32]) {
    let (one, beyond) = (F32s::splat(simd, 1.0), F32s::splat(simd, f32::INFINITY));
    for splat in run.living(tile.index).map(|index| &run.splats[index]) {
        let brush = Brush::new(simd, splat, view);
        let epsilon = F32s::splat(simd, splat.epsilon);
        for Row { y, x, end, dx, dy } in rows(splat, tile, S::F32_LANES) {
            let row = &mut depth[y * TILE..][..TILE];
            let brush = brush.row(dy);
            let mut dx = F32s::splat(simd, dx) + F32s::load(simd, &LANE_OFFSETS, 0);
            for vector in x..end {
                let fragment = brush.fragment(dx);
                let pushed = fragment.depth + epsilon;
                let before = F32s::load(simd, row, vector);
                // A minimum with infinity. A select between old and new values would compile to a masked store, which
                // is slow on many processors.
                fragment.squared.at_most(one).select(pushed, beyond).min(before).store(row, vector);
                dx += F32s::splat(simd, S::F32_LANES as f32);
            }
        }
    }
}

/// Adds the attributes of the living splats of `run` that touch `tile`, wherever they lie within ε of the depth map.
pub(super) fn draw_attributes(
    run: &Run,
    surfels: &[Surfel],
    tile: Tile,
    view: &View,
    depth: &[f32],
    attributes: &Attributes<'_>,
    sums: &mut TileSums,
) {
    if !run.tile(tile.index).is_empty() {
        draw_attribute_entries(run, surfels, tile, view, depth, attributes, sums);
    }
}

#[allow(clippy::too_many_arguments, reason = "the vectors' type is one of them, the dispatch knows no methods")]
#[pulp::with_simd(draw_attribute_entries = pulp::Arch::new())]
#[inline(always)]
fn draw_attribute_entries_with<'a, S: Simd>(
    simd: S,
    run: &'a Run,
    surfels: &'a [Surfel],
    tile: Tile,
    view: &'a View,
    depth: &'a [f32],
    attributes: &'a Attributes<'a>,
    sums: &'a mut TileSums,
) {
    let one = F32s::splat(simd, 1.0);
    let channels = attributes.channels();
    let mut values = [[0f32; CHANNELS]; BATCH];
    for batch in run.tile(tile.index).chunks(BATCH) {
        let is_living = |index: u32| run.alive[index as usize];
        let surfel = |index: u32| &surfels[run.first + index as usize];
        // Surfels lie scattered in memory: the reads of several are awaited together.
        for (values, &index) in values.iter_mut().zip(batch).filter(|(_, index)| is_living(**index)) {
            attributes.values(surfel(index), values);
        }
        for (values, &index) in values.iter().zip(batch).filter(|(_, index)| is_living(**index)) {
            let (splat, surfel) = (&run.splats[index as usize], surfel(index));
            let brush = Brush::new(simd, splat, view);
            for Row { y, x, end, dx, dy } in rows(splat, tile, S::F32_LANES) {
                let row = y * TILE..(y + 1) * TILE;
                let brush = brush.row(dy);
                let mut dx = F32s::splat(simd, dx) + F32s::load(simd, &LANE_OFFSETS, 0);
                for vector in x..end {
                    let fragment = brush.fragment(dx);
                    dx += F32s::splat(simd, S::F32_LANES as f32);
                    let limit = F32s::load(simd, &depth[row.clone()], vector);
                    let visible = fragment.squared.at_most(one).and(fragment.depth.at_most(limit));
                    if !visible.any() {
                        continue;
                    }
                    let weight = visible.keep(kernel(simd, fragment.squared));
                    add(simd, &mut sums.weight[row.clone()], vector, weight);
                    add(simd, &mut sums.depth[row.clone()], vector, weight * fragment.depth);
                    for (channel, &value) in sums.channels.chunks_exact_mut(TILE_AREA).zip(&values[..channels]) {
                        add(simd, &mut channel[row.clone()], vector, weight * F32s::splat(simd, value));
                    }
                    // All are read before any is written, or the select would become a masked store here too.
                    let before = F32s::load(simd, &sums.heaviest[row.clone()], vector);
                    let point = F32s::load(simd, &sums.point[row.clone()], vector);
                    let reach = F32s::load(simd, &sums.reach[row.clone()], vector);
                    let heavier = before.less(weight);
                    before.max(weight).store(&mut sums.heaviest[row.clone()], vector);
                    // Point indices are carried as the bits of floats.
                    let source = F32s::splat(simd, f32::from_bits(surfel.source));
                    heavier.select(source, point).store(&mut sums.point[row.clone()], vector);
                    let own = F32s::splat(simd, splat.reach_px());
                    heavier.select(own, reach).store(&mut sums.reach[row.clone()], vector);
                }
            }
        }
    }
}

#[inline(always)]
fn add<S: Simd>(simd: S, sums: &mut [f32], vector: usize, value: F32s<S>) {
    (F32s::load(simd, sums, vector) + value).store(sums, vector);
}

/// Weight of a fragment by its squared distance from the centre in supports, 0 to 1. The weight is much like exp(-2·d²)
/// with d in splat radii, but without an exponential, and 0.003 at the end.
#[inline(always)]
fn kernel<S: Simd>(simd: S, squared: F32s<S>) -> F32s<S> {
    let w = F32s::splat(simd, 1.0) - F32s::splat(simd, KERNEL_SLOPE) * squared;
    let w = w * w;
    let w = w * w;
    w * w
}

/// One row of the pixels that a splat may cover in a tile.
struct Row {
    /// Row in the tile.
    y: usize,
    /// First vector of pixels in the row, and the end.
    x: usize,
    end: usize,
    /// Offset in pixels from the splat's centre to the centre of the first vector's first pixel.
    dx: f32,
    dy: f32,
}

#[inline(always)]
fn rows(splat: &Splat, tile: Tile, width: usize) -> impl Iterator<Item = Row> + use<> {
    let [x_tile, y_tile] = tile.origin;
    let clip = |[first, last]: [u16; 2], tile: usize| {
        [(first as usize).max(tile) - tile, (last as usize).min(tile + TILE - 1) - tile]
    };
    let [x0, x1] = clip(splat.x, x_tile);
    let [y0, y1] = clip(splat.y, y_tile);
    let [x, end] = [x0 / width, x1 / width + 1];
    let [cx, cy] = splat.center_px;
    let dx = (x_tile + x * width) as f32 + 0.5 - cx;
    (y0..=y1).map(move |y| Row { y, x, end, dx, dy: (y_tile + y) as f32 + 0.5 - cy })
}

/// Gradients of a splat as vectors.
#[derive(Clone, Copy)]
struct Brush<S: Simd> {
    simd: S,
    perspective: bool,
    /// Range of the disc's depth.
    low: F32s<S>,
    high: F32s<S>,
    /// Inverse depth (perspective) or depth in the current row: at the centre's column, and per column.
    plane: Linear<S>,
    u: Linear<S>,
    v: Linear<S>,
    /// Squared distance of the row from the centre, in square pixels.
    dy_squared: F32s<S>,
    splat: Splat,
}

#[derive(Clone, Copy)]
struct Linear<S: Simd> {
    start: F32s<S>,
    per_x: F32s<S>,
}

impl<S: Simd> Linear<S> {
    #[inline(always)]
    fn at(&self, dx: F32s<S>) -> F32s<S> {
        self.start + self.per_x * dx
    }
}

/// A vector of pixels of a splat.
struct Fragment<S: Simd> {
    /// Squared distance from the centre, in supports or dot radii, whichever is less; the splat covers up to 1.
    squared: F32s<S>,
    /// Depth along the viewing axis.
    depth: F32s<S>,
}

impl<S: Simd> Brush<S> {
    #[inline(always)]
    fn new(simd: S, splat: &Splat, view: &View) -> Self {
        let splat_of = |value: f32| F32s::splat(simd, value);
        let linear = |gradient: [f32; 2]| Linear { start: splat_of(0.0), per_x: splat_of(gradient[0]) };
        Self {
            simd,
            perspective: view.perspective,
            low: splat_of(splat.depth - splat.depth_reach),
            high: splat_of(splat.depth + splat.depth_reach),
            plane: linear(splat.plane),
            u: linear(splat.u),
            v: linear(splat.v),
            dy_squared: splat_of(0.0),
            splat: *splat,
        }
    }

    /// The brush for the row `dy` below the centre.
    #[inline(always)]
    fn row(mut self, dy: f32) -> Self {
        let Splat { depth, plane, u, v, .. } = self.splat;
        let center = if self.perspective { 1.0 / depth } else { depth };
        self.plane.start = F32s::splat(self.simd, center + plane[1] * dy);
        self.u.start = F32s::splat(self.simd, u[1] * dy);
        self.v.start = F32s::splat(self.simd, v[1] * dy);
        self.dy_squared = F32s::splat(self.simd, dy * dy);
        self
    }

    /// The pixels `dx` right of the centre.
    #[inline(always)]
    fn fragment(&self, dx: F32s<S>) -> Fragment<S> {
        let simd = self.simd;
        let plane = self.plane.at(dx);
        let [mut u, mut v] = [self.u.at(dx), self.v.at(dx)];
        let mut hit = plane;
        if self.perspective {
            hit = F32s::splat(simd, 1.0) / plane;
            u = u * hit;
            v = v * hit;
        }
        let per_dot = F32s::splat(simd, 1.0 / (DOT_RADIUS_PX * DOT_RADIUS_PX));
        let dot = (dx * dx + self.dy_squared) * per_dot;
        // The dot reaches beyond the disc, where the disc's plane is meaningless, so depth is clamped to the disc's
        // range.
        let mut squared = (u * u + v * v).min(dot);
        if self.perspective {
            // The disc's plane is hit behind the eye.
            squared = plane.less(F32s::splat(simd, 0.0)).select(dot, squared);
        }
        Fragment { squared, depth: hit.max(self.low).min(self.high) }
    }
}
#[cfg(test)]
mod tests {
    use super::super::attributes::PointColors;
    use super::super::tests::{ALL_DISCS, Data, surfels, views};
    use super::*;

    #[test]
    fn vectors_of_any_width_give_the_same_bits() {
        let data = Data::new(500);
        let color = PointColors { srgb: &data.colors, linear: &data.linear };
        let attributes = Attributes { color: Some(color), scalar: None, measures: true, backs: true };
        for view in views([70, 50]) {
            for discs in ALL_DISCS {
                let surfels = surfels(35, 400, discs, &view);
                let mut run = Run::default();
                run.set_up(0, &surfels, &view);
                for tile in [Tile { index: 0, origin: [0, 0] }, Tile { index: 1, origin: [TILE, 0] }] {
                    let mut depth = vec![f32::INFINITY; TILE_AREA];
                    let mut scalar_depth = depth.clone();
                    draw_depth(&run, tile, &view, &mut depth);
                    draw_depth_entries_with(pulp::Scalar, &run, tile, &view, &mut scalar_depth);
                    // Wide vectors reach beyond the picture.
                    let seen = |&i: &usize| tile.origin[0] + i % TILE < view.width as usize;
                    let seen: Vec<usize> = (0..TILE_AREA).filter(seen).collect();
                    let same = seen.iter().all(|&i| depth[i].to_bits() == scalar_depth[i].to_bits());
                    assert!(same, "{discs:?}: depth map of tile {}", tile.index);

                    let (mut sums, mut scalar) = (TileSums::default(), TileSums::default());
                    sums.clear(&attributes);
                    scalar.clear(&attributes);
                    draw_attributes(&run, &surfels, tile, &view, &depth, &attributes, &mut sums);
                    draw_attribute_entries_with(
                        pulp::Scalar,
                        &run,
                        &surfels,
                        tile,
                        &view,
                        &depth,
                        &attributes,
                        &mut scalar,
                    );
                    let bits = |sums: &TileSums| -> Vec<u32> {
                        let all = [&sums.weight, &sums.depth, &sums.channels, &sums.heaviest, &sums.point];
                        let tiles = all.into_iter().flat_map(|sums| sums.chunks_exact(TILE_AREA));
                        tiles.flat_map(|tile| seen.iter().map(|&i| tile[i].to_bits())).collect()
                    };
                    assert!(bits(&sums) == bits(&scalar), "{discs:?}: sums of tile {}", tile.index);
                }
            }
        }
    }
}
