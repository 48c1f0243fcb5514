//! Edges: pixels at the border of a surface show a part of what lies on the other side.
//!
//! # How it works
//! Between neighbouring pixels there is an edge if only one is covered, or if one lies further behind the other than
//! any surface is steep. A border that is nearly level or upright is a row of edges with a turn at its end, up or down
//! by a pixel. The true border is assumed to cross the row of edges in its middle and the turn at half its height. So
//! the border cuts a triangle or trapezium off a pixel beside the turn. Its area is the share of the other side
//! [Reshetov: *Morphological Antialiasing*, 2009]. Here edges come from the surface, not from the picture's colours, so
//! the texture of a scan stays sharp.

use super::depths::Depths;
use crate::camera::View;

/// Slope, as depth by distance across the line of sight, from which neighbouring pixels belong to different surfaces.
const MAX_SURFACE_SLOPE: f32 = 4.0;
/// Length of the search for the ends of a row of edges, in pixels to either side.
pub(super) const EDGE_SEARCH_PX: isize = 12;
/// Distance from a border, in pixels, at which the inner depth and normal are read. The splats of the border itself may
/// be tilted otherwise.
pub(super) const INNER_NORMAL_PX: isize = 3;
/// A border's normal is replaced if its component towards the border is smaller than the inner normal's by more than
/// this. At a corner of pixels the component is the sum of both axes.
pub(super) const MIN_TILT_LOSS: f32 = 0.3;
/// Sides of a pixel.
const SIDES: [[isize; 2]; 4] = [[0, -1], [0, 1], [-1, 0], [1, 0]];

/// Thresholds of edges in a picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edges {
    /// A depth lies behind another if it is greater than this factor times the other, plus the offset.
    pub(super) factor: f32,
    pub(super) offset: f32,
}

/// A neighbour, and the part of the pixel that shows the neighbour's colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Blend {
    pub(super) x: usize,
    pub(super) y: usize,
    pub(super) part: f32,
}

/// Where a row of edges turns at its end.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Turn {
    /// Into the pixel's own row.
    Here,
    Elsewhere,
}

impl Edges {
    /// Thresholds for this view.
    pub(super) fn new(view: &View) -> Self {
        let step = MAX_SURFACE_SLOPE / view.focal_px;
        if view.perspective { Self { factor: 1.0 + step, offset: 0.0 } } else { Self { factor: 1.0, offset: step } }
    }

    /// 1 if depth `b` lies behind `a`, -1 if in front, 0 if both may be one surface.
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

    /// Direction in which the pixel's surface ends in front of something: the sum of the steps to such neighbours.
    pub(super) fn outward(&self, depths: &Depths, size: [usize; 2], x: usize, y: usize) -> [isize; 2] {
        let [x, y] = [x as isize, y as isize];
        let mut sum = [0; 2];
        for [dx, dy] in SIDES {
            if is_inside(size, x + dx, y + dy) && self.step(depths.at(x, y), depths.at(x + dx, y + dy)) == 1 {
                sum = [sum[0] + dx, sum[1] + dy];
            }
        }
        sum
    }

    /// The neighbour that takes the largest part of pixel (x, y), if any does.
    pub(super) fn blend(&self, depths: &Depths, size: [usize; 2], x: usize, y: usize) -> Option<Blend> {
        let [x, y] = [x as isize, y as isize];
        let mut best: Option<Blend> = None;
        for [dx, dy] in SIDES {
            if is_inside(size, x + dx, y + dy) {
                let part = self.part(depths, size, [x, y], [dx, dy]);
                if part > best.map_or(0.0, |best| best.part) {
                    best = Some(Blend { x: (x + dx) as usize, y: (y + dy) as usize, part });
                }
            }
        }
        best
    }

    /// Part of a pixel that its neighbour at [dx, dy] takes, 0 to 1.
    fn part(&self, depths: &Depths, size: [usize; 2], [x, y]: [isize; 2], [dx, dy]: [isize; 2]) -> f32 {
        let kind = self.step(depths.at(x, y), depths.at(x + dx, y + dy));
        if kind == 0 {
            return 0.0;
        }
        let end = |along: isize| {
            let mut last = [depths.at(x, y), depths.at(x + dx, y + dy)];
            for distance in 1..=EDGE_SEARCH_PX {
                let [x, y] = [x + dy * along * distance, y + dx * along * distance];
                if !is_inside(size, x, y) {
                    // Beyond the picture the edge goes on.
                    break;
                }
                let next = [depths.at(x, y), depths.at(x + dx, y + dy)];
                let [here, there] = [self.step(last[0], next[0]), self.step(next[1], last[1])];
                if here != 0 || there != 0 || self.step(next[0], next[1]) != kind {
                    let turn = if here == kind && there == 0 { Turn::Here } else { Turn::Elsewhere };
                    return (distance, turn);
                }
                last = next;
            }
            (EDGE_SEARCH_PX, Turn::Elsewhere)
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

fn is_inside([width, height]: [usize; 2], x: isize, y: isize) -> bool {
    (0..width as isize).contains(&x) && (0..height as isize).contains(&y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Projection};
    use crate::splat::GBuffer;
    use glam::DVec3;

    const SIZE: usize = 48;

    fn view(projection: Projection) -> View {
        let camera = Camera { eye: DVec3::ZERO, look_at: DVec3::Z, up: DVec3::NEG_Y, projection };
        camera.view(DVec3::ZERO, [SIZE as u32; 2]).expect("a view")
    }

    /// Depths of a picture by `of` at the middle of each pixel.
    fn depths(of: impl Fn(f32, f32) -> f32) -> Depths {
        let mut layers = GBuffer::new(SIZE as u32, SIZE as u32);
        for pixel in 0..SIZE * SIZE {
            let [x, y] = [pixel % SIZE, pixel / SIZE];
            let at = layers.index(x, y);
            layers.depth[at] = of(x as f32 + 0.5, y as f32 + 0.5);
        }
        let mut depths = Depths::default();
        depths.fill(&layers, [0..SIZE as isize, 0..SIZE as isize], EDGE_SEARCH_PX as usize + 1);
        depths
    }

    /// Summed squared errors of the covered part of pixels, without and with blending. Pixels near the picture's edges,
    /// where rows of edges end, do not count.
    fn errors(view: &View, inside: impl Fn(f32, f32) -> bool, behind: f32) -> [f64; 2] {
        let depths = depths(|x, y| if inside(x, y) { 2.0 } else { behind });
        let edges = Edges::new(view);
        let mut sums = [0.0; 2];
        for y in 14..SIZE - 14 {
            for x in 14..SIZE - 14 {
                let true_part = covered_part(&inside, x, y);
                let is_inside = |x: usize, y: usize| f64::from(inside(x as f32 + 0.5, y as f32 + 0.5));
                let own = is_inside(x, y);
                let shown = edges
                    .blend(&depths, [SIZE; 2], x, y)
                    .map_or(own, |blend| own + (is_inside(blend.x, blend.y) - own) * f64::from(blend.part));
                sums[0] += (own - true_part).powi(2);
                sums[1] += (shown - true_part).powi(2);
            }
        }
        sums
    }

    #[test]
    fn borders_are_shown_as_they_cut_pixels() {
        let views = [Projection::PerspectiveFovDeg(40.0), Projection::OrthographicHeight(2.0)].map(view);
        for view in &views {
            for behind in [3.0, f32::INFINITY] {
                for slope in [-3.0, -1.0, -0.45, -0.2, 0.08, 0.13, 0.3, 0.7, 1.0, 2.2, 9.0] {
                    let line = |x: f32, y: f32| y - 24.2 < slope * (x - 24.1);
                    let [plain, blended] = errors(view, line, behind);
                    // All steps of an exact diagonal are alike, and do not show where between them the border lies.
                    let limit = if slope.abs() == 1.0 { 0.7 } else { 0.25 };
                    assert!(blended < limit * plain, "slope {slope}, behind {behind}: {plain} becomes {blended}");
                }
                let disc = |x: f32, y: f32| (x - 24.3).hypot(y - 23.8) < 8.0;
                let [plain, blended] = errors(view, disc, behind);
                assert!(blended < 0.5 * plain, "a disc: {plain} becomes {blended}");
            }
        }
    }

    #[test]
    fn a_wrong_blend_is_found() {
        // The measure above must reject a wrong blend, as if the border were mirrored.
        let view = view(Projection::PerspectiveFovDeg(40.0));
        let line = |x: f32, y: f32| y - 24.2 < 0.2 * (x - 24.1);
        let depths = depths(|x, y| if line(x, y) { 2.0 } else { 3.0 });
        let edges = Edges::new(&view);
        let mirrored = |x: usize| SIZE - 1 - x;
        let mut sums = [0.0; 2];
        for (y, x) in (14..34).flat_map(|y| (14..34).map(move |x| (y, x))) {
            let part = |x: usize| edges.blend(&depths, [SIZE; 2], x, y).map_or(0.0, |blend| f64::from(blend.part));
            let true_part = (covered_part(line, x, y) - f64::from(line(x as f32 + 0.5, y as f32 + 0.5))).abs();
            sums[0] += (part(x) - true_part).powi(2);
            sums[1] += (part(mirrored(x)) - true_part).powi(2);
        }
        assert!(sums[1] > 4.0 * sums[0], "the right blend {} and a wrong one {}", sums[0], sums[1]);
    }

    /// Part of a pixel that a shape covers, by 256 samples.
    fn covered_part(inside: impl Fn(f32, f32) -> bool, x: usize, y: usize) -> f64 {
        let steps = (0..256).map(|step| [step % 16, step / 16].map(|step| (step as f32 + 0.5) / 16.0));
        steps.filter(|[dx, dy]| inside(x as f32 + dx, y as f32 + dy)).count() as f64 / 256.0
    }

    #[test]
    fn surfaces_have_no_edges() {
        let view = view(Projection::PerspectiveFovDeg(40.0));
        let unit = view.pixel_size(2.0);
        for slope in [0.0, 1.0, 3.0] {
            let depths = depths(|x, y| 2.0 + unit * slope * (0.3 * x + 0.7 * y));
            let mut marks = [true; SIZE];
            // The first and last row and column have no neighbours.
            for y in 1..SIZE - 1 {
                Edges::new(&view).mark(&depths, y as isize, &mut marks);
                assert_eq!(marks[1..SIZE - 1], [false; SIZE - 2], "slope {slope}, row {y}");
            }
        }
    }
}
