//! Hiding, deleting and moving.

use autosplats::cloud::glam::{DMat4, DVec3};

use super::super::{ClipBox, Document, LayerId, about};
use super::{FAR, contents, document, edit, every, select_every};

fn positions(document: &Document, id: LayerId) -> Vec<DVec3> {
    let layer = document.layer(id).expect("the layer is there");
    (0..layer.cloud.len()).map(|point| layer.position(point)).collect()
}

#[test]
fn points_are_hidden_and_deleted() {
    let (mut document, _) = document();
    let total = document.shown().len();
    select_every(&mut document, 10);
    let count = document.hide_selected();
    assert_eq!(count, total.div_ceil(10), "a tenth");
    assert_eq!(document.shown().len(), total - count, "is seen no longer");
    assert_eq!((document.counts().hidden, document.counts().selected), (count, 0), "and counted");
    select_every(&mut document, 3);
    let deleted = document.delete_selected();
    assert_eq!(deleted, (total - count).div_ceil(3), "a third of the others");
    assert_eq!(document.show_all(), count, "the hidden ones are back");
    assert_eq!(document.shown().len(), total - deleted, "the deleted ones are not");
    assert_eq!(document.counts().deleted, deleted, "they are counted");
    assert_eq!(document.counts().points, total, "and still among all");
    let before = contents(&document);
    assert_eq!(document.delete_selected() + document.hide_selected() + document.show_all(), 0, "none is selected");
    assert_eq!(contents(&document), before, "nothing is done to none");
}

#[test]
fn what_cannot_be_seen_is_safe() {
    let (mut document, [first, second]) = document();
    select_every(&mut document, 1);
    document.set_visible(second, false);
    document.clip = Some(ClipBox::new(FAR, FAR + DVec3::new(1.0, 1.0, 0.5)));
    edit(&mut document, first, |layer| layer.edits.hidden = every(1000, 2));
    let seen = document.shown().len();
    let edits: [fn(&mut Document) -> usize; 4] = [
        Document::delete_selected,
        Document::hide_selected,
        |document| document.move_selected(&DMat4::from_translation(DVec3::X)),
        |document| document.rotate_selected(DVec3::Z, 1.0),
    ];
    for edit in edits {
        let mut changed = document.clone();
        assert_eq!(edit(&mut changed), seen, "only what is seen");
        (changed.clip, changed.layers[0].edits.hidden) = (None, document.layers[0].edits.hidden.clone());
        changed.set_visible(second, true);
        assert!(changed.layers[1].edits.deleted.is_empty() && changed.layers[1].edits.hidden.is_empty(), "invisible");
        let (before, after) = (positions(&document, first), positions(&changed, first));
        let layer = &changed.layers[0];
        for point in 0..1000 {
            let clip = document.clip.expect("a box");
            if point % 2 == 0 || !clip.contains(before[point]) {
                assert!(!layer.edits.deleted.get(point) && before[point] == after[point], "point {point} is safe");
            }
        }
    }
}

#[test]
fn cropping_leaves_the_selection() {
    let (mut document, _) = document();
    let before = contents(&document);
    assert_eq!(document.crop_to_selection(), 0, "nothing is selected");
    assert_eq!(contents(&document), before, "so nothing is deleted");
    let shown = select_every(&mut document, 4);
    let kept = shown.selected(&document).count();
    assert_eq!(document.crop_to_selection(), shown.len() - kept, "the others go");
    let cropped = document.shown();
    assert_eq!(cropped.selected(&document), every(kept, 1), "all that is left is selected");
}

#[test]
fn moves_are_of_the_world() {
    let (mut document, [first, second]) = document();
    let old = [first, second].map(|id| positions(&document, id));
    select_every(&mut document, 3);
    let matrix = about(FAR, DMat4::from_axis_angle(DVec3::ONE.normalize(), 0.7)) * DMat4::from_translation(DVec3::Y);
    let count = document.move_selected(&matrix);
    assert_eq!(count, document.counts().selected, "what is selected moves, and stays so");
    for (id, old) in [first, second].into_iter().zip(&old) {
        let selected = document.layer(id).expect("there").edits.selected.clone();
        for (point, (new, &old)) in positions(&document, id).into_iter().zip(old).enumerate() {
            let wanted = if selected.get(point) { matrix.transform_point3(old) } else { old };
            // Some steps of f64 at 5e6.
            assert!(new.abs_diff_eq(wanted, 1e-8), "point {point}: {new} is not {wanted}");
        }
    }
    document.move_selected(&DMat4::from_translation(DVec3::X));
    assert_eq!(document.layers[0].edits.moves.len(), 1, "a second move of the same points joins the first");
    select_every(&mut document, 2);
    document.move_selected(&DMat4::from_translation(DVec3::X));
    document.move_selected(&DMat4::from_translation(DVec3::NEG_X));
    assert_eq!(document.layers[0].edits.moves.len(), 1, "there and back is no move");
    let before = contents(&document);
    for refused in [DMat4::IDENTITY, DMat4::ZERO, DMat4::from_translation(DVec3::NAN), DMat4::from_scale(DVec3::X)] {
        assert_eq!(document.move_selected(&refused), 0, "{refused} moves nothing");
    }
    assert_eq!(contents(&document), before, "at all");
}

#[test]
fn drags_move_from_where_they_began() {
    let (mut document, [first, second]) = document();
    select_every(&mut document, 2);
    document.move_selected(&DMat4::from_translation(DVec3::Y));
    let before = contents(&document);
    let grip = document.grip();
    let mut dragged = document.clone();
    for way in [1.0, 3.0, 2.0] {
        assert!(dragged.move_gripped(&grip, &DMat4::from_translation(DVec3::X * way)) > 0, "by {way}");
    }
    let mut moved = document.clone();
    moved.move_selected(&DMat4::from_translation(DVec3::X * 2.0));
    assert_eq!(contents(&dragged), contents(&moved), "a drag is a move from its first place to its last");
    assert_eq!(dragged.move_gripped(&grip, &DMat4::ZERO), 0, "nothing is flattened");
    dragged.move_gripped(&grip, &DMat4::IDENTITY);
    assert_eq!(contents(&dragged), before, "and can be given up");
    dragged.remove(first);
    dragged.reload(second, &super::cloud(10, FAR));
    let before = contents(&dragged);
    assert_eq!(dragged.move_gripped(&grip, &DMat4::from_translation(DVec3::X)), 0, "what has gone is let go");
    assert_eq!(contents(&dragged), before, "and nothing else is touched");
}

#[test]
fn turning_is_about_the_centre() {
    let (mut document, [first, _]) = document();
    select_every(&mut document, 1);
    let [low, high] = document.selected_bounds().expect("all are selected");
    let old = positions(&document, first);
    document.rotate_selected(DVec3::Z * 3.0, std::f64::consts::PI);
    let centre = low.midpoint(high);
    for (new, old) in positions(&document, first).into_iter().zip(old) {
        let wanted = centre + DVec3::new(-1.0, -1.0, 1.0) * (old - centre);
        assert!(new.abs_diff_eq(wanted, 1e-8), "{new} is not {wanted}");
    }
    assert_eq!(document.rotate_selected(DVec3::ZERO, 1.0), 0, "about no axis");
    document.select_none();
    assert_eq!(document.rotate_selected(DVec3::Z, 1.0), 0, "of no points");
}
