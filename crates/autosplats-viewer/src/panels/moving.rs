//! Moving the selection by numbers.

use autosplats::cloud::glam::{DMat4, DVec3};
use eframe::egui;

use crate::app::App;
use crate::commands::Tool;

/// The numbers that are being entered.
#[derive(Default)]
pub(crate) struct MoveNumbers {
    way: DVec3,
    degrees: f64,
    /// World axis of the rotation; `None` is the up axis.
    axis: Option<usize>,
}

pub(super) fn show(app: &mut App, context: &egui::Context) {
    if app.ui.tool != Tool::Move {
        return;
    }
    let selected = app.counts().all.selected;
    let mut act = None;
    let place = app.view.rect.right_top() + egui::vec2(-16.0, 310.0);
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
            let speed = speed(app);
            let numbers = &mut app.ui.panels.moving;
            egui::Grid::new("move").num_columns(2).show(ui, |ui| {
                for (axis, name) in ["dx", "dy", "dz"].into_iter().enumerate() {
                    ui.label(name);
                    let number = egui::DragValue::new(&mut numbers.way[axis]).speed(speed).max_decimals(6);
                    let response = ui.add_sized([110.0, 20.0], number);
                    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::SpinButton, true, name));
                    ui.end_row();
                }
            });
            let enabled = numbers.way != DVec3::ZERO && numbers.way.is_finite();
            if ui.add_enabled(enabled, egui::Button::new("Move")).clicked() {
                act = Some(Act::Move);
            }
            ui.separator();
            ui.horizontal(|ui| {
                ui.add(egui::DragValue::new(&mut numbers.degrees).speed(0.5).max_decimals(4).suffix("°"));
                ui.label("about");
                for (axis, name) in [(None, "up"), (Some(0), "x"), (Some(1), "y"), (Some(2), "z")] {
                    ui.selectable_value(&mut numbers.axis, axis, name);
                }
            });
            if ui.add_enabled(numbers.degrees != 0.0, egui::Button::new("Turn")).clicked() {
                act = Some(Act::Turn);
            }
            ui.small("Or drag the arrows and rings in the picture;\nwith Ctrl they turn by steps of 15°.");
        });
    let Some(act) = act else { return };
    let (way, radians) = (app.ui.panels.moving.way, app.ui.panels.moving.degrees.to_radians());
    let axis = app.ui.panels.moving.axis.map_or(app.up(), |axis| DVec3::AXES[axis]);
    match act {
        Act::Move => app.edit_points("Move", |document| document.move_selected(&DMat4::from_translation(way))),
        Act::Turn => app.edit_points("Turn", |document| document.rotate_selected(axis, radians)),
    }
}

enum Act {
    Move,
    Turn,
}

/// Change of a number per screen point dragged, world units: a thousandth of the picture's height at the pivot.
fn speed(app: &App) -> f64 {
    let speed = app.view.navigation.height_at_pivot() * 1e-3;
    if speed > 0.0 && speed.is_finite() { speed } else { 0.01 }
}
