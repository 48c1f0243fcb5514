//! What is truly there at each pixel, and what the picture shows there.

use autosplats::cloud::Scene;
use autosplats::cloud::glam::DVec3;
use autosplats::{Camera, GBuffer, Projection};
use rayon::prelude::*;

use crate::fit::Neighbors;

/// Widest spacing of points, in pixels, that counts as sampled.
const WIDEST_SPACING_PX: f64 = 1.5;
/// Of the k points around a place, this many must lie within 30° of its tangent plane for it to count as sampled: those
/// on another side of an edge, which a scanner may see alone, tell nothing about this one.
const LEAST_BESIDE: usize = 3;
/// Cosine of the steepest slant that widens the tolerance in depth.
const STEEPEST: f64 = 0.1;

/// The true surface at a pixel's centre.
#[derive(Clone, Copy)]
pub(crate) struct Surface {
    /// Along the viewing axis.
    pub(crate) depth: f64,
    /// World space.
    pub(crate) normal: DVec3,
    /// Mean distance in pixels of the points around.
    pub(crate) spacing_px: f64,
    /// Whether there are points enough for a closed picture of this place: elsewhere the limits do not hold.
    pub(crate) sampled: bool,
    /// Difference in depth within which a surface is the same: the radius of the ball that holds k points, and what a
    /// slanted surface goes back within a pixel.
    pub(crate) tolerance: f64,
}

/// The true picture, row by row.
pub(crate) struct Exact {
    pub(crate) width: usize,
    perspective: bool,
    /// Size of a pixel at depth 1.
    pixel: f64,
    pub(crate) surface: Vec<Option<Surface>>,
}

impl Exact {
    /// Sends one ray through the centre of each pixel.
    pub(crate) fn trace(scene: &Scene, camera: &Camera, [width, height]: [u32; 2], neighbors: &Neighbors) -> Self {
        let [right, down, forward] = camera.axes().expect("a camera that can see");
        let [middle_x, middle_y] = [width, height].map(|side| 0.5 * f64::from(side));
        let (perspective, pixel) = match camera.projection {
            Projection::PerspectiveFovDeg(fov) => (true, (0.5 * fov.to_radians()).tan() / middle_y),
            Projection::OrthographicHeight(world) => (false, world / f64::from(height)),
        };
        let trace = |index: u32| {
            let [x, y] = [index % width, index / width].map(|at| f64::from(at) + 0.5);
            let across = right * ((x - middle_x) * pixel) + down * ((y - middle_y) * pixel);
            let (origin, direction) =
                if perspective { (camera.eye, (forward + across).normalize()) } else { (camera.eye + across, forward) };
            let hit = scene.trace(origin, direction)?;
            let depth = hit.distance * direction.dot(forward);
            let pixel_size = if perspective { pixel * depth } else { pixel };
            let around = neighbors.around(origin + direction * hit.distance);
            let spacing_px = spacing(&around) / pixel_size;
            let beside = around.iter().filter(|offset| offset.dot(hit.normal).abs() <= 0.5 * offset.length());
            let cos = direction.dot(hit.normal).abs().clamp(STEEPEST, 1.0);
            Some(Surface {
                depth,
                normal: hit.normal,
                spacing_px,
                sampled: spacing_px <= WIDEST_SPACING_PX && beside.count() >= LEAST_BESIDE,
                tolerance: reach(&around) + pixel_size * (1.0 - cos * cos).sqrt() / cos,
            })
        };
        let surface = (0..width * height).into_par_iter().map(trace).collect();
        Self { width: width as usize, perspective, pixel, surface }
    }

    /// Whether a point shown is one of a sampled surface.
    pub(crate) fn is_sampled(&self, shown: &Shown, neighbors: &Neighbors) -> bool {
        let pixel_size = if self.perspective { self.pixel * shown.depth } else { self.pixel };
        spacing(&neighbors.around(neighbors.position(shown.point))) <= WIDEST_SPACING_PX * pixel_size
    }

    /// The true surface at the pixels of the picture that lie at most `reach` pixels from `index` in x and in y.
    pub(crate) fn around(&self, index: usize, reach: usize) -> impl Iterator<Item = Option<&Surface>> {
        let [width, height] = [self.width, self.surface.len() / self.width];
        let [x, y] = [index % width, index / width];
        let range = move |at: usize, side: usize| at.saturating_sub(reach)..(at + reach + 1).min(side);
        range(y, height).flat_map(move |y| range(x, width).map(move |x| self.surface[y * width + x].as_ref()))
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

/// What the render shows at a pixel.
#[derive(Clone, Copy)]
pub(crate) struct Shown {
    /// Along the viewing axis.
    pub(crate) depth: f64,
    /// World space.
    pub(crate) normal: DVec3,
    /// Index of the point whose splat is the heaviest.
    pub(crate) point: u32,
}

/// The render, row by row.
#[derive(Clone)]
pub(crate) struct Picture {
    width: usize,
    pub(crate) shown: Vec<Option<Shown>>,
}

impl Picture {
    pub(crate) fn new(layers: &GBuffer, camera: &Camera) -> Self {
        let axes = camera.axes().expect("a camera that can see");
        let [width, height] = [layers.width, layers.height].map(|side| side as usize);
        let show = |pixel: usize| {
            let index = layers.index(pixel % width, pixel / width);
            let depth = f64::from(layers.depth[index]);
            let normal = (0..3).map(|i| axes[i] * f64::from(layers.normal[index][i])).sum();
            depth.is_finite().then_some(Shown { depth, normal, point: layers.point[index] })
        };
        Self { width, shown: (0..width * height).map(show).collect() }
    }

    /// The picture moved right by `px` pixels, its right edge coming in on the left.
    pub(crate) fn shifted(&self, px: usize) -> Self {
        let mut shown = self.shown.clone();
        shown.chunks_mut(self.width).for_each(|row| row.rotate_right(px));
        Self { width: self.width, shown }
    }

    /// The picture with the normals of `other` wherever both show something.
    pub(crate) fn with_normals_of(&self, other: &Self) -> Self {
        let replace = |(shown, other): (&Option<Shown>, &Option<Shown>)| {
            shown.map(|shown| Shown { normal: other.map_or(shown.normal, |other| other.normal), ..shown })
        };
        Self { width: self.width, shown: self.shown.iter().zip(&other.shown).map(replace).collect() }
    }
}
