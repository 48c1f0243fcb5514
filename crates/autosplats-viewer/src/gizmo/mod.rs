//! Handles in the picture: the faces of the clipping box, and the arrows and rings of the selection.
//!
//! # How it works
//! In each frame the handles are projected onto the window ([`View`]). The nearest handle within reach of the pointer
//! is the one that a drag would take. A drag changes the document continuously, so that the picture follows, each time
//! starting from the state before the drag. Undo reverts the whole drag.

mod arrows;
mod faces;
#[cfg(test)]
mod tests;
mod view;

use autosplats::cloud::glam::DVec3;
use eframe::egui::{self, Color32, CursorIcon, Pos2, Stroke};

pub(crate) use self::faces::{preview, settle, switch};
use self::view::{Shape, View, nearest};
use crate::app::App;
use crate::commands::Tool;
use crate::document::ClipBox;

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
    hovered: Option<Handle>,
    drag: Option<Drag>,
    /// Document version, and the middle of the selection in that version.
    middle: (u64, Option<DVec3>),
    /// The clipping box before the unfinished change; the inner `None` is no box.
    clip_before: Option<Option<ClipBox>>,
}

impl Gizmo {
    /// Whether a drag is in progress, or cancelled with the button still down.
    pub(crate) fn is_dragging(&self) -> bool {
        self.drag.is_some()
    }

    /// Whether a change is unfinished: a drag, or a number of the clipping box.
    pub(crate) fn is_busy(&self) -> bool {
        self.is_dragging() || self.clip_before.is_some()
    }
}

/// Handles the pointer. Returns whether a handle uses it.
pub(crate) fn handle(app: &mut App, response: &egui::Response, size: [u32; 2]) -> bool {
    let left = egui::PointerButton::Primary;
    if app.ui.tools.gizmo.drag.is_some() && !response.dragged_by(left) {
        finish(app);
        return true;
    }
    let Some(view) = View::new(&app.view.navigation.camera(), response.rect, size) else { return false };
    if app.ui.tools.gizmo.drag.is_some() {
        response.ctx.set_cursor_icon(CursorIcon::Grabbing);
        if let Some(place) = response.interact_pointer_pos() {
            follow(app, &view, place, response.ctx.input(|input| input.modifiers.command));
        }
        return true;
    }
    find_middle(app);
    let (pressed, hover, alt) =
        response.ctx.input(|input| (input.pointer.press_origin(), input.pointer.hover_pos(), input.modifiers.alt));
    let begins = response.drag_started_by(left);
    // The pointer has already moved when a drag is recognized.
    let place = if begins { pressed.or(hover) } else { hover.filter(|_| response.hovered()) };
    let place = place.filter(|_| begins || !response.dragged());
    let handles = handles(app, &view);
    app.ui.tools.gizmo.hovered = place.filter(|_| !alt).and_then(|place| nearest(&handles, place));
    let (Some(hovered), Some(place)) = (app.ui.tools.gizmo.hovered, place) else { return false };
    response.ctx.set_cursor_icon(CursorIcon::Grab);
    if begins {
        app.ui.tools.gizmo.drag = match hovered {
            Handle::Face { axis, high } => faces::Drag::begin(app, &view, axis, high, place).map(Drag::Face),
            _ => arrows::Drag::begin(app, &view, hovered, place).map(Drag::Points),
        };
    }
    begins
}

/// Cancels the drag. Returns whether there was one.
pub(crate) fn cancel(app: &mut App) -> bool {
    match app.ui.tools.gizmo.drag.replace(Drag::Dropped) {
        Some(Drag::Face(drag)) => drag.cancel(app),
        Some(Drag::Points(drag)) => drag.cancel(app),
        Some(Drag::Dropped) => {}
        None => {
            app.ui.tools.gizmo.drag = None;
            return false;
        }
    }
    true
}

fn finish(app: &mut App) {
    match app.ui.tools.gizmo.drag.take() {
        Some(Drag::Face(_)) => settle(app),
        Some(Drag::Points(drag)) => drag.finish(app),
        Some(Drag::Dropped) | None => {}
    }
}

/// Moves the dragged handle to follow the pointer; in steps if `stepped`.
fn follow(app: &mut App, view: &View, place: Pos2, stepped: bool) {
    match app.ui.tools.gizmo.drag.take() {
        Some(Drag::Face(drag)) => {
            drag.follow(app, view, place);
            app.ui.tools.gizmo.drag = Some(Drag::Face(drag));
        }
        Some(Drag::Points(mut drag)) => {
            drag.follow(app, view, place, stepped);
            app.ui.tools.gizmo.drag = Some(Drag::Points(drag));
        }
        dropped => app.ui.tools.gizmo.drag = dropped,
    }
}

/// Computes the middle of the selection, if it may have changed.
fn find_middle(app: &mut App) {
    let version = app.version();
    if app.ui.tool == Tool::Move && app.ui.tools.gizmo.middle.0 != version {
        let bounds = app.document().selected_bounds();
        app.ui.tools.gizmo.middle = (version, bounds.map(|[low, high]| low.midpoint(high)));
    }
}

/// Middle of the arrows and rings, if they are shown.
fn middle(app: &App) -> Option<DVec3> {
    match &app.ui.tools.gizmo.drag {
        Some(Drag::Points(drag)) => Some(drag.middle()),
        _ => app.ui.tools.gizmo.middle.1.filter(|_| app.ui.tool == Tool::Move),
    }
}

/// The clipping box, if its handles are shown.
fn clip(app: &App) -> Option<ClipBox> {
    app.document().clip.filter(|clip| clip.enabled && app.ui.panels.clip)
}

fn handles(app: &App, view: &View) -> Vec<(Handle, Shape)> {
    let mut handles = Vec::new();
    if let Some(clip) = clip(app) {
        handles.extend(faces::handles(&clip, view));
    }
    if let Some(middle) = middle(app) {
        handles.extend(arrows::handles(middle, view));
    }
    handles
}

/// Draws the handles over the picture.
pub(crate) fn show(app: &App, ui: &egui::Ui, rect: egui::Rect, size: [u32; 2]) {
    let Some(view) = View::new(&app.view.navigation.camera(), rect, size) else { return };
    let painter = ui.painter_at(rect);
    let gizmo = &app.ui.tools.gizmo;
    let (taken, says) = match &gizmo.drag {
        Some(Drag::Face(drag)) => (Some(drag.handle()), drag.text(app)),
        Some(Drag::Points(drag)) => (Some(drag.handle), Some(drag.text(app))),
        Some(Drag::Dropped) => (None, None),
        None => (gizmo.hovered, None),
    };
    if app.document().clip.is_some_and(|clip| clip.enabled) {
        faces::show(app, &view, &painter, taken);
    }
    if let Some(middle) = middle(app) {
        arrows::show(middle, &view, &painter, taken);
    }
    if let (Some(text), Some(place)) = (says, ui.ctx().pointer_latest_pos()) {
        let galley = painter.layout_no_wrap(text, egui::FontId::proportional(13.0), Color32::WHITE);
        let frame = egui::Rect::from_min_size(place + egui::vec2(16.0, 12.0), galley.size() + egui::vec2(8.0, 4.0));
        painter.rect_filled(frame, 3.0, Color32::from_black_alpha(190));
        painter.galley(frame.min + egui::vec2(4.0, 2.0), galley, Color32::WHITE);
    }
}

/// A line with a dark outline, visible on any background.
fn line(painter: &egui::Painter, ends: [Pos2; 2], width: f32, color: Color32) {
    let shade = Color32::from_black_alpha((f32::from(color.a()) * 0.5) as u8);
    painter.line_segment(ends, Stroke::new(width + 2.0, shade));
    painter.line_segment(ends, Stroke::new(width, color));
}
