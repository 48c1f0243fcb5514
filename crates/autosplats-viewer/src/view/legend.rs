//! The legend over the picture: which colours stand for which values. Saved pictures have the renderer's own legend.

use autosplats::{ColorMap, ColorMode};
use eframe::egui::{self, Color32, Mesh, Rect, pos2, vec2};

use crate::session::Session;
use crate::view::View;
use crate::view::overlay::round;

/// Width of the colour bar, screen points.
const BAR_WIDTH: f32 = 14.0;
/// Smallest height between two values, screen points.
const MIN_LABEL_STEP: f32 = 26.0;
/// Margin around the legend, screen points.
const MARGIN: f32 = 8.0;
/// Segments of the colour bar.
const BAR_SEGMENTS: u16 = 64;

/// Draws the legend at the right edge, if the last picture shows values.
pub(crate) fn show(session: &Session, view: &View, ui: &egui::Ui) {
    let rect = view.rect;
    let shading = &view.look.settings.shading;
    let Some([low, high]) = view.shot.as_ref().and_then(|shot| shot.counts.value_range) else { return };
    let (true, Some(usual)) = (shading.legend, shading.color.usual_map()) else { return };
    let height = (0.5 * rect.height()).min(320.0);
    if height < 3.0 * MIN_LABEL_STEP {
        return;
    }
    let painter = ui.painter_at(rect);
    let font = egui::FontId::proportional(12.0);
    let text = |text: String| painter.layout_no_wrap(text, font.clone(), Color32::WHITE);
    let title = text(title(&shading.color, session));
    let line = title.size().y;
    let bar_height = height - 3.0 * MARGIN - line;
    let values = ticks(low, high, f64::from(bar_height / MIN_LABEL_STEP).max(2.0));
    let labels: Vec<_> = values.iter().map(|(value, label)| (*value, text(label.clone()))).collect();
    let widest = labels.iter().map(|(_, label)| label.size().x).fold(0.0, f32::max);
    let width = (BAR_WIDTH + 10.0 + widest).max(title.size().x) + 2.0 * MARGIN;
    let panel =
        Rect::from_min_size(pos2(rect.right() - width - 12.0, rect.center().y - 0.5 * height), vec2(width, height));
    painter.rect_filled(panel, 4.0, Color32::from_black_alpha(170));
    let inner = panel.shrink(MARGIN);
    painter.galley(inner.min, title, Color32::WHITE);
    let bar = Rect::from_min_max(
        pos2(inner.left(), inner.top() + line + MARGIN),
        pos2(inner.left() + BAR_WIDTH, inner.bottom()),
    );
    painter.add(colors(shading.color_map.unwrap_or(usual), bar));
    for (value, label) in labels {
        let part = if high > low { (value - low) / (high - low) } else { 0.5 };
        let y = egui::lerp(bar.bottom()..=bar.top(), part as f32);
        let tick = [pos2(bar.right(), y), pos2(bar.right() + 4.0, y)];
        painter.line_segment(tick, egui::Stroke::new(1.0, Color32::WHITE));
        painter.galley(pos2(bar.right() + 7.0, y - 0.5 * label.size().y), label, Color32::WHITE);
    }
}

/// Name of the shown value, and its unit.
fn title(color: &ColorMode, session: &Session) -> String {
    let unit = match color {
        ColorMode::Height | ColorMode::Depth | ColorMode::Radius | ColorMode::KRadius => session.ruler().unit(),
        _ => None,
    };
    unit.map_or_else(|| color.title(), |unit| format!("{} ({unit})", color.title()))
}

/// Mesh of the colour bar.
fn colors(map: ColorMap, bar: Rect) -> Mesh {
    let mut mesh = Mesh::default();
    for piece in 0..=BAR_SEGMENTS {
        let part = f32::from(piece) / f32::from(BAR_SEGMENTS);
        let [r, g, b] = map.at(part);
        let y = egui::lerp(bar.bottom()..=bar.top(), part);
        for x in [bar.left(), bar.right()] {
            mesh.colored_vertex(pos2(x, y), Color32::from_rgb(r, g, b));
        }
        if let Some(below) = u32::from(piece).checked_sub(1).map(|below| 2 * below) {
            mesh.add_triangle(below, below + 1, below + 2);
            mesh.add_triangle(below + 1, below + 2, below + 3);
        }
    }
    mesh
}

/// Round values from `low` to `high`, at most about `most` of them and at least half as many. Labels have enough digits
/// to differ.
fn ticks(low: f64, high: f64, most: f64) -> Vec<(f64, String)> {
    let width = high - low;
    if !(width > 0.0 && width.is_finite()) {
        return vec![(low, format!("{low:.4}"))];
    }
    // The next larger round step: the reciprocal of a round number is round too.
    let step = 1.0 / round(most / width);
    let [first, last] = [(low / step - 1e-6).ceil(), (high / step + 1e-6).floor()];
    let decimals = (0..=12).find(|&decimals| {
        let steps = step * 10_f64.powi(decimals);
        (steps - steps.round()).abs() < 1e-6 * steps
    });
    let largest = low.abs().max(high.abs());
    // Values that differ in their last digits only are written with all of them.
    let close = step * 1e3 < largest && largest < 1e15;
    let label = |value: f64| match decimals {
        Some(decimals) if close || largest < 1e9 && step >= 1e-6 => {
            format!("{value:.*}", decimals.unsigned_abs() as usize)
        }
        _ => format!("{value:.3e}"),
    };
    // Adding zero turns -0 into 0.
    let values = (0..=(last - first).max(0.0) as u32).map(|number| (first + f64::from(number)) * step + 0.0);
    values.map(|value| (value, label(value))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_round_and_in_the_range() {
        let labels = |low, high, most| ticks(low, high, most).into_iter().map(|(_, label)| label).collect::<Vec<_>>();
        assert_eq!(labels(0.0, 1.0, 5.0), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"], "tenths");
        assert_eq!(labels(-1.3, 2.2, 4.0), ["-1", "0", "1", "2"], "across zero");
        assert_eq!(labels(406_123.25, 406_123.75, 5.0).first().map(String::as_str), Some("406123.3"), "far from zero");
        assert_eq!(labels(7.0, 7.0, 5.0), ["7.0000"], "one value");
        let seconds = labels(1.7e9 + 3.0, 1.7e9 + 21.0, 3.0);
        assert_eq!(seconds, ["1700000010", "1700000020"], "seconds of an era");
        for (low, high) in [(0.001, 0.0037), (-5.0, 1e6), (1e-9, 3e-9), (99.5, 101.0)] {
            let found = ticks(low, high, 8.0);
            assert!((3..=9).contains(&found.len()), "{low} to {high}: {found:?}");
            let slack = 1e-5 * (high - low);
            assert!(found.iter().all(|(value, _)| (low - slack..=high + slack).contains(value)), "{found:?}");
            assert!(found.windows(2).all(|pair| pair[0].1 != pair[1].1), "each reads otherwise: {found:?}");
        }
        assert_eq!(ticks(f64::NAN, 1.0, 5.0).len(), 1, "no range");
    }

    #[test]
    fn colours_are_those_of_the_map() {
        let bar = Rect::from_min_max(pos2(0.0, 0.0), pos2(10.0, 100.0));
        let mesh = colors(ColorMap::Gray, bar);
        let ends = [mesh.vertices.first(), mesh.vertices.last()].map(|end| end.map(|end| (end.pos.y, end.color)));
        assert_eq!(ends, [Some((100.0, Color32::BLACK)), Some((0.0, Color32::WHITE))], "low is below");
    }
}
