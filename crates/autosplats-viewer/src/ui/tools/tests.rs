use std::sync::Arc;
use std::time::{Duration, Instant};

use autosplats::cloud::PointCloud;
use eframe::egui::{Event, Key, Modifiers, PointerButton, Rect, pos2, vec2};

use super::*;
use crate::Options;
use crate::app::App;
use crate::session::Layer;
use crate::view::{Answer, Goal, Look, Outcome};

/// An application in a window of 200 by 200 points. Its cloud has two points, one of them in the middle of the window.
fn app(context: &egui::Context, tool: Tool) -> App {
    let mut app = App::new(Options::default(), Look::default(), Vec::new(), context);
    let cloud = PointCloud::new(DVec3::ZERO, vec![[0.0; 3], [0.5, 0.0, 0.0]]);
    app.session.change(|document| document.add(Layer::new("two", None, Arc::new(cloud))));
    let camera = autosplats::Camera {
        eye: DVec3::new(0.0, -3.0, 0.0),
        look_at: DVec3::ZERO,
        up: DVec3::Z,
        projection: autosplats::Projection::PerspectiveFovDeg(40.0),
    };
    app.view.set_camera(&camera);
    app.ui.tools.current = tool;
    // Selecting visible points only would need a picture.
    app.ui.tools.through = true;
    frame(&mut app, context, Event::PointerMoved(pos2(100.0, 100.0)));
    app
}

fn frame(app: &mut App, context: &egui::Context, event: Event) {
    let rect = Rect::from_min_size(Pos2::ZERO, vec2(200.0, 200.0));
    let escape = matches!(event, Event::Key { key: Key::Escape, .. });
    let input = egui::RawInput { screen_rect: Some(rect), events: vec![event], ..egui::RawInput::default() };
    let mut output = context.run_ui(input, |ui| {
        if escape {
            app.ui.tools.cancel_drag();
        }
        let response = ui.allocate_rect(rect, egui::Sense::click_and_drag());
        app.ui.tools.drag(&app.session, &app.view, &response, [200, 200]);
    });
    // There is nothing to draw on.
    output.textures_delta.clear();
}

fn button(pressed: bool, place: Pos2) -> Event {
    Event::PointerButton { pos: place, button: PointerButton::Primary, pressed, modifiers: Modifiers::NONE }
}

/// Number of points hit by the requested selection, if there was one.
fn hits(app: &App) -> Option<usize> {
    // Tasks run in order: when this one is answered, so are all before it.
    let (wish, region) = (Box::new(app.view.wish(&app.session, [200, 200], false)), Region::brush(&[], 1.0));
    app.view.render.task(Task::Select { wish, region, through: true, mode: SelectMode::Intersect });
    let mut hits = None;
    let end = Instant::now() + Duration::from_secs(60);
    while Instant::now() < end {
        for answer in app.view.render.answers() {
            match answer {
                Answer::Done(Outcome::Selected { mode: SelectMode::Intersect, .. }) => return hits,
                Answer::Done(Outcome::Selected { hits: found, .. }) => {
                    hits = Some(found.into_iter().filter(|hit| *hit).count());
                }
                Answer::Failed(why) => panic!("{why}"),
                _ => {}
            }
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    panic!("the thread does not answer");
}

#[test]
fn a_click_of_the_brush_selects_what_is_under_it() {
    let context = egui::Context::default();
    for (tool, wanted) in [(Tool::Brush, Some(1)), (Tool::Lasso, None)] {
        let mut app = app(&context, tool);
        frame(&mut app, &context, button(true, pos2(100.0, 100.0)));
        frame(&mut app, &context, button(false, pos2(100.0, 100.0)));
        assert_eq!(hits(&app), wanted, "{tool:?}");
        assert!(app.ui.tools.way.is_empty(), "nothing is drawn any more");
    }
}

#[test]
fn a_drag_that_is_given_up_selects_nothing() {
    for escape in [false, true] {
        let context = egui::Context::default();
        let mut app = app(&context, Tool::Brush);
        frame(&mut app, &context, button(true, pos2(100.0, 100.0)));
        frame(&mut app, &context, Event::PointerMoved(pos2(90.0, 120.0)));
        frame(&mut app, &context, Event::PointerMoved(pos2(80.0, 140.0)));
        if escape {
            let (key, modifiers) = (Key::Escape, Modifiers::NONE);
            let event = Event::Key { key, physical_key: None, pressed: true, repeat: false, modifiers };
            frame(&mut app, &context, event);
        }
        frame(&mut app, &context, Event::PointerMoved(pos2(70.0, 120.0)));
        frame(&mut app, &context, button(false, pos2(70.0, 100.0)));
        assert_eq!(hits(&app), (!escape).then_some(1), "given up: {escape}");
        frame(&mut app, &context, button(true, pos2(100.0, 100.0)));
        frame(&mut app, &context, Event::PointerMoved(pos2(110.0, 120.0)));
        frame(&mut app, &context, button(false, pos2(110.0, 120.0)));
        assert_eq!(hits(&app), Some(1), "the next drag selects");
    }
}

#[test]
fn pictures_of_dots_have_dots_as_large_as_the_screen() {
    let context = egui::Context::default();
    let mut app = app(&context, Tool::Navigate);
    (app.view.look.dots, app.view.look.dot_size) = (true, 4);
    app.view.look.backend = autosplats::Backend::Cpu;
    let (wish, goal) = (Box::new(app.view.wish(&app.session, [40, 40], false)), Goal::Film(0));
    app.view.render.task(Task::Photograph { wish, goal });
    let end = Instant::now() + Duration::from_secs(60);
    let image = loop {
        assert!(Instant::now() < end, "the thread does not answer");
        match app.view.render.answers().find(|answer| !matches!(answer, Answer::Device(_))) {
            Some(Answer::Done(Outcome::Photographed { image, .. })) => break image,
            Some(Answer::Failed(why)) => panic!("{why}"),
            _ => std::thread::sleep(Duration::from_millis(1)),
        }
    };
    assert_eq!([image.width, image.height], [40, 40], "as large as was asked for");
    let pixel = |x: usize, y: usize| image.pixels[y * 40 + x];
    let places = (0..40).flat_map(|y| (0..40).map(move |x| (x, y)));
    assert!(places.clone().all(|(x, y)| pixel(x, y) == pixel(x / 4 * 4, y / 4 * 4)), "dots are 4 pixels wide");
    assert!(places.clone().any(|(x, y)| pixel(x, y) != pixel(0, 0)), "and there are some");
}

#[test]
fn a_double_click_measures_one_corner() {
    let context = egui::Context::default();
    let mut app = app(&context, Tool::Measure);
    let shown = Arc::new(app.session.document().shown());
    for index in [0, 0, 1, 1, 0] {
        let seen = PickHit { index, shown: Arc::clone(&shown), surface: DVec3::ZERO };
        app.ui.tools.picked(&mut app.session, Purpose::Measure, Some(seen));
    }
    let [one, other] = [DVec3::ZERO, DVec3::new(0.5, 0.0, 0.0)];
    assert_eq!(app.ui.tools.measured, [one, other, one], "none twice in a row");
}

#[test]
fn all_dots_can_be_selected() {
    let context = egui::Context::default();
    let mut app = app(&context, Tool::Lasso);
    let reconstruction = app.view.look.settings.reconstruction.clone();
    assert!(reconstruction.outlier_expansions.is_some(), "outliers are left out of surfaces");
    assert_eq!(
        app.view.wish(&app.session, [9, 9], false).of_points().settings.reconstruction,
        reconstruction,
        "and stay so"
    );
    app.view.look.dots = true;
    let wish = app.view.wish(&app.session, [9, 9], false).of_points();
    assert_eq!(wish.dots, None, "found by a surface");
    assert_eq!(wish.settings.reconstruction.outlier_expansions, None, "that has all points");
}
