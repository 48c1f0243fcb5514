//! The help window: what keys and mouse do.

use eframe::egui;

use crate::ui::Command;

const MOUSE: [(&str, &str); 13] = [
    ("Left drag", "Turn about the pivot"),
    ("Right drag, Shift + left drag", "Move sideways"),
    ("Wheel, pinch", "Zoom to the cursor"),
    ("Two fingers on a touchpad", "Zoom, turn or move sideways, as set in Look, Movement"),
    ("Ctrl + left drag", "Look around"),
    ("Double click", "Make this place the pivot"),
    ("W A S D, Q E", "Fly forward, left, back, right, down and up"),
    ("Shift", "Fly faster"),
    ("Arrow keys", "Look around"),
    ("Alt + left drag", "Turn the view while selecting"),
    ("Tab, after F6", "Next control; Escape returns to the picture"),
    ("Enter in a dialog", "Perform its action; Escape closes it"),
    ("Drag dots, arrows, rings", "Move the faces of the clipping box, or the selection; Escape cancels"),
];

pub(super) fn show(open: &mut bool, context: &egui::Context) {
    let window = egui::Window::new("Keys and mouse").open(open).collapsible(false).resizable(false);
    window.anchor(egui::Align2::CENTER_CENTER, [0.0, 0.0]).show(context, |ui| {
        ui.set_width(440.0);
        let height = context.content_rect().height() - 140.0;
        egui::ScrollArea::vertical().auto_shrink([false, true]).max_height(height).show(ui, |ui| {
            egui::Grid::new("help").num_columns(2).striped(true).spacing([24.0, 4.0]).show(ui, |ui| {
                for (keys, what) in MOUSE {
                    ui.strong(keys);
                    ui.label(what);
                    ui.end_row();
                }
                for command in Command::ALL {
                    ui.strong(command.key(context));
                    ui.label(command.label()).on_hover_text(command.tooltip());
                    ui.end_row();
                }
            });
        });
    });
}
