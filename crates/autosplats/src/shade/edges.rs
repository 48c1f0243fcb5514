//! Edges: pixels at the border of a surface show a part of what lies on the other side.
//!
//! # How it works
//! Between two neighbouring pixels there is an edge if one is covered and the other is not, or if one lies so far behind
//! the other that no surface is that steep. A border that is nearly level or upright is a row of edges with a turn at its
//! end, up or down by a pixel. The true border is taken to cross the row of edges in its middle and the turn at half its
//! height, so a pixel beside the turn is cut by a triangle or a trapezium, whose area is the part of the other side
//! [Reshetov: *Morphological Antialiasing*, 2009]. Here edges come from the surface, not from the picture's colours: the
//! texture of a scan stays as sharp as it is.

use super::depths::Depths;
use crate::camera::View;

/// Slope, as depth by distance across the line of sight, from which neighbouring pixels are not on the same surface.
const STEEPEST: f32 = 4.0;
/// How far the ends of a row of edges are looked for, in pixels to either side.
pub(super) const SEARCH: isize = 12;
/// Sides of a pixel.
const SIDES: [[isize; 2]; 4] = [[0, -1], [0, 1], [-1, 0], [1, 0]];

/// What is an edge in a picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edges {
    /// What is deeper than this factor times a pixel's depth, plus the offset, lies behind it.
    pub(super) factor: f32,
    pub(super) offset: f32,
}

/// A part of a pixel shows what its neighbour shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Blend {
    pub(super) x: usize,
    pub(super) y: usize,
    pub(super) part: f32,
}

/// Where a row of edges turns to.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Turn {
    /// Into the row of the pixel that asks.
    Here,
    Elsewhere,
}

impl Edges {
    /// Edges as this view shows them.
    pub(super) fn new(view: &View) -> Self {
        let step = STEEPEST / view.focal_px;
        if view.perspective { Self { factor: 1.0 + step, offset: 0.0 } } else { Self { factor: 1.0, offset: step } }
    }

    /// 1 if depth `b` lies behind `a`, -1 if before it, 0 if both may be one surface.
    #[inline(always)]
    fn step(&self, a: f32, b: f32) -> i32 {
        let behind = |a: f32, b: f32| i32::from(b > a * self.factor + self.offset);
        behind(a, b) - behind(b, a)
    }

    /// Marks the pixels of row `y` that have an edge on any side.
    pub(super) fn mark(&self, depths: &Depths, y: isize, marks: &mut [bool]) {
        let width = marks.len();
        let row = |dx, dy| &depths.row(dx, y + dy)[..width];
        let (here, sides) = (row(0, 0), SIDES.map(|[dx, dy]| row(dx, dy)));
        for x in 0..width {
            let mut edge = false;
            for side in sides {
                edge |=
                    (side[x] > here[x] * self.factor + self.offset) | (here[x] > side[x] * self.factor + self.offset);
            }
            marks[x] = edge;
        }
    }

    /// The neighbour that takes the largest part of pixel (x, y), if any does.
    pub(super) fn blend(&self, depths: &Depths, [width, height]: [usize; 2], x: usize, y: usize) -> Option<Blend> {
        let mut best: Option<Blend> = None;
        for [dx, dy] in SIDES {
            let (Some(side_x), Some(side_y)) = (x.checked_add_signed(dx), y.checked_add_signed(dy)) else { continue };
            if side_x < width && side_y < height {
                let part = self.part(depths, [x as isize, y as isize], [dx, dy]);
                if part > best.map_or(0.0, |best| best.part) {
                    best = Some(Blend { x: side_x, y: side_y, part });
                }
            }
        }
        best
    }

    /// How much of a pixel its neighbour at [dx, dy] takes.
    fn part(&self, depths: &Depths, [x, y]: [isize; 2], [dx, dy]: [isize; 2]) -> f32 {
        let kind = self.step(depths.at(x, y), depths.at(x + dx, y + dy));
        if kind == 0 {
            return 0.0;
        }
        let end = |along: isize| {
            let mut last = [depths.at(x, y), depths.at(x + dx, y + dy)];
            for distance in 1..=SEARCH {
                let [x, y] = [x + dy * along * distance, y + dx * along * distance];
                let next = [depths.at(x, y), depths.at(x + dx, y + dy)];
                let [here, there] = [self.step(last[0], next[0]), self.step(next[1], last[1])];
                if here != 0 || there != 0 || self.step(next[0], next[1]) != kind {
                    let turn = if here == kind && there == 0 { Turn::Here } else { Turn::Elsewhere };
                    return (distance, turn);
                }
                last = next;
            }
            (SEARCH, Turn::Elsewhere)
        };
        let ends = [end(-1), end(1)];
        let length = (ends[0].0 + ends[1].0 - 1) as f32;
        let mut part = 0.0;
        for (distance, turn) in ends {
            if turn == Turn::Here {
                // The border falls from half a pixel at the turn to nothing half way to the other end.
                let [high, low] = [distance - 1, distance].map(|along| 0.5 - along as f32 / length);
                part += if low >= 0.0 {
                    0.5 * (high + low)
                } else if high > 0.0 {
                    0.5 * high * high * length
                } else {
                    0.0
                };
            }
        }
        part
    }
}
