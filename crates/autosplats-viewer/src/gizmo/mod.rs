//! Handles in the picture that the mouse takes hold of: the faces of the clipping box, and what moves and turns the selection.
//!
//! # How it works
//! In each frame the handles that are there are laid out on the window ([`View`]), and the nearest one within reach of the
//! pointer is the one that a drag would take. A drag changes the document as it goes, so that the picture follows, each time
//! from how it was at the beginning; what undo takes back is the whole drag.

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

/// Something that can be dragged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Handle {
    /// A face of the clipping box.
    Face { axis: usize, high: bool },
    /// Moves the selection along an axis of the world.
    Arrow(usize),
    /// Moves the selection as the pointer goes.
    Middle,
    /// Turns the selection about an axis of the world.
    Ring(usize),
}

/// What is being dragged.
enum Drag {
    Face(faces::Drag),
    Points(arrows::Drag),
    /// It was given up; the button is still down.
    Dropped,
}

/// What the handles have in work.
#[derive(Default)]
pub(crate) struct Gizmo {
    hovered: Option<Handle>,
    drag: Option<Drag>,
    /// The middle of the selection, as of a version of the document.
    middle: (u64, Option<DVec3>),
    /// The clipping box before it was changed, as long as the change is not finished.
    clip_before: Option<Option<ClipBox>>,
}

impl Gizmo {
    /// Whether something is being dragged.
    pub(crate) fn is_dragging(&self) -> bool {
        self.drag.is_some()
    }

    /// Whether the document is in the user's hands: dragged, or a number of the clipping box is.
    pub(crate) fn is_busy(&self) -> bool {
        self.is_dragging() || self.clip_before.is_some()
    }
}

/// What the pointer does to handles; says whether it is taken up by one.
pub(crate) fn handle(app: &mut App, response: &egui::Response, size: [u32; 2]) -> bool {
    let left = egui::PointerButton::Primary;
    if app.tools.gizmo.drag.is_some() && !response.dragged_by(left) {
        finish(app);
        return true;
    }
    let Some(view) = View::new(&app.navigation.camera(), response.rect, size) else { return false };
    if app.tools.gizmo.drag.is_some() {
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
    // The pointer has moved already when a drag is known to be one.
    let place = if begins { pressed.or(hover) } else { hover.filter(|_| response.hovered()) };
    let place = place.filter(|_| begins || !response.dragged());
    let handles = handles(app, &view);
    app.tools.gizmo.hovered = place.filter(|_| !alt).and_then(|place| nearest(&handles, place));
    let (Some(hovered), Some(place)) = (app.tools.gizmo.hovered, place) else { return false };
    response.ctx.set_cursor_icon(CursorIcon::Grab);
    if begins {
        app.tools.gizmo.drag = match hovered {
            Handle::Face { axis, high } => faces::Drag::begin(app, &view, axis, high, place).map(Drag::Face),
            _ => arrows::Drag::begin(app, &view, hovered, place).map(Drag::Points),
        };
    }
    begins
}

/// Gives up what is being dragged; says whether there was anything.
pub(crate) fn cancel(app: &mut App) -> bool {
    match app.tools.gizmo.drag.replace(Drag::Dropped) {
        Some(Drag::Face(drag)) => drag.cancel(app),
        Some(Drag::Points(drag)) => drag.cancel(app),
        Some(Drag::Dropped) => {}
        None => {
            app.tools.gizmo.drag = None;
            return false;
        }
    }
    true
}

fn finish(app: &mut App) {
    match app.tools.gizmo.drag.take() {
        Some(Drag::Face(_)) => settle(app),
        Some(Drag::Points(drag)) => drag.finish(app),
        Some(Drag::Dropped) | None => {}
    }
}

/// Takes what is dragged to where the pointer is; in steps if `stepped`.
fn follow(app: &mut App, view: &View, place: Pos2, stepped: bool) {
    match app.tools.gizmo.drag.take() {
        Some(Drag::Face(drag)) => {
            drag.follow(app, view, place);
            app.tools.gizmo.drag = Some(Drag::Face(drag));
        }
        Some(Drag::Points(mut drag)) => {
            drag.follow(app, view, place, stepped);
            app.tools.gizmo.drag = Some(Drag::Points(drag));
        }
        dropped => app.tools.gizmo.drag = dropped,
    }
}

/// Looks where the selection is, if it may have changed.
fn find_middle(app: &mut App) {
    let version = app.version();
    if app.tool == Tool::Move && app.tools.gizmo.middle.0 != version {
        let bounds = app.document().selected_bounds();
        app.tools.gizmo.middle = (version, bounds.map(|[low, high]| low.midpoint(high)));
    }
}

/// Where the arrows are, if there are any.
fn middle(app: &App) -> Option<DVec3> {
    match &app.tools.gizmo.drag {
        Some(Drag::Points(drag)) => Some(drag.middle()),
        _ => app.tools.gizmo.middle.1.filter(|_| app.tool == Tool::Move),
    }
}

/// The clipping box, if it has handles.
fn clip(app: &App) -> Option<ClipBox> {
    app.document().clip.filter(|clip| clip.enabled && app.panels.clip)
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
    let Some(view) = View::new(&app.navigation.camera(), rect, size) else { return };
    let painter = ui.painter_at(rect);
    let gizmo = &app.tools.gizmo;
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

/// A line that is seen on any ground.
fn line(painter: &egui::Painter, ends: [Pos2; 2], width: f32, color: Color32) {
    let shade = Color32::from_black_alpha((f32::from(color.a()) * 0.5) as u8);
    painter.line_segment(ends, Stroke::new(width + 2.0, shade));
    painter.line_segment(ends, Stroke::new(width, color));
}
