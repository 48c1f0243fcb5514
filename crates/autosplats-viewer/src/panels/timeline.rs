//! What moves: play, pause, and where in time.

use eframe::egui;

use crate::app::App;
use crate::commands::Command;

/// Slowest and fastest, seconds played in a second.
const SPEEDS: std::ops::RangeInclusive<f64> = 0.01..=100.0;

pub(super) fn show(app: &mut App, ui: &mut egui::Ui) {
    if app.playing.is_empty() {
        return;
    }
    let shown = egui::Panel::bottom("timeline").show(ui, |ui| {
        ui.add_space(2.0);
        ui.horizontal(|ui| {
            let timeline = app.playing.has_timeline();
            if timeline {
                button(app, ui, Command::StepBack, "⏮");
            }
            let sign = if app.playing.clock.playing { "⏸" } else { "▶" };
            button(app, ui, Command::Play, sign);
            if timeline {
                button(app, ui, Command::StepForward, "⏭");
            }
            // From the right what is small, then the time with all that is left.
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                statistics(app, ui);
                if timeline {
                    speed(app, ui);
                    times(app, ui);
                }
            });
        });
        ui.add_space(2.0);
    });
    app.panels.focus.part(shown.response.rect);
}

fn button(app: &mut App, ui: &mut egui::Ui, command: Command, sign: &str) {
    let tip = format!("{} ({})", command.tooltip(), command.key(ui.ctx()));
    let response = ui.button(sign).on_hover_text(tip);
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, true, command.label()));
    if response.clicked() {
        let context = ui.ctx().clone();
        crate::keys::run(app, &context, command);
    }
}

/// What became of updates.
fn statistics(app: &App, ui: &mut egui::Ui) {
    let statistics = app.playing.statistics();
    if statistics.refused > 0 {
        let why = statistics.last_refusal.unwrap_or_default();
        let text = format!("{} refused", statistics.refused);
        ui.colored_label(ui.visuals().warn_fg_color, text).on_hover_text(why);
    }
    if app.playing.is_live() {
        if statistics.dropped > 0 {
            ui.weak(format!("{} dropped", statistics.dropped))
                .on_hover_text("Newer points came before they were shown");
        }
        match statistics.waiting {
            Some(why) => ui.weak(why),
            None => ui.weak(format!("{} received", statistics.taken)),
        };
        ui.strong("live");
    }
}

fn speed(app: &mut App, ui: &mut egui::Ui) {
    let clock = &mut app.playing.clock;
    ui.checkbox(&mut clock.looped, "Loop").on_hover_text("Begin anew at the end");
    let number = egui::DragValue::new(&mut clock.speed).range(SPEEDS).speed(0.01).max_decimals(2).suffix("×");
    let response = ui.add(number).on_hover_text("Seconds played in a second");
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::SpinButton, true, "Speed"));
    if clock.has_span() {
        let [begin, end] = clock.span();
        let part = format!("{begin:.2} to {end:.2} s");
        if ui.button(part).on_hover_text("Only this is played; a click plays all again").clicked() {
            clock.play_all();
        }
    }
}

fn times(app: &mut App, ui: &mut egui::Ui) {
    let frame = app.playing.frame().map(|(frame, frames)| format!("  frame {frame} of {frames}")).unwrap_or_default();
    let clock = &mut app.playing.clock;
    let (mut position, length) = (clock.position(), clock.length());
    ui.monospace(format!("{position:.2} / {length:.2} s{frame}"));
    ui.spacing_mut().slider_width = (ui.available_width() - 12.0).max(60.0);
    let slider = egui::Slider::new(&mut position, 0.0..=length).show_value(false);
    let response = ui.add(slider);
    response.widget_info(|| egui::WidgetInfo::slider(true, position, "Time"));
    if response.changed() {
        clock.seek(position);
    }
}
