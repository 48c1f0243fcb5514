//! The menu of an input: its name, its place in the list and in the world.

use autosplats_sources::Source;
use eframe::egui;

use crate::session::{Layer, LayerId, Session};
use crate::ui::Action;

/// A name that is being typed.
pub(crate) struct Naming {
    layer: LayerId,
    text: String,
    /// Whether the field has received the keyboard focus.
    focused: bool,
}

impl Naming {
    /// Starts to rename an input.
    pub(super) fn new(layer: &Layer) -> Self {
        Self { layer: layer.id, text: layer.name.clone(), focused: false }
    }
}

/// Shows a text field instead of the name of an input that is being renamed. Returns whether it is.
pub(super) fn naming(typed: &mut Option<Naming>, ui: &mut egui::Ui, layer: &Layer, actions: &mut Vec<Action>) -> bool {
    let Some(mut naming) = typed.take_if(|naming| naming.layer == layer.id) else { return false };
    let field = egui::TextEdit::singleline(&mut naming.text).desired_width(ui.available_width());
    let response = ui.add(field);
    if !naming.focused {
        response.request_focus();
        naming.focused = true;
    } else if response.lost_focus() || !response.has_focus() {
        let name = naming.text.trim();
        let given_up = ui.input(|input| input.key_pressed(egui::Key::Escape)) || name.is_empty();
        if !given_up && layer.name != name {
            actions.push(Action::Rename(layer.id, name.into()));
        }
        return true;
    }
    *typed = Some(naming);
    true
}

/// The entries of an input's menu.
pub(super) fn menu(
    typed: &mut Option<Naming>,
    ui: &mut egui::Ui,
    session: &Session,
    layer: &Layer,
    actions: &mut Vec<Action>,
) {
    let (id, layers) = (layer.id, &session.document().layers);
    let (count, place) = (layers.len(), layers.iter().position(|layer| layer.id == id).unwrap_or(0));
    let source = session.inputs.get(&id).map(|input| &input.source);
    let again = source.is_some_and(|source| !matches!(source, Source::Scene(..) | Source::StandardInput));
    if ui.button("Rename…").clicked() {
        *typed = Some(Naming::new(layer));
        ui.close();
    }
    if ui.button("Place…").on_hover_text("Move, turn and scale all of it").clicked() {
        actions.push(Action::Place(id));
        ui.close();
    }
    for (name, enabled, to) in [("Up", place > 0, place.saturating_sub(1)), ("Down", place + 1 < count, place + 1)] {
        if ui.add_enabled(enabled, egui::Button::new(name)).on_hover_text("In the list").clicked() {
            actions.push(Action::Reorder(id, to));
            ui.close();
        }
    }
    let unsaved = session.history.is_unsaved(id);
    let reload = ui.add_enabled(again && !unsaved, egui::Button::new("Reload"));
    let reload = reload.on_hover_text("Read it again, from where it was read").on_disabled_hover_text(if unsaved {
        "It has unsaved edits, which would not fit the new points"
    } else {
        "Scenes and pipes cannot be read again"
    });
    if reload.clicked() {
        actions.push(Action::Reload(id));
        ui.close();
    }
    if let Some(path) = &layer.path
        && ui.button("Copy path").on_hover_text(path.display().to_string()).clicked()
    {
        ui.ctx().copy_text(path.display().to_string());
        ui.close();
    }
}
