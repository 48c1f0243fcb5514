//! Boxes around points.

use autosplats::cloud::{
    PointCloud,
    glam::{DMat4, DVec3},
};
use rayon::prelude::*;

/// Bounds of an [overview](Document::overview).
pub(crate) fn bounds_of(overview: &PointCloud) -> Option<[DVec3; 2]> {
    bounds(overview.len(), |index| Some(overview.world_position(index)))
}

/// Bounds of all finite places; `None` if there are none.
pub(super) fn bounds(len: usize, place: impl Fn(usize) -> Option<DVec3> + Sync) -> Option<[DVec3; 2]> {
    let none = || [DVec3::INFINITY, DVec3::NEG_INFINITY];
    let join = |[low, high]: [DVec3; 2], [min, max]: [DVec3; 2]| [low.min(min), high.max(max)];
    let grow = |bounds, index| match place(index) {
        Some(place) if place.is_finite() => join(bounds, [place; 2]),
        _ => bounds,
    };
    let [low, high] = (0..len).into_par_iter().with_min_len(1 << 10).fold(none, grow).reduce(none, join);
    low.cmple(high).all().then_some([low, high])
}

/// Box around a box that is moved.
pub(super) fn placed_box([low, high]: [DVec3; 2], matrix: &DMat4) -> [DVec3; 2] {
    let corner = |at: usize| {
        let pick = |axis: usize| if at >> axis & 1 == 0 { low[axis] } else { high[axis] };
        matrix.transform_point3(DVec3::new(pick(0), pick(1), pick(2)))
    };
    box_of(std::array::from_fn(corner))
}

/// Box around the corners of another.
pub(super) fn box_of(corners: [DVec3; 8]) -> [DVec3; 2] {
    let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    corners.into_iter().fold(none, |[low, high], corner| [low.min(corner), high.max(corner)])
}
