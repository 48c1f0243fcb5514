//! Selecting, deleting, undoing, and leaving.

use super::*;
use crate::session::Counts;

fn counts(window: &Window) -> Counts {
    window.app().session.document().counts()
}

/// Selects by a rectangle in the middle of the picture.
fn select(window: &mut Window) {
    window.press(Key::B);
    let (from, to) = (window.place(0.42, 0.35), window.place(0.58, 0.6));
    window.drag(PointerButton::Primary, Modifiers::NONE, from, to);
    window.until("something is selected", |window| counts(window).selected > 0);
}

#[test]
fn a_rectangle_selects_delete_removes_undo_brings_back() {
    let mut window = Window::with_statue();
    let all = counts(&window);
    assert_eq!(all.selected, 0, "nothing is selected at first");
    select(&mut window);
    let selected = counts(&window).selected;
    assert!(selected > 10 && selected < all.points / 2, "{selected} of {} points, those in front", all.points);
    window.step();
    assert!(window.says("selected"), "the number can be read");
    window.press(Key::Delete);
    let left = counts(&window);
    assert_eq!((left.selected, left.deleted), (0, selected), "they are gone");
    let shown = window.app().session.document().shown().len();
    assert_eq!(shown, all.points - selected, "and not shown");
    window.settle();
    assert!(window.says(&format!("{STATUE} *")), "the list marks what is not saved");
    window.key(CTRL, Key::Z);
    assert_eq!(counts(&window).deleted, 0, "they are back");
    window.key(CTRL_SHIFT, Key::Z);
    assert_eq!(counts(&window).deleted, selected, "and gone again");
    window.key(CTRL, Key::Z);
    window.key(CTRL, Key::Y);
    assert_eq!(counts(&window).deleted, selected, "by the other key, too");
    window.settle();
}

#[test]
fn shift_adds_and_through_reaches_behind() {
    let mut window = Window::with_statue();
    select(&mut window);
    let first = counts(&window).selected;
    let (from, to) = (window.place(0.3, 0.6), window.place(0.7, 0.8));
    window.drag(PointerButton::Primary, SHIFT, from, to);
    window.until("more is selected", |window| counts(window).selected > first);
    window.drag(PointerButton::Primary, CTRL, from, to);
    window.until("less is selected", |window| counts(window).selected <= first);
    window.click_on("Through");
    select(&mut window);
    window.until("what is behind is selected, too", |window| counts(window).selected > first);
}

#[test]
fn leaving_with_edits_asks() {
    let mut window = Window::with_statue();
    let close = |window: &mut Window| {
        let viewports = &mut window.harness.input_mut().viewports;
        viewports.entry(ViewportId::ROOT).or_default().events.push(egui::ViewportEvent::Close);
        window.commands.clear();
        window.steps(2);
        // A window closes unless the close is cancelled.
        !window.commands.contains(&ViewportCommand::CancelClose)
    };
    assert!(close(&mut window), "nothing is lost, so nothing is asked");
    window.key(CTRL, Key::A);
    assert!(counts(&window).selected > 0, "all is selected");
    assert!(close(&mut window), "a selection is no edit");
    window.press(Key::Delete);
    window.step();
    assert!(!close(&mut window), "the window stays");
    assert!(window.says("Edits are not saved") && window.says(STATUE), "and says why: {:?}", window.words());
    window.click_on("Stay");
    assert!(!window.says("Edits are not saved") && !window.app().ui.panels.quit, "staying is possible");
    assert!(!close(&mut window), "it asks again");
    window.commands.clear();
    window.click_on("Leave without saving");
    assert!(window.app().ui.panels.quit && window.commands.contains(&ViewportCommand::Close), "leaving is possible");
    assert!(close(&mut window), "now it closes");
}
