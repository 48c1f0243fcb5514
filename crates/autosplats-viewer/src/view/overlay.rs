//! The overlay of the picture: a scale bar and the directions of the axes.

use eframe::egui::{self, Color32, Stroke};

use crate::session::Session;
use crate::view::View;

/// Red, green and blue of the axes, with brightnesses that differ for colour-blind users.
const AXES: [(&str, Color32); 3] = [
    ("X", Color32::from_rgb(235, 95, 85)),
    ("Y", Color32::from_rgb(150, 205, 90)),
    ("Z", Color32::from_rgb(95, 150, 255)),
];

/// Draws the axes and the scale bar.
pub(crate) fn show(session: &Session, view: &View, ui: &egui::Ui) {
    if view.shot.is_none() {
        return;
    }
    let rect = view.rect;
    let painter = ui.painter_at(rect);
    axes(view, &painter, rect);
    scale_bar(session, view, &painter, rect);
}

fn axes(view: &View, painter: &egui::Painter, rect: egui::Rect) {
    let middle = rect.right_bottom() + egui::vec2(-46.0, -46.0);
    let mut axes: Vec<_> = view.navigation.world_axes_in_view().into_iter().zip(AXES).collect();
    // Axes that point away are drawn first.
    axes.sort_by(|(a, _), (b, _)| b.z.total_cmp(&a.z));
    for (axis, (name, color)) in axes {
        let end = middle + egui::vec2(axis.x as f32, axis.y as f32) * 28.0;
        let color = if axis.z > 0.3 { color.gamma_multiply(0.55) } else { color };
        painter.line_segment([middle, end], Stroke::new(4.0, Color32::from_black_alpha(110)));
        painter.line_segment([middle, end], Stroke::new(2.0, color));
        let text = middle + egui::vec2(axis.x as f32, axis.y as f32) * 37.0;
        painter.text(text, egui::Align2::CENTER_CENTER, name, egui::FontId::proportional(12.0), color);
    }
}

fn scale_bar(session: &Session, view: &View, painter: &egui::Painter, rect: egui::Rect) {
    let per_point = view.navigation.height_at_pivot() / f64::from(rect.height().max(1.0));
    let length = round(per_point * 130.0);
    if !(length > 0.0 && length.is_finite()) {
        return;
    }
    let width = (length / per_point) as f32;
    let left = rect.left_bottom() + egui::vec2(16.0, -16.0);
    let right = left + egui::vec2(width, 0.0);
    for (stroke, color) in [(4.0, Color32::from_black_alpha(140)), (2.0, Color32::from_white_alpha(220))] {
        let stroke = Stroke::new(stroke, color);
        painter.line_segment([left, right], stroke);
        for end in [left, right] {
            painter.line_segment([end - egui::vec2(0.0, 5.0), end], stroke);
        }
    }
    let text = session.ruler().round_text(length);
    let place = left + egui::vec2(0.5 * width, -7.0);
    for (shift, color) in [(1.0, Color32::from_black_alpha(200)), (0.0, Color32::WHITE)] {
        let font = egui::FontId::proportional(12.0);
        painter.text(place + egui::vec2(shift, shift), egui::Align2::CENTER_BOTTOM, &text, font, color);
    }
}

/// The largest number of the form 1, 2, 5, 10, 20 … that is at most `length`.
pub(crate) fn round(length: f64) -> f64 {
    let power = 10f64.powf(length.log10().floor());
    [5.0, 2.0, 1.0].into_iter().map(|step| step * power).find(|&step| step <= length * 1.000_001).unwrap_or(power)
}

#[cfg(test)]
mod tests {
    #[test]
    fn bars_have_round_lengths() {
        for (length, expected) in
            [(1.0, 1.0), (1.9, 1.0), (2.5, 2.0), (7.0, 5.0), (9.99, 5.0), (10.0, 10.0), (0.034, 0.02)]
        {
            let round = super::round(length);
            assert!((round / expected - 1.0).abs() < 1e-9, "{length}: {round} is not {expected}");
        }
    }
}
