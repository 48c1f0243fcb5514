//! Panels, windows and dialogs around the picture.

mod clip;
mod color;
mod export;
mod film;
mod focus;
mod help;
mod inputs;
mod layer;
mod look;
mod measure;
mod menu;
mod moving;
mod open;
mod picture;
mod pose;
mod session;
mod statistics;
mod status;
mod target_file;
mod timeline;

use eframe::egui;

pub(crate) use self::export::open as ask_for_export;
pub(crate) use self::film::toggle as toggle_film;
pub(crate) use self::focus::focus_next_part;
pub(crate) use self::inputs::close_all;
pub(crate) use self::picture::open as ask_for_picture;
pub(crate) use self::session::open as ask_for_session;
use crate::app::App;
use crate::commands::Command;
use crate::document::LayerId;

/// State of the panels, windows and dialogs.
pub(crate) struct Panels {
    pub(crate) inputs: bool,
    pub(crate) look: bool,
    pub(crate) statistics: bool,
    pub(crate) help: bool,
    /// Whether the numbers and the handles of the clipping box are shown.
    pub(crate) clip: bool,
    pub(crate) moving: moving::MoveNumbers,
    pub(crate) pose: Option<pose::Pose>,
    pub(crate) naming: Option<layer::Naming>,
    pub(crate) dialogs: open::Dialogs,
    pub(crate) export: export::Export,
    pub(crate) picture: picture::PictureDialog,
    pub(crate) film: film::Film,
    pub(crate) session: session::Session,
    pub(crate) focus: focus::Focus,
    /// Whether Enter was pressed where no control takes it; the dialog on top then performs its action.
    pub(crate) entered: bool,
    /// Whether Escape has just returned the focus to the picture; that Escape then does nothing else.
    pub(crate) left: bool,
    /// Commands whose keys were taken from egui.
    pub(crate) claimed: Vec<Command>,
    memory: status::Memory,
    /// Whether the last scrolling came from fingers on a touchpad rather than a wheel.
    pub(crate) fingers: bool,
    /// The part of the drag that the view has followed, screen points.
    pub(crate) dragged: egui::Vec2,
    /// Depth of the point grabbed by the drag, world units.
    pub(crate) grabbed: Option<f64>,
    /// The target of the wheel.
    pub(crate) zoomed: Option<crate::viewport::Zoomed>,
    /// Whether to ask about leaving with unsaved edits.
    leave: bool,
    /// Layers with unsaved edits that the user wants to remove.
    removal: Vec<LayerId>,
}

impl Default for Panels {
    fn default() -> Self {
        Self {
            inputs: true,
            look: false,
            statistics: false,
            help: false,
            clip: false,
            moving: moving::MoveNumbers::default(),
            pose: None,
            naming: None,
            dialogs: open::Dialogs::default(),
            export: export::Export::default(),
            picture: picture::PictureDialog::default(),
            film: film::Film::default(),
            session: session::Session::default(),
            focus: focus::Focus::default(),
            entered: false,
            left: false,
            claimed: Vec::new(),
            memory: status::Memory::default(),
            fingers: false,
            dragged: egui::Vec2::ZERO,
            grabbed: None,
            zoomed: None,
            leave: false,
            removal: Vec::new(),
        }
    }
}

impl Panels {
    /// Closes one of the windows over the picture. Returns whether there was one.
    pub(crate) fn close_window(&mut self) -> bool {
        self.windows().into_iter().find(|open| **open).map(|open| *open = false).is_some()
    }

    /// Whether there is a window that Escape closes.
    pub(crate) fn has_window(&mut self) -> bool {
        self.windows().into_iter().any(|open| *open)
    }

    fn windows(&mut self) -> [&mut bool; 5] {
        let Self { help, export, picture, film, session, .. } = self;
        [help, &mut export.open, &mut picture.open, &mut film.open, &mut session.open]
    }
}

/// Shows the panels beside the picture.
pub(crate) fn show(app: &mut App, ui: &mut egui::Ui) {
    app.ui.panels.focus.begin();
    menu::show(app, ui);
    status::show(app, ui);
    timeline::show(app, ui);
    if app.ui.panels.inputs {
        inputs::show(app, ui);
    }
    if app.ui.panels.look {
        look::show(app, ui);
    }
}

/// Shows the windows over the picture.
pub(crate) fn over(app: &mut App, context: &egui::Context) {
    open::show(app, context);
    statistics::show(app, context);
    export::show(app, context);
    picture::show(app, context);
    film::show(app, context);
    session::show(app, context);
    help::show(app, context);
    inputs::inspected(app, context);
    clip::show(app, context);
    moving::show(app, context);
    measure::show(app, context);
    pose::show(app, context);
    inputs::removal(app, context);
    leave(app, context);
    app.ui.panels.entered = false;
    focus::ring(app, context);
}

/// Asks before leaving would lose edits.
fn leave(app: &mut App, context: &egui::Context) {
    let asked = context.input(|input| input.viewport().close_requested());
    let writing = app.ui.panels.export.is_writing();
    if asked && !app.ui.quit && (writing || app.session.history.is_changed_since_saved()) {
        context.send_viewport_cmd(egui::ViewportCommand::CancelClose);
        app.ui.panels.leave = true;
    }
    if !app.ui.panels.leave {
        return;
    }
    let names: Vec<String> = app
        .session
        .history
        .unsaved()
        .filter_map(|id| app.document().layer(id))
        .map(|layer| layer.name.clone())
        .collect();
    let modal = egui::Modal::new(egui::Id::unique("leave")).show(context, |ui| {
        if writing {
            ui.heading("A file is being written");
            ui.label("Leaving now cancels the export; the old file stays unchanged.");
        }
        if !names.is_empty() {
            ui.heading("Edits are not saved");
            ui.label(format!("The edits of {} would be lost.", names.join(", ")));
        }
        ui.add_space(8.0);
        ui.horizontal(|ui| {
            if main_button(ui, "Export…").clicked() {
                app.ui.panels.leave = false;
                export::open(app);
            }
            if ui.button("Leave without saving").clicked() {
                app.ui.quit = true;
                app.ui.panels.leave = false;
            }
            if ui.button("Stay").clicked() {
                app.ui.panels.leave = false;
            }
        });
    });
    if modal.should_close() {
        app.ui.panels.leave = false;
    }
}

/// The harmless button of a question. It has the keyboard focus, so that Enter presses it, until another button is
/// chosen.
fn main_button(ui: &mut egui::Ui, label: &str) -> egui::Response {
    let button = ui.button(label);
    if ui.memory(|memory| memory.focused().is_none()) {
        button.request_focus();
    }
    button
}

/// A button for a command, with its key and its tooltip.
pub(crate) fn command_button(app: &mut App, ui: &mut egui::Ui, command: Command, enabled: bool) {
    let context = ui.ctx().clone();
    let button = egui::Button::new(command.label()).shortcut_text(command.key(&context));
    if ui.add_enabled(enabled, button).on_hover_text(command.tooltip()).clicked() {
        ui.close();
        crate::keys::run(app, &context, command);
    }
}
