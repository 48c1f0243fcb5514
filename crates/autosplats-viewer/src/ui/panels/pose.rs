//! The pose of an input as numbers.

use autosplats::cloud::glam::{DMat3, DMat4, DQuat, DVec3, EulerRot};
use eframe::egui;

use crate::session::document::can_place;
use crate::session::{Layer, LayerId, Session};
use crate::ui::Action;
use crate::view::View;

/// The pose that is being edited.
pub(crate) struct Pose {
    layer: LayerId,
    /// The centre of rotation, in the input's own coordinates.
    middle: DVec3,
    parts: Parts,
    /// The pose made of `parts`. If the document has another one, undo has changed it.
    made: DMat4,
    /// The pose before the unfinished change.
    before: Option<DMat4>,
}

/// The parts of a pose: `place = turn · scale · rest · (own - middle) + middle + way`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Parts {
    way: DVec3,
    /// Angles about x, then y, then z, degrees.
    turn_deg: DVec3,
    scale: f64,
    /// The remainder of the matrix: the identity, except for mirrored, stretched or sheared inputs.
    rest: DMat3,
}

impl Parts {
    fn new(pose: &DMat4, middle: DVec3) -> Self {
        let linear = DMat3::from_mat4(*pose);
        // The rotation that keeps the x axis and the xy plane of the matrix, which also exists for sheared inputs.
        let x = linear.x_axis.normalize();
        let y = linear.y_axis.reject_from_normalized(x).normalize();
        let turn = DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y)));
        let (z, y, x) = turn.to_euler(EulerRot::ZYX);
        // Adding zero turns -0 into 0.
        let turn_deg = DVec3::new(x, y, z).map(f64::to_degrees) + 0.0;
        let stretch = DMat3::from_euler(EulerRot::ZYX, z, y, x).transpose() * linear;
        let scale = stretch.determinant().abs().cbrt();
        let rest = stretch * (1.0 / scale);
        // A remainder within rounding is the identity.
        let rest = if rest.abs_diff_eq(DMat3::IDENTITY, 1e-9) { DMat3::IDENTITY } else { rest };
        Self { way: pose.transform_point3(middle) - middle, turn_deg, scale, rest }
    }

    fn pose(&self, middle: DVec3) -> DMat4 {
        let DVec3 { x, y, z } = self.turn_deg.map(f64::to_radians);
        let turn = DMat3::from_euler(EulerRot::ZYX, z, y, x);
        let linear = turn * self.rest * self.scale;
        let mut pose = DMat4::from_mat3(linear);
        pose.w_axis = (middle + self.way - linear * middle).extend(1.0);
        pose
    }
}

impl Pose {
    /// The pose of an input, to be edited.
    pub(crate) fn of(layer: &Layer) -> Self {
        let middle = layer.bounds().map_or(DVec3::ZERO, |[low, high]| low.midpoint(high));
        let middle = layer.pose.inverse().transform_point3(middle);
        let parts = Parts::new(&layer.pose, middle);
        Self { layer: layer.id, middle, parts, made: layer.pose, before: None }
    }
}

/// Shows the window, while a pose is edited.
pub(super) fn show(
    edited: &mut Option<Pose>,
    context: &egui::Context,
    session: &Session,
    view: &View,
    actions: &mut Vec<Action>,
) {
    let Some(mut pose) = edited.take() else { return };
    let Some(layer) = session.document().layer(pose.layer) else { return };
    let (name, opened_at) = (&layer.name, layer.opened_at);
    if layer.pose != pose.made {
        (pose.parts, pose.made) = (Parts::new(&layer.pose, pose.middle), layer.pose);
    }
    let mut open = true;
    let mut busy = false;
    let speed = (view.navigation.height_at_pivot() * 1e-3).max(1e-9);
    let mut wanted = None;
    let window = egui::Window::new(format!("Place of {name}")).id(egui::Id::unique("pose"));
    let window = window.open(&mut open).resizable(false).default_pos(view.rect.left_top() + egui::vec2(16.0, 16.0));
    window.show(context, |ui| {
        let mut parts = pose.parts;
        busy = numbers(ui, &mut parts, speed);
        if parts != pose.parts {
            pose.parts = parts;
            wanted = Some(parts.pose(pose.middle));
        }
        ui.separator();
        let text = text(&wanted.unwrap_or(pose.made));
        ui.add(egui::Label::new(egui::RichText::new(&text).monospace().small()).selectable(true));
        ui.horizontal(|ui| {
            if ui.button("Copy").on_hover_text("The matrix, row by row").clicked() {
                context.copy_text(text);
            }
            let reset = ui.add_enabled(pose.made != opened_at, egui::Button::new("Reset"));
            if reset.on_hover_text("The pose with which it was opened").clicked() {
                pose.parts = Parts::new(&opened_at, pose.middle);
                wanted = Some(opened_at);
            }
        });
    });
    if let Some(wanted) = wanted.filter(|wanted| *wanted != pose.made && can_place(wanted)) {
        actions.push(Action::PreviewPose { layer: pose.layer, pose: wanted });
        pose.before.get_or_insert(pose.made);
        pose.made = wanted;
    }
    // All changes since the last time become one undo step.
    if (!busy || !open)
        && let Some(before) = pose.before.take().filter(|before| *before != pose.made)
    {
        actions.push(Action::SettlePose { layer: pose.layer, before, made: pose.made });
    }
    *edited = open.then_some(pose);
}

/// Shows the numbers. Returns whether one of them is being dragged or typed.
fn numbers(ui: &mut egui::Ui, parts: &mut Parts, speed: f64) -> bool {
    let mut busy = false;
    egui::Grid::new("pose").num_columns(4).show(ui, |ui| {
        for name in ["", "x", "y", "z"] {
            ui.weak(name);
        }
        ui.end_row();
        let rows = [("Moved by", &mut parts.way, speed, ""), ("Turned by", &mut parts.turn_deg, 0.5, "°")];
        for (name, values, speed, suffix) in rows {
            ui.label(name);
            for axis in 0..3 {
                let number = egui::DragValue::new(&mut values[axis]).speed(speed).max_decimals(6).suffix(suffix);
                let response = ui.add_sized([84.0, 20.0], number);
                let label = format!("{name} {}", ["x", "y", "z"][axis]);
                response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::SpinButton, true, &label));
                busy |= response.dragged() || response.has_focus();
            }
            ui.end_row();
        }
        ui.label("Scaled by");
        let speed = 0.002 * parts.scale;
        let number = egui::DragValue::new(&mut parts.scale).speed(speed).range(1e-9..=1e9).max_decimals(9);
        let response = ui.add_sized([84.0, 20.0], number);
        busy |= response.dragged() || response.has_focus();
        ui.end_row();
    });
    ui.small("Turned about its middle: about x, then y, then z.");
    busy
}

/// A matrix, row by row.
fn text(matrix: &DMat4) -> String {
    let row = |row: usize| matrix.row(row).to_array().map(|value| format!("{value:.9}")).join(" ");
    (0..4).map(row).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_make_the_pose_again() {
        let middle = DVec3::new(5e5, 5e6, 100.0);
        let turn = DMat4::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 2.0);
        let poses = [
            DMat4::IDENTITY,
            DMat4::from_translation(DVec3::new(1.0, -2.0, 3.0)) * turn,
            turn * DMat4::from_scale(DVec3::splat(0.001)),
            DMat4::from_scale(DVec3::new(1.0, -1.0, 1.0)),
            turn * DMat4::from_cols_array(&[1., 0., 0., 0., 0.5, 2., 0., 0., 0., 0., 1., 0., 7., 8., 9., 1.]),
        ];
        for pose in poses {
            let again = Parts::new(&pose, middle).pose(middle);
            for own in [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z] {
                let [a, b] = [pose, again].map(|pose| pose.transform_point3(middle + own));
                // Some steps of f64 at 5e6.
                assert!(a.abs_diff_eq(b, 1e-7), "{a} is not {b} under {pose}");
            }
        }
    }

    #[test]
    fn numbers_mean_what_they_say() {
        let middle = DVec3::new(10.0, 20.0, 30.0);
        let parts = Parts::new(&DMat4::IDENTITY, middle);
        assert_eq!(parts, Parts { way: DVec3::ZERO, turn_deg: DVec3::ZERO, scale: 1.0, rest: DMat3::IDENTITY }, "none");
        let moved = Parts { way: DVec3::X, turn_deg: DVec3::new(0.0, 0.0, 90.0), scale: 2.0, ..parts }.pose(middle);
        let place = moved.transform_point3(middle);
        assert!(place.abs_diff_eq(middle + DVec3::X, 1e-12), "the middle is moved and nothing else: {place}");
        let place = moved.transform_point3(middle + DVec3::X);
        assert!(place.abs_diff_eq(middle + DVec3::new(1.0, 2.0, 0.0), 1e-12), "x becomes y, twice as long: {place}");
        let both = Parts { turn_deg: DVec3::new(90.0, 0.0, 90.0), ..parts }.pose(middle);
        let place = both.transform_point3(middle + DVec3::Y);
        assert!(place.abs_diff_eq(middle + DVec3::Z, 1e-12), "about x first: {place}");
    }
}
