//! The menu of an input: its name, its place in the list and in the world.

use autosplats::cloud::PointFilter;
use autosplats_sources::Source;
use eframe::egui;

use crate::session::{Layer, LayerId, Session};
use crate::ui::Action;

/// A name or a filter of points that is being typed.
pub(crate) struct Naming {
    layer: LayerId,
    text: String,
    /// Whether it is a filter.
    filters: bool,
    /// Whether the field has received the keyboard focus.
    focused: bool,
}

impl Naming {
    /// Starts to rename an input.
    pub(super) fn new(layer: &Layer) -> Self {
        Self { layer: layer.id, text: layer.name.clone(), filters: false, focused: false }
    }

    /// Starts to change which points of an input are shown.
    fn filtering(layer: &Layer, filter: Option<&PointFilter>) -> Self {
        let text = filter.unwrap_or(&PointFilter::usual()).to_string();
        Self { layer: layer.id, text, filters: true, focused: false }
    }
}

/// Shows a text field instead of the name of an input that is being renamed. Returns whether it is.
pub(super) fn naming(typed: &mut Option<Naming>, ui: &mut egui::Ui, layer: &Layer, actions: &mut Vec<Action>) -> bool {
    let Some(mut naming) = typed.take_if(|naming| naming.layer == layer.id) else { return false };
    let field = egui::TextEdit::singleline(&mut naming.text).desired_width(ui.available_width());
    let mut response = ui.add(field);
    let filter = naming.text.parse::<PointFilter>();
    if naming.filters {
        let hint = "Such as ground,building or -noise,-withheld; all, usual, 2..6, first, last";
        response = response.on_hover_text(filter.as_ref().err().map_or(hint.into(), ToString::to_string));
        if filter.is_err() {
            ui.colored_label(ui.visuals().error_fg_color, "?");
        }
    }
    if !naming.focused {
        response.request_focus();
        naming.focused = true;
    } else if response.lost_focus() || !response.has_focus() {
        let name = naming.text.trim();
        let given_up = ui.input(|input| input.key_pressed(egui::Key::Escape)) || name.is_empty();
        if naming.filters {
            actions.extend(filter.ok().filter(|_| !given_up).map(|filter| Action::Keep(layer.id, filter)));
        } else if !given_up && layer.name != name {
            actions.push(Action::Rename(layer.id, name.into()));
        }
        return true;
    }
    *typed = Some(naming);
    true
}

/// The menu of which points are shown.
fn points(typed: &mut Option<Naming>, ui: &mut egui::Ui, session: &Session, layer: &Layer, actions: &mut Vec<Action>) {
    let current = session.inputs.get(&layer.id).and_then(|input| input.options.keep.as_ref());
    let unsaved = session.history.is_unsaved(layer.id);
    ui.menu_button("Points", |ui| {
        for (name, filter) in [("All", PointFilter::all()), ("Without noise and withheld", PointFilter::usual())] {
            let chosen = current.map_or(filter.is_usual(), |current| *current == filter);
            let button = ui.add_enabled(!unsaved || filter.is_all(), egui::Button::selectable(chosen, name));
            if button.on_disabled_hover_text("It has unsaved edits").clicked() {
                actions.push(Action::Keep(layer.id, filter));
                ui.close();
            }
        }
        let button = ui.add_enabled(!unsaved, egui::Button::new("By class, flag or return…"));
        if button.on_disabled_hover_text("It has unsaved edits").clicked() {
            *typed = Some(Naming::filtering(layer, current));
            ui.close();
        }
    });
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
    let filterable = source.is_some_and(|source| !matches!(source, Source::Scene(..)));
    if filterable {
        points(typed, ui, session, layer, actions);
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
