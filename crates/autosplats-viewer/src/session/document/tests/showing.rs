//! The one cloud that is rendered.

use std::sync::Arc;

use autosplats::cloud::glam::{DMat4, DQuat, DVec3};

use super::super::{Bits, ClipBox, Document, Layer, LayerId, ShownCloud};
use super::{FAR, cloud, document, edit, every};

/// The points that should be shown, in order.
fn expected(document: &Document) -> Vec<(LayerId, usize)> {
    let mut points = Vec::new();
    for layer in document.layers.iter().filter(|layer| layer.visible) {
        for point in 0..layer.cloud.len() {
            let there = !layer.edits.hidden.get(point) && !layer.edits.deleted.get(point);
            let clipped = document.clip.is_some_and(|clip| clip.enabled && !clip.contains(layer.position(point)));
            if there && !clipped {
                points.push((layer.id, point));
            }
        }
    }
    points
}

fn check(document: &Document, what: &str) -> ShownCloud {
    let shown = document.shown();
    let expected = expected(document);
    let points: Vec<_> = (0..shown.len()).map(|index| shown.point(index).expect("of a layer")).collect();
    assert_eq!(points, expected, "{what}");
    assert_eq!(shown.point(shown.len()), None, "{what}: no more");
    let shared = document.layers.iter().any(|layer| Arc::ptr_eq(&layer.cloud, &shown.cloud));
    let bytes = if shared { 0 } else { shown.cloud.byte_len() };
    assert!(document.shown_bytes() >= bytes, "{what}: takes {bytes} bytes, not {}", document.shown_bytes());
    assert_eq!(
        document.shown_bytes() == 0,
        shared || document.layers.iter().all(|l| !l.visible),
        "{what}: if it is made"
    );
    assert!(shown.shows(document), "{what}: shows what it was made of");
    for (index, &(id, point)) in expected.iter().enumerate() {
        let layer = document.layer(id).expect("the layer is there");
        let off = shown.cloud.world_position(index) - layer.position(point);
        // Positions are f32 within some units of the origin.
        assert!(off.length() < 1e-6, "{what}: point {point} is off by {off}");
        let color = layer.tint.or(layer.cloud.colors().map(|colors| colors[point]));
        assert_eq!(shown.cloud.colors().map(|colors| colors[index]), color, "{what}: colour");
    }
    let selected = shown.selected(document);
    let flags =
        |&(id, point): &(LayerId, usize)| document.layer(id).is_some_and(|layer| layer.edits.selected.get(point));
    assert_eq!(selected, Bits::from_fn(shown.len(), |index| flags(&expected[index])), "{what}: selected ones");
    shown
}

#[test]
fn an_untouched_layer_is_shared() {
    let mut document = Document::default();
    check(&document, "nothing");
    assert!(document.whole_bounds().is_none(), "nothing has no bounds");
    let id = document.add(Layer::new("only", None, cloud(1000, FAR)));
    edit(&mut document, id, |layer| layer.edits.selected = every(1000, 3));
    let shown = check(&document, "one layer");
    assert!(Arc::ptr_eq(&shown.cloud, &document.layers[0].cloud), "no copy is made");
    document.add(Layer::new("empty", None, cloud(0, DVec3::ZERO)));
    assert!(Arc::ptr_eq(&document.shown().cloud, &document.layers[0].cloud), "nothing beside it is nothing");
    assert!(shown.shows(&document), "and changes nothing");
}

#[test]
fn points_are_shown_where_they_are() {
    let (mut document, [first, second]) = document();
    check(&document, "two layers");
    document.set_tint(second, Some([1, 2, 3]));
    check(&document, "one in a colour");
    edit(&mut document, first, |layer| {
        layer.edits.selected = every(1000, 2);
        layer.edits.hidden = every(1000, 7);
        layer.edits.deleted = every(1000, 11);
    });
    check(&document, "some hidden and deleted");
    let turn = DMat4::from_translation(DVec3::new(0.5, 0.0, 0.0)) * DMat4::from_rotation_z(1.0);
    edit(&mut document, second, |layer| {
        layer.edits.selected = every(700, 2);
        layer.edits.moves = vec![(every(700, 3), turn), (every(700, 2), turn)];
    });
    check(&document, "some moved twice");
    let mut clip = ClipBox::new(FAR + DVec3::splat(0.1), FAR + DVec3::new(1.6, 0.9, 0.9));
    clip.rotation = DQuat::from_rotation_z(0.2);
    document.clip = Some(clip);
    check(&document, "clipped");
    document.set_visible(first, false);
    check(&document, "one invisible");
    document.set_visible(first, true);
    document.set_visible(second, false);
    check(&document, "the other one invisible");
    document.reorder(first, 1);
    document.set_visible(second, true);
    check(&document, "the other way round");
    edit(&mut document, first, |layer| layer.edits.hidden = every(1000, 1));
    check(&document, "all hidden");
    document.remove(second);
    assert!(check(&document, "and removed").len() == 0, "nothing is left");
}

#[test]
fn bounds_are_those_of_what_is_shown() {
    let (mut document, [first, second]) = document();
    document.set_visible(second, false);
    document.clip = Some(ClipBox::new(FAR, FAR + 0.5));
    let [low, high] = document.whole_bounds().expect("some points");
    document.clip = None;
    assert!(low.abs_diff_eq(FAR, 1e-6) && high.abs_diff_eq(FAR + 1.0, 1e-6), "{low} {high}");
    edit(&mut document, first, |layer| layer.edits.selected = Bits::from_fn(1000, |point| point == 1));
    let place = document.layers[0].position(1);
    assert_eq!(document.selected_bounds(), Some([place; 2]), "of one selected point, with all digits");
}

/// A change of a document's layer.
type Change = fn(&mut Document, LayerId);

#[test]
fn only_what_changes_the_picture_is_told() {
    let (mut document, [first, second]) = document();
    document.clip = Some(ClipBox { enabled: false, ..ClipBox::new(FAR, FAR + 1.0) });
    let unseen: [(&str, Change); 4] = [
        ("selecting", |document, id| edit(document, id, |layer| layer.edits.selected = every(9, 2))),
        ("renaming", |document, id| assert!(document.rename(id, "other"), "it is there")),
        ("a box that does not clip", |document, _| document.clip = None),
        ("hiding nothing", |document, _| assert_eq!(document.hide_selected(), 0, "nothing is selected")),
    ];
    let seen: [(&str, Change); 9] = [
        ("hiding", |document, id| edit(document, id, |layer| layer.edits.hidden = every(9, 2))),
        ("deleting", |document, id| edit(document, id, |layer| layer.edits.deleted = every(9, 2))),
        ("moving", |document, id| edit(document, id, |layer| layer.edits.moves.push((every(9, 2), DMat4::IDENTITY)))),
        ("placing", |document, id| assert!(document.set_pose(id, DMat4::from_scale(DVec3::splat(2.0))), "a pose")),
        ("tinting", |document, id| assert!(document.set_tint(id, Some([0; 3])), "it is there")),
        ("making invisible", |document, id| assert!(document.set_visible(id, false), "it is there")),
        ("removing", |document, id| assert!(document.remove(id).is_some(), "it is there")),
        ("reordering", |document, id| assert!(document.reorder(id, 1), "it is there")),
        ("clipping", |document, _| document.clip = Some(ClipBox::new(FAR, FAR + 1.0))),
    ];
    let shown = document.shown();
    for (changes, same) in [(&unseen[..], true), (&seen[..], false)] {
        for (what, change) in changes {
            let mut changed = document.clone();
            change(&mut changed, first);
            assert_eq!(shown.shows(&changed), same, "{what}");
        }
    }
    assert!(!document.set_pose(second, DMat4::ZERO), "a flat pose is refused");
    assert!(!document.set_pose(second, DMat4::from_translation(DVec3::NAN)), "and so is none");
    document.remove(second);
    assert!(!document.rename(second, "gone") && !document.reorder(second, 0), "what is not there cannot be changed");
}
