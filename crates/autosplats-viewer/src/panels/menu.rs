//! The menus and the tool bar.

use autosplats::ViewDirection;
use eframe::egui;

use super::command_button;
use crate::app::App;
use crate::commands::{Command, Tool};

pub(super) fn show(app: &mut App, ui: &mut egui::Ui) {
    let shown = egui::Panel::top("menu").show(ui, |ui| {
        egui::MenuBar::new().ui(ui, |ui| {
            ui.menu_button("File", |ui| file(app, ui));
            ui.menu_button("Edit", |ui| edit(app, ui));
            ui.menu_button("View", |ui| view(app, ui));
            ui.menu_button("Window", |ui| window(app, ui));
            ui.separator();
            tools(app, ui);
        });
    });
    app.ui.panels.focus.part(shown.response.rect);
}

fn file(app: &mut App, ui: &mut egui::Ui) {
    command_button(app, ui, Command::Open, true);
    let recent = app.session.recent.clone();
    ui.add_enabled_ui(!recent.is_empty(), |ui| {
        ui.menu_button("Open recent", |ui| {
            for kept in recent {
                if ui.button(kept.short_name()).on_hover_text(&kept.source).clicked() {
                    app.open_again(kept);
                    ui.close();
                }
            }
        });
    });
    let any = !app.document().layers.is_empty();
    ui.separator();
    command_button(app, ui, Command::Export, any);
    command_button(app, ui, Command::Screenshot, any);
    command_button(app, ui, Command::Film, any);
    command_button(app, ui, Command::SaveState, any);
    ui.separator();
    let open = any || !app.session.loader.jobs().is_empty() || !app.session.playing.is_empty();
    command_button(app, ui, Command::CloseAll, open);
    command_button(app, ui, Command::Quit, true);
}

fn edit(app: &mut App, ui: &mut egui::Ui) {
    let steps = [app.session.history.undo_label(), app.session.history.redo_label()].map(|label| label.is_some());
    command_button(app, ui, Command::Undo, steps[0]);
    command_button(app, ui, Command::Redo, steps[1]);
    ui.separator();
    let counts = app.counts().all;
    let any = counts.points > 0;
    command_button(app, ui, Command::SelectAll, any);
    command_button(app, ui, Command::SelectNone, counts.selected > 0);
    command_button(app, ui, Command::InvertSelection, any);
    ui.separator();
    command_button(app, ui, Command::HideSelected, counts.selected > 0);
    command_button(app, ui, Command::ShowAll, counts.hidden > 0);
    command_button(app, ui, Command::DeleteSelected, counts.selected > 0);
    command_button(app, ui, Command::CropToSelected, counts.selected > 0);
    ui.separator();
    command_button(app, ui, Command::Clip, any);
}

fn view(app: &mut App, ui: &mut egui::Ui) {
    let any = !app.document().layers.is_empty();
    command_button(app, ui, Command::FitAll, any);
    command_button(app, ui, Command::FitSelected, any);
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
        command_button(app, ui, Command::View(direction), any);
    }
    command_button(app, ui, Command::OppositeView, any);
    ui.separator();
    command_button(app, ui, Command::Projection, true);
    ui.horizontal(|ui| {
        let mut fov = app.view.navigation.fov_deg();
        let number = egui::DragValue::new(&mut fov).range(5.0..=120.0).max_decimals(1).suffix("°");
        if ui
            .add(number)
            .on_hover_text("Vertical field of view; the surroundings of the pivot keep their size")
            .changed()
        {
            app.view.navigation.set_fov_deg(fov);
        }
        ui.label("Field of view");
    });
    command_button(app, ui, Command::UpAxis, any);
    command_button(app, ui, Command::Level, any);
    ui.separator();
    command_button(app, ui, Command::CopyView, any);
    command_button(app, ui, Command::PasteView, true);
    ui.separator();
    command_button(app, ui, Command::Dots, any);
    ui.separator();
    let [moves, timeline] = [!app.session.playing.is_empty(), app.session.playing.has_timeline()];
    command_button(app, ui, Command::Play, moves);
    for command in [Command::StepBack, Command::StepForward, Command::PlayFromHere, Command::PlayToHere] {
        command_button(app, ui, command, timeline);
    }
}

fn window(app: &mut App, ui: &mut egui::Ui) {
    for command in [Command::Inputs, Command::Look, Command::Statistics, Command::Help] {
        command_button(app, ui, command, true);
    }
    ui.separator();
    for command in [Command::NextPart, Command::PreviousPart] {
        command_button(app, ui, command, true);
    }
    ui.separator();
    ui.checkbox(&mut app.view.look.overlay, "Axes and scale bar");
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

fn tools(app: &mut App, ui: &mut egui::Ui) {
    let context = ui.ctx().clone();
    for tool in Tool::ALL {
        let command = Command::Tool(tool);
        let tooltip = format!("{} ({})", command.tooltip(), command.key(&context));
        if ui.selectable_label(app.ui.tool == tool, tool.name()).on_hover_text(tooltip).clicked() {
            crate::keys::run(app, &context, command);
        }
    }
    if app.ui.tool.selects() {
        ui.separator();
        ui.checkbox(&mut app.ui.tools.through, "Through").on_hover_text("Also select points behind the surface");
    }
    if app.ui.tool == Tool::Brush {
        let radius = egui::DragValue::new(&mut app.ui.tools.brush).range(2.0..=300.0).suffix(" px");
        ui.add(radius).on_hover_text("Radius of the brush");
    }
}
