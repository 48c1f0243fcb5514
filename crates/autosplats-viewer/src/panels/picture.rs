//! Writing pictures.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};

use autosplats::MAX_SIDE;
use autosplats::cloud::check_memory;
use eframe::egui;

use super::export::has_extension;
use crate::app::App;
use crate::files::ask_for_output;
use crate::output::Goal;
use crate::render::{Task, Wish};

/// Bytes that stages and layers take for each pixel.
const BYTES_PER_PIXEL: u64 = 100;

/// What is being asked.
pub(crate) struct PictureDialog {
    pub(crate) open: bool,
    path: String,
    size: [u32; 2],
    /// The window as it is, menus and all.
    window: bool,
    chosen: Option<Receiver<Option<PathBuf>>>,
    /// The file that may be replaced if it is there.
    replaced: Option<PathBuf>,
    /// The picture of the window, when it arrives, and where it goes.
    expected: Option<(Receiver<Arc<egui::ColorImage>>, PathBuf)>,
}

impl Default for PictureDialog {
    fn default() -> Self {
        Self {
            open: false,
            path: "picture.png".into(),
            size: [1920, 1080],
            window: false,
            chosen: None,
            replaced: None,
            expected: None,
        }
    }
}

pub(super) fn show(app: &mut App, context: &egui::Context) {
    arrived(app);
    if let Some(Ok(chosen)) = app.panels.picture.chosen.as_ref().map(Receiver::try_recv) {
        app.panels.picture.chosen = None;
        if let Some(path) = chosen {
            app.panels.picture.path = path.display().to_string();
            // The system's dialog has asked already.
            app.panels.picture.replaced = Some(path);
        }
    }
    if !app.panels.picture.open {
        app.panels.picture.replaced = None;
        return;
    }
    let mut open = true;
    let mut save = false;
    let seen = app.shot.as_ref().map(|shot| shot.size);
    let window = egui::Window::new("Save picture").open(&mut open).collapsible(false).resizable(false);
    window.default_pos(app.view_rect.center() - egui::vec2(220.0, 110.0)).show(context, |ui| {
        ui.set_width(420.0);
        let dialog = &mut app.panels.picture;
        ui.checkbox(&mut dialog.window, "The window as it is, menus and all");
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
        ui.horizontal(|ui| {
            ui.add(egui::TextEdit::singleline(&mut dialog.path).desired_width(320.0).hint_text("picture.png"));
            if ui.button("Browse…").clicked() && dialog.chosen.is_none() {
                dialog.chosen = Some(ask_for_output(context, "Save picture", "picture.png"));
            }
        });
        let path = PathBuf::from(dialog.path.trim());
        let bytes = u64::from(dialog.size[0]) * u64::from(dialog.size[1]) * BYTES_PER_PIXEL;
        let problem = if !has_extension(&path, "png") {
            Some("The name has to end in .png".to_owned())
        } else if let Err(error) = check_memory("this picture", bytes) {
            Some(error.to_string())
        } else if path.exists() && dialog.replaced.as_ref() != Some(&path) {
            Some("This file is there already".to_owned())
        } else {
            None
        };
        ui.horizontal(|ui| {
            save = ui.add_enabled(problem.is_none(), egui::Button::new("Save")).clicked();
            if let Some(problem) = problem {
                ui.colored_label(ui.visuals().warn_fg_color, problem);
                if has_extension(&path, "png") && path.exists() && ui.button("Replace it").clicked() {
                    dialog.replaced = Some(path);
                }
            }
        });
    });
    app.panels.picture.open = open && !save;
    if save {
        let dialog = &mut app.panels.picture;
        let path = PathBuf::from(dialog.path.trim());
        if dialog.window {
            let (sender, receiver) = channel();
            context.request_screenshot(move |image| {
                let _ = sender.send(image);
            });
            dialog.expected = Some((receiver, path));
        } else {
            let size = dialog.size;
            let wish: Wish = app.wish(size, false);
            app.render.task(Task::Photograph { wish: Box::new(wish), goal: Goal::File(path) });
        }
    }
}

/// Writes the picture of the window that was asked for.
fn arrived(app: &mut App) {
    let Some(image) = app.panels.picture.expected.as_ref().and_then(|(receiver, _)| receiver.try_recv().ok()) else {
        return;
    };
    let Some((_, path)) = app.panels.picture.expected.take() else { return };
    let [width, height] = image.size.map(|side| side as u32);
    let pixels = image.pixels.iter().map(egui::Color32::to_srgba_unmultiplied).collect();
    let picture = autosplats::Image { width, height, pixels, linear: Vec::new() };
    crate::output::save_picture(app, picture, path);
}
