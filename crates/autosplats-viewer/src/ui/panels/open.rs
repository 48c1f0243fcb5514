//! Opening files: the system's dialog, or a text field for a path or a scene where there is none.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, TryRecvError};

use eframe::egui;

use crate::files::ask_for_inputs;
use crate::messages::MessageSender;
use crate::session::Input;
use crate::ui::Action;

#[derive(Default)]
pub(crate) struct Dialogs {
    chosen: Option<Receiver<Option<Vec<PathBuf>>>>,
    /// The text, while the field is shown.
    typed: Option<String>,
}

impl Dialogs {
    pub(crate) fn open(&mut self, context: &egui::Context) {
        if self.chosen.is_none() {
            self.chosen = Some(ask_for_inputs(context));
        }
    }

    /// Receives the choice in the system's dialog, or shows the text field.
    pub(super) fn show(&mut self, context: &egui::Context, messages: &MessageSender, actions: &mut Vec<Action>) {
        match self.chosen.as_ref().map(Receiver::try_recv) {
            // Without a system dialog, the text field is shown.
            Some(Ok(None)) => {
                self.chosen = None;
                self.typed.get_or_insert_default();
            }
            Some(Ok(Some(paths))) => {
                self.chosen = None;
                paths.into_iter().for_each(|path| actions.push(Action::Open(Input::file(path))));
            }
            Some(Err(TryRecvError::Disconnected)) => self.chosen = None,
            Some(Err(TryRecvError::Empty)) | None => {}
        }
        let Some(typed) = &mut self.typed else { return };
        let mut input = None;
        let mut closed = false;
        let modal = egui::Modal::new(egui::Id::unique("open")).show(context, |ui| {
            ui.set_width(420.0);
            ui.label("Path of a file, or a scene such as scene:statue");
            let line = ui.add(egui::TextEdit::singleline(typed).desired_width(f32::INFINITY).hint_text("scan.laz"));
            let enter = line.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
            if !enter {
                line.request_focus();
            }
            ui.horizontal(|ui| {
                if (ui.button("Open").clicked() || enter) && !typed.trim().is_empty() {
                    input = Some(typed.trim().to_owned());
                }
                closed = ui.button("Cancel").clicked();
            });
        });
        if let Some(name) = input {
            match Input::parse(&name) {
                Ok(input) => {
                    actions.push(Action::Open(input));
                    closed = true;
                }
                Err(error) => messages.error(error.to_string()),
            }
        }
        if closed || modal.should_close() {
            self.typed = None;
        }
    }
}
