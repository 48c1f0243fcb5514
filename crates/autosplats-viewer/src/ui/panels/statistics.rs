//! The statistics window: render times and counts.

use autosplats::Timings;
use eframe::egui;
use egui_plot::{Bar, BarChart, Plot};

use crate::session::document::grouped;
use crate::view::View;

/// Name, milliseconds and colour of a stage.
type Stage = (&'static str, fn(&Timings) -> f64, egui::Color32);

/// The stages. Colour-blind people can tell the colours apart (Okabe and Ito 2008).
const STAGES: [Stage; 6] = [
    ("project", |t| t.project, egui::Color32::from_rgb(0, 114, 178)),
    ("search", |t| t.search, egui::Color32::from_rgb(230, 159, 0)),
    ("fit", |t| t.fit, egui::Color32::from_rgb(0, 158, 115)),
    ("adapt", |t| t.adapt, egui::Color32::from_rgb(204, 121, 167)),
    ("splat", |t| t.splat, egui::Color32::from_rgb(213, 94, 0)),
    ("shade", |t| t.shade, egui::Color32::from_rgb(86, 180, 233)),
];

pub(super) fn show(open: &mut bool, context: &egui::Context, view: &View) {
    let place = view.rect.left_bottom() + egui::vec2(10.0, -320.0);
    let window = egui::Window::new("Statistics").open(open).default_pos(place).default_width(330.0);
    window.show(context, |ui| {
        Plot::new("stages")
            .height(120.0)
            .allow_drag(false)
            .allow_zoom(false)
            .allow_scroll(false)
            .show_x(false)
            .show_axes([false, true])
            .include_y(0.0)
            .y_axis_label("ms")
            .show(ui, |plot| {
                let mut below: Vec<f64> = vec![0.0; view.rate.timings.len()];
                for (name, value, color) in STAGES {
                    let bars = view.rate.timings.iter().zip(&mut below).enumerate().map(|(x, (timings, below))| {
                        let value = value(timings);
                        let bar = Bar::new(x as f64, value).base_offset(*below).width(1.0).fill(color);
                        *below += value;
                        bar
                    });
                    plot.bar_chart(BarChart::new(name, bars.collect()).color(color));
                }
            });
        let Some(picture) = &view.shot else { return };
        egui::Grid::new("timings").num_columns(4).striped(true).show(ui, |ui| {
            for pair in STAGES.chunks(2) {
                for (name, value, color) in pair {
                    ui.horizontal(|ui| {
                        let (mark, _) = ui.allocate_exact_size(egui::vec2(9.0, 9.0), egui::Sense::hover());
                        ui.painter().rect_filled(mark, 2.0, *color);
                        ui.label(*name);
                    });
                    ui.monospace(format!("{:7.2} ms", value(&picture.timings)));
                }
                ui.end_row();
            }
            ui.label("upload");
            ui.monospace(format!("{:7.2} ms", picture.timings.upload));
            ui.label("all");
            ui.monospace(format!("{:7.2} ms", picture.milliseconds));
            ui.end_row();
        });
        let counts = picture.counts;
        ui.small(format!(
            "{} points, {} visible, {} outliers, {} clamped, {} recovered; {} pixels covered",
            grouped(counts.points),
            grouped(counts.visible),
            grouped(counts.outliers),
            grouped(counts.clamped),
            grouped(counts.recovered),
            grouped(counts.covered)
        ));
    });
}
