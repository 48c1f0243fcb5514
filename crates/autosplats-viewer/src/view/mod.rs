//! The view: the camera, and the pictures that the render thread makes for it.

pub(crate) mod animation;
mod camera;
pub(crate) mod legend;
mod look;
mod navigation;
mod output;
pub(crate) mod overlay;
mod pictures;
mod rate;
mod recording;
mod render;
mod screen;
pub(crate) mod state;
pub(crate) mod storage;
pub(crate) mod turns;

use autosplats::{AdapterSummary, Camera};
use eframe::egui::{self, Color32, Sense};

pub(crate) use self::look::{Look, TwoFingers};
pub(crate) use self::navigation::{Flight, Navigation};
use self::pictures::RequestKey;
pub(crate) use self::rate::Rate;
pub(crate) use self::recording::Recording;
pub(crate) use self::render::{
    Answer, Goal, Outcome, PickHit, Picture, Pixels, Purpose, RenderRequest, RenderThread, Task, WindowDevice,
};
pub(crate) use self::screen::OnScreen;
pub(crate) use self::state::State;
pub(crate) use self::turns::Turns;
use crate::messages::MessageSender;
use crate::session::TreeHandle;

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
    first_camera: Option<(Camera, f64)>,
    /// Whether a camera was given, so that the first input is not fitted into the picture.
    camera_given: bool,
    /// What the last requested picture shows.
    wished: Option<RequestKey>,
    /// Whether the last requested picture is still to come.
    awaited: bool,
    /// Whether a film preview has moved the view since the last window frame.
    moved_by_preview: bool,
    /// Time of the last movement, seconds.
    moved: f64,
    /// Number of points that a picture can have while the view moves, as far as known.
    moving_points: usize,
    /// Key cameras of a film.
    pub(crate) keys: Vec<Camera>,
    pub(crate) recording: Option<Recording>,
    /// Pixel format of the window; `None` without a device, and then no picture is drawn in the window.
    pub(crate) format: Option<eframe::wgpu::TextureFormat>,
    /// Why the last picture could not be rendered, until there is one.
    pub(crate) failure: Option<String>,
    messages: MessageSender,
    /// Present if the CPU draws the window, and so competes with rendering.
    pub(crate) turns: Option<Turns>,
}

impl View {
    /// A view of nothing. `context` is asked for a repaint with each picture.
    pub(crate) fn new(look: Look, trees: TreeHandle, messages: MessageSender, context: &egui::Context) -> Self {
        Self {
            render: RenderThread::start(trees, context.clone()),
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
            moving_points: usize::MAX,
            keys: Vec::new(),
            recording: None,
            format: None,
            failure: None,
            messages,
            turns: None,
        }
    }

    /// Tells how the window is drawn, before its first frame. Pictures then stay on its device where they can.
    pub(crate) fn share(&mut self, window: WindowDevice) {
        self.format = Some(window.format);
        self.turns = turns::are_taken(&window.device).then(Turns::default);
        self.render.share(window);
    }

    /// Takes all free room of the window for the picture. Returns the mouse's response and the size in pixels.
    pub(crate) fn place(&mut self, ui: &mut egui::Ui) -> (egui::Response, [u32; 2]) {
        let rect = ui.available_rect_before_wrap();
        let response = ui.allocate_rect(rect, Sense::CLICK | Sense::DRAG);
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "Surface of the points"));
        let scale = ui.ctx().pixels_per_point();
        let side = |points: f32| ((points * scale).round() as u32).clamp(1, autosplats::MAX_SIDE);
        let size = [side(rect.width()), side(rect.height())];
        self.rect = rect;
        self.aspect = f64::from(size[0]) / f64::from(size[1]);
        (response, size)
    }

    /// Paints the last picture into its place, or a plain background.
    pub(crate) fn paint(&self, ui: &egui::Ui) {
        let painter = ui.painter_at(self.rect);
        match (&self.shot, self.format) {
            (Some(picture), Some(format)) => {
                let on_screen = OnScreen { pixels: picture.pixels.clone(), sharp: picture.dots, format };
                painter.add(eframe::egui_wgpu::Callback::new_paint_callback(self.rect, on_screen));
            }
            (Some(_), None) => {}
            (None, _) => {
                painter.rect_filled(self.rect, 0.0, Color32::from_rgb(0x2b, 0x30, 0x37));
            }
        }
    }
}
