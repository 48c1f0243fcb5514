//! The choice of an output file: a text field, the system's dialog, and the question before a file is replaced.

use std::path::{Path, PathBuf};
use std::sync::mpsc::Receiver;

use eframe::egui;

use crate::files::ask_for_output;

/// An output file.
///
/// The system's dialog does not tell whether it was cancelled or is missing, so that it only fills in the text field.
pub(crate) struct TargetFile {
    /// The text as typed.
    text: String,
    chosen: Option<Receiver<Option<PathBuf>>>,
    /// The file that may be replaced, as the system's dialog has asked about it.
    agreed: Option<PathBuf>,
    /// Why the file with this path was not written.
    refused: Option<(PathBuf, Refusal)>,
    /// Whether the text field should receive the focus.
    fresh: bool,
}

/// Why a file was not written.
struct Refusal {
    why: String,
    /// Whether the user may decide to replace the file.
    question: bool,
}

/// The texts of a file dialog.
pub(super) struct DialogTexts<'a> {
    /// Title of the system's dialog.
    pub(super) title: &'a str,
    /// Example of a file name.
    pub(super) name: &'a str,
    /// Label of the button that writes the file.
    pub(super) verb: &'a str,
}

/// A decision to write a file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Write {
    pub(super) path: PathBuf,
    /// Whether an existing file may be replaced.
    pub(super) replace: bool,
    /// Whether the user has just allowed that in answer to the question.
    pub(super) answered: bool,
}

impl TargetFile {
    /// A choice with a proposed name.
    pub(super) fn new(text: impl Into<String>) -> Self {
        Self { text: text.into(), chosen: None, agreed: None, refused: None, fresh: false }
    }

    /// Prepares the opened dialog: the text field receives the focus, and no file may be replaced.
    pub(super) fn open(&mut self) {
        self.forget();
        self.fresh = true;
    }

    /// Forgets the permission to replace, as something else is to be written.
    pub(super) fn forget(&mut self) {
        self.agreed = None;
        self.refused = None;
    }

    /// Shows why `path` was not written. With `question`, the user may replace the file; another name can be typed.
    pub(super) fn refuse(&mut self, path: &Path, why: impl Into<String>, question: bool) {
        self.fresh = true;
        self.refused = Some((path.into(), Refusal { why: why.into(), question }));
    }

    /// The path, without surrounding blanks.
    pub(super) fn path(&self) -> PathBuf {
        self.text.trim().into()
    }

    /// Receives the choice in the system's dialog, and forgets what concerns another file.
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

    /// Shows the text field and its buttons. Returns what to write now. Enter presses the button, but never answers the
    /// question to replace. `entered` says that Enter was pressed where no control takes it. `problem` says why the
    /// file cannot be written.
    pub(super) fn show(
        &mut self,
        ui: &mut egui::Ui,
        words: &DialogTexts<'_>,
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
        // The text field keeps the focus, so that typing does not trigger commands.
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
