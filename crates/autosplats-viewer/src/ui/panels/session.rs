//! The dialog to save the session.

use std::path::Path;

use autosplats::cloud::is_there;
use eframe::egui;

use super::target_file::{DialogTexts, TargetFile};
use crate::session::Session;
use crate::view::{State, View};

/// State of the dialog.
pub(crate) struct SessionDialog {
    pub(crate) open: bool,
    target: TargetFile,
}

impl Default for SessionDialog {
    fn default() -> Self {
        Self { open: false, target: TargetFile::new("autosplats.json") }
    }
}

impl SessionDialog {
    /// Opens the dialog. The proposed name is that of `file`, the present session file.
    pub(crate) fn open(&mut self, file: Option<&Path>) {
        if let Some(path) = file {
            self.target = TargetFile::new(path.display().to_string());
        }
        self.target.open();
        self.open = true;
    }

    /// Shows the dialog. `entered` says that Enter was pressed where no control takes it.
    pub(super) fn show(&mut self, context: &egui::Context, session: &Session, view: &View, entered: &mut bool) {
        let mut write = None;
        let window = egui::Window::new("Save session").open(&mut self.open).collapsible(false).resizable(false);
        window.default_pos(view.rect.center() - egui::vec2(220.0, 60.0)).show(context, |ui| {
            ui.set_width(420.0);
            let words = DialogTexts { title: "Save session", name: "autosplats.json", verb: "Save" };
            let folder = self.target.path().is_dir().then(|| "This is a folder".into());
            write = self.target.show(ui, &words, entered, folder);
        });
        let Some(write) = write else { return };
        if !write.replace && is_there(&write.path) {
            self.target.refuse(&write.path, "This file exists already", true);
            return;
        }
        match State::of(session, view).write(&write.path) {
            Ok(()) => {
                session
                    .messages
                    .note(format!("{} was written; 'autosplats --state' restores it", write.path.display()));
                self.open = false;
            }
            Err(error) => self.target.refuse(&write.path, error, false),
        }
    }
}
