//! Inputs that lie too far apart for one picture.

use autosplats_cloud::PointCloud;
use autosplats_cloud::glam::{DMat4, DVec3};

/// Gap between two inputs, in sizes of the larger one, above which a picture of both shows each as a few pixels.
const MAX_GAP_SIZES: f64 = 200.0;

/// Notes the inputs that lie too far from all others to be seen in one picture. Takes the box of each in the world.
pub(super) fn note_distant_inputs(boxes: &[[DVec3; 2]], note: impl Fn(usize, &str)) {
    if boxes.len() < 2 {
        return;
    }
    // Gap between two boxes, in diagonals of the larger one.
    let apart = |[low, high]: [DVec3; 2], [other_low, other_high]: [DVec3; 2]| {
        let gap = (other_low - high).max(low - other_high).max(DVec3::ZERO).length();
        let size = (high - low).length().max((other_high - other_low).length());
        if size > 0.0 { gap / size } else { 0.0 }
    };
    let nearest = |at: usize| {
        let others = boxes.iter().enumerate().filter(|&(other, _)| other != at);
        others.map(|(_, &other)| apart(boxes[at], other)).fold(f64::INFINITY, f64::min)
    };
    let mut far: Vec<_> =
        (0..boxes.len()).map(|at| (at, nearest(at))).filter(|&(_, apart)| apart > MAX_GAP_SIZES).collect();
    // If every input is far from all others, the first is the reference.
    if far.len() == boxes.len() {
        far.remove(0);
    }
    for (at, apart) in far {
        note(
            at,
            &format!(
                "lies {apart:.0} times the inputs' size away from the others; a picture hardly shows both; move it with --pose"
            ),
        );
    }
}

/// Bounding box of all finite points, in world coordinates.
pub(super) fn world_box((cloud, world_from_input): &(PointCloud, DMat4)) -> [DVec3; 2] {
    let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    let each = cloud
        .positions()
        .iter()
        .map(|&position| world_from_input.transform_point3(cloud.origin() + DVec3::from(position.map(f64::from))));
    each.filter(|place| place.is_finite()).fold(none, |[low, high], place| [low.min(place), high.max(place)])
}
