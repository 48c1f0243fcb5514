//! The selection.

use super::super::{Bits, ClipBox, Document, SelectMode};
use super::{FAR, document, edit, every, select_every};

/// The selection, as indices of shown points.
fn selected(document: &Document) -> Bits {
    document.shown().selected(document)
}

/// Whether a point is selected afterwards, given whether it was selected and whether it is hit.
type Rule = fn(bool, bool) -> bool;

#[test]
fn modes_combine_with_what_was_selected() {
    let (mut document, [first, _]) = document();
    edit(&mut document, first, |layer| layer.edits.hidden = every(1000, 5));
    let shown = document.shown();
    let (old, hit) = (|index: usize| index.is_multiple_of(2), |index: usize| index.is_multiple_of(3));
    let rules: [(SelectMode, Rule); 4] = [
        (SelectMode::Replace, |_, hit| hit),
        (SelectMode::Add, |old, hit| old || hit),
        (SelectMode::Subtract, |old, hit| old && !hit),
        (SelectMode::Intersect, |old, hit| old && hit),
    ];
    for (mode, rule) in rules {
        let mut changed = document.clone();
        changed.select(&shown, old, SelectMode::Replace);
        changed.select(&shown, hit, mode);
        let wanted = Bits::from_fn(shown.len(), |index| rule(old(index), hit(index)));
        assert_eq!(selected(&changed), wanted, "{mode:?}");
        assert_eq!(changed.counts().selected, wanted.count(), "{mode:?}: counted");
        assert!(shown.shows(&changed), "{mode:?}: the picture needs no other cloud");
        assert!(
            (0..1000).step_by(5).all(|point| !changed.layers[0].edits.selected.get(point)),
            "{mode:?}: no hidden point"
        );
    }
}

#[test]
fn a_selection_and_its_inverse_are_everything_once() {
    let (mut document, [first, second]) = document();
    edit(&mut document, first, |layer| layer.edits.deleted = every(1000, 4));
    for clip in [None, Some(ClipBox::new(FAR, FAR + 0.75))] {
        document.clip = clip;
        let shown = select_every(&mut document, 3);
        let before = selected(&document);
        document.select_inverse(&shown);
        let after = selected(&document);
        assert_eq!(before.or(&after), every(shown.len(), 1), "together they are all");
        assert_eq!(before.without(&after), before, "and none is in both");
        document.select_inverse(&shown);
        assert_eq!(selected(&document), before, "twice is not at all");
        document.select_all(&shown);
        assert_eq!(document.counts().selected, shown.len(), "all");
        document.select_none();
        assert!(selected(&document).is_empty(), "none");
    }
    document.clip = None;
    let shown = select_every(&mut document, 1);
    document.set_visible(second, false);
    let visible = document.counts_of(&document.layers[0]).selected;
    assert_eq!(document.counts().selected, visible, "what is not visible is not reached");
    document.select(&document.shown(), |_| true, SelectMode::Add);
    assert!(!document.layers[1].edits.selected.is_empty(), "but still selected");
    document.select(&document.shown(), |_| false, SelectMode::Replace);
    assert!(document.layers.iter().all(|layer| layer.edits.selected.is_empty()), "until others are instead");
    document.remove(first);
    document.select_all(&shown);
    assert_eq!(document.layers.len(), 1, "what was shown may be gone");
}
