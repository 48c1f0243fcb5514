//! The list of inputs, and the window with information on a point.

use autosplats::cloud::glam::DVec3;
use eframe::egui;

use crate::app::App;
use crate::document::{Document, LayerId, grouped, shortest};
use crate::playing::WaitingInput;

pub(super) fn show(app: &mut App, ui: &mut egui::Ui) {
    let panel = egui::Panel::left("inputs").default_size(210.0).size_range(150.0..=420.0);
    let shown = panel.show(ui, |ui| {
        ui.add_space(4.0);
        ui.horizontal(|ui| {
            ui.strong("Inputs");
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                if ui.small_button("+").on_hover_text("Open more").clicked() {
                    let context = ui.ctx().clone();
                    app.ui.panels.dialogs.open(&context);
                }
            });
        });
        ui.separator();
        egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            loading(app, ui);
            waiting(app, ui);
            let ids: Vec<LayerId> = app.document().layers.iter().map(|layer| layer.id).collect();
            for id in ids {
                layer(app, ui, id);
            }
            if app.document().layers.is_empty()
                && app.session.loader.jobs().is_empty()
                && app.session.playing.is_empty()
            {
                ui.weak("Nothing is open.");
            }
        });
    });
    app.ui.panels.focus.part(shown.response.rect);
}

/// The inputs that are being read.
fn loading(app: &App, ui: &mut egui::Ui) {
    for job in app.session.loader.jobs() {
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
fn waiting(app: &mut App, ui: &mut egui::Ui) {
    let mut given_up = None;
    for WaitingInput { number, input, why, read, .. } in app.session.playing.waiting() {
        ui.horizontal(|ui| {
            if ui.small_button("×").on_hover_text("Do not open it").clicked() {
                given_up = Some(number);
            }
            ui.add(egui::Label::new(&*input.name).truncate()).on_hover_text(App::source_name(input));
        });
        ui.horizontal_wrapped(|ui| {
            ui.add_space(22.0);
            // A spinner would repaint the window continuously.
            ui.small(if read > 0.0 { format!("{why}, {:.0} %", 100.0 * read) } else { why });
        });
        ui.add_space(4.0);
    }
    if let Some(number) = given_up {
        app.session.playing.give_up(number);
    }
}

fn layer(app: &mut App, ui: &mut egui::Ui, id: LayerId) {
    let Some(layer) = app.document().layer(id) else { return };
    let (name, visible, tint, path) = (layer.name.clone(), layer.visible, layer.tint, layer.path.clone());
    let counts = app.counts().layers.get(&id).copied().unwrap_or_default();
    let unsaved = app.session.history.is_unsaved(id);
    ui.push_id(id, |ui| {
        ui.horizontal(|ui| {
            let mut shown = visible;
            if ui.checkbox(&mut shown, "").on_hover_text("Show this input").changed() {
                app.settle(|document| {
                    document.set_visible(id, shown);
                });
            }
            let mut color = tint.unwrap_or([200, 200, 200]);
            if super::color::button(ui, &mut color, "One colour for all its points") {
                app.settle(|document| {
                    document.set_tint(id, Some(color));
                });
            }
            if super::layer::naming(app, ui, id) {
                return;
            }
            let text = if unsaved { format!("{name} *") } else { name.clone() };
            let label = ui.add(egui::Label::new(text).truncate().sense(egui::Sense::click()));
            let file = path.map_or_else(String::new, |path| format!("\n{}", path.display()));
            let edits = if unsaved { "\nIts edits are not saved" } else { "" };
            let begins =
                app.session.playing.alignment(id).map_or_else(String::new, |words| format!("\nIt begins {words}"));
            if label.double_clicked() {
                super::layer::rename(app, id);
            }
            label.on_hover_text(format!("{name}{file}{edits}{begins}")).context_menu(|ui| menu(app, ui, id));
        });
        ui.horizontal_wrapped(|ui| {
            ui.add_space(22.0);
            let mut figures = format!("{} points", grouped(counts.points));
            for (count, what) in [(counts.selected, "selected"), (counts.hidden, "hidden"), (counts.deleted, "deleted")]
            {
                if count > 0 {
                    figures += &format!(", {} {what}", grouped(count));
                }
            }
            ui.small(figures);
            ui.menu_button("…", |ui| menu(app, ui, id)).response.on_hover_text("Actions for this input");
        });
    });
    ui.add_space(4.0);
}

fn menu(app: &mut App, ui: &mut egui::Ui, id: LayerId) {
    if ui.button("Fit").on_hover_text("Move the camera to show all of it").clicked() {
        let mut alone = Document::default();
        alone.layers.extend(app.document().layer(id).cloned());
        let cloud = alone.overview();
        app.fit(&cloud);
        ui.close();
    }
    if ui.button("Show only this").clicked() {
        app.settle(|document| {
            let ids: Vec<_> = document.layers.iter().map(|layer| layer.id).collect();
            for other in ids {
                document.set_visible(other, other == id);
            }
        });
        ui.close();
    }
    if ui.button("Its own colours").clicked() {
        app.settle(|document| {
            document.set_tint(id, None);
        });
        ui.close();
    }
    ui.separator();
    super::layer::menu(app, ui, id);
    ui.separator();
    if ui.button("Remove").on_hover_text("Remove it from the list; its file stays unchanged").clicked() {
        remove(app, vec![id]);
        ui.close();
    }
}

/// Removes all inputs.
pub(crate) fn close_all(app: &mut App) {
    app.session.loader.cancel_all();
    app.session.playing.give_up_waiting();
    let ids = app.document().layers.iter().map(|layer| layer.id).collect();
    remove(app, ids);
}

/// Removes layers as an undo step. Asks first if edits would be lost.
fn remove(app: &mut App, ids: Vec<LayerId>) {
    if ids.iter().any(|&id| app.session.history.is_unsaved(id)) {
        app.ui.panels.removal = ids;
    } else {
        remove_now(app, &ids);
    }
}

fn remove_now(app: &mut App, ids: &[LayerId]) {
    let incomplete = |id: &LayerId| app.document().layer(*id).is_some_and(|layer| layer.incomplete);
    let (unread, ids): (Vec<LayerId>, Vec<LayerId>) = ids.iter().copied().partition(incomplete);
    unread.into_iter().for_each(|id| app.give_up(id));
    if ids.is_empty() {
        return;
    }
    let label = if let [_] = ids[..] { "Remove an input" } else { "Close all" };
    app.edit(label, |document| {
        ids.iter().for_each(|&id| {
            document.remove(id);
        });
    });
}

/// Asks before layers with unsaved edits are removed.
pub(super) fn removal(app: &mut App, context: &egui::Context) {
    if app.ui.panels.removal.is_empty() {
        return;
    }
    let unsaved: Vec<LayerId> =
        app.ui.panels.removal.iter().copied().filter(|&id| app.session.history.is_unsaved(id)).collect();
    let names: Vec<String> =
        unsaved.iter().filter_map(|&id| app.document().layer(id)).map(|layer| layer.name.clone()).collect();
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
        let ids = std::mem::take(&mut app.ui.panels.removal);
        if remove {
            remove_now(app, &ids);
        }
        if export {
            super::export::open(app);
        }
    }
}

/// Text of a place, with the digits that remain exact after moving and turning.
fn place_text(place: DVec3) -> String {
    let error = 1e-13 * place.abs().max_element();
    place.to_array().map(|value| shortest(value, error)).join(" ")
}

/// The window with information on the inspected point.
pub(super) fn inspected(app: &mut App, context: &egui::Context) {
    let Some(point) = app.ui.tools.inspected.clone() else { return };
    let mut open = true;
    let window = egui::Window::new("Point").open(&mut open).resizable(true).default_width(260.0);
    window.default_pos(app.view.rect.right_top() + egui::vec2(-290.0, 10.0)).show(context, |ui| {
        egui::ScrollArea::vertical().max_height(420.0).show(ui, |ui| {
            egui::Grid::new("point").num_columns(2).striped(true).show(ui, |ui| {
                let mut row = |name: &str, value: &str| {
                    ui.label(name);
                    ui.add(egui::Label::new(egui::RichText::new(value).monospace()).selectable(true).wrap());
                    ui.end_row();
                };
                row("Input", &point.name);
                if let Some(words) = app.session.playing.alignment(point.layer) {
                    row("Begins", &words);
                }
                row("Index", &point.point.to_string());
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
        app.ui.tools.inspected = None;
    }
}
