//! Where something is written: a line for the path, the system's dialog, and the question before anything is replaced.

use std::path::{Path, PathBuf};
use std::sync::mpsc::Receiver;

use eframe::egui;

use crate::files::ask_for_output;

/// A file that is to be written.
///
/// The system's dialog does not tell whether it was cancelled or is not there, so that it is only a way to fill the line in.
pub(crate) struct TargetFile {
    /// As it is typed.
    text: String,
    chosen: Option<Receiver<Option<PathBuf>>>,
    /// What may be replaced if it is there: this very file, as the system's dialog has asked.
    agreed: Option<PathBuf>,
    /// Why it was not written, for this path.
    refused: Option<(PathBuf, Refusal)>,
    /// Whether the line is to have the keyboard.
    fresh: bool,
}

/// Why something was not written.
struct Refusal {
    why: String,
    /// Whether the user may have it all the same.
    question: bool,
}

/// What a dialog for a file says.
pub(super) struct Words<'a> {
    /// Title of the system's dialog.
    pub(super) title: &'a str,
    /// A name as an example.
    pub(super) name: &'a str,
    /// What the button says that writes it.
    pub(super) verb: &'a str,
}

/// What is to be written.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Write {
    pub(super) path: PathBuf,
    /// Whether the user wants it to replace what is there.
    pub(super) replace: bool,
    /// Whether that was said to the last question.
    pub(super) answered: bool,
}

impl TargetFile {
    /// A file of this name, where nobody says another one.
    pub(super) fn new(text: impl Into<String>) -> Self {
        Self { text: text.into(), chosen: None, agreed: None, refused: None, fresh: false }
    }

    /// The dialog is opened: nothing is agreed yet, and a name can be typed.
    pub(super) fn open(&mut self) {
        self.forget();
        self.fresh = true;
    }

    /// Something else is to be written: what was agreed was about another thing.
    pub(super) fn forget(&mut self) {
        self.agreed = None;
        self.refused = None;
    }

    /// Tells why `path` was not written; as a question if it may be all the same. Another name can be typed.
    pub(super) fn refuse(&mut self, path: &Path, why: impl Into<String>, question: bool) {
        self.fresh = true;
        self.refused = Some((path.into(), Refusal { why: why.into(), question }));
    }

    /// The path, without blanks around it.
    pub(super) fn path(&self) -> PathBuf {
        self.text.trim().into()
    }

    /// Takes in what was chosen in the system's dialog, and forgets what was said of another file.
    fn receive(&mut self) {
        if let Some(Ok(chosen)) = self.chosen.as_ref().map(Receiver::try_recv) {
            self.chosen = None;
            if let Some(path) = chosen {
                self.text = path.display().to_string();
                self.agreed = Some(self.path());
            }
        }
        let path = self.path();
        self.agreed.take_if(|agreed| *agreed != path);
        self.refused.take_if(|(refused, _)| *refused != path);
    }

    /// The line and its buttons; gives what is to be written now. Enter does what the button does, but replaces nothing.
    /// `entered` says that Enter was pressed where nothing takes it; `problem` is why it cannot be written as it is.
    pub(super) fn show(
        &mut self,
        ui: &mut egui::Ui,
        words: &Words<'_>,
        entered: &mut bool,
        problem: Option<String>,
    ) -> Option<Write> {
        self.receive();
        let mut enter = ui.ctx().top_layer_id() == Some(ui.layer_id()) && std::mem::take(entered);
        ui.horizontal(|ui| {
            let browse = ui.spacing().button_padding.x * 2.0 + 64.0;
            let width = ui.available_width() - browse;
            let line = egui::TextEdit::singleline(&mut self.text).desired_width(width).hint_text(words.name);
            let response = ui.add(line);
            if std::mem::take(&mut self.fresh) {
                response.request_focus();
            }
            enter |= response.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
            if ui.button("Browse…").clicked() && self.chosen.is_none() {
                self.chosen = Some(ask_for_output(ui.ctx(), words.title, words.name));
            }
        });
        self.receive();
        let refused = self.refused.as_ref().map(|(_, refusal)| refusal);
        let (why, color) = match (&problem, refused) {
            (Some(problem), _) => (Some(problem), ui.visuals().warn_fg_color),
            (None, Some(refusal)) => (Some(&refusal.why), ui.visuals().error_fg_color),
            (None, None) => (None, egui::Color32::PLACEHOLDER),
        };
        if let Some(why) = why {
            ui.add(egui::Label::new(egui::RichText::new(why).color(color)).wrap());
        }
        ui.add_space(4.0);
        let path = self.path();
        let named = !self.text.trim().is_empty() && problem.is_none();
        let write = |replace, answered| Some(Write { path: path.clone(), replace, answered });
        let question = refused.is_some_and(|refusal| refusal.question);
        // What is typed next is no command while the dialog is open.
        self.fresh |= enter && (question || !named);
        if question {
            let replace = ui.add_enabled(named, egui::Button::new("Replace it"));
            return if replace.clicked() { write(true, true) } else { None };
        }
        let button = ui.add_enabled(named, egui::Button::new(words.verb));
        if button.clicked() || enter && named { write(self.agreed.as_ref() == Some(&path), false) } else { None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_very_file_that_was_asked_about_is_replaced() {
        let mut target = TargetFile::new("one.json");
        target.refuse(Path::new("one.json"), "it is there", true);
        target.receive();
        assert!(target.refused.is_some(), "the question stays");
        target.text = "  one.json ".into();
        target.receive();
        assert!(target.refused.is_some(), "blanks make no other file");
        target.text = "other.json".into();
        target.receive();
        target.text = "one.json".into();
        target.receive();
        assert!(target.refused.is_none(), "it is asked again after another name");
        target.agreed = Some("one.json".into());
        target.receive();
        assert!(target.agreed.is_some(), "the system's dialog has asked");
        target.forget();
        assert!(target.agreed.is_none(), "but about something else");
    }

    #[test]
    fn cancelling_the_systems_dialog_changes_nothing() {
        let mut target = TargetFile::new("a.json");
        for (chosen, path) in [(None, "a.json"), (Some(PathBuf::from("b.json")), "b.json")] {
            let (sender, receiver) = std::sync::mpsc::channel();
            target.chosen = Some(receiver);
            sender.send(chosen.clone()).expect("somebody listens");
            target.receive();
            assert_eq!((target.text.as_str(), &target.agreed), (path, &chosen), "as it was told");
        }
    }
}
