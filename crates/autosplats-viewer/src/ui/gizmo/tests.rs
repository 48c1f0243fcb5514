//! Drags in an application without a window.

use std::sync::Arc;

use autosplats::cloud::PointCloud;
use autosplats::cloud::glam::DVec3;
use eframe::egui::{Rect, pos2, vec2};

use super::lens::WindowLens;
use super::*;
use crate::Options;
use crate::app::App;
use crate::session::{Layer, SelectMode};
use crate::ui::Command;
use crate::view::Look;

/// An application with 1,000 points in the unit cube, all selected, with a clipping box; and its lens.
fn app() -> (App, WindowLens) {
    let context = egui::Context::default();
    let mut app = App::new(Options::default(), Look::default(), Vec::new(), &context);
    let position = |i: usize| [7, 13, 29].map(|step| (i * step % 101) as f32 / 100.0);
    let cloud = Arc::new(PointCloud::new(DVec3::ZERO, (0..1000).map(position).collect()));
    app.session.change(|document| {
        document.add(Layer::new("cube", None, cloud));
        let shown = document.shown();
        document.select(&shown, |_| true, SelectMode::Replace);
    });
    app.view.look_from(&app.session, autosplats::ViewDirection::Iso, true);
    app.run(Command::Clip, &context);
    app.ui.tools.gizmo.find_middle(&app.session, true);
    let rect = Rect::from_min_size(pos2(0.0, 0.0), vec2(600.0, 400.0));
    let lens = WindowLens::new(&app.view.navigation.camera(), rect, [600, 400]).expect("a camera that sees");
    (app, lens)
}

/// Undoes all steps and returns their labels, newest first.
fn steps(app: &mut App) -> Vec<String> {
    std::iter::from_fn(|| app.session.undo()).collect()
}

fn begin(app: &mut App, lens: &WindowLens, handle: Handle) -> Pos2 {
    let middle = app.ui.tools.gizmo.middle(true).expect("some points are selected");
    let place = match handle {
        Handle::Face { axis, high } => lens.place(app.session.document().clip.expect("a box").face(axis, high)),
        _ => lens.place(middle),
    };
    let place = place.expect("before the eye");
    app.ui.tools.gizmo.drag = match handle {
        Handle::Face { axis, high } => faces::Drag::begin(&app.session, lens, axis, high, place).map(Drag::Face),
        handle => arrows::Drag::begin(&app.session, middle, lens, handle, place).map(Drag::Points),
    };
    assert!(app.ui.tools.gizmo.is_dragging(), "{handle:?} is taken");
    place
}

#[test]
fn a_drag_is_one_step() {
    for handle in [Handle::Face { axis: 0, high: true }, Handle::Middle, Handle::Arrow(2)] {
        let (mut app, lens) = app();
        let place = begin(&mut app, &lens, handle);
        for step in 1..=5 {
            app.ui.tools.gizmo.follow(&mut app.session, &lens, place + vec2(-4.0, -4.0) * step as f32, false);
        }
        app.ui.tools.gizmo.finish(&mut app.session);
        assert!(!app.ui.tools.gizmo.is_dragging() && !app.session.is_clip_unsettled(), "{handle:?} is let go");
        let wanted = if matches!(handle, Handle::Face { .. }) { "Clipping box" } else { "Move 1,000 points" };
        assert_eq!(steps(&mut app), [wanted, "Clipping box"], "{handle:?}, after the box was put up");
    }
}

#[test]
fn a_drag_can_be_given_up() {
    for handle in [Handle::Face { axis: 1, high: false }, Handle::Middle] {
        let (mut app, lens) = app();
        let before = app.session.document().clone();
        let place = begin(&mut app, &lens, handle);
        app.ui.tools.gizmo.follow(&mut app.session, &lens, place + vec2(20.0, -20.0), false);
        assert!(app.ui.tools.gizmo.cancel(&mut app.session), "{handle:?} was dragged");
        app.ui.tools.gizmo.follow(&mut app.session, &lens, place + vec2(40.0, -40.0), false);
        app.ui.tools.gizmo.finish(&mut app.session);
        assert!(!app.ui.tools.gizmo.cancel(&mut app.session), "and is no longer");
        assert_eq!(app.session.document().clip, before.clip, "the box is where it was");
        assert!(before.layers[0].edits.moves == app.session.document().layers[0].edits.moves, "and so are the points");
        assert_eq!(steps(&mut app), ["Clipping box"], "nothing was done with {handle:?}");
    }
}

#[test]
fn what_arrives_during_a_drag_stays() {
    for handle in [Handle::Face { axis: 0, high: true }, Handle::Middle] {
        let (mut app, lens) = app();
        let place = begin(&mut app, &lens, handle);
        app.ui.tools.gizmo.follow(&mut app.session, &lens, place + vec2(-10.0, -10.0), false);
        let cloud = Arc::new(PointCloud::new(DVec3::ZERO, vec![[0.5; 3]; 10]));
        app.session.change(|document| document.add(Layer::new("late", None, cloud)));
        app.ui.tools.gizmo.follow(&mut app.session, &lens, place + vec2(-20.0, -20.0), false);
        app.ui.tools.gizmo.finish(&mut app.session);
        assert_eq!(app.session.document().layers.len(), 2, "{handle:?}: the file is there");
        app.session.undo();
        assert_eq!(app.session.document().layers.len(), 2, "{handle:?}: also when the drag is undone");
    }
}
