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
pub(crate) mod welcome;

use eframe::egui;

pub(crate) use self::pose::Pose;
use crate::session::{LayerId, Session};
use crate::ui::{Action, Command, Tool, Tools};
use crate::view::View;

/// The panels, windows and dialogs.
#[derive(Default)]
pub(crate) struct Panels {
    pub(crate) inputs: inputs::Inputs,
    status: status::Status,
    pub(crate) look: bool,
    pub(crate) statistics: bool,
    pub(crate) help: bool,
    pub(crate) moving: moving::MoveNumbers,
    pub(crate) pose: Option<Pose>,
    pub(crate) dialogs: open::Dialogs,
    pub(crate) export: export::Export,
    pub(crate) picture: picture::PictureDialog,
    pub(crate) film: film::Film,
    pub(crate) session: session::SessionDialog,
    pub(crate) focus: focus::Focus,
    /// Whether Enter was pressed where no control takes it; the dialog on top then performs its action.
    pub(crate) entered: bool,
    /// Whether to ask about leaving with unsaved edits.
    leave: bool,
    /// Whether to leave.
    pub(crate) quit: bool,
    /// Layers with unsaved edits that the user wants to remove.
    pub(crate) removal: Vec<LayerId>,
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

    /// Shows the panels beside the picture. Returns what they ask for.
    pub(crate) fn beside(
        &mut self,
        ui: &mut egui::Ui,
        session: &Session,
        view: &View,
        tools: &mut Tools,
    ) -> Vec<Action> {
        let mut actions = Vec::new();
        self.focus.begin();
        self.focus.part(menu::show(ui, session, view, tools, &mut actions));
        self.focus.part(self.status.show(ui, session, view));
        if let Some(rect) = timeline::show(ui, &session.playing, &mut actions) {
            self.focus.part(rect);
        }
        if self.inputs.open {
            self.focus.part(self.inputs.show(ui, session, &mut actions));
        }
        if self.look {
            self.focus.part(look::show(ui, view, &mut actions));
        }
        actions
    }

    /// Shows the windows over the picture. Returns what they ask for.
    pub(crate) fn over(
        &mut self,
        context: &egui::Context,
        session: &Session,
        view: &View,
        tools: &mut Tools,
    ) -> Vec<Action> {
        let mut actions = Vec::new();
        self.dialogs.show(context, &session.messages, &mut actions);
        statistics::show(&mut self.statistics, context, view);
        self.export.show(context, session, view, &mut self.entered, &mut actions);
        self.picture.show(context, session, view, &mut self.entered);
        self.film.show(context, session, view, &mut self.entered, &mut actions);
        self.session.show(context, session, view, &mut self.entered);
        help::show(&mut self.help, context);
        inputs::inspected(&mut tools.inspected, context, session, view);
        clip::show(&mut tools.gizmo, context, session, view, &mut actions);
        match tools.current {
            Tool::Move => self.moving.show(context, session, view, &mut actions),
            Tool::Measure => measure::show(&mut tools.measured, context, session, view),
            _ => {}
        }
        pose::show(&mut self.pose, context, session, view, &mut actions);
        inputs::removal(&mut self.removal, context, session, &mut actions);
        self.ask_to_leave(context, session);
        self.entered = false;
        self.focus.ring(context);
        actions
    }

    /// Asks before leaving would lose edits.
    fn ask_to_leave(&mut self, context: &egui::Context, session: &Session) {
        let asked = context.input(|input| input.viewport().close_requested());
        let writing = self.export.is_writing();
        if asked && !self.quit && (writing || session.history.is_changed_since_saved()) {
            context.send_viewport_cmd(egui::ViewportCommand::CancelClose);
            self.leave = true;
        }
        if !self.leave {
            return;
        }
        let unsaved = session.history.unsaved().filter_map(|id| session.document().layer(id));
        let names: Vec<&str> = unsaved.map(|layer| &*layer.name).collect();
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
                    self.leave = false;
                    self.export.open();
                }
                if ui.button("Leave without saving").clicked() {
                    self.quit = true;
                    self.leave = false;
                }
                if ui.button("Stay").clicked() {
                    self.leave = false;
                }
            });
        });
        if modal.should_close() {
            self.leave = false;
        }
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
fn command_button(ui: &mut egui::Ui, actions: &mut Vec<Action>, command: Command, enabled: bool) {
    let button = egui::Button::new(command.label()).shortcut_text(command.key(ui.ctx()));
    if ui.add_enabled(enabled, button).on_hover_text(command.tooltip()).clicked() {
        ui.close();
        actions.push(command.into());
    }
}
