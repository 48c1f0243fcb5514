//! What is truly there at each pixel.

use anyhow::Result;
use autosplats::Camera;
use autosplats::cloud::glam::DVec3;
use rayon::prelude::*;

use crate::picture::Shown;
use crate::subject::Subject;
use crate::view::Rays;

/// Widest spacing of points, in pixels, that counts as sampled.
const WIDEST_SPACING_PX: f64 = 1.5;
/// Of the k points around a place, this many must lie within 30° of its tangent plane for it to count as sampled: those
/// on another side of an edge, which a scanner may see alone, tell nothing about this one.
const LEAST_BESIDE: usize = 3;
/// Cosine of the steepest slant that widens the tolerance in depth.
const STEEPEST: f64 = 0.1;
/// How near a surface must be that is taken for one that the sensor of a sweep does not see, as a share of the diagonal.
const UNSEEN: f64 = 0.01;
/// Pixels from a silhouette within which normals are judged once more.
const BAND_PX: usize = 4;
/// Steps in depth below this many pixels are no silhouettes.
const LEAST_STEP_PX: f64 = 4.0;

/// The true surface at a pixel's centre.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// Along the viewing axis.
    pub depth: f64,
    /// World space, towards the eye.
    pub normal: DVec3,
    /// Mean distance in pixels of the points around; of swept ones the distance along the ring or across, whichever is the
    /// longer, and infinite where the sensor sees nothing.
    pub spacing_px: f64,
    /// Of swept points, whether the sensor sees this place.
    pub swept: Option<bool>,
    /// Whether there are points enough for a closed picture of this place: elsewhere limits do not hold.
    pub sampled: bool,
    /// Difference in depth within which a surface is the same: the radius of the ball that holds k points, or the distance
    /// of swept ones, what a slanted surface goes back within a pixel, and how far points lie off the surface.
    pub tolerance: f64,
}

/// The true picture, row by row.
#[derive(Clone, Debug)]
pub struct Exact {
    /// Pixels in a row.
    pub width: usize,
    /// The lines of sight.
    pub rays: Rays,
    /// What each pixel shows.
    pub seen: Vec<Option<Seen>>,
}

impl Exact {
    /// Sends one ray through the centre of each pixel.
    ///
    /// # Errors
    /// A camera that cannot see.
    pub fn trace(subject: &Subject, camera: &Camera, size: [u32; 2]) -> Result<Self> {
        Self::trace_with(subject, camera, size, |seen, place, direction, pixel_size| {
            let (spacing, reach, all_around) = match &subject.recipe.sweep {
                Some(sweep) => {
                    let gap = sweep.gap(&subject.surface, place);
                    (gap, if gap.is_finite() { gap } else { UNSEEN * subject.diagonal }, true)
                }
                None => {
                    let around = subject.clean.around(place);
                    let beside = around.iter().filter(|offset| offset.dot(seen.normal).abs() <= 0.5 * offset.length());
                    (spacing(&around), reach(&around), beside.count() >= LEAST_BESIDE)
                }
            };
            let spacing_px = spacing / pixel_size;
            let cos = direction.dot(seen.normal).abs().clamp(STEEPEST, 1.0);
            let slant = pixel_size * (1.0 - cos * cos).sqrt() / cos;
            Seen {
                spacing_px,
                swept: subject.recipe.sweep.map(|_| spacing.is_finite()),
                sampled: spacing_px <= WIDEST_SPACING_PX && all_around,
                tolerance: reach + slant + subject.blur,
                ..seen
            }
        })
    }

    /// The same without asking where points are: depths and normals only.
    ///
    /// # Errors
    /// A camera that cannot see.
    pub fn trace_alone(subject: &Subject, camera: &Camera, size: [u32; 2]) -> Result<Self> {
        Self::trace_with(subject, camera, size, |seen, _, _, _| seen)
    }

    /// Sends the rays; `about` adds what is to be known of a place from its direction and the size of a pixel there.
    fn trace_with(
        subject: &Subject,
        camera: &Camera,
        size @ [width, height]: [u32; 2],
        about: impl Fn(Seen, DVec3, DVec3, f64) -> Seen + Sync,
    ) -> Result<Self> {
        let rays = Rays::new(camera, size)?;
        let trace = |index: u32| {
            let (origin, direction) = rays.through([index % width, index / width].map(|at| f64::from(at) + 0.5));
            let hit = subject.surface.trace(origin, direction)?;
            let depth = hit.distance * direction.dot(rays.axes[2]);
            let normal = if hit.normal.dot(direction) > 0.0 { -hit.normal } else { hit.normal };
            let seen = Seen { depth, normal, spacing_px: f64::INFINITY, swept: None, sampled: false, tolerance: 0.0 };
            Some(about(seen, origin + direction * hit.distance, direction, rays.pixel_size(depth)))
        };
        let seen = (0..width * height).into_par_iter().map(trace).collect();
        Ok(Self { width: width as usize, rays, seen })
    }

    /// Pixels in a column.
    pub fn height(&self) -> usize {
        self.seen.len() / self.width
    }

    /// Whether anything is asked about a pixel: not where there is a surface that the sensor of a sweep does not see.
    pub fn is_asked(&self, pixel: usize) -> bool {
        self.seen[pixel].is_none_or(|seen| seen.swept != Some(false))
    }

    /// Whether a point shown is one of a sampled surface. An outlier is none, but should not be seen.
    pub fn is_sampled(&self, shown: &Shown, subject: &Subject) -> bool {
        if subject.is_outlier(shown.point) {
            return true;
        }
        let place = subject.clean.position(shown.point);
        let spacing = match &subject.recipe.sweep {
            Some(sweep) => sweep.gap(&subject.surface, place),
            None => spacing(&subject.clean.around(place)),
        };
        spacing <= WIDEST_SPACING_PX * self.rays.pixel_size(shown.depth)
    }

    /// The true surface at the pixels of the picture that lie at most `reach` pixels from `index` in x and in y.
    pub fn around(&self, index: usize, reach: usize) -> impl Iterator<Item = Option<&Seen>> {
        self.beside(index, reach).map(|pixel| self.seen[pixel].as_ref())
    }

    fn beside(&self, index: usize, reach: usize) -> impl Iterator<Item = usize> + use<> {
        let [width, height] = [self.width, self.height()];
        let [x, y] = [index % width, index / width];
        let range = move |at: usize, side: usize| at.saturating_sub(reach)..(at + reach + 1).min(side);
        range(y, height).flat_map(move |y| range(x, width).map(move |x| y * width + x))
    }

    /// The pixels near a silhouette: near an end of the surface or a step from one part of it to another behind.
    pub fn band(&self) -> Vec<bool> {
        let steps: Vec<bool> = (0..self.seen.len()).map(|pixel| self.is_step(pixel)).collect();
        let near = |pixel: usize| self.seen[pixel].is_some() && self.beside(pixel, BAND_PX).any(|near| steps[near]);
        (0..self.seen.len()).into_par_iter().map(near).collect()
    }

    /// Whether there is a step between a pixel and the one right of it or below it.
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

    /// Whether two pixels beside each other show no common surface: neither's tangent plane leads to the other.
    fn is_torn(&self, here: &Seen, there: &Seen, [x, y]: [f64; 2]) -> bool {
        let jump = there.depth - here.depth;
        let unit = self.rays.pixel_size(here.depth.min(there.depth));
        let rise = |seen: &Seen| {
            let normal = self.rays.turned(seen.normal);
            // How much deeper the plane is a pixel on.
            if normal.z == 0.0 { f64::INFINITY } else { -(normal.x * x + normal.y * y) / normal.z * unit }
        };
        let is_off = |seen: &Seen| !((jump - rise(seen)).abs() <= 0.5 * jump.abs());
        jump.abs() > LEAST_STEP_PX * unit && is_off(here) && is_off(there)
    }
}

/// The farthest of some offsets, ascending.
fn reach(offsets: &[DVec3]) -> f64 {
    offsets.last().map_or(f64::INFINITY, |farthest| farthest.length())
}

/// Mean distance between points that lie at these offsets, ascending, on a surface.
fn spacing(offsets: &[DVec3]) -> f64 {
    reach(offsets) * (std::f64::consts::PI / offsets.len() as f64).sqrt()
}
