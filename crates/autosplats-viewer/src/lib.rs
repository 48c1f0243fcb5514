//! A window that shows raw points as a lit surface.
//!
//! [`run`] opens it. The window never waits: files are read ([`loading`]) and pictures made ([`render`]) by threads of their
//! own, which send what they have; [`app`] is the round of a frame of the window.

mod animation;
mod app;
mod commands;
mod document;
mod files;
mod keys;
mod loading;
mod look;
mod measure;
mod messages;
mod navigation;
mod output;
mod overlay;
mod panels;
mod render;
mod storage;
#[cfg(test)]
mod tests;
mod threads;
mod tools;
mod viewport;

use autosplats::Backend;
use eframe::egui;

pub use self::loading::Input;

/// What the window begins with.
#[derive(Debug, Default)]
pub struct Options {
    /// What is opened.
    pub inputs: Vec<Input>,
    /// Read files again when they change.
    pub watch: bool,
    /// Where pictures are made; as last time if it is not said.
    pub backend: Option<Backend>,
}

/// Why there is no window.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// There is no display, or nothing that draws on it.
    #[error("no window can be opened: {0}; 'autosplats render' makes pictures without one")]
    Window(String),
}

/// Opens the window and returns when it is closed.
///
/// # Errors
/// [`Error::Window`].
pub fn run(options: Options) -> Result<(), Error> {
    let viewport = egui::ViewportBuilder::default()
        .with_app_id("autosplats")
        .with_title("autosplats")
        .with_inner_size([1280.0, 800.0])
        .with_min_inner_size([640.0, 400.0])
        .with_drag_and_drop(true);
    let native = eframe::NativeOptions { viewport, renderer: eframe::Renderer::Wgpu, ..Default::default() };
    let create: eframe::AppCreator<'_> = Box::new(move |creation| {
        let (look, recent) = storage::load(creation.storage);
        Ok(Box::new(app::App::new(options, look, recent, &creation.egui_ctx)))
    });
    eframe::run_native("autosplats", native, create).map_err(|error| Error::Window(error.to_string()))
}
