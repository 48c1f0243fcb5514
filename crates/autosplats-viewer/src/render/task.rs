//! What is done in order, besides pictures.

use std::sync::Arc;

use autosplats::Image;
use autosplats::cloud::glam::DVec3;

use super::Wish;
use crate::document::{Region, SelectMode, Shown};
use crate::output::Goal;

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
    /// A picture of the size that was asked for.
    Photographed { image: Box<Image>, goal: Goal },
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
