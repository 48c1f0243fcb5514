//! Pictures as depths, normals and points of pixels.

use autosplats::GBuffer;
use autosplats::cloud::glam::DVec3;

use crate::rays::Rays;

/// The surface that a picture shows at a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrawnSurface {
    /// Depth along the viewing axis.
    pub depth: f64,
    /// Unit normal in world space, towards the eye. Zero for methods without normals.
    pub normal: DVec3,
    /// Index of the point whose splat has the greatest weight. Meaningless in a true picture.
    pub point: u32,
}

/// A picture, in rows of pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Number of pixels in a row.
    pub width: usize,
    /// The surface at each pixel. `None` where the picture is empty.
    pub shown: Vec<Option<DrawnSurface>>,
}

impl Picture {
    /// The picture in the layers of a renderer.
    pub fn new(layers: &GBuffer, rays: &Rays) -> Self {
        let [width, height] = [layers.width, layers.height].map(|side| side as usize);
        let show = |pixel: usize| {
            let index = layers.index(pixel % width, pixel / width);
            let depth = f64::from(layers.depth[index]);
            let normal = (0..3).map(|i| rays.axes[i] * f64::from(layers.normal[index][i])).sum();
            depth.is_finite().then_some(DrawnSurface { depth, normal, point: layers.point[index] })
        };
        Self { width, shown: (0..width * height).map(show).collect() }
    }

    /// Number of pixels in a column.
    pub fn height(&self) -> usize {
        self.shown.len() / self.width
    }

    /// The picture moved right by `px` pixels. Its right edge continues on the left.
    #[must_use]
    pub fn shifted(&self, px: usize) -> Self {
        let mut shown = self.shown.clone();
        shown.chunks_mut(self.width).for_each(|row| row.rotate_right(px));
        Self { width: self.width, shown }
    }

    /// The picture with the normals of `other` where both show a surface.
    #[must_use]
    pub fn with_normals_of(&self, other: &Self) -> Self {
        let replace = |(shown, other): (&Option<DrawnSurface>, &Option<DrawnSurface>)| {
            shown.map(|shown| DrawnSurface { normal: other.map_or(shown.normal, |other| other.normal), ..shown })
        };
        Self { width: self.width, shown: self.shown.iter().zip(&other.shown).map(replace).collect() }
    }

    /// The picture with every covered pixel replaced by the result of `change`, which may be empty.
    #[must_use]
    pub fn changed(&self, change: impl Fn(usize, DrawnSurface) -> Option<DrawnSurface>) -> Self {
        let change = |(pixel, shown): (usize, &Option<DrawnSurface>)| shown.and_then(|shown| change(pixel, shown));
        Self { width: self.width, shown: self.shown.iter().enumerate().map(change).collect() }
    }
}
