//! The first view of an input, found by the thread that reads the input. A look at a hundred thousand points takes
//! longer than a window frame may.

use std::sync::{Arc, Mutex, PoisonError};

use autosplats::cloud::glam::DVec3;
use autosplats::cloud::{Axes, PointCloud};
use autosplats::{Camera, Projection, ViewDirection, guess_axes};

use crate::session::document::{Bits, bounds_of};
use crate::session::{Document, Input, Layer};

/// What the first view depends on besides the points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ViewFrame {
    /// Width over height.
    pub(crate) aspect: f64,
    /// The up axis, if the user chose one.
    pub(crate) up: Option<Axes>,
}

/// The frame of the window's picture, shared with the threads that read.
#[derive(Clone, Debug)]
pub(crate) struct SharedViewFrame(Arc<Mutex<ViewFrame>>);

impl SharedViewFrame {
    /// Starts with `frame`, until the window is drawn.
    pub(crate) fn new(frame: ViewFrame) -> Self {
        Self(Arc::new(Mutex::new(frame)))
    }

    /// The current frame.
    pub(crate) fn get(&self) -> ViewFrame {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sets the current frame.
    pub(crate) fn set(&self, frame: ViewFrame) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = frame;
    }
}

/// What a first look at an input finds.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FirstLook {
    /// Up axis, guessed from the points.
    pub(crate) axes: Axes,
    /// Box around most of the points, world coordinates.
    pub(crate) bounds: Option<[DVec3; 2]>,
    /// Camera that shows the input alone; `None` if no camera can.
    pub(crate) camera: Option<Camera>,
    /// The frame that `camera` is for.
    pub(crate) frame: ViewFrame,
}

impl FirstLook {
    /// Examines the points of an input, of which some are hidden.
    pub(crate) fn of(input: &Input, cloud: &Arc<PointCloud>, hidden: &Bits, frame: ViewFrame) -> Self {
        let axes = guess_axes(cloud);
        let mut alone = Document::default();
        let id = alone.add(Layer::new(&*input.name, None, Arc::clone(cloud)).opened_at(input.world_from_input));
        alone.set_hidden(id, hidden);
        let overview = alone.overview();
        let projection = Projection::PerspectiveFovDeg(Projection::USUAL_FOV_DEG);
        let up = frame.up.unwrap_or(axes);
        let camera = Camera::fit(&overview, up, ViewDirection::Auto, frame.aspect, projection).ok();
        Self { axes, bounds: bounds_of(&overview), camera, frame }
    }
}
