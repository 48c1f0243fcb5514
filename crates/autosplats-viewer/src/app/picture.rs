//! The picture in the window, with all that lies over it.

use eframe::egui;

use super::App;
use crate::ui::panels::welcome;
use crate::ui::{Tool, Ui};
use crate::view::{legend, overlay};

impl App {
    /// Shows the picture and handles the mouse.
    pub(super) fn picture(&mut self, ui: &mut egui::Ui) {
        let Self { session, view, ui: Ui { tools, pointer, messages, .. }, .. } = self;
        let mut actions = Vec::new();
        egui::CentralPanel::default().frame(egui::Frame::NONE).show(ui, |ui| {
            let (response, size) = view.place(ui);
            let moves = tools.current == Tool::Move;
            let busy = tools.gizmo.handle(session, view, moves, &response, size)
                || pointer.handle(session, view, tools, &response, size);
            view.ask(session, ui.ctx(), size, busy);
            view.paint(ui);
            if view.shot.is_none() {
                welcome::show(session, ui, view.rect, &mut actions);
            }
            tools.show(session, view, ui, size);
            tools.gizmo.show(session, view, moves, ui, size);
            if view.look.overlay {
                overlay::show(session, view, ui);
            }
            legend::show(session, view, ui);
            messages.show(ui.ctx(), view.rect, view.failure.as_deref());
        });
        self.perform_all(actions, ui.ctx());
    }
}
