//! The true surface at each pixel.

use anyhow::Result;
use autosplats::Camera;
use autosplats::cloud::glam::DVec3;
use rayon::prelude::*;

use crate::picture::{DrawnSurface, Picture};
use crate::rays::Rays;
use crate::subject::Subject;

/// Greatest spacing of points that counts as sampled, pixels.
const MAX_SPACING_PX: f64 = 1.5;
/// Fewest of a place's nearest points within 30° of its tangent plane that make the place count as sampled. Points
/// beyond an edge do not sample this side of the edge, which a scanner may not have seen.
const MIN_POINTS_NEAR_PLANE: usize = 3;
/// Least cosine between line of sight and normal from which the tolerance in depth is computed.
const MIN_TOLERANCE_COSINE: f64 = 0.1;
/// Tolerance in depth where the lidar does not see the surface, as a share of the subject's diagonal.
const UNSEEN_TOLERANCE: f64 = 0.01;
/// Greatest distance from a silhouette, in pixels, at which a pixel belongs to the band.
const BAND_PX: usize = 4;
/// Least step in depth that may be a silhouette, pixels.
const MIN_STEP_PX: f64 = 4.0;

/// The true surface at a pixel's centre.
#[derive(Clone, Copy, Debug)]
pub struct TrueSurface {
    /// Depth along the viewing axis.
    pub depth: f64,
    /// Unit normal in world space, towards the eye.
    pub normal: DVec3,
    /// Mean spacing of the points around, pixels. For a lidar the spacing along or across rings, whichever is longer,
    /// and infinite where the lidar does not see the surface.
    pub spacing_px: f64,
    /// Whether the lidar sees this place. `None` for sampled points.
    pub swept: Option<bool>,
    /// Whether points are dense enough for a closed picture. Limits hold only there.
    pub sampled: bool,
    /// Greatest difference in depth that counts as the same surface, a sum of three terms. The first is the distance to
    /// the k-th nearest point, or a lidar's spacing. The others are a slanted surface's depth within a pixel, and
    /// [`Subject::max_offset`].
    pub tolerance: f64,
}

/// The true picture, in rows of pixels.
#[derive(Clone, Debug)]
pub struct Exact {
    /// Number of pixels in a row.
    pub width: usize,
    /// The picture's lines of sight.
    pub rays: Rays,
    /// The surface at each pixel's centre. `None` where no surface is.
    pub seen: Vec<Option<TrueSurface>>,
}

impl Exact {
    /// Traces one ray through the centre of each pixel.
    ///
    /// # Errors
    /// An invalid camera.
    pub fn trace(subject: &Subject, camera: &Camera, size: [u32; 2]) -> Result<Self> {
        Self::trace_with(subject, camera, size, |seen, place, direction, pixel_size| {
            let (spacing, reach, all_around) = match &subject.recipe.sweep {
                Some(sweep) => {
                    let gap = sweep.gap(&subject.surface, place);
                    (gap, if gap.is_finite() { gap } else { UNSEEN_TOLERANCE * subject.diagonal }, true)
                }
                None => {
                    let around = subject.clean.around(place);
                    let beside = around.iter().filter(|offset| offset.dot(seen.normal).abs() <= 0.5 * offset.length());
                    (spacing(&around), reach(&around), beside.count() >= MIN_POINTS_NEAR_PLANE)
                }
            };
            let spacing_px = spacing / pixel_size;
            let cos = direction.dot(seen.normal).abs().clamp(MIN_TOLERANCE_COSINE, 1.0);
            let slant = pixel_size * (1.0 - cos * cos).sqrt() / cos;
            TrueSurface {
                spacing_px,
                swept: subject.recipe.sweep.map(|_| spacing.is_finite()),
                sampled: spacing_px <= MAX_SPACING_PX && all_around,
                tolerance: reach + slant + subject.max_offset,
                ..seen
            }
        })
    }

    /// Traces depths and normals alone, without the spacing of points.
    ///
    /// # Errors
    /// An invalid camera.
    pub fn trace_surface(subject: &Subject, camera: &Camera, size: [u32; 2]) -> Result<Self> {
        Self::trace_with(subject, camera, size, |seen, _, _, _| seen)
    }

    /// Traces the rays. `about` completes each surface, given its place, the ray's direction and the size of a pixel
    /// there.
    fn trace_with(
        subject: &Subject,
        camera: &Camera,
        size @ [width, height]: [u32; 2],
        about: impl Fn(TrueSurface, DVec3, DVec3, f64) -> TrueSurface + Sync,
    ) -> Result<Self> {
        let rays = Rays::new(camera, size)?;
        let trace = |index: u32| {
            let (origin, direction) = rays.through([index % width, index / width].map(|at| f64::from(at) + 0.5));
            let hit = subject.surface.trace(origin, direction)?;
            let depth = hit.distance * direction.dot(rays.axes[2]);
            let normal = if hit.normal.dot(direction) > 0.0 { -hit.normal } else { hit.normal };
            let seen =
                TrueSurface { depth, normal, spacing_px: f64::INFINITY, swept: None, sampled: false, tolerance: 0.0 };
            Some(about(seen, origin + direction * hit.distance, direction, rays.pixel_size(depth)))
        };
        let seen = (0..width * height).into_par_iter().map(trace).collect();
        Ok(Self { width: width as usize, rays, seen })
    }

    /// Number of pixels in a column.
    pub fn height(&self) -> usize {
        self.seen.len() / self.width
    }

    /// Whether a pixel is measured. Pixels of a surface that the lidar does not see are not.
    pub fn is_measured(&self, pixel: usize) -> bool {
        self.seen[pixel].is_none_or(|seen| seen.swept != Some(false))
    }

    /// Whether a drawn point lies where points are dense enough. Outliers count as such: they should not be visible.
    pub fn is_sampled(&self, shown: &DrawnSurface, subject: &Subject) -> bool {
        if subject.is_outlier(shown.point) {
            return true;
        }
        let place = subject.clean.position(shown.point);
        let spacing = match &subject.recipe.sweep {
            Some(sweep) => sweep.gap(&subject.surface, place),
            None => spacing(&subject.clean.around(place)),
        };
        spacing <= MAX_SPACING_PX * self.rays.pixel_size(shown.depth)
    }

    /// The true surface at all pixels at most `reach` pixels from `index` in x and in y.
    pub fn around(&self, index: usize, reach: usize) -> impl Iterator<Item = Option<&TrueSurface>> {
        self.beside(index, reach).map(|pixel| self.seen[pixel].as_ref())
    }

    fn beside(&self, index: usize, reach: usize) -> impl Iterator<Item = usize> + use<> {
        let [width, height] = [self.width, self.height()];
        let [x, y] = [index % width, index / width];
        let range = move |at: usize, side: usize| at.saturating_sub(reach)..(at + reach + 1).min(side);
        range(y, height).flat_map(move |y| range(x, width).map(move |x| y * width + x))
    }

    /// Whether each pixel lies near a silhouette: near an end of the surface, or near a step in depth.
    pub fn band(&self) -> Vec<bool> {
        let steps: Vec<bool> = (0..self.seen.len()).map(|pixel| self.is_step(pixel)).collect();
        let near = |pixel: usize| self.seen[pixel].is_some() && self.beside(pixel, BAND_PX).any(|near| steps[near]);
        (0..self.seen.len()).into_par_iter().map(near).collect()
    }

    /// Whether a silhouette lies between a pixel and the next one to the right or below.
    fn is_step(&self, pixel: usize) -> bool {
        let [x, y] = [pixel % self.width, pixel / self.width];
        let right = (x + 1 < self.width).then_some((pixel + 1, [1.0, 0.0]));
        let below = (y + 1 < self.height()).then_some((pixel + self.width, [0.0, 1.0]));
        right.into_iter().chain(below).any(|(other, offset)| match (&self.seen[pixel], &self.seen[other]) {
            (None, None) => false,
            (Some(here), Some(there)) => self.is_torn(here, there, offset),
            _ => true,
        })
    }

    /// Whether two neighbouring pixels show different surfaces: neither's tangent plane leads to the other.
    fn is_torn(&self, here: &TrueSurface, there: &TrueSurface, [x, y]: [f64; 2]) -> bool {
        let jump = there.depth - here.depth;
        let unit = self.rays.pixel_size(here.depth.min(there.depth));
        let rise = |seen: &TrueSurface| {
            let normal = self.rays.turned(seen.normal);
            // Growth of the plane's depth towards the other pixel.
            if normal.z == 0.0 { f64::INFINITY } else { -(normal.x * x + normal.y * y) / normal.z * unit }
        };
        let is_off = |seen: &TrueSurface| !((jump - rise(seen)).abs() <= 0.5 * jump.abs());
        jump.abs() > MIN_STEP_PX * unit && is_off(here) && is_off(there)
    }
}

impl Picture {
    /// The true picture, as a method without errors would draw it.
    pub fn truth(exact: &Exact) -> Self {
        let show = |seen: &Option<TrueSurface>| {
            seen.map(|seen| DrawnSurface { depth: seen.depth, normal: seen.normal, point: u32::MAX })
        };
        Self { width: exact.width, shown: exact.seen.iter().map(show).collect() }
    }
}

/// Length of the last offset, which is the longest.
fn reach(offsets: &[DVec3]) -> f64 {
    offsets.last().map_or(f64::INFINITY, |farthest| farthest.length())
}

/// Mean spacing of points on a surface, from their offsets in ascending order.
fn spacing(offsets: &[DVec3]) -> f64 {
    reach(offsets) * (std::f64::consts::PI / offsets.len() as f64).sqrt()
}
