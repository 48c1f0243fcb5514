//! Opening files: the system's dialog, and a line to type a path or a scene where there is none. And where the session goes.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, TryRecvError};

use eframe::egui;

use crate::app::App;
use crate::files::{ask_for_inputs, ask_for_output};
use crate::loading::Input;
use crate::state::State;

/// What is being asked.
#[derive(Default)]
pub(crate) struct Dialogs {
    chosen: Option<Receiver<Option<Vec<PathBuf>>>>,
    /// Where the session is to be kept, while that is asked.
    session: Option<Session>,
    /// What is typed, while it can be.
    typed: Option<String>,
}

/// Where the session is to be kept.
///
/// The system's dialog does not tell whether it was cancelled or is not there, so that it is only a way to fill the line in.
struct Session {
    path: String,
    chosen: Option<Receiver<Option<PathBuf>>>,
    /// The file that may be replaced if it is there.
    replaced: Option<PathBuf>,
}

impl Session {
    fn new(path: &Path) -> Self {
        Self { path: path.display().to_string(), chosen: None, replaced: None }
    }

    fn path(&self) -> PathBuf {
        self.path.trim().into()
    }

    /// Takes in what was chosen in the system's dialog, which has asked already whether to replace it.
    fn receive(&mut self) {
        let Some(Ok(chosen)) = self.chosen.as_ref().map(Receiver::try_recv) else { return };
        self.chosen = None;
        if let Some(path) = chosen {
            self.path = path.display().to_string();
            self.replaced = Some(self.path());
        }
    }

    /// Why it cannot be written as it is.
    fn problem(&self) -> Option<&'static str> {
        let path = self.path();
        if self.path.trim().is_empty() {
            Some("It needs a name")
        } else if path.is_dir() {
            Some("This is a folder")
        } else if path.exists() && self.replaced.as_ref() != Some(&path) {
            Some("This file is there already")
        } else {
            None
        }
    }
}

impl Dialogs {
    /// Asks where to keep the session, which is kept at `path` so far.
    pub(crate) fn save_state(&mut self, path: Option<&Path>) {
        self.session.get_or_insert_with(|| Session::new(path.unwrap_or(Path::new("autosplats.json"))));
    }

    /// Asks for files.
    pub(crate) fn open(&mut self, context: &egui::Context) {
        if self.chosen.is_none() {
            self.chosen = Some(ask_for_inputs(context));
        }
    }
}

/// Asks where the session goes, and writes it there.
fn save_state(app: &mut App, context: &egui::Context) {
    let Some(session) = &mut app.panels.dialogs.session else { return };
    session.receive();
    let mut save = false;
    let mut closed = false;
    let modal = egui::Modal::new(egui::Id::unique("session")).show(context, |ui| {
        ui.set_width(420.0);
        ui.label("Keep the session in");
        ui.horizontal(|ui| {
            ui.add(egui::TextEdit::singleline(&mut session.path).desired_width(320.0));
            if ui.button("Browse…").clicked() && session.chosen.is_none() {
                session.chosen = Some(ask_for_output(context, "Save session", "autosplats.json"));
            }
        });
        let problem = session.problem();
        if let Some(problem) = problem {
            ui.colored_label(ui.visuals().warn_fg_color, problem);
        }
        ui.horizontal(|ui| {
            save = ui.add_enabled(problem.is_none(), egui::Button::new("Save")).clicked();
            let path = session.path();
            if problem.is_some() && path.is_file() && ui.button("Replace it").clicked() {
                session.replaced = Some(path);
                save = true;
            }
            closed = ui.button("Cancel").clicked();
        });
    });
    let path = session.path();
    if save {
        match State::of(app).write(&path) {
            Ok(()) => {
                app.messages.note(format!("{} was written; 'autosplats --state' has it again", path.display()));
                closed = true;
            }
            Err(error) => app.messages.error(error),
        }
    }
    if closed || modal.should_close() {
        app.panels.dialogs.session = None;
    }
}

pub(super) fn show(app: &mut App, context: &egui::Context) {
    save_state(app, context);
    match app.panels.dialogs.chosen.as_ref().map(Receiver::try_recv) {
        // Without a system dialog a path can be typed.
        Some(Ok(None)) => {
            app.panels.dialogs.chosen = None;
            app.panels.dialogs.typed.get_or_insert_default();
        }
        Some(Ok(Some(paths))) => {
            app.panels.dialogs.chosen = None;
            paths.into_iter().for_each(|path| app.open(Input::file(path)));
        }
        Some(Err(TryRecvError::Disconnected)) => app.panels.dialogs.chosen = None,
        Some(Err(TryRecvError::Empty)) | None => {}
    }
    let Some(typed) = &mut app.panels.dialogs.typed else { return };
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
                app.open(input);
                closed = true;
            }
            Err(error) => app.messages.error(error.to_string()),
        }
    }
    if closed || modal.should_close() {
        app.panels.dialogs.typed = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_very_file_that_was_asked_about_is_replaced() {
        let folder = tempfile::tempdir().expect("a folder");
        let [one, other, new] = ["one.json", "other.json", "new.json"].map(|name| folder.path().join(name));
        for path in [&one, &other] {
            std::fs::write(path, "{}").expect("it is written");
        }
        let mut session = Session::new(&new);
        assert_eq!(session.problem(), None, "a new file is no problem");
        session.path = one.display().to_string();
        assert!(session.problem().is_some(), "one that is there is asked about");
        session.replaced = Some(one);
        assert_eq!(session.problem(), None, "it may be replaced");
        session.path = other.display().to_string();
        assert!(session.problem().is_some(), "another may not");
        session.path = "  ".into();
        assert!(session.problem().is_some(), "nothing is no name");
    }

    #[test]
    fn cancelling_the_systems_dialog_changes_nothing() {
        let mut session = Session::new(Path::new("a.json"));
        for (chosen, path) in [(None, "a.json"), (Some(PathBuf::from("b.json")), "b.json")] {
            let (sender, receiver) = std::sync::mpsc::channel();
            session.chosen = Some(receiver);
            sender.send(chosen.clone()).expect("somebody listens");
            session.receive();
            assert_eq!((session.path.as_str(), &session.replaced), (path, &chosen), "as it was told");
        }
    }
}
