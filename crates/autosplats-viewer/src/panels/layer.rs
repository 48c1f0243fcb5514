//! The menu of an input: its name, its place in the list and in the world.

use autosplats_sources::Source;
use eframe::egui;

use crate::app::App;
use crate::document::LayerId;

/// A name that is being typed.
pub(crate) struct Naming {
    layer: LayerId,
    text: String,
    /// Whether the field has received the keyboard focus.
    focused: bool,
}

/// Starts to rename an input.
pub(super) fn rename(app: &mut App, id: LayerId) {
    let Some(text) = app.document().layer(id).map(|layer| layer.name.clone()) else { return };
    app.ui.panels.naming = Some(Naming { layer: id, text, focused: false });
}

/// Shows a text field instead of the name of an input that is being renamed. Returns whether it is.
pub(super) fn naming(app: &mut App, ui: &mut egui::Ui, id: LayerId) -> bool {
    let Some(mut naming) = app.ui.panels.naming.take_if(|naming| naming.layer == id) else { return false };
    let field = egui::TextEdit::singleline(&mut naming.text).desired_width(ui.available_width());
    let response = ui.add(field);
    if !naming.focused {
        response.request_focus();
        naming.focused = true;
    } else if response.lost_focus() || !response.has_focus() {
        let name = naming.text.trim();
        let given_up = ui.input(|input| input.key_pressed(egui::Key::Escape)) || name.is_empty();
        if !given_up && app.document().layer(id).is_some_and(|layer| layer.name != name) {
            app.edit("Rename an input", |document| {
                document.rename(id, name);
            });
        }
        return true;
    }
    app.ui.panels.naming = Some(naming);
    true
}

/// The entries of an input's menu.
pub(super) fn menu(app: &mut App, ui: &mut egui::Ui, id: LayerId) {
    let layers = &app.document().layers;
    let (count, place) = (layers.len(), layers.iter().position(|layer| layer.id == id).unwrap_or(0));
    let path = layers.get(place).and_then(|layer| layer.path.clone());
    let source = app.session.inputs.get(&id).map(|input| &input.source);
    let again = source.is_some_and(|source| !matches!(source, Source::Scene(..) | Source::StandardInput));
    if ui.button("Rename…").clicked() {
        rename(app, id);
        ui.close();
    }
    if ui.button("Place…").on_hover_text("Move, turn and scale all of it").clicked() {
        super::pose::open(app, id);
        ui.close();
    }
    for (name, enabled, to) in [("Up", place > 0, place.saturating_sub(1)), ("Down", place + 1 < count, place + 1)] {
        if ui.add_enabled(enabled, egui::Button::new(name)).on_hover_text("In the list").clicked() {
            app.edit("Reorder the inputs", |document| {
                document.reorder(id, to);
            });
            ui.close();
        }
    }
    let unsaved = app.session.history.is_unsaved(id);
    let reload = ui.add_enabled(again && !unsaved, egui::Button::new("Reload"));
    let reload = reload.on_hover_text("Read it again, from where it was read").on_disabled_hover_text(if unsaved {
        "It has unsaved edits, which would not fit the new points"
    } else {
        "Scenes and pipes cannot be read again"
    });
    if reload.clicked() {
        app.reload_layer(id);
        ui.close();
    }
    if let Some(path) = path
        && ui.button("Copy path").on_hover_text(path.display().to_string()).clicked()
    {
        ui.ctx().copy_text(path.display().to_string());
        ui.close();
    }
}
