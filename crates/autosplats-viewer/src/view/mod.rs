//! The view: the camera, and the pictures that the render thread makes for it.

use autosplats::{AdapterSummary, Camera};
use eframe::egui;

use crate::app::RequestKey;
use crate::look::Look;
use crate::navigation::Navigation;
use crate::rate::Rate;
use crate::recording::Recording;
use crate::render::{Picture, RenderThread};
use crate::turns::Turns;

/// The camera and its pictures.
pub(crate) struct View {
    pub(crate) render: RenderThread,
    pub(crate) navigation: Navigation,
    pub(crate) look: Look,
    /// The last picture.
    pub(crate) shot: Option<Box<Picture>>,
    pub(crate) device: Option<AdapterSummary>,
    pub(crate) rate: Rate,
    /// Width over height of the picture in the window.
    pub(crate) aspect: f64,
    /// The picture's rectangle in the window, screen points.
    pub(crate) rect: egui::Rect,
    /// The camera that the program chose by itself, and the picture's width over height at the time. Until the user
    /// moves, a new camera is chosen when points arrive or the picture changes its shape.
    pub(crate) first_camera: Option<(Camera, f64)>,
    /// Whether a camera was given, so that the first input is not fitted into the picture.
    pub(crate) camera_given: bool,
    /// What the last requested picture shows.
    pub(crate) wished: Option<RequestKey>,
    /// Whether the last requested picture is still to come.
    pub(crate) awaited: bool,
    /// Whether a film preview has moved the view since the last window frame.
    pub(crate) moved_by_preview: bool,
    /// Time of the last movement, seconds.
    pub(crate) moved: f64,
    /// Key cameras of a film.
    pub(crate) keys: Vec<Camera>,
    pub(crate) recording: Option<Recording>,
    /// Pixel format of the window; `None` without a device, and then no picture is drawn in the window.
    pub(crate) format: Option<eframe::wgpu::TextureFormat>,
    /// Present if the CPU draws the window, and so competes with rendering.
    pub(crate) turns: Option<Turns>,
}

impl View {
    /// A view of nothing. `context` is asked for a repaint with each picture.
    pub(crate) fn new(look: Look, context: &egui::Context) -> Self {
        Self {
            render: RenderThread::start(context.clone()),
            navigation: Navigation::new(),
            look,
            shot: None,
            device: None,
            rate: Rate::default(),
            aspect: 1.5,
            rect: egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(800.0, 600.0)),
            first_camera: None,
            camera_given: false,
            wished: None,
            awaited: false,
            moved_by_preview: false,
            moved: 0.0,
            keys: Vec::new(),
            recording: None,
            format: None,
            turns: None,
        }
    }
}
