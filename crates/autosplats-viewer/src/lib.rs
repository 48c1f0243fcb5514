//! A window that shows raw points as a lit surface.
//!
//! [`run`] opens the window and returns when it is closed:
//!
//! ```no_run
//! use autosplats_viewer::{Input, Options, run};
//!
//! run(Options { inputs: vec![Input::parse("scene:statue")?], ..Options::default() })?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # How it works
//! `session` is what is open, `view` is the camera and its pictures, and `ui` is what the user touches. Each folder
//! imports only those before it. `app` holds all three, and the work of each window frame. The window never waits:
//! threads of their own read files and render pictures, and send their results.

#![warn(clippy::print_stderr, clippy::print_stdout, reason = "they panic where the stream cannot be written")]

mod app;
mod files;
mod messages;
mod session;
#[cfg(test)]
mod tests;
mod threads;
mod ui;
mod view;

use std::cell::RefCell;
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::mpsc::Receiver;

use autosplats::Backend;
use autosplats::cloud::ErrorKind;
use eframe::{egui, egui_wgpu, wgpu};

pub use autosplats_sources::Input;

pub use session::TreeOptions;

/// Options at the start of the viewer.
#[derive(Debug, Default)]
pub struct Options {
    /// Inputs to open.
    pub inputs: Vec<Input>,
    /// File of the session: restored if it exists, and written on exit.
    pub state: Option<PathBuf>,
    /// Whether to read files again when they change.
    pub watch: bool,
    /// Backend for rendering; `None` keeps that of the last start.
    pub backend: Option<Backend>,
    /// How much of octrees is read.
    pub trees: TreeOptions,
    /// A message closes the window, as its button does.
    pub close: Option<Receiver<()>>,
}

/// Why no window could be opened.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// There is no display, or no way to draw on it.
    #[error("no window can be opened: {0}; 'autosplats render' makes pictures without one")]
    Window(String),
    /// The session file could not be read.
    #[error("{0}")]
    State(String),
    /// The session file could not be written at the end.
    #[error("{0}")]
    Unsaved(String),
}

impl Error {
    /// The kind of this error.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::Window(_) => ErrorKind::Device,
            Self::State(_) => ErrorKind::Data,
            Self::Unsaved(_) => ErrorKind::Io,
        }
    }
}

/// Opens the window and returns when it is closed.
///
/// # Errors
/// [`Error::Window`], [`Error::State`] if the session file exists but is invalid, and [`Error::Unsaved`].
pub fn run(mut options: Options) -> Result<(), Error> {
    let path = options.state.as_deref().filter(|path| path.exists());
    let state = path.map(view::state::State::read).transpose().map_err(Error::State)?;
    let viewport = egui::ViewportBuilder::default()
        .with_app_id("autosplats")
        .with_title("autosplats")
        .with_inner_size(session::START_SIZE.map(|side| side as f32))
        .with_min_inner_size([640.0, 400.0])
        .with_drag_and_drop(true);
    let native = eframe::NativeOptions {
        viewport,
        renderer: eframe::Renderer::Wgpu,
        wgpu_options: device_options(),
        dithering: false,
        ..Default::default()
    };
    let close = options.close.take();
    let unsaved = Rc::<RefCell<Option<String>>>::default();
    let told = Rc::clone(&unsaved);
    let create: eframe::AppCreator<'_> = Box::new(move |creation| {
        colors(&creation.egui_ctx);
        close.into_iter().for_each(|close| close_on(close, &creation.egui_ctx));
        let (look, recent) = view::storage::load(creation.storage);
        let mut app = app::App::new(options, look, recent, &creation.egui_ctx);
        if let Some(state) = &creation.wgpu_render_state {
            let (device, queue) = (state.device.clone(), state.queue.clone());
            app.view.share(view::WindowDevice { device, queue, format: state.target_format });
        }
        app.unsaved = told;
        if let Some(state) = state {
            let folder = app.session.file.as_deref().map(view::state::folder).unwrap_or_default();
            state.restore(&mut app.session, &mut app.view, &folder);
        }
        Ok(Box::new(app))
    });
    let screens = ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"];
    if cfg!(target_os = "linux") && screens.iter().all(|name| std::env::var_os(name).is_none()) {
        return Err(Error::Window("there is no screen, as neither DISPLAY nor WAYLAND_DISPLAY is set".into()));
    }
    eframe::run_native("autosplats", native, create).map_err(|error| Error::Window(error.to_string()))?;
    unsaved.take().map_or(Ok(()), |why| Err(Error::Unsaved(why)))
}

/// A device that draws the window and can render pictures too. Without the checks that `wgpu` adds by default: that of
/// indirect dispatches would put one more dispatch and barriers before most steps of a picture.
fn device_options() -> egui_wgpu::WgpuConfiguration {
    let mut setup = egui_wgpu::WgpuSetupCreateNew::without_display_handle();
    setup.instance_descriptor.flags = wgpu::InstanceFlags::empty().with_env();
    setup.device_descriptor = Arc::new(autosplats::device_descriptor);
    egui_wgpu::WgpuConfiguration { wgpu_setup: setup.into(), ..Default::default() }
}

/// Closes the window once a message comes.
fn close_on(close: Receiver<()>, context: &egui::Context) {
    let context = context.clone();
    threads::spawn("close", move || {
        if close.recv().is_ok() {
            context.send_viewport_cmd(egui::ViewportCommand::Close);
            context.request_repaint();
        }
    });
}

/// Sets readable colours: egui's own red is too dark on a dark background.
fn colors(context: &egui::Context) {
    let red = |dark: bool| if dark { [255, 128, 118] } else { [176, 24, 16] };
    let amber = |dark: bool| if dark { [255, 180, 70] } else { [150, 84, 0] };
    for theme in [egui::Theme::Dark, egui::Theme::Light] {
        context.style_mut_of(theme, |style| {
            let dark = theme == egui::Theme::Dark;
            let color = |[r, g, b]: [u8; 3]| egui::Color32::from_rgb(r, g, b);
            style.visuals.error_fg_color = color(red(dark));
            style.visuals.warn_fg_color = color(amber(dark));
        });
    }
}
