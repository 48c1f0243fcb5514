//! Splat set-up: a surfel made ready to be drawn over its pixels.
//!
//! # How it works
//! Let (dx, dy) be the offset of a pixel's centre from the projected surfel centre. In perspective, the inverse depth
//! of a plane is linear in (dx, dy), and so are the disc coordinates divided by depth. In parallel projection, depth
//! and disc coordinates themselves are linear. So a splat is a few gradients, and a pixel costs a few multiplications
//! and at most one division. In perspective all this holds for centres behind the eye too. They project through the
//! eye. The part of the disc in front of the eye is where the inverse depth is positive.

use crate::camera::View;
use crate::fit::{SUPPORT, Surfel};

/// Radius in pixels of the dot that is always drawn around a surfel's centre: the low-pass filter of [BHZK05]. So a
/// splat smaller than a pixel or seen from its edge still covers the pixel of its point. A pixel's centre is at most √½
/// away from any point in the pixel.
pub(super) const DOT_RADIUS_PX: f32 = 0.71;
/// Distance around a passive point, in first search radii, at which nearer surface must lie on all four sides for the
/// point to stay hidden. Splats reach about this far over a silhouette, and refinement and trim remove that part again.
/// The surface seen there in the end has to be reconstructed.
// Differs from the paper: the paper asks at the point's own pixel only. Grid culling then changes more of a picture,
// and leaves holes.
pub(super) const RECOVER_DISTANCE_RADII: f32 = 1.3;
/// Cosine of the angle to the line of sight below which a disc is drawn as a dot, because its gradients are no longer
/// reliable.
pub(super) const MIN_FACING_COSINE: f32 = 0.01;
/// Depth tolerance ε in splat radii: layers of one surface blend, layers further apart occlude.
pub(super) const EPSILON_RADII: f32 = 1.0;
/// Least depth of a disc's centre, before or behind the eye, as a share of its distance from the eye. A centre in the
/// plane of the eye, which projects nowhere, moves that far.
pub(super) const MIN_DEPTH_SHARE: f32 = 1.0 / 256.0;

/// A surfel ready to be drawn. Depths and ε are in world units.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Splat {
    /// Projected centre in pixels.
    pub(super) center_px: [f32; 2],
    /// Depth of the centre.
    pub(super) depth: f32,
    /// Largest difference of the disc's depth from the centre's.
    pub(super) depth_reach: f32,
    /// Depth tolerance ε.
    pub(super) epsilon: f32,
    /// Gradient of inverse depth (perspective) or depth (orthographic) per pixel.
    pub(super) plane: [f32; 2],
    /// Gradients of the two disc coordinates, divided by depth in perspective; the disc is where u² + v² ≤ 1.
    pub(super) u: [f32; 2],
    pub(super) v: [f32; 2],
    /// Columns and rows of pixels that may be covered, both ends included; first > last if there are none.
    pub(super) x: [u16; 2],
    pub(super) y: [u16; 2],
}

impl Splat {
    /// A splat that covers nothing.
    const NONE: Self = Self {
        center_px: [0.0; 2],
        depth: 0.0,
        depth_reach: 0.0,
        epsilon: 0.0,
        plane: [0.0; 2],
        u: [0.0; 2],
        v: [0.0; 2],
        x: [1, 0],
        y: [1, 0],
    };

    #[inline(always)]
    pub(super) fn new(surfel: &Surfel, view: &View) -> Self {
        let [cx, cy, _] = surfel.center;
        let cz = center_depth(surfel.center, view);
        let [nx, ny, nz] = surfel.normal;
        let a = surfel.major_axis;
        let b = [ny * a[2] - nz * a[1], nz * a[0] - nx * a[2], nx * a[1] - ny * a[0]];
        let minor = SUPPORT * surfel.radius;
        let major = minor * surfel.major_ratio;
        if !(minor > 0.0) {
            return Self::NONE;
        }

        let focal = view.focal_px;
        let [a_scale, b_scale] = [1.0 / (focal * major), 1.0 / (focal * minor)];
        let (facing, least_facing, plane, u, v);
        if view.perspective {
            let dot = |p: [f32; 3]| p[0] * cx + p[1] * cy + p[2] * cz;
            facing = dot(surfel.normal);
            least_facing = MIN_FACING_COSINE * (cx * cx + cy * cy + cz * cz).sqrt();
            plane = [nx / (focal * facing), ny / (focal * facing)];
            let [a_shear, b_shear] = [dot(a) / facing, dot(b) / facing];
            u = [(a[0] - nx * a_shear) * a_scale, (a[1] - ny * a_shear) * a_scale];
            v = [(b[0] - nx * b_shear) * b_scale, (b[1] - ny * b_shear) * b_scale];
        } else {
            facing = nz;
            least_facing = MIN_FACING_COSINE;
            plane = [-nx / (focal * nz), -ny / (focal * nz)];
            let [a_shear, b_shear] = [a[2] / nz, b[2] / nz];
            u = [(a[0] - nx * a_shear) * a_scale, (a[1] - ny * a_shear) * a_scale];
            v = [(b[0] - nx * b_shear) * b_scale, (b[1] - ny * b_shear) * b_scale];
        }
        let grazing = !(facing.abs() > least_facing);
        // A disc seen from its edge is drawn as the dot alone.
        let per_dot = 1.0 / (DOT_RADIUS_PX * if view.perspective { cz } else { 1.0 });
        let [plane, u, v] = if grazing { [[0.0; 2], [per_dot, 0.0], [0.0, per_dot]] } else { [plane, u, v] };

        let [axis_a, axis_b] = [a.map(|c| c * major), b.map(|c| c * minor)];
        let depth_reach = (axis_a[2] * axis_a[2] + axis_b[2] * axis_b[2]).sqrt();
        let center = [cx, cy, cz];
        let center_px = view.to_pixel(center.into());
        if view.perspective && !(cz > 0.0) {
            // A disc has no sides on a line of sight whose other end meets its centre.
            let is_opposite = |at: f32, size: u32| at > -1.0 && at < size as f32 + 1.0;
            let [x, y] = center_px;
            if !(cz + depth_reach > 0.0) || is_opposite(x, view.width) && is_opposite(y, view.height) {
                return Self::NONE;
            }
        }
        let x = extent(0, center, axis_a, axis_b, center_px[0], view.width, view);
        let y = extent(1, center, axis_a, axis_b, center_px[1], view.height, view);
        Self { center_px, depth: cz, depth_reach, epsilon: EPSILON_RADII * surfel.radius, plane, u, v, x, y }
    }

    /// Approximate reach from the centre, in pixels.
    #[inline(always)]
    pub(super) fn reach_px(&self) -> f32 {
        let [width, height] = [self.x, self.y].map(|[first, last]| f32::from(last.saturating_sub(first)));
        0.5 * width.max(height) + 0.5
    }

    #[inline(always)]
    pub(super) fn covers_nothing(&self) -> bool {
        self.x[0] > self.x[1] || self.y[0] > self.y[1]
    }
}

/// Depth of a disc's centre, moved off the plane of the eye.
#[inline(always)]
fn center_depth([x, y, z]: [f32; 3], view: &View) -> f32 {
    let least = MIN_DEPTH_SHARE * (x * x + y * y + z * z).sqrt();
    if view.perspective && z.abs() < least { least.copysign(z) } else { z }
}

/// First and last pixel along `axis` whose centre the disc or its dot may cover.
#[inline(always)]
fn extent(axis: usize, center: [f32; 3], a: [f32; 3], b: [f32; 3], center_px: f32, size: u32, view: &View) -> [u16; 2] {
    let [c, cz] = [center[axis], center[2]];
    let squared = a[axis] * a[axis] + b[axis] * b[axis];
    let (mut low, mut high);
    if view.perspective {
        // The lines of sight s = x/z that touch the ellipse c + a·cos + b·sin: (c - s·cz)² = (a - s·az)² + (b - s·bz)².
        let qa = cz * cz - a[2] * a[2] - b[2] * b[2];
        let qb = c * cz - a[axis] * a[2] - b[axis] * b[2];
        let qc = c * c - squared;
        let square = qb * qb - qa * qc;
        let root = square.max(0.0).sqrt();
        (low, high) = ((qb - root) / qa, (qb + root) / qa);
        if qa <= 0.0 || cz <= 0.0 {
            // The disc meets the plane of the eye. It ends at the lines of sight that touch it in front of the eye.
            let tangents = if square > 0.0 { [low, high] } else { [f32::NAN; 2] };
            [low, high] = front_extent(tangents, [c, cz], [a[axis], a[2]], [b[axis], b[2]]);
        }
    } else {
        let reach = squared.sqrt();
        (low, high) = (c - reach, c + reach);
    }
    let middle = view.middle[axis];
    // Pixel i is covered if its centre i + ½ lies within.
    let dot_px = if cz > 0.0 || !view.perspective { DOT_RADIUS_PX } else { f32::NAN };
    let low = (low * view.focal_px + middle).min(center_px - dot_px) - 0.5;
    let high = (high * view.focal_px + middle).max(center_px + dot_px) - 0.5;
    // Casts from float saturate, so an extent beside the picture must become an empty one explicitly.
    let first = low.ceil().max(0.0);
    let last = high.floor().min(size as f32 - 1.0);
    if first <= last { [first as u16, last as u16] } else { [1, 0] }
}

/// Range of slopes of the part of an ellipse in front of the eye, which meets the plane of the eye. `tangents` are the
/// slopes of the lines through the eye that touch it, NaN if there are none. The ellipse has the centre `c` and the
/// axes `a` and `b`; all places are an offset aside and a depth.
fn front_extent(tangents: [f32; 2], c: [f32; 2], a: [f32; 2], b: [f32; 2]) -> [f32; 2] {
    let mut range = [f32::NEG_INFINITY, f32::INFINITY];
    for slope in tangents {
        let aside = |p: [f32; 2]| p[0] - slope * p[1];
        // The ellipse touches the line where the offset c + a·cos + b·sin from it is zero and stationary.
        let touched = c[1] - (a[1] * aside(a) + b[1] * aside(b)) / aside(c);
        if touched > 0.0 {
            range[usize::from(aside(c) < 0.0)] = slope;
        }
    }
    range
}
