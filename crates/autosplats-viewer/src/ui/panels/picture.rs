//! The dialog to save pictures.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};

use autosplats::cloud::{Existing, check_memory, is_there};
use autosplats::{BYTES_PER_PIXEL, MAX_SIDE};
use autosplats_output::PictureFormat;
use eframe::egui;

use super::target_file::{DialogTexts, TargetFile, Write};
use crate::session::Session;
use crate::view::{Goal, Task, View};

pub(crate) struct PictureDialog {
    pub(crate) open: bool,
    target: TargetFile,
    size: [u32; 2],
    /// Whether to save the whole window, menus included.
    window: bool,
    /// The expected screenshot of the window, and its file.
    expected: Option<(Receiver<Arc<egui::ColorImage>>, PathBuf, Existing)>,
}

impl Default for PictureDialog {
    fn default() -> Self {
        Self { open: false, target: TargetFile::new("picture.png"), size: [1920, 1080], window: false, expected: None }
    }
}

impl PictureDialog {
    /// Opens the dialog.
    pub(crate) fn open(&mut self) {
        self.target.open();
        self.open = true;
    }

    /// Shows the dialog. `entered` says that Enter was pressed where no control takes it.
    pub(super) fn show(&mut self, context: &egui::Context, session: &Session, view: &View, entered: &mut bool) {
        self.arrived(view);
        if !self.open {
            return;
        }
        let mut write = None;
        let seen = view.shot.as_ref().map(|shot| shot.size);
        let window = egui::Window::new("Save picture").open(&mut self.open).collapsible(false).resizable(false);
        window.default_pos(view.rect.center() - egui::vec2(220.0, 110.0)).show(context, |ui| {
            ui.set_width(420.0);
            ui.checkbox(&mut self.window, "The whole window, with menus");
            ui.add_enabled_ui(!self.window, |ui| {
                ui.horizontal(|ui| {
                    ui.add(egui::DragValue::new(&mut self.size[0]).range(1..=MAX_SIDE).suffix(" px"));
                    ui.label("×");
                    ui.add(egui::DragValue::new(&mut self.size[1]).range(1..=MAX_SIDE).suffix(" px"));
                    if let Some(seen) = seen {
                        for (label, factor) in [("As seen", 1), ("Twice", 2), ("Four times", 4)] {
                            if ui.button(label).clicked() {
                                self.size = seen.map(|side| (side * factor).min(MAX_SIDE));
                            }
                        }
                    }
                });
            });
            let bytes = u64::from(self.size[0]) * u64::from(self.size[1]) * BYTES_PER_PIXEL;
            let problem = if PictureFormat::of(&self.target.path()).is_none() {
                Some("The name has to end in .png or .jpg".to_owned())
            } else {
                check_memory("this picture", bytes).err().map(|error| error.to_string())
            };
            let words = DialogTexts { title: "Save picture", name: "picture.png", verb: "Save" };
            write = self.target.show(ui, &words, entered, problem);
        });
        let Some(Write { path, replace, .. }) = write else { return };
        let existing = if replace { Existing::Replace } else { Existing::Keep };
        if !replace && is_there(&path) {
            self.target.refuse(&path, "This file exists already", true);
            return;
        }
        self.open = false;
        if self.window {
            let (sender, receiver) = channel();
            context.request_screenshot(move |image| {
                let _ = sender.send(image);
            });
            self.expected = Some((receiver, path, existing));
        } else {
            let wish = Box::new(view.wish(session, self.size, false));
            view.render.task(Task::Photograph { wish, goal: Goal::File(path, existing) });
        }
    }

    /// Writes the screenshot of the window once it arrives.
    fn arrived(&mut self, view: &View) {
        let Some(image) = self.expected.as_ref().and_then(|(receiver, ..)| receiver.try_recv().ok()) else {
            return;
        };
        let Some((_, path, existing)) = self.expected.take() else { return };
        let [width, height] = image.size.map(|side| side as u32);
        let pixels = image.pixels.iter().map(egui::Color32::to_srgba_unmultiplied).collect();
        let picture = autosplats::Image { width, height, pixels, linear: Vec::new() };
        view.save_picture(picture, path, existing);
    }
}
