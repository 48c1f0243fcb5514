//! The clipping box as numbers.

use autosplats::cloud::glam::{DQuat, DVec3};
use eframe::egui;

use crate::session::{ClipBox, Session};
use crate::ui::{Action, Gizmo};
use crate::view::View;

/// Change of a number per screen point dragged, as a share of the box's longest side.
const DRAG_SPEED_SHARE: f64 = 0.002;

pub(super) fn show(
    gizmo: &mut Gizmo,
    context: &egui::Context,
    session: &Session,
    view: &View,
    actions: &mut Vec<Action>,
) {
    if !gizmo.clip {
        return;
    }
    let mut clip = session.document().clip;
    let mut busy = false;
    let place = view.rect.right_top() + egui::vec2(-16.0, 60.0);
    let window = egui::Window::new("Clipping box")
        .open(&mut gizmo.clip)
        .resizable(false)
        .default_width(250.0)
        .pivot(egui::Align2::RIGHT_TOP)
        .default_pos(place);
    window.show(context, |ui| {
        if let Some(clip) = &mut clip {
            busy = numbers(ui, session.up(), clip);
        }
        buttons(ui, session, &mut clip);
    });
    let changed = clip != session.document().clip;
    if changed {
        actions.push(Action::PreviewClip(clip));
    }
    // Changes by dragging or typing a number become one undo step when the number is released.
    if !busy && (changed || session.is_clip_unsettled()) && !gizmo.is_dragging() {
        actions.push(Action::SettleClip);
        // Points are counted again only after the change; the repaint shows the counts.
        context.request_repaint();
    }
}

/// Shows the numbers. Returns whether one of them is being dragged or typed.
fn numbers(ui: &mut egui::Ui, up: DVec3, clip: &mut ClipBox) -> bool {
    let mut busy = false;
    ui.checkbox(&mut clip.enabled, "Clips").on_hover_text("If off, all points are shown and the box is kept");
    let speed = DRAG_SPEED_SHARE * (clip.max - clip.min).max_element().max(1e-9);
    egui::Grid::new("clip").num_columns(3).show(ui, |ui| {
        ui.label("");
        ui.weak("from");
        ui.weak("to");
        ui.end_row();
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            ui.label(name);
            let (low, high) = (clip.min[axis], clip.max[axis]);
            for (value, range, what) in
                [(&mut clip.min[axis], f64::MIN..=high, "from"), (&mut clip.max[axis], low..=f64::MAX, "to")]
            {
                let number = egui::DragValue::new(value).speed(speed).range(range).max_decimals(4);
                let response = ui.add_sized([84.0, 20.0], number);
                response
                    .widget_info(|| egui::WidgetInfo::labeled(egui::Role::SpinButton, true, format!("{name} {what}")));
                busy |= response.dragged() || response.has_focus();
            }
            ui.end_row();
        }
    });
    let mut angle = clip.angle_about(up).to_degrees();
    ui.horizontal(|ui| {
        ui.label("Turned");
        let number = egui::DragValue::new(&mut angle).speed(0.5).range(-180.0..=180.0).max_decimals(2).suffix("°");
        let response = ui.add(number).on_hover_text("About the upward axis");
        if response.changed() {
            clip.rotation = DQuat::from_axis_angle(up, angle.to_radians());
        }
        busy |= response.dragged() || response.has_focus();
    });
    busy
}

fn buttons(ui: &mut egui::Ui, session: &Session, clip: &mut Option<ClipBox>) {
    let around = |bounds: Option<[DVec3; 2]>| bounds.map(|[min, max]| ClipBox::new(min, max));
    let selected = session.counts().all.selected > 0;
    ui.horizontal(|ui| {
        let button = ui.add_enabled(selected, egui::Button::new("Around selected"));
        if button.on_hover_text("Put the box around the selected points").clicked() {
            *clip = around(session.document().selected_bounds()).or(*clip);
        }
        if ui.button("Reset").on_hover_text("Put the box around everything, along the axes").clicked() {
            *clip = around(session.document().whole_bounds()).or(*clip);
        }
        if ui.add_enabled(clip.is_some(), egui::Button::new("Remove")).on_hover_text("Remove the box").clicked() {
            *clip = None;
        }
    });
    ui.small(if clip.is_some() { "Drag the dots on the faces in the picture." } else { "There is no box." });
}
