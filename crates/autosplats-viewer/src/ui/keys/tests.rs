use std::sync::Arc;

use autosplats::cloud::PointCloud;
use autosplats::cloud::glam::DVec3;

use super::*;
use crate::Options;
use crate::app::App;
use crate::session::{Layer, SelectMode};
use crate::ui::Tool;
use crate::view::Look;

/// An application whose points are all selected.
fn app(context: &egui::Context) -> App {
    let mut app = App::new(Options::default(), Look::default(), Vec::new(), context);
    app.session.change(|document| {
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
    app.ui.claim(context, &mut input);
    let mut output = context.run_ui(input, |ui| {
        let context = ui.ctx().clone();
        app.keys(&context);
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
    app.ui.tools.current = Tool::Lasso;
    app.ui.tools.draw(&[egui::pos2(1.0, 2.0)]);
    press(&mut app, &context, Key::Escape, false);
    assert!(app.ui.panels.help && app.ui.tools.current == Tool::Lasso, "first the drag");
    press(&mut app, &context, Key::Escape, false);
    assert!(!app.ui.panels.help, "then the window");
}

#[test]
fn closing_nothing_is_nothing_to_undo() {
    let context = egui::Context::default();
    let mut app = App::new(Options::default(), Look::default(), Vec::new(), &context);
    app.run(Command::CloseAll, &context);
    assert_eq!(app.session.undo(), None, "nothing was done");
}
