//! The window with the measured values.

use std::fmt::Write as _;

use autosplats::cloud::glam::DVec3;
use eframe::egui;

use crate::session::measure::angle_text;
use crate::session::{Ruler, Session};
use crate::view::View;

/// Shows the values of a measurement by its corners, for the tool that measures.
pub(super) fn show(corners: &mut Vec<DVec3>, context: &egui::Context, session: &Session, view: &View) {
    if corners.is_empty() {
        return;
    }
    let report = Report::new(&session.ruler(), corners);
    let mut open = true;
    let place = view.rect.right_top() + egui::vec2(-16.0, 310.0);
    let window = egui::Window::new("Measurement")
        .open(&mut open)
        .resizable(true)
        .default_width(290.0)
        .pivot(egui::Align2::RIGHT_TOP)
        .default_pos(place);
    window.show(context, |ui| {
        egui::ScrollArea::vertical().max_height(360.0).show(ui, |ui| {
            for (number, rows) in report.parts().into_iter().enumerate().filter(|(_, rows)| !rows.is_empty()) {
                egui::Grid::new(("measurement", number)).num_columns(2).striped(true).show(ui, |ui| {
                    for (name, value) in rows {
                        ui.label(name);
                        ui.add(egui::Label::new(egui::RichText::new(value).monospace()).selectable(true));
                        ui.end_row();
                    }
                });
                ui.add_space(6.0);
            }
        });
        ui.horizontal(|ui| {
            if ui.button("Copy").on_hover_text("As text, a line each").clicked() {
                context.copy_text(report.text());
                session.messages.note("The measurement was copied");
            }
            if ui.button("Remove last").on_hover_text("The last corner (Backspace)").clicked() {
                corners.pop();
            }
            if ui.button("Clear").clicked() {
                corners.clear();
            }
        });
    });
    if !open {
        corners.clear();
    }
}

/// A name and its value.
type Row = (String, String);

/// All values of a polyline.
#[derive(Debug, Default)]
struct Report {
    whole: Vec<Row>,
    steps: Vec<Row>,
    angles: Vec<Row>,
    corners: Vec<Row>,
}

impl Report {
    fn new(ruler: &Ruler, corners: &[DVec3]) -> Self {
        let mut report = Self::default();
        let decimals = decimals(corners);
        for (number, corner) in corners.iter().enumerate() {
            let place = corner.to_array().map(|value| format!("{value:.decimals$}")).join("  ");
            report.corners.push((format!("Corner {}", number + 1), place));
        }
        let [first, .., last] = corners else { return report };
        for (number, ends) in corners.windows(2).enumerate() {
            let length = ruler.length_text(ruler.distance(ends[0], ends[1]));
            report.steps.push((format!("{} to {}", number + 1, number + 2), length));
        }
        for (number, way) in corners.windows(3).enumerate() {
            if let Some(angle) = ruler.angle(way[0], way[1], way[2]) {
                report.angles.push((format!("Angle at {}", number + 2), angle_text(angle)));
            }
        }
        let mut whole = |name: &str, value: String| report.whole.push((name.into(), value));
        if corners.len() > 2 {
            whole("Total length", ruler.length_text(ruler.polyline(corners)));
            whole("Straight from first to last", ruler.length_text(ruler.distance(*first, *last)));
        } else {
            whole("Distance", ruler.length_text(ruler.distance(*first, *last)));
        }
        whole("Horizontal distance", ruler.length_text(ruler.horizontal_distance(*first, *last)));
        whole("Height difference", ruler.length_text(ruler.height_difference(*first, *last)));
        if corners.len() > 2 {
            whole("Area, if closed", ruler.area_text(ruler.area(corners)));
        }
        report
    }

    fn parts(&self) -> [&[Row]; 4] {
        [&self.whole, &self.steps, &self.angles, &self.corners]
    }

    /// One line per value, with a tab between name and value.
    fn text(&self) -> String {
        let mut text = String::new();
        for (name, value) in self.parts().into_iter().flatten() {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{name}\t{value}");
        }
        text
    }
}

/// Decimals that resolve a hundred-thousandth of the distance between corners; three at least.
fn decimals(corners: &[DVec3]) -> usize {
    let low = corners.iter().copied().reduce(DVec3::min).unwrap_or_default();
    let high = corners.iter().copied().reduce(DVec3::max).unwrap_or_default();
    let extent = low.distance(high).log10().floor();
    if extent.is_finite() { (4.0 - extent).clamp(3.0, 12.0) as usize } else { 6 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use autosplats::cloud::{Crs, Unit};

    fn report(corners: &[DVec3]) -> String {
        Report::new(&Ruler::new(&Crs { unit: Some(Unit::Metre), ..Crs::default() }, DVec3::Z), corners).text()
    }

    #[test]
    fn one_corner_is_a_place() {
        assert_eq!(
            report(&[DVec3::new(1.0, 2.5, 3.0)]),
            "Corner 1\t1.000000  2.500000  3.000000\n",
            "and nothing else"
        );
        assert_eq!(report(&[]), "", "none is nothing");
    }

    #[test]
    fn two_corners_have_a_distance() {
        let text = report(&[DVec3::new(5e5, 5e6, 0.0), DVec3::new(5e5 + 3.0, 5e6 + 4.0, -12.0)]);
        for line in ["Distance\t13.000 m", "Horizontal distance\t5.0000 m", "Height difference\t-12.000 m"] {
            assert!(text.lines().any(|own| own == line), "'{line}' is not in:\n{text}");
        }
        assert!(!text.contains("Area") && !text.contains("Angle"), "no polygon:\n{text}");
    }

    #[test]
    fn more_corners_have_angles_and_an_area() {
        let text = report(&[DVec3::ZERO, DVec3::X * 4.0, DVec3::new(4.0, 3.0, 0.0)]);
        let lines = [
            "Total length\t7.0000 m",
            "Straight from first to last\t5.0000 m",
            "Area, if closed\t6.0000 m²",
            "2 to 3\t3.0000 m",
        ];
        for line in lines.into_iter().chain(["Angle at 2\t90.00°", "Corner 3\t4.0000  3.0000  0.0000"]) {
            assert!(text.lines().any(|own| own == line), "'{line}' is not in:\n{text}");
        }
    }
}
