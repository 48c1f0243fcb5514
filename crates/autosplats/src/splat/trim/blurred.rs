//! Borders that noise has blurred: the density of points decides where the surface ends.
//!
//! # How it works
//! Noise scatters points past the end of a surface. Most of their splats are moved back; the others draw a fringe as
//! wide as the noise. In the fringe points get fewer outwards, so their mean in a window lies towards the surface. Its
//! offset does not depend on the density. Let w be the deviation of the window and σ that of the noise. The offset is
//! 0.80 w²/√(w² + σ²) at the straight end of evenly scattered points. It is 0.48 w²/√(w² + σ²) where a surface curves
//! away, so that points get ever closer up to its end.
//!
//! The spread of the points tells the two kinds apart. Let density grow from the end inwards with power a - 1; a is 1
//! and 0.5 for the two kinds. Then the mean square of the places without noise is a (w² + σ²). The measure is the mean
//! less a quarter of the mean square, in these units: 0.55 and 0.35. Outlines come out smoother than by the mean alone.
//! Nearly all silhouettes curve away; straight ends are cut by about half of the noise too much.
//!
//! A pixel is beside the surface if this measure exceeds its limit away from the empty side, and an empty pixel lies
//! ahead. Only the offset in that direction counts, because another surface behind the border draws the mean along it.
//! Half way to the empty pixel the mean must be off as well. Otherwise a surface goes on there, and the points here are
//! denser on one side because another surface stands behind. All points count, hidden ones too. The points kept are the
//! nearest of each half of a pixel: too few where points are dense, but all of them in the fringe.
//!
//! Scanners err along their rays, while the noise left after fitting is across surfaces. So a border of a surface that
//! faces the eye, where scans end, counts as sharp. The whole noise counts only where a surface is seen from the side.
//! See docs/decisions/0003-borders-of-noise.md.

use std::f32::consts::PI;

use glam::Vec3;
use pulp::Simd;
use rayon::prelude::*;

use super::{EMPTY, Outline, Rim, SPLAT_WINDOW_PX};
use crate::adapt::Noise;
use crate::camera::View;
use crate::fit::SUPPORT;
use crate::project::{COUNTED_BLOCK_PX, OCCUPANCY_BLOCK_PX, Sixteenths};
use crate::splat::layers::PixelSurface;
use crate::splat::{TILE, Tiles};

/// Least noise in pixels that blurs a border. With less noise, detail of far views that passes for noise would be cut.
pub(in crate::splat) const MIN_BLURRING_NOISE_PX: f32 = 0.25;
/// Squared window radius per variance of its kernel, along one axis.
pub(in crate::splat) const WINDOW_PER_KERNEL_VARIANCE: f32 = 10.0;
/// Sine of a surface's tilt from the eye from which the whole noise counts. Below 1, because normals in a fringe lean
/// towards the eye.
pub(in crate::splat) const FULL_NOISE_SINE: f32 = 0.8;
/// Share of the noise that blurs a border. With the whole noise borders are too narrow by a few tenths of a pixel, and
/// slits open.
pub(in crate::splat) const BLURRING_NOISE_SHARE: f32 = 0.87;
/// Growth of the squared window radius per variance of the noise, both in square pixels.
pub(in crate::splat) const WINDOW_PER_NOISE_VARIANCE: f32 = 12.0;
/// Radius in pixels of the window without noise. Smaller windows hold so few points that borders come out ragged.
pub(in crate::splat) const MIN_WINDOW_PX: f32 = 4.0;
/// Largest radius of a window, in pixels.
pub(in crate::splat) const MAX_WINDOW_PX: f32 = 48.0;
/// Largest radius in pixels of windows that are summed pixel by pixel. Windows up to twice this are summed in pairs of
/// pixels along both axes, wider ones in blocks.
pub(in crate::splat) const MAX_PIXEL_WINDOW_PX: f32 = 8.0;
/// Weight of the mean square against the mean. A larger weight depends less on how a surface ends, and more on single
/// points where these are few.
pub(in crate::splat) const SPREAD_WEIGHT: f32 = 0.25;
/// Largest measure on a surface, in w²/√(w² + σ²): for little noise, and for certain noise. Little noise may be small
/// structure, so its limit is about that of sharp borders,
/// [`MAX_SPLAT_MEAN_OFFSET_PX`](super::MAX_SPLAT_MEAN_OFFSET_PX). The second limit holds from [`SURE_NOISE_PX`] or
/// [`SURE_NOISE_DISTANCES`] on; limits between are interpolated.
pub(in crate::splat) const MAX_BLURRED_OFFSET: [f32; 2] = [0.5, 0.335];
/// Noise in pixels from which the limit is that of certain noise.
pub(in crate::splat) const SURE_NOISE_PX: f32 = 0.8;
/// Noise from which the limit is that of certain noise, if the frame's noise is certain and this is less than
/// [`SURE_NOISE_PX`]. The unit is the mean distance of marked sixteenths in the window, its empty part included. At a
/// border that distance is √2 times as large as on the surface.
pub(in crate::splat) const SURE_NOISE_DISTANCES: f32 = 1.25;
/// Fewest marked sixteenths in a window whose moments decide.
pub(in crate::splat) const MIN_WINDOW_SIXTEENTHS: u32 = 12;
/// Width of a fringe in multiples of the noise, beside the reach of its splats.
pub(in crate::splat) const FRINGE_NOISES: f32 = 3.0;
/// Largest width of a fringe, in blocks.
pub(in crate::splat) const FRINGE_BLOCKS: usize = 16;
/// Share of the limit that the mean has to exceed half way to the empty pixel.
pub(in crate::splat) const HALF_WAY_OFFSET_SHARE: f32 = 0.7;
/// Distance beyond the fringe, in blocks, up to which empty blocks define the direction to the empty side.
pub(in crate::splat) const BLOCKS_BEYOND_FRINGE: f32 = 2.0;
/// Side of a block in pixels.
pub(in crate::splat) const BLOCK_PX: usize = COUNTED_BLOCK_PX;

const _: () = assert!(BLOCK_PX == 4, "pairs of pairs of pixels are blocks");
/// Blocks along the side of a tile.
const BLOCKS_PER_TILE: usize = TILE / BLOCK_PX;

/// Squares that are summed at a time. Sums are added in this many lanes on any machine, so results do not depend on the
/// machine.
const LANES: usize = 8;

/// Number of sixteenths that hold points (marked ones) in each square of a picture, row by row.
#[derive(Debug)]
struct SixteenthCounts {
    /// Side of a square in pixels.
    side: usize,
    columns: usize,
    rows: usize,
    /// Followed by [`LANES`] zeros, so that the last lanes may be read.
    count: Vec<u16>,
}

/// Noise of a frame, and density and emptiness of its picture.
#[derive(Debug)]
pub(in crate::splat) struct BlurredBorders {
    noise: Noise,
    /// K-radius per splat radius.
    per_radius: f32,
    /// Counts in single pixels, in pairs along both axes, and in blocks.
    held: [SixteenthCounts; 3],
    /// Distance of each block to the nearest empty one, in blocks, the larger along either axis. An empty block has no
    /// splats and, in the margin of the picture, no points either.
    to_empty: Vec<u8>,
}

impl BlurredBorders {
    /// State for a picture whose k-radii are `per_radius` splat radii; `None` without noise.
    pub(in crate::splat) fn new(
        noise: Noise,
        per_radius: f32,
        (rims, tiles): (&[Rim], &Tiles),
        sixteenths: &Sixteenths,
        view: &View,
    ) -> Option<Self> {
        if !(noise.level > 0.0) {
            return None;
        }
        let [width, height] = [view.width as usize, view.height as usize];
        let holds = |column: usize, row: usize| sixteenths.blocks().holds(column, row);
        let count = |x: usize, y: usize| sixteenths.of(y * width + x).count_ones() as u16;
        let pixels = SixteenthCounts::new([1, width, height], holds, count);
        let pairs = pixels.in_pairs(holds);
        let blocks = pairs.in_pairs(holds);
        let [columns, rows] = [blocks.columns, blocks.rows];
        // Most of the margin has no splats, although it may hold a surface.
        let goes_on = |[x, y]: [usize; 2]| {
            let [first, last] = [0, BLOCK_PX - 1].map(|more| [x, y].map(|at| at * BLOCK_PX + more));
            let is_beside = view.beside_picture(first) > 0 && view.beside_picture(last) > 0;
            is_beside && blocks.count[y * columns + x] > 0
        };
        // Distances along a row of blocks, tile by tile.
        let along_row = |y: usize, to_empty: &mut [u8]| {
            let pixel_rows = y * BLOCK_PX..((y + 1) * BLOCK_PX).min(height);
            for (tile, to_empty) in to_empty.chunks_mut(BLOCKS_PER_TILE).enumerate() {
                let (first, len) = (tile * TILE, TILE.min(width - tile * TILE));
                let mut covered = [false; TILE];
                for y in pixel_rows.clone() {
                    let rims = &rims[tiles.index([first, y])..][..len];
                    covered.iter_mut().zip(rims).for_each(|(covered, &rim)| *covered |= rim != EMPTY);
                }
                for (x, (to_empty, covered)) in to_empty.iter_mut().zip(covered.chunks(BLOCK_PX)).enumerate() {
                    let is_empty = covered == [false; BLOCK_PX] && !goes_on([tile * BLOCKS_PER_TILE + x, y]);
                    *to_empty = if is_empty { 0 } else { FRINGE_BLOCKS as u8 + 2 };
                }
            }
            (1..columns).for_each(|x| to_empty[x] = to_empty[x].min(to_empty[x - 1] + 1));
            (1..columns).rev().for_each(|x| to_empty[x - 1] = to_empty[x - 1].min(to_empty[x] + 1));
        };
        let mut to_empty = vec![0; columns * rows];
        to_empty.par_chunks_mut(columns).enumerate().for_each(|(y, row)| along_row(y, row));
        // Distances from row to row, across corners too: down, then up.
        let step = |from: &[u8], row: &mut [u8]| {
            let nearer = |(to_empty, from): (&mut u8, &u8)| *to_empty = (*to_empty).min(from + 1);
            row.iter_mut().zip(from).for_each(nearer);
            row.iter_mut().zip(&from[1..]).for_each(nearer);
            row[1..].iter_mut().zip(from).for_each(nearer);
        };
        for y in 1..rows {
            let (before, after) = to_empty.split_at_mut(y * columns);
            step(&before[(y - 1) * columns..], &mut after[..columns]);
        }
        for y in (1..rows).rev() {
            let (before, after) = to_empty.split_at_mut(y * columns);
            step(&after[..columns], &mut before[(y - 1) * columns..]);
        }
        Some(Self { noise, per_radius, held: [pixels, pairs, blocks], to_empty })
    }

    fn blocks(&self) -> &SixteenthCounts {
        &self.held[2]
    }

    /// The squares that a window of this radius is summed in.
    fn squares(&self, window: f32) -> &SixteenthCounts {
        let wider = [1.0, 2.0].map(|times| usize::from(window > times * MAX_PIXEL_WINDOW_PX));
        &self.held[wider[0] + wider[1]]
    }

    /// Distance of a block to the nearest empty one, in blocks; at most two more than a fringe has.
    pub(super) fn blocks_to_empty(&self, column: usize, row: usize) -> u8 {
        self.to_empty[row * self.blocks().columns + column]
    }

    /// Unit vector from the middle of pixel (x, y) to the empty blocks within `radius` pixels, weighted by nearness.
    /// `None` if there are none, or if they balance.
    pub(super) fn towards_empty(&self, [x, y]: [usize; 2], radius: f32) -> Option<[f32; 2]> {
        let reach = radius as usize;
        let along =
            |at: usize, most: usize| at.saturating_sub(reach) / BLOCK_PX..((at + reach) / BLOCK_PX + 1).min(most);
        let middle = |block: usize, at: usize| (BLOCK_PX * block) as f32 - at as f32 + 0.5 * (BLOCK_PX as f32 - 1.0);
        let per_radius = 1.0 / (radius * radius);
        let [mut right, mut down] = [0f32; 2];
        for row in along(y, self.blocks().rows) {
            for column in along(x, self.blocks().columns) {
                if self.blocks_to_empty(column, row) > 0 {
                    continue;
                }
                let (ox, oy) = (middle(column, x), middle(row, y));
                let near = (1.0 - (ox * ox + oy * oy) * per_radius).max(0.0);
                let weight = near * near * near;
                right += weight * ox;
                down += weight * oy;
            }
        }
        let length = (right * right + down * down).sqrt();
        (length > 0.0).then(|| [right / length, down / length])
    }
}

impl Outline<'_> {
    /// Whether pixel (x, y), covered by a splat of this reach, is beside a surface whose border noise has blurred.
    /// `None` if there is too little noise, too few points, or nothing empty within a fringe.
    pub(super) fn is_beside_blurred(&self, [x, y]: [usize; 2], shown: PixelSurface, reach_px: f32) -> Option<bool> {
        let blurred = self.blurred?;
        let BlurredBorders { noise, per_radius, .. } = blurred;
        let PixelSurface { depth, normal } = shown;
        let pixel = self.view.pixel_size(depth);
        // One more block, because blocks that a border crosses are not empty.
        let blocks = |fringe: f32| (fringe / BLOCK_PX as f32).ceil() as u8 + 1;
        let fringe_of = |noise_px: f32| (reach_px + FRINGE_NOISES * noise_px).min((BLOCK_PX * FRINGE_BLOCKS) as f32);
        let to_empty = blurred.blocks_to_empty(x / BLOCK_PX, y / BLOCK_PX);
        // Early exit: most pixels lie further inside than any noise is wide.
        let most_noise_px = noise.level / pixel;
        if !(most_noise_px >= MIN_BLURRING_NOISE_PX) || to_empty > blocks(fringe_of(most_noise_px)) {
            return None;
        }
        let radius_px = reach_px / SUPPORT;
        let to_eye = self.view.to_eye(self.view.unproject([x as f32 + 0.5, y as f32 + 0.5], depth));
        let facing = Vec3::from(normal).dot(to_eye) / to_eye.length();
        let aside = ((1.0 - facing * facing).max(0.0).sqrt() / FULL_NOISE_SINE).min(1.0);
        let noise_px = BLURRING_NOISE_SHARE * aside * noise.at(per_radius * radius_px * pixel) / pixel;
        if !(noise_px >= MIN_BLURRING_NOISE_PX) {
            return None;
        }
        let fringe = fringe_of(noise_px);
        if to_empty > blocks(fringe) {
            return None;
        }
        let [width, height] = self.size();
        // Points beyond the screen are unknown.
        let to_edge = x.min(y).min(width - 1 - x).min(height - 1 - y) as f32;
        let widest = MAX_WINDOW_PX.min(to_edge);
        let window =
            (MIN_WINDOW_PX * MIN_WINDOW_PX + WINDOW_PER_NOISE_VARIANCE * noise_px * noise_px).sqrt().min(widest);
        // A window narrower than splats would show the distances between points, or scan lines.
        if window < SPLAT_WINDOW_PX.max(radius_px) {
            return None;
        }
        let squares = blurred.squares(window);
        let here = moments(squares, [x, y], window)?;
        let blur = BlurVariances { window: window * window / WINDOW_PER_KERNEL_VARIANCE, noise: noise_px * noise_px };
        let apart = window * (PI / here.count).sqrt();
        let sure_px = SURE_NOISE_PX + noise.sure * ((SURE_NOISE_DISTANCES * apart).min(SURE_NOISE_PX) - SURE_NOISE_PX);
        let [unsure, sure] = MAX_BLURRED_OFFSET;
        let may_be = sure + (unsure - sure) * (1.0 - noise_px / sure_px).max(0.0);
        // An offset that is small in total is small in any direction.
        if blur.most_off(here) <= may_be {
            return Some(false);
        }
        let towards = blurred.towards_empty([x, y], fringe + BLOCKS_BEYOND_FRINGE * BLOCK_PX as f32)?;
        if blur.off(here, towards) <= may_be {
            return Some(false);
        }
        let ahead = |step: usize| {
            let at = [(x, towards[0]), (y, towards[1])].map(|(at, along)| at as f32 + 0.5 + along * step as f32);
            let [x, y] = at.map(|at| at.floor() as isize);
            let inside = (0..width as isize).contains(&x) && (0..height as isize).contains(&y);
            // Beyond the screen the surface goes on.
            inside.then_some([x as usize, y as usize])
        };
        let is_empty = |[x, y]: [usize; 2]| {
            self.rims[self.index([x, y])] == EMPTY
                && (self.view.beside_picture([x, y]) == 0 || blurred.blocks_to_empty(x / BLOCK_PX, y / BLOCK_PX) == 0)
        };
        let mut steps = (1..=fringe as usize + 1).map_while(|step| Some((step, ahead(step)?)));
        let Some((met, _)) = steps.find(|&(_, at)| is_empty(at)) else { return Some(false) };
        let Some([x, y]) = ahead(met / 2) else { return Some(true) };
        if (x.min(y).min(width - 1 - x).min(height - 1 - y) as f32) < window {
            return Some(true);
        }
        let goes_on = |half_way: Moments| blur.off(half_way, towards) <= HALF_WAY_OFFSET_SHARE * may_be;
        Some(!moments(squares, [x, y], window).is_some_and(goes_on))
    }
}

impl SixteenthCounts {
    /// Counts in the blocks of the screen, by column and row, that hold points. The others stay zero, untouched.
    fn new(
        [side, columns, rows]: [usize; 3],
        holds: impl Fn(usize, usize) -> bool + Sync,
        count: impl Fn(usize, usize) -> u16 + Sync,
    ) -> Self {
        let mut counts = vec![0; columns * rows + LANES];
        let per_block = OCCUPANCY_BLOCK_PX / side;
        counts.par_chunks_mut(columns).take(rows).enumerate().for_each(|(y, row)| {
            let blocks = row.chunks_mut(per_block).enumerate();
            for (column, block) in blocks.filter(|&(column, _)| holds(column, y / per_block)) {
                block.iter_mut().enumerate().for_each(|(x, held)| *held = count(column * per_block + x, y));
            }
        });
        Self { side, columns, rows, count: counts }
    }

    /// The same counts in squares twice as wide.
    fn in_pairs(&self, holds: impl Fn(usize, usize) -> bool + Sync) -> Self {
        let size = [2 * self.side, self.columns.div_ceil(2), self.rows.div_ceil(2)];
        Self::new(size, holds, |x, y| {
            let [columns, rows] = [(x, self.columns), (y, self.rows)].map(|(at, most)| 2 * at..(2 * at + 2).min(most));
            rows.flat_map(|y| &self.count[y * self.columns..][columns.clone()]).sum()
        })
    }
}

/// Variances, in square pixels, of the window and of the noise.
#[derive(Clone, Copy, Debug)]
struct BlurVariances {
    window: f32,
    noise: f32,
}

impl BlurVariances {
    /// Unit of the measure, w²/√(w² + σ²), in pixels.
    fn unit(self) -> f32 {
        self.window / (self.window + self.noise).sqrt()
    }

    /// Upper bound of [`off`](Self::off): the whole mean offset counts as away from the empty side, and the spread does
    /// not count.
    fn most_off(self, Moments { offset: [x, y], .. }: Moments) -> f32 {
        (x * x + y * y).sqrt() / self.unit()
    }

    /// Measure of a window: the mean offset away from `towards`, a unit vector, less a share of the mean square along
    /// it. The mean square is capped at that of a straight end, because further out it grows faster than the mean.
    fn off(self, Moments { offset, squares: [xx, xy, yy], .. }: Moments, [x, y]: [f32; 2]) -> f32 {
        let mean = -(offset[0] * x + offset[1] * y) / self.unit();
        let square = xx * x * x + 2.0 * xy * x * y + yy * y * y;
        // Variance that noise adds to the places of points in the window.
        let of_noise = self.window * self.noise / (self.window + self.noise);
        mean - SPREAD_WEIGHT * ((square - of_noise) / (self.unit() * self.unit())).clamp(0.0, 1.0)
    }
}

/// Moments of the marked sixteenths around a pixel.
#[derive(Clone, Copy, Debug)]
struct Moments {
    /// Mean offset from the pixel's middle, in pixels.
    offset: [f32; 2],
    /// Mean squares in square pixels: xx, xy, yy.
    squares: [f32; 3],
    count: f32,
}

/// The moments in a window of this radius around the middle of pixel (x, y), which lies within the screen. `None` if
/// there are too few marked sixteenths.
#[pulp::with_simd(moments = pulp::Arch::new())]
#[inline(always)]
fn moments_with<S: Simd>(_: S, squares: &SixteenthCounts, [x, y]: [usize; 2], window: f32) -> Option<Moments> {
    let reach = window as usize;
    // Offset in pixels of the first square's middle from the pixel's, then the range of squares.
    let along = |at: usize, most: usize| {
        let first = (at - reach) / squares.side;
        let middle = (squares.side * first) as f32 - at as f32 + 0.5 * (squares.side as f32 - 1.0);
        (middle, first, ((at + reach) / squares.side).min(most - 1) + 1)
    };
    let ((left, x0, x1), (top, y0, y1)) = (along(x, squares.columns), along(y, squares.rows));
    let side = squares.side as f32;
    let per_window = 1.0 / (window * window);
    let lanes: [f32; LANES] = std::array::from_fn(|lane| side * lane as f32);
    let [mut count, mut weight, mut right, mut down, mut xx, mut xy, mut yy] = [[0f32; LANES]; 7];
    for row in y0..y1 {
        let oy = top + side * (row - y0) as f32;
        for (first, column) in (x0..x1).step_by(LANES).enumerate() {
            let first = left + side * (LANES * first) as f32;
            let counts: &[u16; LANES] =
                squares.count[row * squares.columns + column..].first_chunk().expect("some after the last");
            for lane in 0..LANES {
                // Nothing counts beyond the window or the row. There 1 - r² is clamped to 0; inside it is at least
                // 2⁻²⁴.
                let ox = first + lanes[lane];
                let near = (1.0 - (ox * ox + oy * oy) * per_window).max(0.0);
                let held = f32::from(counts[lane]);
                let of_lane = held * (near * near * near);
                count[lane] += held * (near * (1 << 24) as f32).min(1.0);
                weight[lane] += of_lane;
                right[lane] += of_lane * ox;
                down[lane] += of_lane * oy;
                xx[lane] += of_lane * (ox * ox);
                xy[lane] += of_lane * (ox * oy);
                yy[lane] += of_lane * (oy * oy);
            }
        }
    }
    let sum = |lanes: [f32; LANES]| lanes.iter().sum::<f32>();
    let [count, weight] = [count, weight].map(sum);
    let of_weight = |lanes: [f32; LANES]| sum(lanes) / weight;
    (count >= MIN_WINDOW_SIXTEENTHS as f32).then(|| Moments {
        offset: [right, down].map(of_weight),
        squares: [xx, xy, yy].map(of_weight),
        count,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_clouds::Random;

    /// The measure with the spread, and without, at the slanted end of a surface in the middle of a picture. Density
    /// grows with this power of the distance from the end; noise is in pixels.
    fn off_at_end(power: f32, noise_px: f32) -> [f32; 2] {
        let [width, height] = [256, 256];
        let ([x, y], window) = ([128, 128], (16.0 + WINDOW_PER_NOISE_VARIANCE * noise_px * noise_px).sqrt());
        let (sin, cos) = 0.4f32.sin_cos();
        let mut random = Random::new(91);
        let mut counts = vec![0; width * height];
        for _ in 0..400_000 {
            let inside = 100.0 * random.unit().powf(1.0 / (1.0 + power));
            let [along, across] = [180.0 * (random.unit() - 0.5), inside].map(|at| at + noise_px * random.gaussian());
            let place = [128.5 + cos * along + sin * across, 128.5 - sin * along + cos * across];
            if let [Some(column), Some(row)] = place.map(|at| (0.0..256.0).contains(&at).then_some(at as usize)) {
                counts[row * width + column] += 1;
            }
        }
        let all = |_, _| true;
        let pixels = SixteenthCounts::new([1, width, height], all, |x, y| counts[y * width + x]);
        let pairs = pixels.in_pairs(all);
        let blur = BlurVariances { window: window * window / WINDOW_PER_KERNEL_VARIANCE, noise: noise_px * noise_px };
        let [pixels, pairs] =
            [pixels, pairs].map(|squares| moments(&squares, [x, y], window).expect("there are thousands"));
        let off = blur.off(pixels, [-sin, -cos]);
        let differs = (blur.off(pairs, [-sin, -cos]) - off).abs();
        assert!(window < MAX_PIXEL_WINDOW_PX || differs < 0.03, "in pairs of pixels it differs by {differs}");
        [off, blur.most_off(pixels)]
    }

    #[test]
    fn at_an_end_points_are_as_far_off_whatever_the_noise() {
        for noise_px in [0.0, 1.5, 4.0] {
            let [straight, curved] = [0.0, -0.5].map(|power| off_at_end(power, noise_px));
            for ([off, most], [expected_off, expected_most]) in [(straight, [0.55, 0.80]), (curved, [0.353, 0.478])] {
                let what =
                    format!("noise of {noise_px} pixels: {off} and {most}, not {expected_off} and {expected_most}");
                // The tolerance covers the finite kernel and the width of pixels.
                assert!((off - expected_off).abs() < 0.05 && (most - expected_most).abs() < 0.05, "{what}");
            }
        }
    }

    #[test]
    fn pairs_hold_what_their_pixels_do() {
        let mut random = Random::new(92);
        for [width, height] in [[1, 1], [2, 3], [7, 4], [5, 9]] {
            let counts: Vec<_> = (0..width * height).map(|_| random.below(17) as u16).collect();
            let all = |_, _| true;
            let pairs = SixteenthCounts::new([1, width, height], all, |x, y| counts[y * width + x]).in_pairs(all);
            assert_eq!([pairs.side, pairs.columns, pairs.rows], [2, width.div_ceil(2), height.div_ceil(2)]);
            for (x, y) in (0..pairs.columns).flat_map(|x| (0..pairs.rows).map(move |y| (x, y))) {
                let inside = |&at: &usize| at % width / 2 == x && at / width / 2 == y;
                let expected: u16 = (0..width * height).filter(inside).map(|at| counts[at]).sum();
                assert_eq!(pairs.count[y * pairs.columns + x], expected, "{width}x{height}: {x}, {y}");
            }
        }
    }
}
