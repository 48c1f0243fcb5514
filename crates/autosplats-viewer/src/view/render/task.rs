//! Tasks: work that the render thread does in order, besides pictures.

use std::path::PathBuf;
use std::sync::Arc;

use autosplats::Image;
use autosplats::cloud::Existing;
use autosplats::cloud::glam::DVec3;

use super::RenderRequest;
use crate::session::{Region, SelectMode, ShownCloud};

impl RenderRequest {
    /// The same request, for finding points: splats instead of dots. Where dots are shown, all points are visible; so
    /// outlier removal and adaptation, which would leave points out, are switched off.
    pub(crate) fn of_points(mut self) -> Self {
        if self.dots.take().is_some() {
            self.settings.reconstruction.outlier_expansions = None;
            self.settings.reconstruction.adaptive = false;
        }
        self
    }

    /// Size of a picture at `scale`, pixels. Dots take one pixel each, and the picture is enlarged later.
    pub(super) fn rendered_size(&self, scale: f64) -> [u32; 2] {
        let dots = f64::from(self.dots.unwrap_or(1).max(1));
        self.size.map(|side| ((f64::from(side) * scale / dots) as u32).max(1))
    }
}

/// Enlarges a picture by repeating pixels, as the screen does.
pub(super) fn enlarge(image: &Image, [width, height]: [u32; 2]) -> Image {
    if [image.width, image.height] == [width, height] {
        return image.clone();
    }
    // The old pixel under the middle of each new one.
    let places = |new: u32, old: u32| {
        let (new, old) = (u64::from(new), u64::from(old));
        (0..new).map(move |place| ((2 * place + 1) * old / (2 * new)) as usize)
    };
    let columns: Vec<usize> = places(width, image.width).collect();
    let row = |y: usize| &image.pixels[y * image.width as usize..][..image.width as usize];
    let pixels = places(height, image.height).flat_map(|y| columns.iter().map(move |&x| row(y)[x])).collect();
    Image { width, height, pixels, linear: Vec::new() }
}

/// A task, done as soon as the picture in work is finished.
pub(crate) enum Task {
    /// Finds the point seen at a pixel of the requested picture.
    Pick { wish: Box<RenderRequest>, pixel: [f32; 2], purpose: Purpose },
    /// Finds the points in a region of the requested picture: the visible ones, or with `through` all.
    Select { wish: Box<RenderRequest>, region: Region, through: bool, mode: SelectMode },
    /// Renders a picture of any size and hands it over.
    Photograph { wish: Box<RenderRequest>, goal: Goal },
}

/// What a rendered picture is for.
pub(crate) enum Goal {
    /// A file, and what happens to one that is there.
    File(PathBuf, Existing),
    /// A picture of the film with this number.
    Film(u64),
}

/// What a point is picked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// To be the new pivot of the view.
    Pivot,
    /// To show its attributes.
    Inspect,
    /// To be the next corner of a measurement.
    Measure,
}

/// Result of a task.
pub(crate) enum Outcome {
    /// The point under the cursor, if there is one.
    Picked { purpose: Purpose, point: Option<PickHit> },
    /// For each shown point, whether it is in the region.
    Selected { shown: Arc<ShownCloud>, hits: Vec<bool>, mode: SelectMode },
    /// A picture of the requested size, and the ends of its colour map.
    Photographed { image: Box<Image>, range: Option<[f64; 2]>, goal: Goal },
}

/// A point seen at a pixel.
#[derive(Clone)]
pub(crate) struct PickHit {
    /// Index among the shown points.
    pub(crate) index: usize,
    pub(crate) shown: Arc<ShownCloud>,
    /// World position where the line of sight meets the surface; the point itself may lie beside it.
    pub(crate) surface: DVec3,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_enlarged_as_on_the_screen() {
        let pixels = (0..6).map(|pixel| [pixel; 4]).collect();
        let image = Image { width: 3, height: 2, pixels, linear: Vec::new() };
        let large = enlarge(&image, [7, 4]);
        assert_eq!([large.width, large.height], [7, 4], "as large as was asked for");
        let rows: Vec<Vec<u8>> = large.pixels.chunks(7).map(|row| row.iter().map(|pixel| pixel[0]).collect()).collect();
        let [upper, lower] = [vec![0, 0, 1, 1, 1, 2, 2], vec![3, 3, 4, 4, 4, 5, 5]];
        assert_eq!(rows, [upper.clone(), upper, lower.clone(), lower], "each pixel again and again, none mixed");
        assert_eq!(enlarge(&image, [3, 2]), image, "nothing to do");
    }
}
