//! Everything has a name and fits into a small window.

use super::*;
use crate::ui::{Command, Tool};

#[test]
fn everything_that_can_be_used_has_a_name() {
    let mut window = Window::with_statue();
    let mut nameless = Vec::new();
    let mut look = |window: &Window, state: &str| {
        nameless.extend(window.harness.unnamed_widgets().into_iter().map(|widget| format!("{state}: {widget}")));
    };
    look(&window, "at first");
    window.press(Key::L);
    window.press(Key::P);
    window.key(CTRL, Key::E);
    window.steps(3);
    look(&window, "look, statistics and export");
    let context = window.harness.ctx.clone();
    window.press(Key::Escape);
    window.press(Key::H);
    window.press(Key::C);
    window.harness.state_mut().run(Command::Screenshot, &context);
    window.steps(3);
    assert!(window.says("Radius of the brush") || window.app().ui.tools.current == Tool::Brush, "C takes the brush");
    look(&window, "picture, help and brush");
    window.key(CTRL, Key::T);
    window.steps(3);
    look(&window, "film");
    window.press(Key::Escape);
    window.harness.state_mut().run(Command::SaveState, &context);
    window.steps(3);
    look(&window, "session");
    (0..4).for_each(|_| window.press(Key::Escape));
    for menu in ["File", "Edit", "View", "Window"] {
        window.click_on(menu);
        look(&window, menu);
        window.press(Key::Escape);
        window.steps(2);
    }
    assert!(nameless.is_empty(), "{} widgets have no name:\n{}", nameless.len(), nameless.join("\n"));
}

#[test]
fn a_widget_without_a_name_is_found() {
    let mut harness = Harness::builder().with_accessibility_check(false).build_ui(|ui| {
        let mut on = true;
        ui.checkbox(&mut on, "");
        ui.checkbox(&mut on, "On");
    });
    harness.run_steps(2);
    assert_eq!(harness.unnamed_widgets().len(), 1, "one of the two has no name");
}

/// Share of the window that the picture has left, and the widgets that end outside the window.
fn crowding(window: &Window) -> (f32, Vec<String>) {
    let screen = Rect::from_min_size(Pos2::ZERO, SMALL).expand(1.0);
    let picture = window.picture();
    let mut outside = Vec::new();
    for node in window.harness.root().children_recursive() {
        let access = node.accesskit_node();
        let used =
            matches!(access.role(), Role::Button | Role::CheckBox | Role::Slider | Role::ComboBox | Role::Window);
        let Some(bounds) = access.bounding_box().filter(|_| used && !access.is_hidden()) else { continue };
        let rect = Rect::from_min_max(
            egui::pos2(bounds.x0 as f32, bounds.y0 as f32),
            egui::pos2(bounds.x1 as f32, bounds.y1 as f32),
        );
        // Widgets scrolled out of a list may lie below or above the window, never beside it.
        let beside = rect.left() < screen.left() || rect.right() > screen.right();
        let lost = access.role() == Role::Window && !screen.contains_rect(rect);
        if beside || lost {
            outside.push(format!("{:?} {:?} at {rect}", access.role(), access.label()));
        }
    }
    (picture.area() / (SMALL.x * SMALL.y), outside)
}

#[test]
fn a_small_window_has_room_for_everything() {
    let mut window = Window::with_statue();
    window.press(Key::L);
    window.steps(3);
    let (share, outside) = crowding(&window);
    assert!(share > 0.4, "{share} of the window is left to the picture");
    assert!(outside.is_empty(), "with both panels: {outside:#?}");
    window.press(Key::P);
    window.steps(3);
    assert!(crowding(&window).1.is_empty(), "statistics: {:#?}", crowding(&window).1);
    window.press(Key::P);
    for command in [Command::Export, Command::Screenshot, Command::Help, Command::Film] {
        let context = window.harness.ctx.clone();
        window.harness.state_mut().run(command, &context);
        window.steps(4);
        let (_, outside) = crowding(&window);
        assert!(outside.is_empty(), "{command:?}: {outside:#?}");
        let panels = &mut window.harness.state_mut().ui.panels;
        (panels.export.open, panels.picture.open, panels.help, panels.film.open) = (false, false, false, false);
        window.steps(2);
    }
    // The check can fail: it finds widgets outside the small window.
    window.harness.set_size(SMALL + egui::vec2(300.0, 200.0));
    window.steps(3);
    assert!(!crowding(&window).1.is_empty(), "a larger window reaches beyond the small one");
}
