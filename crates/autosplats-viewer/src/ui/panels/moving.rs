//! Moving the selection by numbers.

use autosplats::cloud::glam::DVec3;
use eframe::egui;

use crate::session::Session;
use crate::ui::Action;
use crate::view::View;

/// The numbers that are being entered.
#[derive(Default)]
pub(crate) struct MoveNumbers {
    way: DVec3,
    degrees: f64,
    /// World axis of the rotation; `None` is the up axis.
    axis: Option<usize>,
}

impl MoveNumbers {
    /// Shows the numbers, for the tool that moves.
    pub(super) fn show(&mut self, context: &egui::Context, session: &Session, view: &View, actions: &mut Vec<Action>) {
        let selected = session.counts().all.selected;
        let place = view.rect.right_top() + egui::vec2(-16.0, 310.0);
        egui::Window::new("Move")
            .resizable(false)
            .default_width(250.0)
            .pivot(egui::Align2::RIGHT_TOP)
            .default_pos(place)
            .show(context, |ui| {
                if selected == 0 {
                    ui.label("Nothing is selected.");
                    ui.small("Select points by rectangle (B), lasso (G) or brush (C),\nor all of them with Ctrl+A.");
                    return;
                }
                let speed = speed(view);
                egui::Grid::new("move").num_columns(2).show(ui, |ui| {
                    for (axis, name) in ["dx", "dy", "dz"].into_iter().enumerate() {
                        ui.label(name);
                        let number = egui::DragValue::new(&mut self.way[axis]).speed(speed).max_decimals(6);
                        let response = ui.add_sized([110.0, 20.0], number);
                        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::SpinButton, true, name));
                        ui.end_row();
                    }
                });
                let enabled = self.way != DVec3::ZERO && self.way.is_finite();
                if ui.add_enabled(enabled, egui::Button::new("Move")).clicked() {
                    actions.push(Action::MoveSelected(self.way));
                }
                ui.separator();
                ui.horizontal(|ui| {
                    ui.add(egui::DragValue::new(&mut self.degrees).speed(0.5).max_decimals(4).suffix("°"));
                    ui.label("about");
                    for (axis, name) in [(None, "up"), (Some(0), "x"), (Some(1), "y"), (Some(2), "z")] {
                        ui.selectable_value(&mut self.axis, axis, name);
                    }
                });
                if ui.add_enabled(self.degrees != 0.0, egui::Button::new("Turn")).clicked() {
                    let axis = self.axis.map_or(session.up(), |axis| DVec3::AXES[axis]);
                    actions.push(Action::TurnSelected { axis, radians: self.degrees.to_radians() });
                }
                ui.small("Or drag the arrows and rings in the picture;\nwith Ctrl they turn by steps of 15°.");
            });
    }
}

/// Change of a number per screen point dragged, world units: a thousandth of the picture's height at the pivot.
fn speed(view: &View) -> f64 {
    let speed = view.navigation.height_at_pivot() * 1e-3;
    if speed > 0.0 && speed.is_finite() { speed } else { 0.01 }
}
