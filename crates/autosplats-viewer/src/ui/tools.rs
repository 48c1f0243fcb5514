//! What the left button does besides turning the view: inspecting, measuring and selecting points.

use autosplats::cloud::glam::DVec3;
use eframe::egui::{self, Color32, Pos2, Stroke};

use crate::session::measure::angle_text;
use crate::session::{PickedPoint, Region, SelectMode, Session};
use crate::ui::{Gizmo, Tool};
use crate::view::{PickHit, Purpose, Task, View};

/// Initial radius of the brush, screen points.
const INITIAL_BRUSH_RADIUS: f32 = 24.0;

/// The tools, and the one in use.
pub(crate) struct Tools {
    pub(crate) current: Tool,
    /// Path of the pointer since the button went down, screen points.
    way: Vec<Pos2>,
    /// Whether the drag was cancelled; the button may still be down.
    given_up: bool,
    /// Radius of the brush, screen points.
    pub(crate) brush: f32,
    /// Whether to select points behind the surface too.
    pub(crate) through: bool,
    /// The inspected point.
    pub(crate) inspected: Option<PickedPoint>,
    /// Corners of the measurement, world coordinates.
    pub(crate) measured: Vec<DVec3>,
    /// The handles in the picture.
    pub(crate) gizmo: Gizmo,
}

impl Default for Tools {
    fn default() -> Self {
        Self {
            current: Tool::default(),
            way: Vec::new(),
            given_up: false,
            brush: INITIAL_BRUSH_RADIUS,
            through: false,
            inspected: None,
            measured: Vec::new(),
            gizmo: Gizmo::default(),
        }
    }
}

impl Tools {
    /// Extends the pointer's path, for tests.
    #[cfg(test)]
    pub(crate) fn draw(&mut self, way: &[Pos2]) {
        self.way.extend_from_slice(way);
    }

    /// Cancels the drawing until the button is released. Returns whether there was any.
    pub(crate) fn cancel_drag(&mut self) -> bool {
        let any = !self.way.is_empty();
        self.given_up |= any;
        self.way.clear();
        any
    }

    /// Cancels what the tool is doing. Returns whether there was anything.
    pub(crate) fn cancel(&mut self) -> bool {
        let any = self.cancel_drag() || self.inspected.is_some() || !self.measured.is_empty();
        self.inspected = None;
        self.measured.clear();
        any
    }

    /// Selects by a drag with the left button, or by a click of the brush.
    pub(crate) fn drag(&mut self, session: &Session, view: &View, response: &egui::Response, size: [u32; 2]) {
        let Some(place) = response.interact_pointer_pos() else { return };
        let modifiers = response.ctx.input(|input| input.modifiers);
        if response.drag_started_by(egui::PointerButton::Primary) {
            self.given_up = false;
            self.way.clear();
            // The pointer has already moved when a drag is recognized.
            let start = response.ctx.input(|input| input.pointer.press_origin());
            self.way.extend(start);
        }
        let dab = self.current == Tool::Brush && response.clicked_by(egui::PointerButton::Primary) && !modifiers.alt;
        if dab {
            self.given_up = false;
            self.way = vec![place];
        }
        if self.given_up {
            return;
        }
        if response.dragged_by(egui::PointerButton::Primary) && self.way.last() != Some(&place) {
            self.way.push(place);
        }
        if !(dab || response.drag_stopped_by(egui::PointerButton::Primary)) || self.way.is_empty() {
            return;
        }
        let scale = size[0] as f32 / response.rect.width();
        let pixel = |place: &Pos2| [(place.x - response.rect.left()) * scale, (place.y - response.rect.top()) * scale];
        let way: Vec<[f32; 2]> = std::mem::take(&mut self.way).iter().map(pixel).collect();
        let region = match self.current {
            Tool::Rectangle => Region::rectangle(way[0], way[way.len() - 1]),
            Tool::Lasso => Region::lasso(&way),
            _ => Region::brush(&way, self.brush * scale),
        };
        let mode = match (modifiers.shift, modifiers.command) {
            (true, true) => SelectMode::Intersect,
            (true, false) => SelectMode::Add,
            (false, true) => SelectMode::Subtract,
            (false, false) => SelectMode::Replace,
        };
        let wish = Box::new(view.wish(session, size, false).of_points());
        view.render.task(Task::Select { wish, region, through: self.through, mode });
    }

    /// Receives the point under a click.
    pub(crate) fn picked(&mut self, session: &mut Session, purpose: Purpose, point: Option<PickHit>) {
        let Some(seen) = point else {
            if purpose == Purpose::Inspect {
                self.inspected = None;
            }
            return;
        };
        let described = session.document().describe(&seen.shown, seen.index);
        match (purpose, described) {
            (Purpose::Inspect, described) => {
                if let Some(point) = &described {
                    session.inspect(point, &seen.shown);
                }
                self.inspected = described;
            }
            // The second click of a double click hits the same point.
            (Purpose::Measure, Some(described)) if self.measured.last() != Some(&described.position) => {
                self.measured.push(described.position);
            }
            _ => {}
        }
    }

    /// Adds the attributes of the inspected point, once they are read.
    pub(crate) fn complete(&mut self, point: PickedPoint) {
        let is_same = |shown: &PickedPoint| shown.layer == point.layer && shown.node == point.node;
        if self.inspected.as_ref().is_some_and(is_same) {
            self.inspected = Some(point);
        }
    }

    /// Draws the state of the tools over the picture.
    pub(crate) fn show(&self, session: &Session, view: &View, ui: &egui::Ui, size: [u32; 2]) {
        let rect = view.rect;
        let painter = ui.painter_at(rect);
        let accent = Color32::from_rgb(255, 160, 40);
        let line = Stroke::new(1.5, accent);
        let way = &self.way;
        match self.current {
            Tool::Rectangle => {
                if let (Some(&from), Some(&to)) = (way.first(), way.last()) {
                    painter.rect(
                        egui::Rect::from_two_pos(from, to),
                        0.0,
                        accent.gamma_multiply(0.15),
                        line,
                        egui::StrokeKind::Middle,
                    );
                }
            }
            Tool::Lasso if way.len() > 1 => {
                painter.add(egui::Shape::closed_line(way.clone(), line));
            }
            Tool::Brush => {
                for &place in way {
                    painter.circle_filled(place, self.brush, accent.gamma_multiply(0.08));
                }
                if let Some(place) = ui.ctx().pointer_hover_pos().filter(|place| rect.contains(*place)) {
                    painter.circle_stroke(place, self.brush, line);
                }
            }
            _ => {}
        }
        let Ok(lens) = view.navigation.camera().lens(size) else { return };
        let scale = rect.width() / size[0] as f32;
        let place = |world: DVec3| {
            let (pixel, _) = lens.to_pixel(world)?;
            Some(rect.min + egui::vec2(pixel.x as f32, pixel.y as f32) * scale)
        };
        if let Some(point) = &self.inspected
            && let Some(at) = place(point.position)
        {
            painter.circle_stroke(at, 6.0, Stroke::new(2.0, Color32::BLACK));
            painter.circle_stroke(at, 6.0, line);
        }
        let corners = &self.measured;
        let ruler = session.ruler();
        let text = |at: Pos2, text: String| {
            let galley = painter.layout_no_wrap(text, egui::FontId::proportional(13.0), Color32::WHITE);
            let frame = egui::Rect::from_center_size(at, galley.size() + egui::vec2(8.0, 4.0));
            painter.rect_filled(frame, 3.0, Color32::from_black_alpha(190));
            painter.galley(frame.min + egui::vec2(4.0, 2.0), galley, Color32::WHITE);
        };
        for ends in corners.windows(2) {
            if let (Some(a), Some(b)) = (place(ends[0]), place(ends[1])) {
                painter.line_segment([a, b], Stroke::new(3.5, Color32::from_black_alpha(160)));
                painter.line_segment([a, b], line);
                text(a + (b - a) * 0.5, ruler.length_text(ruler.distance(ends[0], ends[1])));
            }
        }
        for way in corners.windows(3) {
            if let (Some(at), Some(angle)) = (place(way[1]), ruler.angle(way[0], way[1], way[2])) {
                text(at + egui::vec2(0.0, 16.0), angle_text(angle));
            }
        }
        for &corner in corners {
            if let Some(at) = place(corner) {
                painter.circle_filled(at, 4.0, Color32::BLACK);
                painter.circle_filled(at, 3.0, accent);
            }
        }
    }
}

#[cfg(test)]
mod tests;
