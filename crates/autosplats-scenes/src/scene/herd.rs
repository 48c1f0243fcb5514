//! Horses galloping over a meadow.

use glam::{DMat3, DVec3};

use super::body::{Body, Op};
use super::fold::Fold;
use super::horse::{Coat, Gait, horse};
use super::model::{Model, Points};
use super::octree::Octree;
use super::paint::Paint;
use super::shape::{Placement, Shape, Similarity, meadow_height};

/// Strides per period of the animation.
const STRIDES: f64 = 4.0;

/// Position (x, y) of each horse, its rotation from the x axis, its size, the phase of its stride and its coat.
const HERD: [(f64, f64, f64, f64, f64, Coat); 13] = [
    (3.1, -1.9, -0.06, 1.02, 0.00, Coat::BAY),
    (3.9, 0.1, 0.02, 1.04, 0.37, Coat::BLACK),
    (2.6, 2.2, 0.07, 0.98, 0.71, Coat::GREY),
    (0.2, -2.9, -0.04, 0.97, 0.55, Coat::PALOMINO),
    (0.7, -0.9, 0.00, 1.01, 0.18, Coat::CHESTNUT),
    (0.9, 1.2, 0.03, 1.00, 0.86, Coat::BAY),
    (-0.2, 3.3, 0.08, 1.03, 0.30, Coat::CHESTNUT),
    (-2.3, -2.1, -0.05, 1.03, 0.80, Coat::BLACK),
    (-2.0, 0.2, 0.01, 0.96, 0.48, Coat::GREY),
    (-2.6, 2.3, 0.04, 1.00, 0.09, Coat::BAY),
    (-4.9, -1.0, 0.02, 1.00, 0.62, Coat::PALOMINO),
    (-4.7, 1.3, 0.05, 1.02, 0.25, Coat::CHESTNUT),
    // A foal keeps up with its mother.
    (-0.7, -4.2, -0.02, 0.62, 0.93, Coat::CHESTNUT),
];

/// The herd at a phase of the animation, 0 to 1.
pub(super) fn scene(phase: f64) -> Model {
    let mut body = Body::new(Paint::Grass);
    body.group(Op::Join, 0.0);
    body.join(0.0, Shape::Meadow { radius: 7.4 });
    body.zone = 1;
    for (x, y, turn, size, start, coat) in HERD {
        let origin = DVec3::new(x, y, meadow_height(x, y) - 0.01);
        body.frame = Similarity { placement: Placement { origin, axes: DMat3::from_rotation_z(turn) }, scale: size };
        horse(&mut body, Gait::Gallop((STRIDES * phase + start).rem_euclid(1.0)), coat);
    }
    let tree = Octree::new(body, Fold::None, DVec3::new(-8.0, -8.0, -4.0), 16.0, 9);
    // The meadow needs fewer points than the horses.
    Model { tree, points: Points::Sampled(vec![0.22, 0.78]) }
}
