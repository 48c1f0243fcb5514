//! The menus and the tool bar.

use autosplats::ViewDirection;
use eframe::egui;

use super::command_button;
use crate::session::Session;
use crate::ui::{Action, Command, Tool, Tools};
use crate::view::{Look, View};

/// Shows the menus. Returns their place.
pub(super) fn show(
    ui: &mut egui::Ui,
    session: &Session,
    view: &View,
    tools: &mut Tools,
    actions: &mut Vec<Action>,
) -> egui::Rect {
    let shown = egui::Panel::top("menu").show(ui, |ui| {
        egui::MenuBar::new().ui(ui, |ui| {
            ui.menu_button("File", |ui| file(ui, session, actions));
            ui.menu_button("Edit", |ui| edit(ui, session, actions));
            ui.menu_button("View", |ui| view_menu(ui, session, view, actions));
            ui.menu_button("Window", |ui| window(ui, view, actions));
            ui.separator();
            tool_bar(ui, tools, actions);
        });
    });
    shown.response.rect
}

fn file(ui: &mut egui::Ui, session: &Session, actions: &mut Vec<Action>) {
    command_button(ui, actions, Command::Open, true);
    ui.add_enabled_ui(!session.recent.is_empty(), |ui| {
        ui.menu_button("Open recent", |ui| {
            for kept in &session.recent {
                if ui.button(kept.short_name()).on_hover_text(&kept.source).clicked() {
                    actions.push(Action::OpenAgain(kept.clone()));
                    ui.close();
                }
            }
        });
    });
    let any = !session.document().layers.is_empty();
    ui.separator();
    command_button(ui, actions, Command::Export, any);
    command_button(ui, actions, Command::Screenshot, any);
    command_button(ui, actions, Command::Film, any);
    command_button(ui, actions, Command::SaveState, any);
    ui.separator();
    command_button(ui, actions, Command::CloseAll, !session.is_empty());
    command_button(ui, actions, Command::Quit, true);
}

fn edit(ui: &mut egui::Ui, session: &Session, actions: &mut Vec<Action>) {
    let steps = [session.history.undo_label(), session.history.redo_label()].map(|label| label.is_some());
    command_button(ui, actions, Command::Undo, steps[0]);
    command_button(ui, actions, Command::Redo, steps[1]);
    ui.separator();
    let counts = session.counts().all;
    let any = counts.points > 0;
    command_button(ui, actions, Command::SelectAll, any);
    command_button(ui, actions, Command::SelectNone, counts.selected > 0);
    command_button(ui, actions, Command::InvertSelection, any);
    ui.separator();
    command_button(ui, actions, Command::HideSelected, counts.selected > 0);
    command_button(ui, actions, Command::ShowAll, counts.hidden > 0);
    command_button(ui, actions, Command::DeleteSelected, counts.selected > 0);
    command_button(ui, actions, Command::CropToSelected, counts.selected > 0);
    ui.separator();
    command_button(ui, actions, Command::Clip, any);
}

fn view_menu(ui: &mut egui::Ui, session: &Session, view: &View, actions: &mut Vec<Action>) {
    let any = !session.document().layers.is_empty();
    command_button(ui, actions, Command::FitAll, any);
    command_button(ui, actions, Command::FitSelected, any);
    ui.separator();
    for direction in [
        ViewDirection::Front,
        ViewDirection::Back,
        ViewDirection::Right,
        ViewDirection::Left,
        ViewDirection::Top,
        ViewDirection::Bottom,
        ViewDirection::Iso,
        ViewDirection::Auto,
    ] {
        command_button(ui, actions, Command::View(direction), any);
    }
    command_button(ui, actions, Command::OppositeView, any);
    ui.separator();
    command_button(ui, actions, Command::Projection, true);
    ui.horizontal(|ui| {
        let mut fov = view.navigation.fov_deg();
        let number = egui::DragValue::new(&mut fov).range(5.0..=120.0).max_decimals(1).suffix("°");
        if ui
            .add(number)
            .on_hover_text("Vertical field of view; the surroundings of the pivot keep their size")
            .changed()
        {
            actions.push(Action::SetFov(fov));
        }
        ui.label("Field of view");
    });
    command_button(ui, actions, Command::UpAxis, any);
    command_button(ui, actions, Command::Level, any);
    ui.separator();
    command_button(ui, actions, Command::CopyView, any);
    command_button(ui, actions, Command::PasteView, true);
    ui.separator();
    command_button(ui, actions, Command::Dots, any);
    ui.separator();
    let [moves, timeline] = [!session.playing.is_empty(), session.playing.has_timeline()];
    command_button(ui, actions, Command::Play, moves);
    for command in [Command::StepBack, Command::StepForward, Command::PlayFromHere, Command::PlayToHere] {
        command_button(ui, actions, command, timeline);
    }
}

fn window(ui: &mut egui::Ui, view: &View, actions: &mut Vec<Action>) {
    for command in [Command::Inputs, Command::Look, Command::Statistics, Command::Help] {
        command_button(ui, actions, command, true);
    }
    ui.separator();
    for command in [Command::NextPart, Command::PreviousPart] {
        command_button(ui, actions, command, true);
    }
    ui.separator();
    let mut overlay = view.look.overlay;
    if ui.checkbox(&mut overlay, "Axes and scale bar").changed() {
        actions.push(Action::SetLook(Box::new(Look { overlay, ..view.look.clone() })));
    }
    ui.separator();
    let mut theme = ui.ctx().options(|options| options.theme_preference);
    let themes = [
        (egui::ThemePreference::Dark, "Dark"),
        (egui::ThemePreference::Light, "Light"),
        (egui::ThemePreference::System, "Like the system"),
    ];
    for (preference, label) in themes {
        if ui.radio_value(&mut theme, preference, label).changed() {
            ui.ctx().set_theme(preference);
        }
    }
}

fn tool_bar(ui: &mut egui::Ui, tools: &mut Tools, actions: &mut Vec<Action>) {
    let context = ui.ctx().clone();
    for tool in Tool::ALL {
        let command = Command::Tool(tool);
        let tooltip = format!("{} ({})", command.tooltip(), command.key(&context));
        if ui.selectable_label(tools.current == tool, tool.name()).on_hover_text(tooltip).clicked() {
            actions.push(command.into());
        }
    }
    if tools.current.selects() {
        ui.separator();
        ui.checkbox(&mut tools.through, "Through").on_hover_text("Also select points behind the surface");
    }
    if tools.current == Tool::Brush {
        let radius = egui::DragValue::new(&mut tools.brush).range(2.0..=300.0).suffix(" px");
        ui.add(radius).on_hover_text("Radius of the brush");
    }
}
