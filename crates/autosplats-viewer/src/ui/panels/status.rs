//! The status line below the picture.

use eframe::egui;

use crate::session::document::grouped;
use crate::session::{CachedCounts, Session, TreeStatus};
use crate::view::View;

/// The line, and the memory of the program, which is queried once a second.
#[derive(Default)]
pub(super) struct Status {
    asked: Option<f64>,
    bytes: Option<usize>,
}

impl Status {
    /// Shows the line. Returns its place.
    pub(super) fn show(&mut self, ui: &mut egui::Ui, session: &Session, view: &View) -> egui::Rect {
        let shown = egui::Panel::bottom("status").show(ui, |ui| {
            ui.horizontal(|ui| {
                let &CachedCounts { all: counts, bytes, old_bytes, .. } = session.counts();
                match session.trees.status() {
                    Some(status) => octrees(ui, &status, counts.points),
                    None => {
                        ui.label(format!("{} points", grouped(counts.points)));
                    }
                }
                if counts.selected > 0 {
                    ui.separator();
                    let color = ui.visuals().warn_fg_color;
                    ui.colored_label(color, format!("{} selected", grouped(counts.selected)));
                }
                if let Some(picture) = &view.shot {
                    ui.separator();
                    ui.label(format!("{} visible", grouped(picture.counts.visible)))
                        .on_hover_text("Points that own a pixel or half of one");
                    ui.separator();
                    ui.label(format!("{:.0} ms", picture.milliseconds))
                        .on_hover_text("Render time of the last picture (P shows more)");
                    if let Some(rate) = view.rate.per_second() {
                        ui.label(format!("{rate:.0} fps"));
                    }
                    if let Some(remark) = &picture.remark {
                        ui.colored_label(ui.visuals().warn_fg_color, remark);
                    }
                    if !picture.whole {
                        ui.weak("moving").on_hover_text("Coarser while the view moves");
                    }
                }
                ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                    let device = view.device.as_ref().map_or("CPU", |device| &*device.name);
                    ui.weak(device).on_hover_text("Device that renders the pictures");
                    let [points, undo] = [bytes, old_bytes].map(|bytes| bytes as f64 * 1e-6);
                    let all = self.bytes(ui.input(|input| input.time)).map(|bytes| bytes as f64 * 1e-6);
                    ui.weak(format!("{:.0} MB", all.unwrap_or(points + undo)))
                        .on_hover_text(format!("Memory of this program; points {points:.0} MB, undo {undo:.0} MB"));
                });
            });
        });
        let rect = shown.response.rect;
        // The line has no controls, but screen readers can reach it.
        let line = ui.interact(rect, egui::Id::unique("status line"), egui::Sense::focusable_noninteractive());
        line.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Label, true, "Status"));
        rect
    }

    /// Resident memory in bytes at time `now`, seconds; `None` where the system does not report it.
    fn bytes(&mut self, now: f64) -> Option<usize> {
        if self.asked.is_none_or(|asked| now - asked >= 1.0) {
            self.asked = Some(now);
            self.bytes = memory_stats::memory_stats().map(|stats| stats.physical_mem);
        }
        self.bytes
    }
}

/// Shows how much is there of octrees, and the number of all points that are in memory if that is all.
fn octrees(ui: &mut egui::Ui, status: &TreeStatus, points: usize) {
    let TreeStatus { there, needed, stored, spacing_px, is_limited, .. } = *status;
    let text =
        if there < needed { format!("{} points", share(there, needed)) } else { format!("{} points", grouped(points)) };
    let apart = format!("Neighbouring points are at most {spacing_px:.1} pixels apart where finer ones exist");
    let hint = format!("Of {} points in octrees, what this view needs is read.\n{apart}.", grouped(stored as usize));
    ui.label(text).on_hover_text(hint);
    if is_limited {
        let hint = format!("{apart}; a larger --points-budget or --memory shows finer ones");
        ui.weak(format!("{spacing_px:.1} px apart")).on_hover_text(hint);
    }
}

/// A number as a share of another, in millions if there are some.
fn share(part: u64, all: u64) -> String {
    if all < 1_000_000 {
        return format!("{} of {}", grouped(part as usize), grouped(all as usize));
    }
    // A part is never shown as all.
    let millions = |points: u64| (points as f64 * 1e-5).floor() * 0.1;
    format!("{:.1} of {:.1}M", millions(part), (all as f64 * 1e-5).ceil() * 0.1)
}

#[cfg(test)]
mod tests {
    use super::share;

    #[test]
    fn shares_are_short() {
        assert_eq!(share(3_149_999, 7_400_000), "3.1 of 7.4M");
        assert_eq!(share(7_399_999, 7_400_000), "7.3 of 7.4M", "not yet all");
        assert_eq!(share(1500, 42_000), "1,500 of 42,000");
    }
}
