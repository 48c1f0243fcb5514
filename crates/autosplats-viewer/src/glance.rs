//! Where to stand before what is read, found out by the thread that reads it: to look at a hundred thousand points takes longer
//! than a frame of the window may.

use std::sync::{Arc, Mutex, PoisonError};

use autosplats::cloud::glam::DVec3;
use autosplats::cloud::{Axes, PointCloud};
use autosplats::{Camera, Projection, ViewDirection, guess_axes};

use crate::document::{Document, Layer, bounds_of};
use crate::loading::Input;

/// Vertical field of view of the first picture, degrees.
pub(crate) const FOV_DEG: f64 = 40.0;

/// What the first picture depends on besides points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Frame {
    /// Width over height.
    pub(crate) aspect: f64,
    /// Which way is up, if the user says so.
    pub(crate) up: Option<Axes>,
}

/// The frame of the window's picture, as the threads that read know it.
#[derive(Clone, Debug)]
pub(crate) struct Known(Arc<Mutex<Frame>>);

impl Known {
    /// Until the window is drawn.
    pub(crate) fn new(frame: Frame) -> Self {
        Self(Arc::new(Mutex::new(frame)))
    }

    /// As it is now.
    pub(crate) fn get(&self) -> Frame {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// It is another one now.
    pub(crate) fn set(&self, frame: Frame) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = frame;
    }
}

/// What is known of an input at the first glance.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Glance {
    /// Which way is up, as far as the points tell.
    pub(crate) axes: Axes,
    /// The box around most of it.
    pub(crate) bounds: Option<[DVec3; 2]>,
    /// Where it is seen alone, if it can be seen.
    pub(crate) camera: Option<Camera>,
    /// In this frame.
    pub(crate) frame: Frame,
}

impl Glance {
    /// Looks at the points of an input.
    pub(crate) fn of(input: &Input, cloud: &Arc<PointCloud>, frame: Frame) -> Self {
        let axes = guess_axes(cloud);
        let mut alone = Document::default();
        alone.add(Layer::new(&*input.name, None, Arc::clone(cloud)).opened_at(input.world_from_input));
        let overview = alone.overview();
        let projection = Projection::PerspectiveFovDeg(FOV_DEG);
        let up = frame.up.unwrap_or(axes);
        let camera = Camera::fit(&overview, up, ViewDirection::Auto, frame.aspect, projection).ok();
        Self { axes, bounds: bounds_of(&overview), camera, frame }
    }
}
