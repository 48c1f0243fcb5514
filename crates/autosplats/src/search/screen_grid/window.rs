//! Windows: rectangles of the screen with a range of depths.

use std::ops::Range;

use crate::camera::View;
use crate::project::ScreenCells;
use crate::search::{MARGIN_PX, MAX_CANDIDATES};

/// A rectangle of pixels and a range of depths, all ends included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Window {
    pub(super) x0: f32,
    pub(super) x1: f32,
    pub(super) y0: f32,
    pub(super) y1: f32,
    pub(super) near: f32,
    pub(super) far: f32,
}

impl Window {
    /// The empty window, the neutral element of [`union`](Self::union).
    pub(super) const EMPTY: Self =
        Self { x0: f32::MAX, x1: -1.0, y0: f32::MAX, y1: -1.0, near: f32::INFINITY, far: f32::NEG_INFINITY };

    /// The window that holds all points within `radius` of `center` (view space).
    #[inline(always)]
    pub(super) fn of_sphere(center: [f32; 3], radius: f32, view: &View) -> Self {
        let [x, y, z] = center;
        let [right, bottom] = [view.width as f32 - 1.0, view.height as f32 - 1.0];
        let (mut x0, mut x1, mut y0, mut y1);
        if view.perspective {
            [x0, x1] = tangents(x, z, radius);
            [y0, y1] = tangents(y, z, radius);
        } else {
            [x0, x1, y0, y1] = [x - radius, x + radius, y - radius, y + radius];
        }
        x0 = (x0 * view.focal_px + view.middle[0] - MARGIN_PX).floor();
        x1 = (x1 * view.focal_px + view.middle[0] + MARGIN_PX).floor();
        y0 = (y0 * view.focal_px + view.middle[1] - MARGIN_PX).floor();
        y1 = (y1 * view.focal_px + view.middle[1] + MARGIN_PX).floor();
        // A sphere around the plane of the eye projects everywhere.
        let bounded = !view.perspective | (z > 1.0001 * radius);
        Self {
            x0: if bounded & (x0 > 0.0) { x0 } else { 0.0 },
            x1: if bounded & (x1 < right) { x1 } else { right },
            y0: if bounded & (y0 > 0.0) { y0 } else { 0.0 },
            y1: if bounded & (y1 < bottom) { y1 } else { bottom },
            near: z - radius,
            far: z + radius,
        }
    }

    /// Whether a sphere [`BOUND_STEP`](crate::search::BOUND_STEP) times as large, with two points in each pixel, stays
    /// within the bound on search work.
    #[inline(always)]
    pub(super) fn is_small(&self) -> bool {
        let side = |low: f32, high: f32| 1.5 * (high - low + 1.0) + 4.0;
        2.0 * side(self.x0, self.x1) * side(self.y0, self.y1) <= MAX_CANDIDATES as f32
    }

    #[inline(always)]
    pub(super) fn union(self, other: Self) -> Self {
        Self {
            x0: self.x0.min(other.x0),
            x1: self.x1.max(other.x1),
            y0: self.y0.min(other.y0),
            y1: self.y1.max(other.y1),
            near: self.near.min(other.near),
            far: self.far.max(other.far),
        }
    }

    #[inline(always)]
    pub(super) fn contains(&self, other: &Self) -> bool {
        self.contains_pixels(other) & (self.near <= other.near) & (self.far >= other.far)
    }

    #[inline(always)]
    fn contains_pixels(&self, other: &Self) -> bool {
        (self.x0 <= other.x0) & (self.x1 >= other.x1) & (self.y0 <= other.y0) & (self.y1 >= other.y1)
    }

    /// Grows the window to what is read anyway: whole strips, and all depths if it covers the whole picture.
    #[inline(always)]
    pub(super) fn grown(mut self, cells: &ScreenCells, view: &View) -> Self {
        let [right, bottom] = [view.width as f32 - 1.0, view.height as f32 - 1.0];
        let strip_px = cells.strip_px as f32;
        self.y0 = (self.y0 / strip_px).floor() * strip_px;
        self.y1 = ((self.y1 / strip_px).floor() * strip_px + strip_px - 1.0).min(bottom);
        let picture = Self { x0: 0.0, x1: right, y0: 0.0, y1: bottom, ..self };
        if self.contains_pixels(&picture) {
            [self.near, self.far] = [f32::NEG_INFINITY, f32::INFINITY];
        }
        self
    }

    /// Whether the window holds every screen point.
    pub(super) fn is_all(&self) -> bool {
        self.far == f32::INFINITY
    }

    /// The runs of screen points in the window's rectangle, strip by strip.
    pub(super) fn runs<'a>(&self, cells: &'a ScreenCells) -> impl Iterator<Item = Range<usize>> + use<'a> {
        let [x0, x1, y0, y1] = [self.x0, self.x1, self.y0, self.y1].map(|pixel| pixel as usize);
        (y0 / cells.strip_px..=y1 / cells.strip_px).map(move |strip| cells.run(strip, x0, x1))
    }

    /// Number of screen points in the window's rectangle.
    pub(super) fn candidates(&self, cells: &ScreenCells) -> usize {
        self.runs(cells).map(|run| run.len()).sum()
    }
}

/// Slopes of the lines through the eye that touch the circle of `radius` about (x, z), which lies in front of the eye.
#[inline(always)]
fn tangents(x: f32, z: f32, radius: f32) -> [f32; 2] {
    let length = (x * x + z * z - radius * radius).max(0.0).sqrt();
    [(x * length - radius * z) / (z * length + radius * x), (x * length + radius * z) / (z * length - radius * x)]
}
