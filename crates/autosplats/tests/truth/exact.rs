//! What is truly there at each pixel, and what the picture shows there.

use autosplats::cloud::Scene;
use autosplats::cloud::glam::DVec3;
use autosplats::{Camera, GBuffer, Projection};
use rayon::prelude::*;

use crate::fit::Neighbors;

/// Widest spacing of points, in pixels, that counts as sampled.
const WIDEST_SPACING_PX: f64 = 1.5;

/// The true surface at a pixel's centre.
#[derive(Clone, Copy)]
pub(crate) struct Surface {
    /// Along the viewing axis.
    pub(crate) depth: f64,
    /// World space.
    pub(crate) normal: DVec3,
    /// Radius of the ball about this place that holds k points.
    pub(crate) k_radius: f64,
    /// Mean distance of the points in that ball, in pixels.
    pub(crate) spacing_px: f64,
}

impl Surface {
    /// Whether there are points enough for a closed picture of this place: elsewhere the limits do not hold.
    pub(crate) fn sampled(&self) -> bool {
        self.spacing_px <= WIDEST_SPACING_PX
    }
}

/// The true picture, row by row.
pub(crate) struct Exact {
    pub(crate) width: usize,
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
            let k_radius = neighbors.k_radius(origin + direction * hit.distance);
            let pixel_size = if perspective { pixel * depth } else { pixel };
            let spacing_px = k_radius * (std::f64::consts::PI / neighbors.k()).sqrt() / pixel_size;
            Some(Surface { depth, normal: hit.normal, k_radius, spacing_px })
        };
        Self { width: width as usize, surface: (0..width * height).into_par_iter().map(trace).collect() }
    }

    /// The true surface at the pixels of the picture that lie at most `reach` pixels from `index` in x and in y.
    pub(crate) fn around(&self, index: usize, reach: usize) -> impl Iterator<Item = Option<&Surface>> {
        let [width, height] = [self.width, self.surface.len() / self.width];
        let [x, y] = [index % width, index / width];
        let range = move |at: usize, side: usize| at.saturating_sub(reach)..(at + reach + 1).min(side);
        range(y, height).flat_map(move |y| range(x, width).map(move |x| self.surface[y * width + x].as_ref()))
    }
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
