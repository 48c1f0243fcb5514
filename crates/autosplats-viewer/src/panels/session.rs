//! The dialog to save the session.

use eframe::egui;

use super::target_file::{DialogTexts, TargetFile};
use crate::app::App;
use crate::state::State;

/// State of the dialog.
pub(crate) struct Session {
    pub(crate) open: bool,
    target: TargetFile,
}

impl Default for Session {
    fn default() -> Self {
        Self { open: false, target: TargetFile::new("autosplats.json") }
    }
}

/// Opens the dialog. The proposed file is the present session file, if there is one.
pub(crate) fn open(app: &mut App) {
    if let Some(path) = &app.session.file {
        app.ui.panels.session.target = TargetFile::new(path.display().to_string());
    }
    app.ui.panels.session.target.open();
    app.ui.panels.session.open = true;
}

pub(super) fn show(app: &mut App, context: &egui::Context) {
    let mut open = app.ui.panels.session.open;
    let mut write = None;
    let window = egui::Window::new("Save session").open(&mut open).collapsible(false).resizable(false);
    window.default_pos(app.view.rect.center() - egui::vec2(220.0, 60.0)).show(context, |ui| {
        ui.set_width(420.0);
        let words = DialogTexts { title: "Save session", name: "autosplats.json", verb: "Save" };
        let (target, entered) = (&mut app.ui.panels.session.target, &mut app.ui.panels.entered);
        let folder = target.path().is_dir().then(|| "This is a folder".into());
        write = target.show(ui, &words, entered, folder);
    });
    app.ui.panels.session.open = open;
    let Some(write) = write else { return };
    if !write.replace && write.path.exists() {
        app.ui.panels.session.target.refuse(&write.path, "This file exists already", true);
        return;
    }
    match State::of(app).write(&write.path) {
        Ok(()) => {
            app.ui.messages.note(format!("{} was written; 'autosplats --state' restores it", write.path.display()));
            app.ui.panels.session.open = false;
        }
        Err(error) => app.ui.panels.session.target.refuse(&write.path, error, false),
    }
}
