//! What is done in order, besides pictures.

use std::sync::Arc;

use autosplats::Image;
use autosplats::cloud::glam::DVec3;

use super::Wish;
use crate::document::{Region, SelectMode, Shown};
use crate::output::Goal;

impl Wish {
    /// The same picture with what points are found by: a surface, which all points belong to where dots are shown, as all of
    /// them are seen then.
    pub(crate) fn of_points(mut self) -> Self {
        if self.dots.take().is_some() {
            self.settings.reconstruction.outlier_expansions = None;
            self.settings.reconstruction.adaptive = false;
        }
        self
    }

    /// Pixels of a picture that is `scale` times as large as wished for; with dots, one pixel a dot, to be enlarged.
    pub(super) fn rendered_size(&self, scale: f64) -> [u32; 2] {
        let dots = f64::from(self.dots.unwrap_or(1).max(1));
        self.size.map(|side| ((f64::from(side) * scale / dots) as u32).max(1))
    }
}

/// Enlarges a picture by repeating its pixels, as the screen does.
pub(super) fn enlarge(image: &Image, [width, height]: [u32; 2]) -> Image {
    if [image.width, image.height] == [width, height] {
        return image.clone();
    }
    // The pixel under the middle of each new one.
    let places = |new: u32, old: u32| {
        let (new, old) = (u64::from(new), u64::from(old));
        (0..new).map(move |place| ((2 * place + 1) * old / (2 * new)) as usize)
    };
    let columns: Vec<usize> = places(width, image.width).collect();
    let row = |y: usize| &image.pixels[y * image.width as usize..][..image.width as usize];
    let pixels = places(height, image.height).flat_map(|y| columns.iter().map(move |&x| row(y)[x])).collect();
    Image { width, height, pixels, linear: Vec::new() }
}

/// Something to be done as soon as the picture in work is finished.
pub(crate) enum Task {
    /// Finds the point that is seen at a pixel of the picture wished for.
    Pick { wish: Box<Wish>, pixel: [f32; 2], purpose: Purpose },
    /// Finds the points in a region of the picture wished for: those seen, or those behind them too.
    Select { wish: Box<Wish>, region: Region, through: bool, mode: SelectMode },
    /// Makes a picture of any size and hands it over.
    Photograph { wish: Box<Wish>, goal: Goal },
}

/// What a point is picked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// To turn about it.
    Pivot,
    /// To say what is known of it.
    Inspect,
    /// As the next corner of a measurement.
    Measure,
}

/// What came of a task.
pub(crate) enum Outcome {
    /// The point under the cursor, if there is one.
    Picked { purpose: Purpose, point: Option<Seen> },
    /// Which of the points shown are in the region.
    Selected { shown: Arc<Shown>, hits: Vec<bool>, mode: SelectMode },
    /// A picture of the size that was asked for, and the range of values that its colours are of.
    Photographed { image: Box<Image>, range: Option<[f64; 2]>, goal: Goal },
}

/// A point that is seen at a pixel.
#[derive(Clone)]
pub(crate) struct Seen {
    /// Among the points shown.
    pub(crate) index: usize,
    pub(crate) shown: Arc<Shown>,
    /// Where the line of sight meets the surface; the point itself may lie beside it.
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
