//! Borders that noise has blurred: surfaces end by the density of points there.
//!
//! # How it works
//! Noise strews points past the end of a surface, and what splats draw there, though most are moved back, is a fringe as wide as
//! the noise. Around a place in it points are the fewer the further out they are, and their mean in a window lies on the side of
//! the surface. How far does not depend on how dense points are: with a window of deviation w and noise of deviation σ, it is
//! 0.80 w²/√(w² + σ²) at the straight end of points strewn evenly, and 0.48 w²/√(w² + σ²) where a surface curves away, so that
//! points lie ever closer up to its end. Their spread tells more: where density grows from the end inwards with power a - 1, the
//! mean square of what their places would be without noise is a (w² + σ²), which makes 1 and 0.5. So what counts is the mean less a
//! quarter of the mean square, 0.55 and 0.35 at the two ends: outlines come out smoother by it than by the mean alone. Silhouettes
//! are nearly always of the second kind; straight ends are cut off by half of the noise too much.
//!
//! What is off by more, away from where it is empty, and has something empty ahead there, is beside the surface. Only how far it is
//! off that way counts: another surface behind the border draws the mean along it. And half way to what is empty the mean has to be
//! off as well: if not, a surface goes on there, and here it is where another stands behind it that points are dense on one side.
//! All points tell, hidden ones too: those kept are the nearest of each half of a pixel, fewer than there are where they are dense,
//! and all there are in the fringe.
//!
//! Scanners err along their rays, and what is left over of fits is across surfaces. So the border of a surface that faces the eye,
//! where scans end, is taken for as sharp as it is seen, and all of the noise counts only where a surface is seen from the side.

use std::f32::consts::PI;

use glam::Vec3;
use pulp::Simd;
use rayon::prelude::*;

use super::{AROUND_PX, EMPTY, Outline, Rim, Shown};
use crate::adapt::Noise;
use crate::camera::View;
use crate::fit::SUPPORT;
use crate::project::Sixteenths;
use crate::splat::{TILE, tiled_index};

/// Least noise, in pixels, that blurs a border: with less, detail of far views that was taken for noise would be cut.
pub(in crate::splat) const LEAST_NOISE_PX: f32 = 0.25;
/// Squared radius of a window over the variance of its kernel, along one axis.
pub(in crate::splat) const PER_VARIANCE: f32 = 10.0;
/// All of the noise counts where the sine of a surface's tilt from the eye is at least this: in a fringe normals lean towards the
/// eye.
pub(in crate::splat) const TILTED: f32 = 0.8;
/// Of the noise, what blurs a border. With all of it borders come out too narrow by a few tenths of a pixel, and slits open.
pub(in crate::splat) const BLURS: f32 = 0.87;
/// Squared radius of a window over the variance of the noise, but for what it is without noise.
pub(in crate::splat) const PER_NOISE: f32 = 12.0;
/// Radius of the window without noise, in pixels: smaller ones hold so few points that borders come out ragged.
pub(in crate::splat) const LEAST_RADIUS_PX: f32 = 4.0;
/// And of the widest one.
pub(in crate::splat) const WIDEST_RADIUS_PX: f32 = 48.0;
/// Windows with a larger radius than this, in pixels, are summed up in pairs of pixels along both axes, and those larger than twice
/// this in blocks.
pub(in crate::splat) const FINE_RADIUS_PX: f32 = 8.0;
/// How much of the mean square counts against the mean. More would make less of how a surface ends, and more of single points where
/// these are few.
pub(in crate::splat) const SPREAD: f32 = 0.25;
/// Of what that makes, how much there may be: with hardly any noise, which may as well be small structure, as much as at sharp
/// borders, where the mean may be off by [`OFF_PX`](super::OFF_PX), and with noise of [`SURE_NOISE_PX`] and more, or
/// [`SURE_DISTANCES`].
pub(in crate::splat) const OFF_BLURRED: [f32; 2] = [0.5, 0.335];
/// In pixels.
pub(in crate::splat) const SURE_NOISE_PX: f32 = 0.8;
/// If it is sure to be noise, less is enough: as much as this many mean distances of the sixteenths with points in the window, what
/// is empty of it included. At a border those are √2 times as far apart as on the surface.
pub(in crate::splat) const SURE_DISTANCES: f32 = 1.25;
/// From how many sixteenths with points on they tell.
pub(in crate::splat) const FEWEST_BLURRED: u32 = 12;
/// A fringe is no wider than the reach of its splats and this many times the noise,
pub(in crate::splat) const FRINGE_NOISES: f32 = 3.0;
/// nor than so many blocks.
pub(crate) const FRINGE_BLOCKS: usize = 16;
/// How far it is off at least half way to what is empty, as a part of that.
pub(in crate::splat) const OFF_HALF_WAY: f32 = 0.7;
/// Blocks that are empty, up to so many beyond the fringe, tell where it is empty.
pub(in crate::splat) const BEYOND_FRINGE: f32 = 2.0;
/// Side of a block in pixels.
pub(crate) const BLOCK_PX: usize = 4;

const _: () = assert!(BLOCK_PX == 4, "pairs of pairs of pixels are blocks");
/// Along an axis.
const BLOCKS_PER_TILE: usize = TILE / BLOCK_PX;

/// Squares that are summed up at a time; their sums are added up in this many parts on any machine.
const LANES: usize = 8;

/// How many sixteenths hold points in each square of a picture, row by row.
#[derive(Debug)]
struct Held {
    /// Side of a square in pixels.
    side: usize,
    columns: usize,
    rows: usize,
    /// And nothing after the last, so that the last lanes may be read.
    count: Vec<u16>,
}

/// The noise of a frame's points, and what is known of its picture.
#[derive(Debug)]
pub(in crate::splat) struct Blurred {
    noise: Noise,
    /// K-radii in splat radii.
    per_radius: f32,
    /// Of pixels, of pairs of them along both axes, and of blocks.
    held: [Held; 3],
    /// Of each block, how many blocks away the nearest is that is empty, along either axis: without splats and, beside the
    /// picture, without points.
    to_empty: Vec<u8>,
}

impl Blurred {
    /// Of a picture of points whose k-radii are `per_radius` splat radii; `None` if there is no noise.
    pub(in crate::splat) fn new(
        noise: Noise,
        per_radius: f32,
        rims: &[Rim],
        sixteenths: &Sixteenths,
        view: &View,
    ) -> Option<Self> {
        if !(noise.level > 0.0) {
            return None;
        }
        let [width, height] = [view.width as usize, view.height as usize];
        let pixels = Held::new([1, width, height], |x, y| sixteenths.of(y * width + x).count_ones() as u16);
        let pairs = pixels.in_pairs();
        let blocks = pairs.in_pairs();
        let [columns, rows] = [blocks.columns, blocks.rows];
        // Most of the margin has no splats, and may hold a surface.
        let goes_on = |[x, y]: [usize; 2]| {
            let [first, last] = [0, BLOCK_PX - 1].map(|more| [x, y].map(|at| at * BLOCK_PX + more));
            let is_beside = view.beside_picture(first) > 0 && view.beside_picture(last) > 0;
            is_beside && blocks.count[y * columns + x] > 0
        };
        // Along a row of blocks, tile by tile.
        let along_row = |y: usize, to_empty: &mut [u8]| {
            let pixel_rows = y * BLOCK_PX..((y + 1) * BLOCK_PX).min(height);
            for (tile, to_empty) in to_empty.chunks_mut(BLOCKS_PER_TILE).enumerate() {
                let (first, len) = (tile * TILE, TILE.min(width - tile * TILE));
                let mut covered = [false; TILE];
                for y in pixel_rows.clone() {
                    let rims = &rims[tiled_index(width, first, y)..][..len];
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
        // Then from row to row, across corners as well: down, and back.
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

    fn blocks(&self) -> &Held {
        &self.held[2]
    }

    /// The squares that a window of such a radius is summed up in.
    fn squares(&self, window: f32) -> &Held {
        let wider = [1.0, 2.0].map(|times| usize::from(window > times * FINE_RADIUS_PX));
        &self.held[wider[0] + wider[1]]
    }

    /// How many blocks the nearest empty one is from a block, at most two more than a fringe has.
    pub(super) fn blocks_to_empty(&self, column: usize, row: usize) -> u8 {
        self.to_empty[row * self.blocks().columns + column]
    }

    /// The direction, as a unit vector, from the middle of pixel (x, y) to the blocks that are empty within so many pixels, the
    /// nearest of which count most; `None` if there are none, or as many on all sides.
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
    /// Whether pixel (x, y), which a splat with this `reach_px` covers, is beside a surface whose border noise has blurred.
    /// `None` if there is too little noise or too few points, or nothing empty within a fringe.
    pub(super) fn is_beside_blurred(&self, [x, y]: [usize; 2], shown: Shown, reach_px: f32) -> Option<bool> {
        let blurred = self.blurred?;
        let Blurred { noise, per_radius, .. } = blurred;
        let Shown { depth, normal } = shown;
        let pixel = self.view.pixel_size(depth);
        // One more, as blocks that a border crosses are not empty.
        let blocks = |fringe: f32| (fringe / BLOCK_PX as f32).ceil() as u8 + 1;
        let fringe_of = |noise_px: f32| (reach_px + FRINGE_NOISES * noise_px).min((BLOCK_PX * FRINGE_BLOCKS) as f32);
        let to_empty = blurred.blocks_to_empty(x / BLOCK_PX, y / BLOCK_PX);
        // Most pixels are further inside than any noise is wide.
        let most_noise_px = noise.level / pixel;
        if !(most_noise_px >= LEAST_NOISE_PX) || to_empty > blocks(fringe_of(most_noise_px)) {
            return None;
        }
        let radius_px = reach_px / SUPPORT;
        let to_eye = self.view.to_eye(self.view.unproject([x as f32 + 0.5, y as f32 + 0.5], depth));
        let facing = Vec3::from(normal).dot(to_eye) / to_eye.length();
        let aside = ((1.0 - facing * facing).max(0.0).sqrt() / TILTED).min(1.0);
        let noise_px = BLURS * aside * noise.at(per_radius * radius_px * pixel) / pixel;
        if !(noise_px >= LEAST_NOISE_PX) {
            return None;
        }
        let fringe = fringe_of(noise_px);
        if to_empty > blocks(fringe) {
            return None;
        }
        let [width, height] = self.size();
        // Of points beyond the screen nothing is known.
        let to_edge = x.min(y).min(width - 1 - x).min(height - 1 - y) as f32;
        let widest = WIDEST_RADIUS_PX.min(to_edge);
        let window = (LEAST_RADIUS_PX * LEAST_RADIUS_PX + PER_NOISE * noise_px * noise_px).sqrt().min(widest);
        // In one narrower than splats are wide, points tell of their distances from each other, or of rows.
        if window < AROUND_PX.max(radius_px) {
            return None;
        }
        let squares = blurred.squares(window);
        let here = moments(squares, [x, y], window)?;
        let blur = Blur { window: window * window / PER_VARIANCE, noise: noise_px * noise_px };
        let apart = window * (PI / here.count).sqrt();
        let sure_px = SURE_NOISE_PX + noise.sure * ((SURE_DISTANCES * apart).min(SURE_NOISE_PX) - SURE_NOISE_PX);
        let [unsure, sure] = OFF_BLURRED;
        let may_be = sure + (unsure - sure) * (1.0 - noise_px / sure_px).max(0.0);
        // What is off by less altogether is so that way as well.
        if blur.most_off(here) <= may_be {
            return Some(false);
        }
        let towards = blurred.towards_empty([x, y], fringe + BEYOND_FRINGE * BLOCK_PX as f32)?;
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
        let goes_on = |half_way: Moments| blur.off(half_way, towards) <= OFF_HALF_WAY * may_be;
        Some(!moments(squares, [x, y], window).is_some_and(goes_on))
    }
}

impl Held {
    fn new([side, columns, rows]: [usize; 3], count: impl Fn(usize, usize) -> u16 + Sync) -> Self {
        let mut counts = vec![0; columns * rows + LANES];
        counts.par_chunks_mut(columns).take(rows).enumerate().for_each(|(y, row)| {
            row.iter_mut().enumerate().for_each(|(x, held)| *held = count(x, y));
        });
        Self { side, columns, rows, count: counts }
    }

    /// In squares twice as wide.
    fn in_pairs(&self) -> Self {
        let size = [2 * self.side, self.columns.div_ceil(2), self.rows.div_ceil(2)];
        Self::new(size, |x, y| {
            let [columns, rows] = [(x, self.columns), (y, self.rows)].map(|(at, most)| 2 * at..(2 * at + 2).min(most));
            rows.flat_map(|y| &self.count[y * self.columns..][columns.clone()]).sum()
        })
    }
}

/// What blurs a border, as variances in square pixels: the window, and the noise.
#[derive(Clone, Copy, Debug)]
struct Blur {
    window: f32,
    noise: f32,
}

impl Blur {
    /// How far a mean is off in w²/√(w² + σ²), in pixels.
    fn unit(self) -> f32 {
        self.window / (self.window + self.noise).sqrt()
    }

    /// How far the mean of points is off, if all of it is away from what is empty, and what is spread does not count.
    fn most_off(self, Moments { offset: [x, y], .. }: Moments) -> f32 {
        (x * x + y * y).sqrt() / self.unit()
    }

    /// How far it is off away from `towards`, a unit vector, less a part of the mean square along it, of which no more counts than
    /// a straight end has: further out it grows faster than the mean.
    fn off(self, Moments { offset, squares: [xx, xy, yy], .. }: Moments, [x, y]: [f32; 2]) -> f32 {
        let mean = -(offset[0] * x + offset[1] * y) / self.unit();
        let square = xx * x * x + 2.0 * xy * x * y + yy * y * y;
        // Noise strews points by so much about where the window sees them.
        let of_noise = self.window * self.noise / (self.window + self.noise);
        mean - SPREAD * ((square - of_noise) / (self.unit() * self.unit())).clamp(0.0, 1.0)
    }
}

/// Of the sixteenths with points around a pixel.
#[derive(Clone, Copy, Debug)]
struct Moments {
    /// Mean offset from the pixel's middle, in pixels.
    offset: [f32; 2],
    /// Means of squares, in square pixels: of x, of x and y, of y.
    squares: [f32; 3],
    count: f32,
}

/// The moments of the sixteenths with points in a window of such a radius around the middle of pixel (x, y), which lies within the
/// screen; `None` if there are too few.
#[pulp::with_simd(moments = pulp::Arch::new())]
#[inline(always)]
fn moments_with<S: Simd>(_: S, squares: &Held, [x, y]: [usize; 2], window: f32) -> Option<Moments> {
    let reach = window as usize;
    // The first square's middle from the pixel's, in pixels, and the squares.
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
                // Beyond the window, and beyond the row, nothing counts: what is left of 1 there is none, else 2⁻²⁴ at least.
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
    (count >= FEWEST_BLURRED as f32).then(|| Moments {
        offset: [right, down].map(of_weight),
        squares: [xx, xy, yy].map(of_weight),
        count,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_clouds::Random;

    /// How far off the points of a surface are at its slanted end in the middle of a picture, where their density grows with this
    /// power of the distance from it, if noise of so many pixels moves them: with the spread, and without.
    fn off_at_end(power: f32, noise_px: f32) -> [f32; 2] {
        let [width, height] = [256, 256];
        let ([x, y], window) = ([128, 128], (16.0 + PER_NOISE * noise_px * noise_px).sqrt());
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
        let pixels = Held::new([1, width, height], |x, y| counts[y * width + x]);
        let pairs = pixels.in_pairs();
        let blur = Blur { window: window * window / PER_VARIANCE, noise: noise_px * noise_px };
        let [pixels, pairs] =
            [pixels, pairs].map(|squares| moments(&squares, [x, y], window).expect("there are thousands"));
        let off = blur.off(pixels, [-sin, -cos]);
        let differs = (blur.off(pairs, [-sin, -cos]) - off).abs();
        assert!(window < FINE_RADIUS_PX || differs < 0.03, "in pairs of pixels it differs by {differs}");
        [off, blur.most_off(pixels)]
    }

    #[test]
    fn at_an_end_points_are_as_far_off_whatever_the_noise() {
        for noise_px in [0.0, 1.5, 4.0] {
            let [straight, curved] = [0.0, -0.5].map(|power| off_at_end(power, noise_px));
            for ([off, most], [expected_off, expected_most]) in [(straight, [0.55, 0.80]), (curved, [0.353, 0.478])] {
                let what =
                    format!("noise of {noise_px} pixels: {off} and {most}, not {expected_off} and {expected_most}");
                // The kernel ends, and pixels are wide.
                assert!((off - expected_off).abs() < 0.05 && (most - expected_most).abs() < 0.05, "{what}");
            }
        }
    }

    #[test]
    fn pairs_hold_what_their_pixels_do() {
        let mut random = Random::new(92);
        for [width, height] in [[1, 1], [2, 3], [7, 4], [5, 9]] {
            let counts: Vec<_> = (0..width * height).map(|_| random.below(17) as u16).collect();
            let pairs = Held::new([1, width, height], |x, y| counts[y * width + x]).in_pairs();
            assert_eq!([pairs.side, pairs.columns, pairs.rows], [2, width.div_ceil(2), height.div_ceil(2)]);
            for (x, y) in (0..pairs.columns).flat_map(|x| (0..pairs.rows).map(move |y| (x, y))) {
                let inside = |&at: &usize| at % width / 2 == x && at / width / 2 == y;
                let expected: u16 = (0..width * height).filter(inside).map(|at| counts[at]).sum();
                assert_eq!(pairs.count[y * pairs.columns + x], expected, "{width}x{height}: {x}, {y}");
            }
        }
    }
}
