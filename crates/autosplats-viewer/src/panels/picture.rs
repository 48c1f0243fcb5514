//! The dialog to save pictures.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};

use autosplats::cloud::check_memory;
use autosplats::{BYTES_PER_PIXEL, MAX_SIDE};
use eframe::egui;

use super::export::has_extension;
use super::target_file::{DialogTexts, TargetFile, Write};
use crate::app::App;
use crate::output::Goal;
use crate::render::{RenderRequest, Task};

pub(crate) struct PictureDialog {
    pub(crate) open: bool,
    target: TargetFile,
    size: [u32; 2],
    /// Whether to save the whole window, menus included.
    window: bool,
    /// The expected screenshot of the window, and its file.
    expected: Option<(Receiver<Arc<egui::ColorImage>>, PathBuf)>,
}

impl Default for PictureDialog {
    fn default() -> Self {
        Self { open: false, target: TargetFile::new("picture.png"), size: [1920, 1080], window: false, expected: None }
    }
}

pub(crate) fn open(app: &mut App) {
    app.ui.panels.picture.target.open();
    app.ui.panels.picture.open = true;
}

pub(super) fn show(app: &mut App, context: &egui::Context) {
    arrived(app);
    if !app.ui.panels.picture.open {
        return;
    }
    let mut open = true;
    let mut write = None;
    let seen = app.view.shot.as_ref().map(|shot| shot.size);
    let window = egui::Window::new("Save picture").open(&mut open).collapsible(false).resizable(false);
    window.default_pos(app.view.rect.center() - egui::vec2(220.0, 110.0)).show(context, |ui| {
        ui.set_width(420.0);
        let dialog = &mut app.ui.panels.picture;
        ui.checkbox(&mut dialog.window, "The whole window, with menus");
        ui.add_enabled_ui(!dialog.window, |ui| {
            ui.horizontal(|ui| {
                ui.add(egui::DragValue::new(&mut dialog.size[0]).range(1..=MAX_SIDE).suffix(" px"));
                ui.label("×");
                ui.add(egui::DragValue::new(&mut dialog.size[1]).range(1..=MAX_SIDE).suffix(" px"));
                if let Some(seen) = seen {
                    for (label, factor) in [("As seen", 1), ("Twice", 2), ("Four times", 4)] {
                        if ui.button(label).clicked() {
                            dialog.size = seen.map(|side| (side * factor).min(MAX_SIDE));
                        }
                    }
                }
            });
        });
        let bytes = u64::from(dialog.size[0]) * u64::from(dialog.size[1]) * BYTES_PER_PIXEL;
        let problem = if !has_extension(&dialog.target.path(), "png") {
            Some("The name has to end in .png".to_owned())
        } else {
            check_memory("this picture", bytes).err().map(|error| error.to_string())
        };
        let words = DialogTexts { title: "Save picture", name: "picture.png", verb: "Save" };
        write = dialog.target.show(ui, &words, &mut app.ui.panels.entered, problem);
    });
    app.ui.panels.picture.open = open;
    let Some(Write { path, replace, .. }) = write else { return };
    let dialog = &mut app.ui.panels.picture;
    if !replace && path.exists() {
        dialog.target.refuse(&path, "This file exists already", true);
        return;
    }
    dialog.open = false;
    if dialog.window {
        let (sender, receiver) = channel();
        context.request_screenshot(move |image| {
            let _ = sender.send(image);
        });
        dialog.expected = Some((receiver, path));
    } else {
        let size = dialog.size;
        let wish: RenderRequest = app.wish(size, false);
        app.view.render.task(Task::Photograph { wish: Box::new(wish), goal: Goal::File(path) });
    }
}

/// Writes the screenshot of the window once it arrives.
fn arrived(app: &mut App) {
    let Some(image) = app.ui.panels.picture.expected.as_ref().and_then(|(receiver, _)| receiver.try_recv().ok()) else {
        return;
    };
    let Some((_, path)) = app.ui.panels.picture.expected.take() else { return };
    let [width, height] = image.size.map(|side| side as u32);
    let pixels = image.pixels.iter().map(egui::Color32::to_srgba_unmultiplied).collect();
    let picture = autosplats::Image { width, height, pixels, linear: Vec::new() };
    crate::output::save_picture(app, picture, path);
}
