//! Handles in the picture: the faces of the clipping box, and the arrows and rings of the selection.
//!
//! # How it works
//! In each frame the handles are projected onto the window ([`WindowLens`]). The nearest handle within reach of the
//! pointer is the one that a drag would take. A drag changes the document continuously, so that the picture follows,
//! each time starting from the state before the drag. Undo reverts the whole drag.

mod arrows;
mod faces;
mod lens;
#[cfg(test)]
mod tests;

use autosplats::cloud::glam::DVec3;
use eframe::egui::{self, Color32, CursorIcon, Pos2, Stroke};

use self::lens::{Shape, WindowLens, nearest};
use crate::session::{ClipBox, Session};
use crate::view::View;

/// A handle that can be dragged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Handle {
    /// A face of the clipping box.
    Face { axis: usize, high: bool },
    /// Moves the selection along a world axis.
    Arrow(usize),
    /// Moves the selection in the plane of the picture.
    Middle,
    /// Turns the selection about a world axis.
    Ring(usize),
}

/// The drag in progress.
enum Drag {
    Face(faces::Drag),
    Points(arrows::Drag),
    /// A cancelled drag whose button is still down.
    Dropped,
}

/// State of the handles.
#[derive(Default)]
pub(crate) struct Gizmo {
    /// Whether the numbers and the handles of the clipping box are shown.
    pub(crate) clip: bool,
    hovered: Option<Handle>,
    drag: Option<Drag>,
    /// Document version, and the middle of the selection in that version.
    middle: (u64, Option<DVec3>),
}

impl Gizmo {
    /// Whether a drag is in progress, or cancelled with the button still down.
    pub(crate) fn is_dragging(&self) -> bool {
        self.drag.is_some()
    }

    /// Handles the pointer. Returns whether a handle uses it. `moves` says whether the tool moves the selection.
    pub(crate) fn handle(
        &mut self,
        session: &mut Session,
        view: &View,
        moves: bool,
        response: &egui::Response,
        size: [u32; 2],
    ) -> bool {
        let left = egui::PointerButton::Primary;
        if self.drag.is_some() && !response.dragged_by(left) {
            self.finish(session);
            return true;
        }
        let Some(lens) = WindowLens::new(&view.navigation.camera(), response.rect, size) else { return false };
        if self.drag.is_some() {
            response.ctx.set_cursor_icon(CursorIcon::Grabbing);
            if let Some(place) = response.interact_pointer_pos() {
                self.follow(session, &lens, place, response.ctx.input(|input| input.modifiers.command));
            }
            return true;
        }
        self.find_middle(session, moves);
        let (pressed, hover, alt) =
            response.ctx.input(|input| (input.pointer.press_origin(), input.pointer.hover_pos(), input.modifiers.alt));
        let begins = response.drag_started_by(left);
        // The pointer has already moved when a drag is recognized.
        let place = if begins { pressed.or(hover) } else { hover.filter(|_| response.hovered()) };
        let place = place.filter(|_| begins || !response.dragged());
        let handles = self.handles(session, moves, &lens);
        self.hovered = place.filter(|_| !alt).and_then(|place| nearest(&handles, place));
        let (Some(hovered), Some(place)) = (self.hovered, place) else { return false };
        response.ctx.set_cursor_icon(CursorIcon::Grab);
        if begins {
            self.drag = match hovered {
                Handle::Face { axis, high } => faces::Drag::begin(session, &lens, axis, high, place).map(Drag::Face),
                _ => self
                    .middle(moves)
                    .and_then(|middle| arrows::Drag::begin(session, middle, &lens, hovered, place))
                    .map(Drag::Points),
            };
        }
        begins
    }

    /// Cancels the drag. Returns whether there was one.
    pub(crate) fn cancel(&mut self, session: &mut Session) -> bool {
        match self.drag.replace(Drag::Dropped) {
            Some(Drag::Face(drag)) => drag.cancel(session),
            Some(Drag::Points(drag)) => drag.cancel(session),
            Some(Drag::Dropped) => {}
            None => {
                self.drag = None;
                return false;
            }
        }
        true
    }

    fn finish(&mut self, session: &mut Session) {
        match self.drag.take() {
            Some(Drag::Face(_)) => session.settle_clip(),
            Some(Drag::Points(drag)) => drag.finish(session),
            Some(Drag::Dropped) | None => {}
        }
    }

    /// Moves the dragged handle to follow the pointer; in steps if `stepped`.
    fn follow(&mut self, session: &mut Session, lens: &WindowLens, place: Pos2, stepped: bool) {
        match self.drag.take() {
            Some(Drag::Face(drag)) => {
                drag.follow(session, lens, place);
                self.drag = Some(Drag::Face(drag));
            }
            Some(Drag::Points(mut drag)) => {
                drag.follow(session, lens, place, stepped);
                self.drag = Some(Drag::Points(drag));
            }
            dropped => self.drag = dropped,
        }
    }

    /// Computes the middle of the selection, if it may have changed.
    fn find_middle(&mut self, session: &Session, moves: bool) {
        let version = session.version;
        if moves && self.middle.0 != version {
            let bounds = session.document().selected_bounds();
            self.middle = (version, bounds.map(|[low, high]| low.midpoint(high)));
        }
    }

    /// Middle of the arrows and rings, if they are shown.
    fn middle(&self, moves: bool) -> Option<DVec3> {
        match &self.drag {
            Some(Drag::Points(drag)) => Some(drag.middle()),
            _ => self.middle.1.filter(|_| moves),
        }
    }

    /// The clipping box, if its handles are shown.
    fn shown_clip(&self, session: &Session) -> Option<ClipBox> {
        session.document().clip.filter(|clip| clip.enabled && self.clip)
    }

    fn handles(&self, session: &Session, moves: bool, lens: &WindowLens) -> Vec<(Handle, Shape)> {
        let mut handles = Vec::new();
        if let Some(clip) = self.shown_clip(session) {
            handles.extend(faces::handles(&clip, lens));
        }
        if let Some(middle) = self.middle(moves) {
            handles.extend(arrows::handles(middle, lens));
        }
        handles
    }

    /// Draws the handles over the picture.
    pub(crate) fn show(&self, session: &Session, view: &View, moves: bool, ui: &egui::Ui, size: [u32; 2]) {
        let Some(lens) = WindowLens::new(&view.navigation.camera(), view.rect, size) else { return };
        let painter = ui.painter_at(view.rect);
        let (taken, says) = match &self.drag {
            Some(Drag::Face(drag)) => (Some(drag.handle()), drag.text(session)),
            Some(Drag::Points(drag)) => (Some(drag.handle), Some(drag.text(session))),
            Some(Drag::Dropped) => (None, None),
            None => (self.hovered, None),
        };
        if session.document().clip.is_some_and(|clip| clip.enabled) {
            let shown = self.shown_clip(session).is_some();
            faces::show(session, view, &lens, &painter, taken, shown);
        }
        if let Some(middle) = self.middle(moves) {
            arrows::show(middle, &lens, &painter, taken);
        }
        if let (Some(text), Some(place)) = (says, ui.ctx().pointer_latest_pos()) {
            let galley = painter.layout_no_wrap(text, egui::FontId::proportional(13.0), Color32::WHITE);
            let frame = egui::Rect::from_min_size(place + egui::vec2(16.0, 12.0), galley.size() + egui::vec2(8.0, 4.0));
            painter.rect_filled(frame, 3.0, Color32::from_black_alpha(190));
            painter.galley(frame.min + egui::vec2(4.0, 2.0), galley, Color32::WHITE);
        }
    }
}

/// A line with a dark outline, visible on any background.
fn line(painter: &egui::Painter, ends: [Pos2; 2], width: f32, color: Color32) {
    let shade = Color32::from_black_alpha((f32::from(color.a()) * 0.5) as u8);
    painter.line_segment(ends, Stroke::new(width + 2.0, shade));
    painter.line_segment(ends, Stroke::new(width, color));
}
