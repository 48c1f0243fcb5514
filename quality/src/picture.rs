//! What a picture shows at each pixel.

use autosplats::GBuffer;
use autosplats::cloud::glam::DVec3;

use crate::exact::Exact;
use crate::view::Rays;

/// What a picture shows at a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown {
    /// Along the viewing axis.
    pub depth: f64,
    /// World space, towards the eye; zero where the method knows none.
    pub normal: DVec3,
    /// Index of the point whose splat is the heaviest; nothing sensible in a picture of the truth.
    pub point: u32,
}

/// A picture, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels in a row.
    pub width: usize,
    /// What each pixel shows.
    pub shown: Vec<Option<Shown>>,
}

impl Picture {
    /// The picture that a renderer's layers are.
    pub fn new(layers: &GBuffer, rays: &Rays) -> Self {
        let [width, height] = [layers.width, layers.height].map(|side| side as usize);
        let show = |pixel: usize| {
            let index = layers.index(pixel % width, pixel / width);
            let depth = f64::from(layers.depth[index]);
            let normal = (0..3).map(|i| rays.axes[i] * f64::from(layers.normal[index][i])).sum();
            depth.is_finite().then_some(Shown { depth, normal, point: layers.point[index] })
        };
        Self { width, shown: (0..width * height).map(show).collect() }
    }

    /// The picture that nobody can improve on.
    pub fn truth(exact: &Exact) -> Self {
        let show = |seen: &Option<crate::exact::Seen>| {
            seen.map(|seen| Shown { depth: seen.depth, normal: seen.normal, point: u32::MAX })
        };
        Self { width: exact.width, shown: exact.seen.iter().map(show).collect() }
    }

    /// Pixels in a column.
    pub fn height(&self) -> usize {
        self.shown.len() / self.width
    }

    /// The picture moved right by `px` pixels, its right edge coming in on the left.
    #[must_use]
    pub fn shifted(&self, px: usize) -> Self {
        let mut shown = self.shown.clone();
        shown.chunks_mut(self.width).for_each(|row| row.rotate_right(px));
        Self { width: self.width, shown }
    }

    /// The picture with the normals of `other` wherever both show something.
    #[must_use]
    pub fn with_normals_of(&self, other: &Self) -> Self {
        let replace = |(shown, other): (&Option<Shown>, &Option<Shown>)| {
            shown.map(|shown| Shown { normal: other.map_or(shown.normal, |other| other.normal), ..shown })
        };
        Self { width: self.width, shown: self.shown.iter().zip(&other.shown).map(replace).collect() }
    }

    /// The picture with each pixel that shows something changed, or emptied, by what `change` makes of it.
    #[must_use]
    pub fn changed(&self, change: impl Fn(usize, Shown) -> Option<Shown>) -> Self {
        let change = |(pixel, shown): (usize, &Option<Shown>)| shown.and_then(|shown| change(pixel, shown));
        Self { width: self.width, shown: self.shown.iter().enumerate().map(change).collect() }
    }
}
