//! The timeline: play, pause, and the time.

use eframe::egui;

use crate::session::{Clock, Playing, SPEEDS};
use crate::ui::{Action, Command};

/// Shows the timeline, if something plays. Returns its place.
pub(super) fn show(ui: &mut egui::Ui, playing: &Playing, actions: &mut Vec<Action>) -> Option<egui::Rect> {
    if playing.is_empty() {
        return None;
    }
    let mut clock = playing.clock.clone();
    let shown = egui::Panel::bottom("timeline").show(ui, |ui| {
        ui.add_space(2.0);
        ui.horizontal(|ui| {
            let timeline = playing.has_timeline();
            if timeline {
                button(ui, actions, Command::StepBack, ButtonSymbol::Back);
            }
            let sign = if clock.playing { ButtonSymbol::Pause } else { ButtonSymbol::Play };
            button(ui, actions, Command::Play, sign);
            if timeline {
                button(ui, actions, Command::StepForward, ButtonSymbol::Forward);
            }
            // From the right: the small controls, then the time slider in the remaining space.
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                statistics(ui, playing);
                if timeline {
                    speed(ui, &mut clock);
                    times(ui, playing, &mut clock);
                }
            });
        });
        ui.add_space(2.0);
    });
    if clock != playing.clock {
        actions.push(Action::SetClock(clock));
    }
    Some(shown.response.rect)
}

/// A symbol drawn on a button, since the fonts have no such glyphs.
#[derive(Clone, Copy)]
enum ButtonSymbol {
    Play,
    Pause,
    Back,
    Forward,
}

impl ButtonSymbol {
    /// Draws the symbol about the middle of a button.
    fn draw(self, painter: &egui::Painter, middle: egui::Pos2, color: egui::Color32) {
        let bar = |x: f32| {
            let rect = egui::Rect::from_center_size(middle + egui::vec2(x, 0.0), egui::vec2(2.5, 10.0));
            painter.rect_filled(rect, 0.0, color);
        };
        // A triangle that points to the right, or to the left for negative `to`.
        let arrow = |x: f32, to: f32| {
            let corners = [[x - to, -5.0], [x + to, 0.0], [x - to, 5.0]].map(|[x, y]| middle + egui::vec2(x, y));
            painter.add(egui::Shape::convex_polygon(corners.to_vec(), color, egui::Stroke::NONE));
        };
        match self {
            Self::Play => arrow(0.0, 4.5),
            Self::Pause => [-3.0, 3.0].into_iter().for_each(bar),
            Self::Back => {
                bar(-5.0);
                arrow(1.0, -4.0);
            }
            Self::Forward => {
                arrow(-1.0, 4.0);
                bar(5.0);
            }
        }
    }
}

fn button(ui: &mut egui::Ui, actions: &mut Vec<Action>, command: Command, sign: ButtonSymbol) {
    let tip = format!("{} ({})", command.tooltip(), command.key(ui.ctx()));
    let response = ui.add(egui::Button::new("").min_size(egui::vec2(30.0, 0.0))).on_hover_text(tip);
    sign.draw(ui.painter(), response.rect.center(), ui.style().interact(&response).fg_stroke.color);
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, true, command.label()));
    if response.clicked() {
        actions.push(command.into());
    }
}

/// Counts of live updates.
fn statistics(ui: &mut egui::Ui, playing: &Playing) {
    let statistics = playing.statistics();
    if statistics.refused > 0 {
        let why = statistics.last_refusal.unwrap_or_default();
        let text = format!("{} refused", statistics.refused);
        ui.colored_label(ui.visuals().warn_fg_color, text).on_hover_text(why);
    }
    if playing.is_live() {
        if statistics.dropped > 0 {
            ui.weak(format!("{} dropped", statistics.dropped))
                .on_hover_text("Replaced by newer points before they were shown");
        }
        match statistics.waiting {
            Some(why) => ui.weak(why),
            None => ui.weak(format!("{} received", statistics.taken)),
        };
        ui.strong("live");
    }
}

fn speed(ui: &mut egui::Ui, clock: &mut Clock) {
    ui.checkbox(&mut clock.looped, "Loop").on_hover_text("Start again at the end");
    let number = egui::DragValue::new(&mut clock.speed).range(SPEEDS).speed(0.01).max_decimals(2).suffix("×");
    let response = ui.add(number).on_hover_text("Seconds played per second");
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::SpinButton, true, "Speed"));
    if clock.has_span() {
        let [begin, end] = clock.span();
        let part = format!("{begin:.2} to {end:.2} s");
        if ui.button(part).on_hover_text("Only this is played; a click plays all again").clicked() {
            clock.play_all();
        }
    }
}

fn times(ui: &mut egui::Ui, playing: &Playing, clock: &mut Clock) {
    let frame = playing.frame().map(|(frame, frames)| format!("  frame {frame} of {frames}")).unwrap_or_default();
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
