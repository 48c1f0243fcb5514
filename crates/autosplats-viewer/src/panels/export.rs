//! Writing points, beside the window.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, PoisonError};

use autosplats::cloud::{Progress, written_formats};
use eframe::egui;

use crate::app::App;
use crate::document::{Document, ExportError, Exported, LayerId, Replace, What, export, grouped};
use crate::files::ask_for_output;
use crate::threads::spawn;

/// What is being asked and what is being written.
pub(crate) struct Export {
    pub(crate) open: bool,
    /// Whether it was open in the last frame.
    was_open: bool,
    what: What,
    path: String,
    chosen: Option<Receiver<Option<PathBuf>>>,
    /// What was not written, to be decided about.
    refused: Option<Refusal>,
    work: Option<Work>,
}

impl Default for Export {
    fn default() -> Self {
        Self {
            open: false,
            was_open: false,
            what: What::Shown,
            path: String::new(),
            chosen: None,
            refused: None,
            work: None,
        }
    }
}

/// What was not written.
struct Refusal {
    what: What,
    path: PathBuf,
    why: String,
    /// What writing it all the same would replace.
    replace: Replace,
}

impl Export {
    fn path(&self) -> PathBuf {
        self.path.trim().into()
    }

    /// Forgets why something was not written as soon as something else is asked for: what may be replaced is one file.
    fn forget_refusal(&mut self) {
        let path = self.path();
        let opened = self.open && !self.was_open;
        self.was_open = self.open;
        self.refused.take_if(|refused| opened || refused.path != path || refused.what != self.what);
    }

    /// Whether a file is being written, which leaving would stop.
    pub(crate) fn is_writing(&self) -> bool {
        self.work.is_some()
    }
}

/// A file that is being written.
struct Work {
    /// As it was when writing began.
    document: Document,
    what: What,
    path: PathBuf,
    listener: Arc<Listener>,
    result: Receiver<Result<Exported, ExportError>>,
}

/// What writer and window share.
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

pub(super) fn show(app: &mut App, context: &egui::Context) {
    finish(app);
    if let Some(Ok(chosen)) = app.panels.export.chosen.as_ref().map(Receiver::try_recv) {
        app.panels.export.chosen = None;
        if let Some(path) = chosen {
            app.panels.export.path = path.display().to_string();
        }
    }
    app.panels.export.forget_refusal();
    if !app.panels.export.open {
        return;
    }
    let mut open = true;
    let mut begin = None;
    let choices = choices(app);
    if !choices.iter().any(|(_, what, _)| *what == app.panels.export.what) {
        app.panels.export.what = What::Shown;
    }
    let window = egui::Window::new("Export points").open(&mut open).collapsible(false).resizable(false);
    window.default_pos(app.view_rect.center() - egui::vec2(220.0, 140.0)).show(context, |ui| {
        ui.set_width(420.0);
        let export = &mut app.panels.export;
        if let Some(work) = &export.work {
            let done = work.listener.done.load(Ordering::Relaxed) as f32 / 1000.0;
            ui.add(egui::ProgressBar::new(done).text(work.path.display().to_string()));
            if ui.button("Stop").clicked() {
                work.listener.cancelled.store(true, Ordering::Relaxed);
            }
            return;
        }
        for (label, what, enabled) in choices {
            ui.add_enabled_ui(enabled, |ui| ui.radio_value(&mut export.what, what, label));
        }
        ui.add_space(6.0);
        ui.horizontal(|ui| {
            let typed = egui::TextEdit::singleline(&mut export.path).desired_width(320.0).hint_text("points.ply");
            ui.add(typed);
            if ui.button("Browse…").clicked() && export.chosen.is_none() {
                export.chosen = Some(ask_for_output(context, "Export points", "points.ply"));
            }
        });
        let formats: Vec<_> = written_formats().flat_map(|(_, extensions)| extensions.iter().copied()).collect();
        ui.small(format!("The name tells the format: .{}", formats.join(" .")));
        ui.add_space(6.0);
        export.forget_refusal();
        if let Some(Refusal { why, replace, .. }) = &export.refused {
            ui.colored_label(ui.visuals().error_fg_color, why);
            if *replace != Replace::Nothing && ui.button("Replace it").clicked() {
                begin = Some(*replace);
            }
        } else if ui.add_enabled(!export.path.trim().is_empty(), egui::Button::new("Export")).clicked() {
            begin = Some(Replace::Nothing);
        }
    });
    app.panels.export.open = open;
    if let Some(replace) = begin {
        start(app, context, replace);
    }
}

/// What can be written: what it is called, what it is, and whether there is any of it.
fn choices(app: &mut App) -> Vec<(String, What, bool)> {
    let counts = app.counts().all;
    let document = app.document();
    let mut choices = vec![
        ("What is shown".into(), What::Shown, counts.points > 0),
        (format!("What is selected ({})", grouped(counts.selected)), What::Selected, counts.selected > 0),
        ("All, hidden points too".into(), What::All, counts.points > 0),
    ];
    if document.layers.len() > 1 {
        let layer = |layer: &crate::document::Layer| (format!("All of {}", layer.name), What::Layer(layer.id), true);
        choices.extend(document.layers.iter().map(layer));
    }
    choices
}

fn start(app: &mut App, context: &egui::Context, replace: Replace) {
    let document = app.document().clone();
    let export_state = &mut app.panels.export;
    let path = export_state.path();
    let listener = Arc::new(Listener {
        done: AtomicU32::new(0),
        cancelled: AtomicBool::new(false),
        notes: Mutex::default(),
        context: context.clone(),
    });
    let (sender, result) = channel();
    let what = export_state.what;
    let (theirs, points, target) = (Arc::clone(&listener), document.clone(), path.clone());
    spawn("export", move || {
        let _ = sender.send(export(&points, what, &target, replace, &*theirs));
        theirs.context.request_repaint();
    });
    export_state.refused = None;
    export_state.work = Some(Work { document, what, path, listener, result });
}

/// Takes in how writing ended.
fn finish(app: &mut App) {
    let Some(result) = app.panels.export.work.as_ref().and_then(|work| work.result.try_recv().ok()) else { return };
    let Some(Work { document, what, path, listener, .. }) = app.panels.export.work.take() else { return };
    let notes = std::mem::take(&mut *listener.notes.lock().unwrap_or_else(PoisonError::into_inner));
    notes.into_iter().for_each(|note| app.messages.note(note));
    match result {
        Ok(Exported { points }) => {
            saved_layers(&document, what).into_iter().for_each(|id| app.history.mark_saved(&document, id));
            app.messages.note(format!("{} points were written to {}", grouped(points), path.display()));
            app.panels.export.open = false;
        }
        Err(ExportError::Cancelled) => app.messages.note("Nothing was written"),
        Err(error) => {
            let replace = match &error {
                ExportError::Exists { .. } => Replace::Files,
                ExportError::Input { .. } => Replace::Inputs,
                _ => Replace::Nothing,
            };
            let export = &mut app.panels.export;
            export.refused = Some(Refusal { what, path, why: error.to_string(), replace });
            // It is opened to say so, not to forget it.
            (export.open, export.was_open) = (true, true);
        }
    }
}

/// The layers of which nothing would be lost now: all their points that are left are in the file.
fn saved_layers(document: &Document, what: What) -> Vec<LayerId> {
    let complete = |layer: &&crate::document::Layer| match what {
        What::All => true,
        What::Layer(id) => layer.id == id,
        What::Shown => {
            layer.visible && layer.edits.hidden.is_empty() && !document.clip.as_ref().is_some_and(|clip| clip.enabled)
        }
        What::Selected => false,
    };
    document.layers.iter().filter(complete).map(|layer| layer.id).collect()
}

/// Whether a path names a picture.
pub(super) fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|own| own.eq_ignore_ascii_case(extension))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A window in which replacing `a.ply` was refused.
    fn refused() -> Export {
        let refused = Refusal { what: What::Shown, path: "a.ply".into(), why: "there".into(), replace: Replace::Files };
        Export { open: true, was_open: true, path: " a.ply".into(), refused: Some(refused), ..Export::default() }
    }

    #[test]
    fn what_may_be_replaced_is_what_was_refused() {
        let kept = |change: fn(&mut Export)| {
            let mut export = refused();
            change(&mut export);
            export.forget_refusal();
            export.refused.is_some()
        };
        assert!(kept(|_| {}), "nothing has changed");
        assert!(!kept(|export| export.path = "b.ply".into()), "another file");
        assert!(!kept(|export| export.what = What::All), "other points");
        assert!(!kept(|export| export.was_open = false), "the window is opened anew");
        let mut export = refused();
        export.path = "b.ply".into();
        export.forget_refusal();
        export.path = "a.ply".into();
        export.forget_refusal();
        assert!(export.refused.is_none(), "it is asked again after all");
    }
}
