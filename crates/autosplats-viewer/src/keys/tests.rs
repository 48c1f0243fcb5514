use std::sync::Arc;

use autosplats::Projection;
use autosplats::cloud::PointCloud;

use super::*;
use crate::Options;
use crate::document::{Layer, SelectMode};
use crate::look::Look;

#[test]
fn the_opposite_view_is_upright() {
    for degrees in [-60.0_f64, 0.0, 30.0, 45.0, 60.0, 89.0] {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let look_at = DVec3::new(3.0, 4.0, 5.0);
        let eye = look_at + 10.0 * DVec3::new(0.0, -cosine, sine);
        let up = DVec3::new(0.0, sine, cosine);
        let camera = Camera { eye, look_at, up, projection: Projection::PerspectiveFovDeg(40.0) };
        let there = opposite(&camera, DVec3::Z);
        assert!(there.eye.distance(look_at + 10.0 * DVec3::new(0.0, cosine, sine)) < 1e-9, "{degrees}: {there:?}");
        let [before, after] = [camera, there].map(|camera| camera.axes().expect("a camera that sees"));
        assert!(before[0].distance(-after[0]) < 1e-9, "{degrees}: right is left");
        assert!(after[1].z < 0.0, "{degrees}: down is down, {:?}", after[1]);
        let back = opposite(&there, DVec3::Z);
        assert!(back.eye.distance(eye) < 1e-9 && back.up.distance(up) < 1e-9, "{degrees}: twice is none");
    }
    let above =
        Camera { eye: DVec3::Z, look_at: DVec3::ZERO, up: DVec3::Y, projection: Projection::OrthographicHeight(1.0) };
    assert_eq!(opposite(&above, DVec3::Z).eye, DVec3::NEG_Z, "from above is from below");
}

/// An application whose points are all selected.
fn app(context: &egui::Context) -> App {
    let mut app = App::new(Options::default(), Look::default(), Vec::new(), context);
    app.change(|document| {
        document.add(Layer::new("some", None, Arc::new(PointCloud::new(DVec3::ZERO, vec![[0.5; 3]; 10]))));
        let shown = document.shown();
        document.select(&shown, |_| true, SelectMode::Replace);
    });
    app
}

/// Presses a key in a window frame; with `question`, the frame shows a modal question.
fn press(app: &mut App, context: &egui::Context, key: Key, question: bool) {
    let mut input = egui::RawInput::default();
    let event = |key| Event::Key { key, physical_key: None, pressed: true, repeat: false, modifiers: Modifiers::NONE };
    input.events.push(event(key));
    claim(app, context, &mut input);
    let mut output = context.run_ui(input, |ui| {
        let context = ui.ctx().clone();
        perform(app, &context);
        if question {
            egui::Modal::new(egui::Id::unique("question")).show(&context, |ui| ui.label("Well?"));
        }
    });
    // There is nothing to draw on.
    output.textures_delta.clear();
}

#[test]
fn keys_do_nothing_behind_a_question() {
    let context = egui::Context::default();
    let mut app = app(&context);
    press(&mut app, &context, Key::F20, true);
    for key in [Key::Delete, Key::Tab] {
        press(&mut app, &context, key, true);
    }
    assert_eq!(app.session.history.undo_label(), None, "nothing was deleted");
    assert!(!app.view.look.dots, "nor shown in another way");
    press(&mut app, &context, Key::F20, false);
    for key in [Key::Delete, Key::Tab] {
        press(&mut app, &context, key, false);
    }
    assert!(app.session.history.undo_label().is_some(), "without a question they do what they do");
    assert!(app.view.look.dots, "both of them");
}

#[test]
fn escape_gives_up_a_drag_before_it_closes_a_window() {
    let context = egui::Context::default();
    let mut app = app(&context);
    app.ui.panels.help = true;
    app.ui.tool = Tool::Lasso;
    app.ui.tools.draw(&[egui::pos2(1.0, 2.0)]);
    press(&mut app, &context, Key::Escape, false);
    assert!(app.ui.panels.help && app.ui.tool == Tool::Lasso, "first the drag");
    press(&mut app, &context, Key::Escape, false);
    assert!(!app.ui.panels.help, "then the window");
}

#[test]
fn closing_nothing_is_nothing_to_undo() {
    let context = egui::Context::default();
    let mut app = App::new(Options::default(), Look::default(), Vec::new(), &context);
    run(&mut app, &context, Command::CloseAll);
    assert_eq!(app.undo(), None, "nothing was done");
}
