//! Undo, its limits, and unsaved edits.

use autosplats::cloud::glam::{DMat4, DVec3};

use super::super::{Document, History, Layer, LayerId, label};
use super::{FAR, cloud, contents, document, edit, every, select_every};

/// A history of edits of all kinds, and the contents of the document before each edit and at the end.
fn edited() -> (History, Vec<String>) {
    let mut history = History::default();
    history.replace(document().0);
    let mut states = vec![contents(history.current())];
    let edits: [fn(&mut Document) -> usize; 6] = [
        Document::hide_selected,
        Document::delete_selected,
        |document| document.move_selected(&DMat4::from_translation(DVec3::X)),
        |document| document.rotate_selected(DVec3::Z, 1.0),
        Document::show_all,
        Document::crop_to_selection,
    ];
    for (step, edit) in edits.into_iter().enumerate() {
        let mut document = history.current().clone();
        select_every(&mut document, step + 2);
        let count = edit(&mut document);
        history.record(label("Edit", count), document);
        states.push(contents(history.current()));
    }
    let mut document = history.current().clone();
    document.layers.pop();
    history.record("Remove layer", document);
    states.push(contents(history.current()));
    (history, states)
}

#[test]
fn undo_and_redo_return_the_same_documents() {
    let (mut history, states) = edited();
    assert_eq!(history.undo_label(), Some("Remove layer"), "the last step");
    for _ in 0..2 {
        for state in states.iter().rev().skip(1) {
            assert!(history.undo().is_some(), "a step to take back");
            assert_eq!(contents(history.current()), *state, "as it was");
        }
        assert_eq!((history.undo(), history.undo_label()), (None, None), "no more");
        for state in &states[1..] {
            assert!(history.redo().is_some(), "a step to do again");
            assert_eq!(contents(history.current()), *state, "as it became");
        }
        assert_eq!((history.redo(), history.redo_label()), (None, None), "no more");
    }
    history.undo();
    assert_eq!(history.redo_label(), Some("Remove layer"), "can be done again");
    history.replace(history.current().clone());
    assert!(history.redo_label().is_some(), "even after what is no step");
    history.record("other", history.current().clone());
    assert_eq!(history.redo_label(), None, "but not after another");
}

#[test]
fn memory_of_old_documents_is_bounded() {
    let len = 64_000;
    // Each set takes 8 kB.
    let (most, set) = (100_000, len / 8);
    let mut history = History::with_limits(1000, most);
    let mut document = Document::default();
    let id = document.add(Layer::new("only", None, cloud(len, FAR)));
    history.replace(document);
    assert_eq!(history.old_bytes(), 0, "nothing old");
    for step in 2..50 {
        let mut document = history.current().clone();
        edit(&mut document, id, |layer| layer.edits.deleted = every(len, step));
        history.record("Delete", document);
        let old = (step - 2) * set;
        assert!(history.old_bytes() <= most, "{} bytes", history.old_bytes());
        assert!(old > most || history.old_bytes() == old, "step {step}: all that may be is kept");
    }
    let mut undone = 0;
    while history.undo().is_some() {
        undone += 1;
        assert!(history.old_bytes() <= most, "undone, too");
    }
    assert_eq!(undone, most / set, "as many as fit");
    let mut document = history.current().clone();
    document.remove(id);
    history.record("Remove layer", document);
    assert!(history.old_bytes() > most, "a layer that only old documents have counts");
    assert_eq!(history.undo().as_deref(), Some("Remove layer"), "but what was done last can be undone");
    assert_eq!(history.undo(), None, "that alone");
    assert!(history.current().layer(id).is_some(), "and it is there again");
}

#[test]
fn number_of_old_documents_is_bounded() {
    let mut history = History::with_limits(5, usize::MAX);
    for step in 0..20 {
        history.record(step.to_string(), Document::default());
    }
    let undone: Vec<_> = std::iter::from_fn(|| history.undo()).collect();
    assert_eq!(undone, ["19", "18", "17", "16", "15"], "the newest are kept");
}

#[test]
fn only_changes_of_points_are_to_be_saved() {
    let mut history = History::default();
    let (document, [first, second]) = document();
    history.replace(document);
    let unsaved = |history: &History| history.unsaved().collect::<Vec<LayerId>>();
    let change = |history: &mut History, change: &dyn Fn(&mut Document)| {
        let mut document = history.current().clone();
        change(&mut document);
        history.record("Change", document);
    };
    assert!(!history.is_changed_since_saved(), "opened, placed or not");
    let harmless: [&dyn Fn(&mut Document) -> bool; 5] = [
        &|document: &mut Document| select_every(document, 2).len() > 0,
        &|document: &mut Document| document.hide_selected() > 0,
        &|document: &mut Document| document.set_visible(second, false),
        &|document: &mut Document| document.rename(first, "other") && document.set_tint(first, Some([9; 3])),
        &|document: &mut Document| document.reorder(first, 1),
    ];
    for harmless in harmless {
        change(&mut history, &|document| assert!(harmless(document), "something is done"));
        assert!(!history.is_changed_since_saved(), "no point was changed");
    }
    change(&mut history, &|document| {
        select_every(document, 5);
        assert!(document.delete_selected() > 0, "some are deleted");
    });
    assert_eq!(unsaved(&history), [first], "the visible layer");
    assert!(history.is_unsaved(first) && !history.is_unsaved(second), "asked for each");
    history.undo();
    assert!(!history.is_changed_since_saved(), "as it was opened");
    history.redo();
    let written = history.current().clone();
    change(&mut history, &|document| assert!(document.set_pose(second, DMat4::IDENTITY), "placed elsewhere"));
    history.mark_saved(&written, first);
    history.mark_saved(&written, second);
    assert_eq!(unsaved(&history), [second], "placed after it was written");
    history.undo();
    assert!(!history.is_changed_since_saved(), "what was written");
    history.undo();
    assert_eq!(unsaved(&history), [first], "undone what is in the file");
}

#[test]
fn labels_count() {
    let labels = [0, 1, 12, 999, 1000, 1_234_567].map(|points| label("Delete", points));
    assert_eq!(labels[1], "Delete 1 point", "one");
    assert_eq!(
        [&labels[0], &labels[2], &labels[3], &labels[4], &labels[5]],
        ["Delete 0 points", "Delete 12 points", "Delete 999 points", "Delete 1,000 points", "Delete 1,234,567 points"],
        "others"
    );
}

#[test]
fn files_that_come_outlast_undo() {
    let mut history = History::default();
    let first = Layer::new("first", None, cloud(10, FAR));
    let id = first.id;
    history.everywhere(|document| {
        document.add(first.clone());
    });
    let mut document = history.current().clone();
    edit(&mut document, id, |layer| layer.edits.deleted = every(10, 2));
    history.record("Delete", document);
    let second = Layer::new("second", None, cloud(20, FAR));
    history.everywhere(|document| {
        document.add(second.clone());
    });
    assert_eq!(history.undo().as_deref(), Some("Delete"), "the edit is undone");
    assert!(history.current().layer(second.id).is_some(), "the file stays");
    assert_eq!(history.redo().as_deref(), Some("Delete"), "and done again");
    history.reload(id, &cloud(30, FAR));
    assert!(!history.is_unsaved(id), "what was done was of other points");
    history.undo();
    assert_eq!(
        history.current().layer(id).map(|layer| layer.cloud.len()),
        Some(30),
        "undo does not bring old points back"
    );
}

#[test]
fn what_is_incomplete_is_not_edited() {
    let mut document = Document::default();
    let id = document.add(Layer { incomplete: true, ..Layer::new("growing", None, cloud(10, FAR)) });
    let shown = document.shown();
    document.select_all(&shown);
    assert_eq!(
        document.delete_selected() + document.hide_selected() + document.crop_to_selection(),
        0,
        "nothing is done"
    );
    document.complete(id);
    let shown = document.shown();
    document.select_all(&shown);
    assert_eq!(document.delete_selected(), 10, "until it is complete");
}
