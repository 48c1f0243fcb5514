//! The dialog to export points, and the export on a thread of its own.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, PoisonError};

use autosplats::cloud::Progress;
use autosplats_formats::written_formats;
use eframe::egui;

use super::target_file::{DialogTexts, TargetFile, Write};
use crate::messages::MessageSender;
use crate::session::document::{export, grouped};
use crate::session::{Document, ExportError, ExportScope, Exported, LayerId, Replace, Session};
use crate::threads::spawn;
use crate::ui::Action;
use crate::view::View;

/// State of the dialog and of the export.
pub(crate) struct Export {
    pub(crate) open: bool,
    what: ExportScope,
    target: TargetFile,
    /// The files that the last refused export would replace.
    replace: Replace,
    work: Option<ExportJob>,
}

impl Default for Export {
    fn default() -> Self {
        let target = TargetFile::new("");
        Self { open: false, what: ExportScope::Shown, target, replace: Replace::Nothing, work: None }
    }
}

impl Export {
    /// Whether a file is being written; leaving would stop the export.
    pub(crate) fn is_writing(&self) -> bool {
        self.work.is_some()
    }

    /// Opens the dialog.
    pub(crate) fn open(&mut self) {
        self.target.open();
        self.open = true;
    }

    /// Receives the result of an export, and shows the dialog. `entered` says that Enter was pressed where no control
    /// takes it.
    pub(super) fn show(
        &mut self,
        context: &egui::Context,
        session: &Session,
        view: &View,
        entered: &mut bool,
        actions: &mut Vec<Action>,
    ) {
        self.finish(&session.messages, actions);
        if !self.open {
            return;
        }
        let mut write = None;
        let choices = choices(session);
        if !choices.iter().any(|(_, what, _)| *what == self.what) {
            self.what = ExportScope::Shown;
            self.target.forget();
        }
        let window = egui::Window::new("Export points").open(&mut self.open).collapsible(false).resizable(false);
        window.default_pos(view.rect.center() - egui::vec2(220.0, 140.0)).show(context, |ui| {
            ui.set_width(420.0);
            if let Some(work) = &self.work {
                let done = work.listener.done.load(Ordering::Relaxed) as f32 / 1000.0;
                ui.add(egui::ProgressBar::new(done).text(work.path.display().to_string()));
                if ui.button("Stop").clicked() {
                    work.listener.cancelled.store(true, Ordering::Relaxed);
                }
                return;
            }
            for (label, what, enabled) in choices {
                if ui.add_enabled_ui(enabled, |ui| ui.radio_value(&mut self.what, what, label)).inner.changed() {
                    self.target.forget();
                }
            }
            ui.add_space(6.0);
            let formats: Vec<_> = written_formats().flat_map(|(_, extensions)| extensions.iter().copied()).collect();
            ui.small(format!("The extension of the name sets the format: .{}", formats.join(" .")));
            let words = DialogTexts { title: "Export points", name: "points.ply", verb: "Export" };
            write = self.target.show(ui, &words, entered, None);
        });
        if let Some(Write { path, replace, answered }) = write {
            let replace = match (answered, replace) {
                (true, _) => self.replace,
                (false, true) => Replace::Files,
                (false, false) => Replace::Nothing,
            };
            self.start(session.document().clone(), context, path, replace);
        }
    }

    /// Starts to write the points of `document`.
    fn start(&mut self, document: Document, context: &egui::Context, path: PathBuf, replace: Replace) {
        let listener = Arc::new(Listener {
            done: AtomicU32::new(0),
            cancelled: AtomicBool::new(false),
            notes: Mutex::default(),
            context: context.clone(),
        });
        let (sender, result) = channel();
        let what = self.what;
        let (theirs, points, target) = (Arc::clone(&listener), document.clone(), path.clone());
        spawn("export", move || {
            let _ = sender.send(export(&points, what, &target, replace, &*theirs));
            theirs.context.request_repaint();
        });
        self.target.forget();
        self.work = Some(ExportJob { document, what, path, listener, result });
    }

    /// Receives the result of the export.
    fn finish(&mut self, messages: &MessageSender, actions: &mut Vec<Action>) {
        let Some(result) = self.work.as_ref().and_then(|work| work.result.try_recv().ok()) else { return };
        let Some(ExportJob { document, what, path, listener, .. }) = self.work.take() else { return };
        let notes = std::mem::take(&mut *listener.notes.lock().unwrap_or_else(PoisonError::into_inner));
        notes.into_iter().for_each(|note| messages.note(note));
        match result {
            Ok(Exported { points }) => {
                let layers = saved_layers(&document, what);
                actions.push(Action::MarkSaved { document, layers });
                messages.note(format!("{} points were written to {}", grouped(points), path.display()));
                self.open = false;
            }
            Err(ExportError::Cancelled) => messages.note("Nothing was written"),
            Err(error) => {
                self.replace = match &error {
                    ExportError::Exists { .. } => Replace::Files,
                    ExportError::Input { .. } => Replace::Inputs,
                    _ => Replace::Nothing,
                };
                // The permission to replace holds only for the points that were refused.
                let question = self.replace != Replace::Nothing && self.what == what;
                self.target.refuse(&path, error.to_string(), question);
                self.open = true;
            }
        }
    }
}

/// An export in progress.
struct ExportJob {
    /// The document when the export began.
    document: Document,
    what: ExportScope,
    path: PathBuf,
    listener: Arc<Listener>,
    result: Receiver<Result<Exported, ExportError>>,
}

/// State shared by the writer and the window.
struct Listener {
    done: AtomicU32,
    cancelled: AtomicBool,
    notes: Mutex<Vec<String>>,
    context: egui::Context,
}

impl Progress for Listener {
    fn report(&self, fraction: f32) {
        self.done.store((fraction.clamp(0.0, 1.0) * 1000.0) as u32, Ordering::Relaxed);
        self.context.request_repaint();
    }

    fn cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    fn note(&self, note: &str) {
        self.notes.lock().unwrap_or_else(PoisonError::into_inner).push(note.into());
    }
}

/// The choices of an export: label, scope, and whether it holds any points.
fn choices(session: &Session) -> Vec<(String, ExportScope, bool)> {
    let counts = session.counts().all;
    let document = session.document();
    let mut choices = vec![
        ("Visible points".into(), ExportScope::Shown, counts.points > 0),
        (format!("Selected points ({})", grouped(counts.selected)), ExportScope::Selected, counts.selected > 0),
        ("All points, including hidden ones".into(), ExportScope::All, counts.points > 0),
    ];
    if document.layers.len() > 1 {
        let layer =
            |layer: &crate::session::Layer| (format!("All of {}", layer.name), ExportScope::Layer(layer.id), true);
        choices.extend(document.layers.iter().map(layer));
    }
    choices
}

/// The layers that are saved by an export, as all their remaining points are in the file.
fn saved_layers(document: &Document, what: ExportScope) -> Vec<LayerId> {
    let complete = |layer: &&crate::session::Layer| match what {
        ExportScope::All => true,
        ExportScope::Layer(id) => layer.id == id,
        ExportScope::Shown => {
            layer.visible && layer.edits.hidden.is_empty() && !document.clip.as_ref().is_some_and(|clip| clip.enabled)
        }
        ExportScope::Selected => false,
    };
    document.layers.iter().filter(complete).map(|layer| layer.id).collect()
}
