//! What stands in place of the picture while there is none.

use eframe::egui::{self, Color32};

use crate::session::Session;
use crate::ui::{Action, Command};

/// Shows the welcome of an empty window, or what the first input waits for.
pub(crate) fn show(session: &Session, ui: &mut egui::Ui, rect: egui::Rect, actions: &mut Vec<Action>) {
    if let Some(waiting) = session.playing.waiting().next() {
        let text = format!("{}: {}", waiting.input.name, waiting.why);
        let (font, color) = (egui::FontId::proportional(15.0), Color32::from_gray(190));
        ui.painter_at(rect).text(rect.center(), egui::Align2::CENTER_CENTER, text, font, color);
    }
    if !session.is_empty() {
        return;
    }
    let middle = egui::Rect::from_center_size(rect.center(), egui::vec2(360.0_f32.min(rect.width()), 320.0));
    ui.scope_builder(egui::UiBuilder::new().max_rect(middle), |ui| {
        ui.vertical_centered(|ui| {
            ui.heading("Drop point clouds here");
            ui.label("or open them with Ctrl+O. H shows all keys and mouse actions.");
            ui.add_space(12.0);
            if ui.button("Open…").clicked() {
                actions.push(Command::Open.into());
            }
            if !session.recent.is_empty() {
                ui.add_space(12.0);
                ui.weak("Recently opened");
            }
            for kept in session.recent.iter().take(8) {
                if ui.link(kept.short_name()).on_hover_text(&kept.source).clicked() {
                    actions.push(Action::OpenAgain(kept.clone()));
                }
            }
        });
    });
}
