//! Trim: takes off the rim of tails that splats leave around a silhouette.
//!
//! # How it works
//! The outer half of a splat closes the gaps between scattered points, but where there are no more points it sticks out.
//! The inner half, the *core*, ends about where the surface does. A pixel that lies in no core stays if it is closed in:
//! if on one of eight lines through it there is a core in both directions, at most five times as far as the splat there
//! reaches, and nothing empty in between; or if there is no core around it at all.
//!
//! Where points are dense, discs are too coarse a measure, and what ends the surface are the points themselves, all of them,
//! hidden or not (`Sixteenths`): close to an empty pixel, one stays if points lie on both sides of its middle, whichever line
//! through it parts them, or if it is not there that the pixel is empty. Close to an empty square of three pixels, which is no gap
//! between points, that need not be, and where points are few the mean of the splats around has to be close to its middle as well:
//! noise strews points past the border, and splats are back on the surface. Lines between cores kept a row of tails wherever two
//! cores stood out of a border. A surface that curves away has its points close together at its border, however wide its splats are
//! where it faces the eye: so wide splats are asked as well, but more points have to say it.
//!
//! Where there is noise, the density of points tells in place of all this (`blurred`).
// Differs from the paper: it draws what its splats cover, and silhouettes are as much too wide as splats are.

pub(super) mod blurred;
#[cfg(test)]
mod tests;

use self::blurred::Blurred;
use super::centers::mean;
use super::{TILE, TILE_AREA, tiled_index};
use crate::camera::View;
use crate::project::Sixteenths;

/// Weight of a splat from which a pixel belongs to its core: the kernel at 0.42 splat radii.
pub(super) const CORE_WEIGHT: f32 = 0.68;
/// Sum of weights from which a pixel belongs to the surface whatever its heaviest splat: inside a surface the sum is
/// about 2, at its border 1. Where many points fall into each pixel, the nearest one may lie at the same edge of every
/// pixel, and no pixel's centre in a core.
pub(super) const INNER_WEIGHT: f32 = 1.3;
/// How far lines go, in reaches of the splat.
pub(super) const FURTHEST: f32 = 5.0;
/// Strides that a line takes in the reach of a splat wider than so many pixels.
pub(super) const STRIDES_PER_REACH: f32 = 6.0;
/// Longest stride, in pixels, that stops where those of neighbours do.
pub(super) const LONGEST_ALIGNED: isize = 3;
/// Added to how far lines go: what is a pixel wide has cores here and there along it.
pub(super) const LEAST_REACH_PX: usize = 2;
/// Of the sixteenths of pixels around a pixel that hold points, one in so many lies on either side at least, or the pixel is
/// beside the surface.
pub(super) const LEAST_SHARE: u32 = 8;
/// From how many of them on, out of some 50, they tell: around narrow splats, and around wide ones; and from how many on they do so
/// alone.
pub(super) const FEWEST_POINTS: [u32; 2] = [5, 8];
pub(super) const MANY_POINTS: u32 = 18;
/// From how many of them on they tell which way a border runs more finely than the eight lines.
pub(super) const FINE_POINTS: u32 = 24;
/// Splats closer than so many pixels are those around a pixel.
pub(super) const AROUND_PX: f32 = 3.0;
/// How far from the middle of a pixel their mean may be. At the straight end of points strewn evenly it is 0.8 pixels off, at that
/// of a surface which curves away, where they lie ever closer, less.
pub(super) const OFF_PX: f32 = 0.7;
/// From how many of them on their mean tells: around narrow splats, and around wide ones, of which only a surface that curves away
/// has as many at its border, and no gap among sparse points.
pub(super) const FEWEST_SPLATS: [f32; 2] = [3.0, 14.0];
/// Reach in pixels of the widest narrow splat: points are about two pixels apart then.
pub(super) const NARROW_PX: f32 = 3.0;
/// Pixels from the middle of an empty square of three that are the border, along an axis; in a square, but for its corners. An
/// empty pixel alone may be a gap between points, which the splats around would widen.
const BORDER_PX: usize = 3;
/// The same from an empty pixel that may be a gap: points alone tell there, if their open side has it no farther away.
const GAP_PX: usize = 2;
/// Pixels beside a tile that tell of its border.
const MARGIN: usize = BORDER_PX + 1;
const _: () = assert!(TILE == 64, "a row of a tile is a word");
/// Directions of the eight lines.
const LINES: [[isize; 2]; 8] = [[1, 0], [0, 1], [1, 1], [1, -1], [2, 1], [1, 2], [2, -1], [1, -2]];
/// Directions across which borders are looked for: along the lines, and between them.
#[rustfmt::skip]
const ACROSS: [[isize; 2]; 2 * LINES.len()] = [
    [1, 0], [0, 1], [1, 1], [1, -1], [2, 1], [1, 2], [2, -1], [1, -2],
    [4, 1], [1, 4], [4, -1], [1, -4], [4, 3], [3, 4], [4, -3], [3, -4],
];
/// Of the sixteenths around a pixel, as [`Sixteenths::around`] has them, those within a pixel of its middle that lie ahead in
/// each direction, or neither ahead nor behind; then those behind.
const SIDES: [[u64; 2]; ACROSS.len()] = {
    let mut sides = [[0; 2]; ACROSS.len()];
    let mut at = 0;
    while at < 64 * ACROSS.len() {
        let (direction, bit) = (at / 64, at % 64);
        let [dx, dy] = ACROSS[direction];
        // From the middle, in eighths of a pixel.
        let [x, y] = [2 * (bit as isize % 8) - 7, 2 * (bit as isize / 8) - 7];
        let ahead = x * dx + y * dy;
        if x * x + y * y < 64 {
            sides[direction][0] |= ((ahead >= 0) as u64) << bit;
            sides[direction][1] |= ((ahead <= 0) as u64) << bit;
        }
        at += 1;
    }
    sides
};
/// Each side holds one of these whole.
const QUARTERS: [u64; 4] =
    [SIDES[0][0] & SIDES[1][0], SIDES[0][0] & SIDES[1][1], SIDES[0][1] & SIDES[1][0], SIDES[0][1] & SIDES[1][1]];
/// Those within a pixel of the middle, and those of the pixel itself.
const DISC: u64 = SIDES[0][0] | SIDES[0][1];
const OWN: u64 = 0x3c3c_3c3c << 16;

/// What trimming knows of a pixel: [`EMPTY`], or how far its heaviest splat reaches in pixels, below 0 in a core.
pub(super) type Rim = f32;
pub(super) const EMPTY: Rim = 0.0;

/// The rim of a pixel by its sum of weights, and the weight and the reach of its heaviest splat.
pub(super) fn rim(weight: f32, heaviest: f32, reach_px: f32) -> Rim {
    if heaviest >= CORE_WEIGHT || weight >= INNER_WEIGHT {
        -reach_px
    } else if heaviest > 0.0 {
        reach_px
    } else {
        EMPTY
    }
}

/// What a pixel shows, before anything is taken off.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shown {
    pub(super) depth: f32,
    /// View space.
    pub(super) normal: [f32; 3],
}

/// What is empty close to a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Near {
    Nothing,
    /// A pixel, which may be a gap between points.
    Gap,
    /// A square of three pixels.
    Border,
}

/// What is empty close to the pixels of a tile: of each row a bit for each of them, the lowest the first.
#[derive(Debug)]
pub(super) struct Edges {
    gaps: [u64; TILE],
    borders: [u64; TILE],
}

impl Edges {
    /// Close to pixel (x, y) of the tile.
    pub(super) fn near(&self, [x, y]: [usize; 2]) -> Near {
        match [self.borders, self.gaps].map(|rows| rows[y] >> x & 1 == 1) {
            [true, _] => Near::Border,
            [_, true] => Near::Gap,
            _ => Near::Nothing,
        }
    }
}

/// What trimming knows of a picture, tile by tile.
#[derive(Clone, Copy)]
pub(super) struct Outline<'a> {
    pub(super) rims: &'a [Rim],
    /// Of splats, in each pixel.
    pub(super) centers: &'a [u32],
    pub(super) sixteenths: &'a Sixteenths,
    pub(super) view: &'a View,
    /// If there is noise.
    pub(super) blurred: Option<&'a Blurred>,
}

impl Outline<'_> {
    fn size(&self) -> [usize; 2] {
        [self.view.width as usize, self.view.height as usize]
    }

    fn index(&self, [x, y]: [usize; 2]) -> usize {
        tiled_index(self.view.width as usize, x, y)
    }

    /// What is empty close to the pixels of the tile with this upper left one.
    pub(super) fn edges(&self, [x0, y0]: [usize; 2]) -> Edges {
        let [width, height] = self.size();
        let own = &self.rims[self.index([x0, y0])..][..TILE_AREA];
        // Bits of empty pixels, of the margin on each side as well.
        let empty = |row: usize| {
            let Some(y) = (y0 + row).checked_sub(MARGIN).filter(|&y| y < height) else { return 0 };
            let bit = |x: usize| u128::from(self.rims[self.index([x, y])] == EMPTY) << (x + MARGIN - x0);
            let end = (x0 + TILE).min(width);
            let beside = (x0.saturating_sub(MARGIN)..x0).chain(end..(end + MARGIN).min(width)).map(bit);
            let bits = beside.fold(0, |bits, bit| bits | bit);
            if y / TILE != y0 / TILE {
                return bits | (x0..end).map(bit).fold(0, |bits, bit| bits | bit);
            }
            let row = own[(y - y0) * TILE..][..end - x0].iter().enumerate();
            let word = row.fold(0u64, |word, (x, &rim)| word | u64::from(rim == EMPTY) << x);
            bits | u128::from(word) << MARGIN
        };
        let rows: [u128; TILE + 2 * MARGIN] = std::array::from_fn(empty);
        // Middles of empty squares.
        let middles: [u128; TILE + 2 * BORDER_PX] = std::array::from_fn(|row| {
            let all = rows[row] & rows[row + 1] & rows[row + 2];
            all & all << 1 & all >> 1
        });
        let narrow = |bits: u128| bits | bits << 1 | bits >> 1 | bits << 2 | bits >> 2;
        let wide = |bits: u128| narrow(bits) | bits << 3 | bits >> 3;
        let slim = |bits: u128| bits | bits << 1 | bits >> 1;
        let gaps = |y: usize| {
            let around = &rows[y + MARGIN - GAP_PX..];
            ((slim(around[0] | around[4]) | narrow(around[1] | around[2] | around[3])) >> MARGIN) as u64
        };
        let borders = |y: usize| {
            let inner = middles[y + 1..y + 6].iter().fold(0, |bits, row| bits | row);
            ((narrow(middles[y] | middles[y + 6]) | wide(inner)) >> MARGIN) as u64
        };
        Edges { gaps: std::array::from_fn(gaps), borders: std::array::from_fn(borders) }
    }

    /// Whether a splat covers pixel (x, y), of which this is shown, but no surface does.
    pub(super) fn sticks_out(&self, x: usize, y: usize, shown: Shown, near: Near) -> bool {
        let own = self.rims[self.index([x, y])];
        if own == EMPTY {
            return false;
        }
        let by_density = self.is_beside_blurred([x, y], shown, own.abs());
        by_density
            .or_else(|| self.is_beside([x, y], own.abs() > NARROW_PX, near))
            .unwrap_or_else(|| own > 0.0 && self.is_open([x, y], own))
    }

    /// Whether pixel (x, y) is beside the surface, by the points around, if they tell; `wide` says whether its splat is.
    fn is_beside(&self, [x, y]: [usize; 2], wide: bool, near: Near) -> Option<bool> {
        let [width, height] = self.size();
        let window = AROUND_PX as usize;
        // Of points beyond the screen nothing is known.
        let known = x >= window && y >= window && x + window < width && y + window < height;
        if near == Near::Nothing || !known {
            return None;
        }
        let points = self.sixteenths.around([x, y]);
        let count = (points & DISC).count_ones();
        let open = if count < FEWEST_POINTS[usize::from(wide)] { None } else { open_side(points) };
        if let Some([dx, dy]) = open {
            let most = dx.abs().max(dy.abs());
            let [dx, dy] = [dx, dy].map(|along| if 2 * along.abs() < most { 0 } else { along.signum() });
            let ahead = |steps: isize| [x.wrapping_add_signed(steps * dx), y.wrapping_add_signed(steps * dy)];
            let is_empty = |at: [usize; 2]| self.rims[self.index(at)] == EMPTY;
            if near == Near::Gap && !(1..=GAP_PX as isize).any(|steps| is_empty(ahead(steps))) {
                return None;
            }
            // What is thin, or alone, has points in this pixel and no other behind it to be seen in: it would be gone.
            let behind = ahead(-1);
            let stays = !is_empty(behind) && open_side(self.sixteenths.around(behind)).is_none();
            return Some(points & OWN == 0 || stays);
        }
        if count >= MANY_POINTS {
            return Some(false);
        }
        if near == Near::Gap {
            return None;
        }
        let offset = self.splats_offset([x, y], FEWEST_SPLATS[usize::from(wide)])?;
        Some(square(offset) > OFF_PX * OFF_PX)
    }

    /// The mean offset, in pixels, of the splats around pixel (x, y), if there are so many.
    fn splats_offset(&self, [x, y]: [usize; 2], fewest: f32) -> Option<[f32; 2]> {
        let window = AROUND_PX as usize;
        let mut splats = 0.0;
        let mut sums = [0f32; 3];
        for dy in 0..=2 * window {
            for dx in 0..=2 * window {
                let centers = self.centers[self.index([x + dx - window, y + dy - window])];
                if centers == 0 {
                    continue;
                }
                let (count, offset) = mean(centers);
                let [ox, oy] = [offset[0] + (dx as f32 - window as f32), offset[1] + (dy as f32 - window as f32)];
                let near = (1.0 - square([ox, oy]) / (AROUND_PX * AROUND_PX)).max(0.0);
                let weight = count * near * near * near;
                splats += if weight > 0.0 { count } else { 0.0 };
                sums = [sums[0] + weight, sums[1] + weight * ox, sums[2] + weight * oy];
            }
        }
        let [weight, ox, oy] = sums;
        (splats >= fewest).then(|| [ox / weight, oy / weight])
    }

    /// Whether the pixel is a tail that nothing closes in, of a splat that reaches so far.
    fn is_open(&self, [x, y]: [usize; 2], reach_px: f32) -> bool {
        let [width, height] = self.size();
        // Wide splats have wide cores, which strides do not miss; so the work per pixel is bounded whatever the density.
        let stride = (reach_px / STRIDES_PER_REACH).max(1.0) as isize;
        let strides = (FURTHEST * reach_px) as usize / stride as usize + LEAST_REACH_PX;
        let meets_core = |[dx, dy]: [isize; 2]| {
            // Lines of neighbours stop at the same places: if one saw what the next strides over, borders would be dotted. Not
            // with long strides, which would make rays of what all of them miss.
            let (along, place) = if dx.abs() == 1 { (dx, x as isize) } else { (dy, y as isize) };
            let beyond = place % stride;
            let first = match (stride > LONGEST_ALIGNED, along > 0 || beyond == 0) {
                (true, _) => stride,
                (false, true) => stride - beyond,
                (false, false) => beyond,
            };
            for at in 0..strides as isize {
                let distance = first + at * stride;
                let (x, y) = match (x.checked_add_signed(dx * distance), y.checked_add_signed(dy * distance)) {
                    (Some(x), Some(y)) if x < width && y < height => (x, y),
                    // Beyond the picture the surface goes on.
                    _ => return true,
                };
                let rim = self.rims[self.index([x, y])];
                if rim <= EMPTY {
                    return rim < EMPTY;
                }
            }
            false
        };
        // What has no core anywhere around, as a point alone, sticks out of nothing.
        let mut sticks_out = false;
        for [dx, dy] in LINES {
            let ahead = meets_core([dx, dy]);
            // Half a line closes nothing in: the other half is of use only while no core was met at all.
            if !ahead && sticks_out {
                continue;
            }
            let behind = meets_core([-dx, -dy]);
            if ahead && behind {
                return false;
            }
            sticks_out |= ahead | behind;
        }
        sticks_out
    }
}

/// Towards the side on which the fewest of the sixteenths around a pixel that hold points lie, if they are too few for a surface.
fn open_side(points: u64) -> Option<[isize; 2]> {
    let count = |side: u64| (points & side).count_ones();
    let all = count(DISC);
    let is_few = |count: u32| LEAST_SHARE * count < all.max(1);
    // Most pixels have points on all sides.
    if !QUARTERS.iter().any(|&quarter| is_few(count(quarter))) {
        return None;
    }
    let told = if all < FINE_POINTS { LINES.len() } else { ACROSS.len() };
    let sides = |back: usize| (0..told).map(move |at| (count(SIDES[at][back]), back, at));
    let (least, back, at) = sides(0).chain(sides(1)).min()?;
    let sign = [1, -1][back];
    is_few(least).then(|| ACROSS[at].map(|along| sign * along))
}

fn square([x, y]: [f32; 2]) -> f32 {
    x * x + y * y
}
