//! Trim: removes the rim of tails that splats leave around a silhouette.
//!
//! # How it works
//! The outer half of a splat closes the gaps between scattered points, but sticks out where points end. The inner half,
//! the *core*, ends about where the surface does. A pixel that lies in no core stays if it is closed in. That is so if
//! one of eight lines through the pixel meets a core in both directions. Lines end at empty pixels, and at about five
//! times the reach of the splat there. The pixel also stays if no line meets any core.
//!
//! Where points are dense, discs are too coarse a measure. There the points themselves end the surface, all of them,
//! hidden or not (`Sixteenths`). A pixel close to an empty square of three pixels is beside the surface if too few
//! points lie on one side of its middle. Every line through the middle is tried. Close to a single empty pixel, which
//! may be a gap between points, the open side must face that pixel too. Otherwise cores decide. Lines between cores
//! alone would keep a row of tails between two cores that stand out of a border. See
//! docs/decisions/0002-borders-by-sixteenths.md.
//!
//! Where points are few, close to an empty square, the mean of the splats around has to be near the pixel's middle.
//! Noise scatters points past the border, while their splats are back on the surface. A surface that curves away has
//! dense points at its border, however wide its splats are where it faces the eye. So points decide about wide splats
//! too, but more points are needed.
//!
//! Where noise blurs the border, the density of points decides before all these rules (`blurred`). See
//! docs/decisions/0003-borders-of-noise.md.
// Differs from the paper: the paper draws all that its splats cover, so its silhouettes are too wide by their rims.

pub(super) mod blurred;
#[cfg(test)]
mod tests;

use self::blurred::BlurredBorders;
use super::centers::mean;
use super::layers::PixelSurface;
use super::{TILE, TILE_AREA, Tiles};
use crate::camera::View;
use crate::project::Sixteenths;

/// Weight of a splat from which a pixel belongs to its core: the kernel at 0.42 splat radii.
pub(super) const CORE_WEIGHT: f32 = 0.68;
/// Sum of weights from which a pixel belongs to the surface whatever its heaviest splat. Inside a surface the sum is
/// about 2, at its border 1. Where many points fall into each pixel, the nearest one may lie at the same edge of every
/// pixel. Then no pixel's centre lies in a core.
pub(super) const INNER_WEIGHT: f32 = 1.3;
/// Length of a line to each side, in reaches of the pixel's heaviest splat.
pub(super) const LINE_LENGTH_REACHES: f32 = 5.0;
/// Strides that a line takes per reach of a splat. A stride is one pixel at least.
pub(super) const STRIDES_PER_REACH: f32 = 6.0;
/// Longest stride, in pixels, at which lines of neighbouring pixels stop at the same places.
pub(super) const MAX_ALIGNED_STRIDE_PX: isize = 3;
/// Strides added to each line: a structure one pixel wide has cores only here and there along its length.
pub(super) const EXTRA_STRIDES: usize = 2;
/// Least share on each side of a border line, as a divisor: at least 1/8 of the marked sixteenths around a pixel. With
/// fewer on any side the pixel is beside the surface. A sixteenth is marked if it holds a point.
pub(super) const SIDE_SHARE_DIVISOR: u32 = 8;
/// Fewest marked sixteenths, of some 50 within a pixel, that can show an open side: around narrow splats, and around
/// wide ones.
pub(super) const MIN_SIXTEENTHS: [u32; 2] = [5, 8];
/// Marked sixteenths from which points alone decide: without an open side the pixel stays.
pub(super) const DECISIVE_SIXTEENTHS: u32 = 18;
/// Marked sixteenths from which 16 directions are tested instead of the eight of the lines.
pub(super) const FINE_DIRECTION_SIXTEENTHS: u32 = 24;
/// Radius in pixels of the window whose splats are averaged.
pub(super) const SPLAT_WINDOW_PX: f32 = 3.0;
/// Largest offset in pixels of the mean of the splats in the window from the pixel's middle. At the straight end of
/// evenly scattered points the mean is off by 0.8 pixels. Where a surface curves away, points get ever closer and the
/// mean is off by less.
pub(super) const MAX_SPLAT_MEAN_OFFSET_PX: f32 = 0.7;
/// Fewest splats in the window whose mean decides: around narrow splats, and around wide ones. Around wide splats only
/// a surface that curves away has so many at its border; a gap among sparse points has fewer.
pub(super) const MIN_SPLATS: [f32; 2] = [3.0, 14.0];
/// Reach in pixels of the widest narrow splat: points are about two pixels apart then.
pub(super) const MAX_NARROW_REACH_PX: f32 = 3.0;
/// Distance in pixels, along either axis, from the middle of an empty 3×3 square up to which pixels are its border. The
/// pixels form a square without its corners. A single empty pixel may be a gap between points, which this rule would
/// widen.
const BORDER_DISTANCE_PX: usize = 3;
/// Distance in pixels from a single empty pixel up to which pixels are beside a possible gap; a square without its
/// corners. Only points decide there, and only if an empty pixel lies within this distance on their open side.
const GAP_DISTANCE_PX: usize = 2;
/// Pixels around a tile that its border tests read.
pub(super) const MARGIN: usize = BORDER_DISTANCE_PX + 1;
const _: () = assert!(TILE == 64, "a row of a tile is a word");
/// Directions of the eight lines, in pixels.
pub(super) const LINES: [[isize; 2]; 8] = [[1, 0], [0, 1], [1, 1], [1, -1], [2, 1], [1, 2], [2, -1], [1, -2]];
/// Directions across which borders are tested: those of the lines, then those between them.
#[rustfmt::skip]
pub(super) const ACROSS: [[isize; 2]; 2 * LINES.len()] = [
    [1, 0], [0, 1], [1, 1], [1, -1], [2, 1], [1, 2], [2, -1], [1, -2],
    [4, 1], [1, 4], [4, -1], [1, -4], [4, 3], [3, 4], [4, -3], [3, -4],
];
/// Masks of the two sides of each direction, in the layout of [`Sixteenths::around`]: the sixteenths ahead, then those
/// behind. Only sixteenths within a pixel of the middle count; those level with the middle belong to both sides.
pub(super) const SIDES: [[u64; 2]; ACROSS.len()] = {
    let mut sides = [[0; 2]; ACROSS.len()];
    let mut at = 0;
    while at < 64 * ACROSS.len() {
        let (direction, bit) = (at / 64, at % 64);
        let [dx, dy] = ACROSS[direction];
        // Offset from the pixel's middle, in eighths of a pixel.
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
/// Quarters of the disc. Each mask of [`SIDES`] contains one of these whole, so no side is open if all quarters hold
/// enough points.
const QUARTERS: [u64; 4] =
    [SIDES[0][0] & SIDES[1][0], SIDES[0][0] & SIDES[1][1], SIDES[0][1] & SIDES[1][0], SIDES[0][1] & SIDES[1][1]];
/// Masks of the sixteenths within a pixel of the middle, and of those of the pixel itself.
const DISC: u64 = SIDES[0][0] | SIDES[0][1];
pub(super) const OWN_SIXTEENTHS: u64 = 0x3c3c_3c3c << 16;

/// Settings of trimming.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TrimRules {
    /// Ratio of the k-radius of a point with k neighbours to the radius of its splat.
    pub(crate) k_radius_per_radius: f32,
}

/// State of a pixel for trimming: [`EMPTY`], or the reach of its heaviest splat in pixels, negated in a core.
pub(super) type Rim = f32;
pub(super) const EMPTY: Rim = 0.0;

/// The rim of a pixel from its sum of weights, and the weight and reach of its heaviest splat.
pub(super) fn rim(weight: f32, heaviest: f32, reach_px: f32) -> Rim {
    if heaviest >= CORE_WEIGHT || weight >= INNER_WEIGHT {
        -reach_px
    } else if heaviest > 0.0 {
        reach_px
    } else {
        EMPTY
    }
}

/// Kind of emptiness close to a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum EmptyNearby {
    Nothing,
    /// A single empty pixel, which may be a gap between points.
    Gap,
    /// An empty 3×3 square.
    Border,
}

/// Masks of the pixels of a tile that are close to emptiness: a word per row, the lowest bit for the first column.
#[derive(Debug)]
pub(super) struct EmptyMasks {
    gaps: [u64; TILE],
    borders: [u64; TILE],
}

impl EmptyMasks {
    /// Kind of emptiness close to pixel (x, y) of the tile.
    pub(super) fn near(&self, [x, y]: [usize; 2]) -> EmptyNearby {
        match [self.borders, self.gaps].map(|rows| rows[y] >> x & 1 == 1) {
            [true, _] => EmptyNearby::Border,
            [_, true] => EmptyNearby::Gap,
            _ => EmptyNearby::Nothing,
        }
    }
}

/// Input of trimming for a picture, tile by tile.
#[derive(Clone, Copy)]
pub(super) struct Outline<'a> {
    pub(super) rims: &'a [Rim],
    /// Centres of splats per pixel (`centers`).
    pub(super) centers: &'a [u32],
    pub(super) sixteenths: &'a Sixteenths,
    pub(super) tiles: &'a Tiles,
    pub(super) view: &'a View,
    /// State of borders that noise has blurred; `None` without noise.
    pub(super) blurred: Option<&'a BlurredBorders>,
}

impl Outline<'_> {
    fn size(&self) -> [usize; 2] {
        [self.view.width as usize, self.view.height as usize]
    }

    fn index(&self, pixel: [usize; 2]) -> usize {
        self.tiles.index(pixel)
    }

    /// Masks of emptiness for the tile whose upper left pixel is (x0, y0).
    pub(super) fn edges(&self, [x0, y0]: [usize; 2]) -> EmptyMasks {
        let [width, height] = self.size();
        let own = &self.rims[self.index([x0, y0])..][..TILE_AREA];
        // Bits of the empty pixels in a row of the tile with its margin.
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
        // Bits of the middles of empty 3×3 squares.
        let middles: [u128; TILE + 2 * BORDER_DISTANCE_PX] = std::array::from_fn(|row| {
            let all = rows[row] & rows[row + 1] & rows[row + 2];
            all & all << 1 & all >> 1
        });
        let narrow = |bits: u128| bits | bits << 1 | bits >> 1 | bits << 2 | bits >> 2;
        let wide = |bits: u128| narrow(bits) | bits << 3 | bits >> 3;
        let slim = |bits: u128| bits | bits << 1 | bits >> 1;
        let gaps = |y: usize| {
            let around = &rows[y + MARGIN - GAP_DISTANCE_PX..];
            ((slim(around[0] | around[4]) | narrow(around[1] | around[2] | around[3])) >> MARGIN) as u64
        };
        let borders = |y: usize| {
            let inner = middles[y + 1..y + 6].iter().fold(0, |bits, row| bits | row);
            ((narrow(middles[y] | middles[y + 6]) | wide(inner)) >> MARGIN) as u64
        };
        EmptyMasks { gaps: std::array::from_fn(gaps), borders: std::array::from_fn(borders) }
    }

    /// Whether pixel (x, y), which shows `shown`, is covered by a splat but by no surface.
    pub(super) fn sticks_out(&self, x: usize, y: usize, shown: PixelSurface, near: EmptyNearby) -> bool {
        let own = self.rims[self.index([x, y])];
        if own == EMPTY {
            return false;
        }
        let by_density = self.is_beside_blurred([x, y], shown, own.abs());
        by_density
            .or_else(|| self.is_beside([x, y], own.abs() > MAX_NARROW_REACH_PX, near))
            .unwrap_or_else(|| own > 0.0 && self.is_open([x, y], own))
    }

    /// Whether pixel (x, y) is beside the surface by the points around; `None` if they do not decide. `wide` states
    /// whether its splat is wide.
    fn is_beside(&self, [x, y]: [usize; 2], wide: bool, near: EmptyNearby) -> Option<bool> {
        let [width, height] = self.size();
        let window = SPLAT_WINDOW_PX as usize;
        // Points beyond the screen are unknown.
        let known = x >= window && y >= window && x + window < width && y + window < height;
        if near == EmptyNearby::Nothing || !known {
            return None;
        }
        let points = self.sixteenths.around([x, y]);
        let count = (points & DISC).count_ones();
        let open = if count < MIN_SIXTEENTHS[usize::from(wide)] { None } else { open_side(points) };
        if let Some([dx, dy]) = open {
            let most = dx.abs().max(dy.abs());
            let [dx, dy] = [dx, dy].map(|along| if 2 * along.abs() < most { 0 } else { along.signum() });
            let ahead = |steps: isize| [x.wrapping_add_signed(steps * dx), y.wrapping_add_signed(steps * dy)];
            let is_empty = |at: [usize; 2]| self.rims[self.index(at)] == EMPTY;
            if near == EmptyNearby::Gap && !(1..=GAP_DISTANCE_PX as isize).any(|steps| is_empty(ahead(steps))) {
                return None;
            }
            // A thin structure or an isolated point has points in this pixel, and no closed pixel behind it. It stays,
            // or it would vanish.
            let behind = ahead(-1);
            let stays = !is_empty(behind) && open_side(self.sixteenths.around(behind)).is_none();
            return Some(points & OWN_SIXTEENTHS == 0 || stays);
        }
        if count >= DECISIVE_SIXTEENTHS {
            return Some(false);
        }
        if near == EmptyNearby::Gap {
            return None;
        }
        let offset = self.splats_offset([x, y], MIN_SPLATS[usize::from(wide)])?;
        Some(square(offset) > MAX_SPLAT_MEAN_OFFSET_PX * MAX_SPLAT_MEAN_OFFSET_PX)
    }

    /// Mean offset in pixels of the splats in the window around pixel (x, y); `None` if they are fewer than `fewest`.
    fn splats_offset(&self, [x, y]: [usize; 2], fewest: f32) -> Option<[f32; 2]> {
        let window = SPLAT_WINDOW_PX as usize;
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
                let near = (1.0 - square([ox, oy]) / (SPLAT_WINDOW_PX * SPLAT_WINDOW_PX)).max(0.0);
                let weight = count * near * near * near;
                splats += if weight > 0.0 { count } else { 0.0 };
                sums = [sums[0] + weight, sums[1] + weight * ox, sums[2] + weight * oy];
            }
        }
        let [weight, ox, oy] = sums;
        (splats >= fewest).then(|| [ox / weight, oy / weight])
    }

    /// Whether no line closes in the pixel, a tail of a splat with this reach.
    fn is_open(&self, [x, y]: [usize; 2], reach_px: f32) -> bool {
        let [width, height] = self.size();
        // Wide splats have wide cores, which strides do not miss. So the work per pixel is bounded whatever the
        // density.
        let stride = (reach_px / STRIDES_PER_REACH).max(1.0) as isize;
        let strides = (LINE_LENGTH_REACHES * reach_px) as usize / stride as usize + EXTRA_STRIDES;
        let meets_core = |[dx, dy]: [isize; 2]| {
            // Lines of neighbouring pixels stop at the same places, or borders would be dotted where some lines stride
            // over a core. Long strides are not aligned: places that all lines stride over would show as rays.
            let (along, place) = if dx.abs() == 1 { (dx, x as isize) } else { (dy, y as isize) };
            let beyond = place % stride;
            let first = match (stride > MAX_ALIGNED_STRIDE_PX, along > 0 || beyond == 0) {
                (true, _) => stride,
                (false, true) => stride - beyond,
                (false, false) => beyond,
            };
            for at in 0..strides as isize {
                let distance = first + at * stride;
                let (x, y) = match (x.checked_add_signed(dx * distance), y.checked_add_signed(dy * distance)) {
                    (Some(x), Some(y)) if x < width && y < height => (x, y),
                    // Beyond the screen the surface goes on.
                    _ => return true,
                };
                let rim = self.rims[self.index([x, y])];
                if rim <= EMPTY {
                    return rim < EMPTY;
                }
            }
            false
        };
        // A pixel without any core on its lines, such as that of an isolated point, sticks out of nothing.
        let mut sticks_out = false;
        for [dx, dy] in LINES {
            let ahead = meets_core([dx, dy]);
            // One direction alone closes nothing in. The opposite direction matters only while no core was met at all.
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

/// The direction of the side with the fewest marked sixteenths around a pixel; `None` if every side has enough.
fn open_side(points: u64) -> Option<[isize; 2]> {
    let count = |side: u64| (points & side).count_ones();
    let all = count(DISC);
    let is_few = |count: u32| SIDE_SHARE_DIVISOR * count < all.max(1);
    // Quick test: most pixels have points on all sides.
    if !QUARTERS.iter().any(|&quarter| is_few(count(quarter))) {
        return None;
    }
    // Number of directions to test: the finer ones only where many sixteenths are marked.
    let told = if all < FINE_DIRECTION_SIXTEENTHS { LINES.len() } else { ACROSS.len() };
    let sides = |back: usize| (0..told).map(move |at| (count(SIDES[at][back]), back, at));
    let (least, back, at) = sides(0).chain(sides(1)).min()?;
    let sign = [1, -1][back];
    is_few(least).then(|| ACROSS[at].map(|along| sign * along))
}

fn square([x, y]: [f32; 2]) -> f32 {
    x * x + y * y
}
