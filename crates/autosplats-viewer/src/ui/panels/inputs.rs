//! The list of inputs, and the window with information on a point.

use autosplats::cloud::{PointFilter, glam::DVec3};
use eframe::egui;

use super::layer::{Naming, naming};
use crate::session::document::{grouped, shortest};
use crate::session::{Layer, LayerId, Loader, PickedPoint, Playing, Session, WaitingInput};
use crate::ui::{Action, Command};
use crate::view::View;

/// The list of inputs.
pub(crate) struct Inputs {
    pub(crate) open: bool,
    /// The name that is being typed.
    naming: Option<Naming>,
}

impl Default for Inputs {
    fn default() -> Self {
        Self { open: true, naming: None }
    }
}

impl Inputs {
    /// Shows the list. Returns its place.
    pub(super) fn show(&mut self, ui: &mut egui::Ui, session: &Session, actions: &mut Vec<Action>) -> egui::Rect {
        let panel = egui::Panel::left("inputs").default_size(210.0).size_range(150.0..=420.0);
        let shown = panel.show(ui, |ui| {
            ui.add_space(4.0);
            ui.horizontal(|ui| {
                ui.strong("Inputs");
                ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                    if ui.small_button("+").on_hover_text("Open more").clicked() {
                        actions.push(Command::Open.into());
                    }
                });
            });
            ui.separator();
            egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                loading(ui, &session.loader);
                waiting(ui, &session.playing, actions);
                for layer in &session.document().layers {
                    self.layer(ui, session, layer, actions);
                }
                if session.is_empty() {
                    ui.weak("Nothing is open.");
                }
            });
        });
        shown.response.rect
    }

    /// Shows a layer.
    fn layer(&mut self, ui: &mut egui::Ui, session: &Session, layer: &Layer, actions: &mut Vec<Action>) {
        let (id, name, path) = (layer.id, &layer.name, &layer.path);
        let counts = session.counts().layers.get(&id).copied().unwrap_or_default();
        let unsaved = session.history.is_unsaved(id);
        ui.push_id(id, |ui| {
            ui.horizontal(|ui| {
                let mut shown = layer.visible;
                if ui.checkbox(&mut shown, "").on_hover_text("Show this input").changed() {
                    actions.push(Action::SetVisible(id, shown));
                }
                let mut color = layer.tint.unwrap_or([200, 200, 200]);
                if super::color::button(ui, &mut color, "One colour for all its points") {
                    actions.push(Action::SetTint(id, Some(color)));
                }
                if naming(&mut self.naming, ui, layer, actions) {
                    return;
                }
                let text = if unsaved { format!("{name} *") } else { name.clone() };
                let label = ui.add(egui::Label::new(text).truncate().sense(egui::Sense::click()));
                let file = path.as_ref().map_or_else(String::new, |path| format!("\n{}", path.display()));
                let edits = if unsaved { "\nIts edits are not saved" } else { "" };
                let begins =
                    session.playing.alignment(id).map_or_else(String::new, |words| format!("\nIt begins {words}"));
                if label.double_clicked() {
                    self.naming = Some(Naming::new(layer));
                }
                let hint = format!("{name}{file}{edits}{begins}");
                label.on_hover_text(hint).context_menu(|ui| self.menu(ui, session, layer, actions));
            });
            ui.horizontal_wrapped(|ui| {
                ui.add_space(22.0);
                let mut figures = match &layer.tree {
                    Some(tree) => {
                        let all = grouped(tree.open.tree.info().points as usize);
                        format!("{} of {all} points", grouped(counts.points))
                    }
                    None => format!("{} points", grouped(counts.points)),
                };
                for (count, what) in
                    [(counts.selected, "selected"), (counts.hidden, "hidden"), (counts.deleted, "deleted")]
                {
                    if count > 0 {
                        figures += &format!(", {} {what}", grouped(count));
                    }
                }
                ui.small(figures);
                let filtered = session.inputs.get(&id).is_some_and(|input| {
                    !input.source.moves() && input.options.keep.as_ref().is_none_or(|filter| !filter.is_all())
                });
                if filtered && counts.hidden > 0 {
                    let show =
                        ui.small_button("Show").on_hover_text("Show all its points, noise and withheld ones too");
                    if show.clicked() {
                        actions.push(Action::Keep(id, PointFilter::all()));
                    }
                }
                ui.menu_button("…", |ui| self.menu(ui, session, layer, actions))
                    .response
                    .on_hover_text("Actions for this input");
            });
        });
        ui.add_space(4.0);
    }

    /// Shows the menu of a layer.
    fn menu(&mut self, ui: &mut egui::Ui, session: &Session, layer: &Layer, actions: &mut Vec<Action>) {
        let id = layer.id;
        if ui.button("Fit").on_hover_text("Move the camera to show all of it").clicked() {
            actions.push(Action::Fit(id));
            ui.close();
        }
        if ui.button("Show only this").clicked() {
            actions.push(Action::ShowOnly(id));
            ui.close();
        }
        if ui.button("Its own colours").clicked() {
            actions.push(Action::SetTint(id, None));
            ui.close();
        }
        ui.separator();
        super::layer::menu(&mut self.naming, ui, session, layer, actions);
        ui.separator();
        if ui.button("Remove").on_hover_text("Remove it from the list; its file stays unchanged").clicked() {
            actions.push(Action::Remove(vec![id]));
            ui.close();
        }
    }
}

/// The inputs that are being read.
fn loading(ui: &mut egui::Ui, loader: &Loader) {
    for job in loader.jobs() {
        ui.horizontal(|ui| {
            if ui.small_button("×").on_hover_text("Stop reading").clicked() {
                job.cancel();
            }
            let bar = egui::ProgressBar::new(job.fraction()).desired_width(ui.available_width());
            ui.add(bar.text(&*job.input.name));
        });
    }
}

/// The playing inputs that have no points yet, and why.
fn waiting(ui: &mut egui::Ui, playing: &Playing, actions: &mut Vec<Action>) {
    for WaitingInput { number, input, why, read, .. } in playing.waiting() {
        ui.horizontal(|ui| {
            if ui.small_button("×").on_hover_text("Do not open it").clicked() {
                actions.push(Action::GiveUpWaiting(number));
            }
            ui.add(egui::Label::new(&*input.name).truncate()).on_hover_text(input.source_name());
        });
        ui.horizontal_wrapped(|ui| {
            ui.add_space(22.0);
            // A spinner would repaint the window continuously.
            ui.small(if read > 0.0 { format!("{why}, {:.0} %", 100.0 * read) } else { why });
        });
        ui.add_space(4.0);
    }
}

/// Asks before layers with unsaved edits are removed.
pub(super) fn removal(ids: &mut Vec<LayerId>, context: &egui::Context, session: &Session, actions: &mut Vec<Action>) {
    if ids.is_empty() {
        return;
    }
    let unsaved = ids.iter().filter(|&&id| session.history.is_unsaved(id));
    let names: Vec<&str> = unsaved.filter_map(|&id| session.document().layer(id)).map(|layer| &*layer.name).collect();
    let mut answer = None;
    let modal = egui::Modal::new(egui::Id::unique("removal")).show(context, |ui| {
        ui.heading("Edits are not saved");
        ui.label(format!("The edits of {} are in no file yet.", names.join(", ")));
        ui.add_space(8.0);
        ui.horizontal(|ui| {
            if super::main_button(ui, "Export…").clicked() {
                answer = Some((false, true));
            }
            for (label, remove) in [("Remove", true), ("Keep", false)] {
                if ui.button(label).clicked() {
                    answer = Some((remove, false));
                }
            }
        });
    });
    if let Some((remove, export)) = answer.or_else(|| modal.should_close().then_some((false, false))) {
        let ids = std::mem::take(ids);
        if remove {
            actions.push(Action::RemoveEdited(ids));
        }
        if export {
            actions.push(Command::Export.into());
        }
    }
}

/// Text of a place, with the digits that remain exact after moving and turning.
fn place_text(place: DVec3) -> String {
    let error = 1e-13 * place.abs().max_element();
    place.to_array().map(|value| shortest(value, error)).join(" ")
}

/// The window with information on the inspected point.
pub(super) fn inspected(inspected: &mut Option<PickedPoint>, context: &egui::Context, session: &Session, view: &View) {
    let Some(point) = inspected else { return };
    let mut open = true;
    let window = egui::Window::new("Point").open(&mut open).resizable(true).default_width(260.0);
    window.default_pos(view.rect.right_top() + egui::vec2(-290.0, 10.0)).show(context, |ui| {
        egui::ScrollArea::vertical().max_height(420.0).show(ui, |ui| {
            egui::Grid::new("point").num_columns(2).striped(true).show(ui, |ui| {
                let mut row = |name: &str, value: &str| {
                    ui.label(name);
                    ui.add(egui::Label::new(egui::RichText::new(value).monospace()).selectable(true).wrap());
                    ui.end_row();
                };
                row("Input", &point.name);
                if let Some(words) = session.playing.alignment(point.layer) {
                    row("Begins", &words);
                }
                match point.node {
                    Some((key, index)) => row("Node and index", &format!("{key} {index}")),
                    None => row("Index", &point.point.to_string()),
                }
                for (axis, value) in ["x", "y", "z"].into_iter().zip(&point.file_text) {
                    row(axis, value);
                }
                if point.position != point.file_position {
                    row("shown at", &place_text(point.position));
                }
                if let Some([r, g, b]) = point.color {
                    row("Colour", &format!("{r} {g} {b}"));
                }
                if let Some(scan) = &point.scan {
                    row("Scan", scan);
                }
                for (name, value) in &point.fields {
                    row(name, value);
                }
            });
        });
    });
    if !open {
        *inspected = None;
    }
}
