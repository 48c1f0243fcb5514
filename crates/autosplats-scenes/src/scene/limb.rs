//! Joints, hands and feet.

use std::f64::consts::TAU;

use glam::DVec3;

use super::body::Body;
use super::shape::{Placement, Shape};

/// Inverse kinematics of two bones of length `upper` and `lower` from `from` to `to`, bent towards `pole`. Returns the
/// joint and the far end, which is nearer than `to` if `to` is out of reach.
pub(super) fn reach(from: DVec3, to: DVec3, upper: f64, lower: f64, pole: DVec3) -> (DVec3, DVec3) {
    let far = (to - from).length().clamp((upper - lower).abs() * 1.05 + 1e-6, (upper + lower) * 0.995);
    let along = (to - from).normalize_or(DVec3::NEG_Z);
    let side = (pole - along * pole.dot(along)).normalize_or(along.any_orthonormal_vector());
    let x = (upper * upper - lower * lower + far * far) / (2.0 * far);
    let y = (upper * upper - x * x).max(0.0).sqrt();
    (from + along * x + side * y, from + along * far)
}

/// Pose of a hand.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hand {
    pub(super) wrist: DVec3,
    /// Direction of the fingers.
    pub(super) forward: DVec3,
    /// Direction out of the palm.
    pub(super) palm: DVec3,
    /// Side of the thumb: +1 in the direction of `forward` × `palm`, else -1.
    pub(super) thumb: f64,
    /// How far the fingers are closed, 0 to 1.
    pub(super) curl: f64,
}

/// Adds a hand to the group.
pub(super) fn hand(body: &mut Body, hand: Hand) {
    let Hand { wrist, forward, palm, thumb, curl } = hand;
    let f = forward.normalize();
    let n = (palm - f * palm.dot(f)).normalize();
    let side = f.cross(n) * thumb;
    let at = Placement::along(wrist + f * 0.048, f, side);
    body.join(0.012, Shape::Block { at, half: DVec3::new(0.037, 0.0125, 0.045), round: 0.0122 });
    for finger in 0..4 {
        let i = f64::from(finger) - 1.5;
        let long = [0.92, 1.05, 1.0, 0.8][finger as usize];
        let knuckle = wrist + f * (0.088 - 0.003 * i * i) - side * (0.0185 * i);
        let spread = (f - side * (0.07 * i)).normalize();
        let bent = |angle: f64| spread * angle.cos() + n * angle.sin();
        let turn = curl * (0.75 + 0.1 * i) + 0.12;
        let a = knuckle + bent(turn) * (0.042 * long);
        let b = a + bent(1.9 * turn) * (0.026 * long);
        let c = b + bent(2.6 * turn) * (0.020 * long);
        body.strand(0.006, &[(knuckle, 0.0098), (a, 0.0088), (b, 0.0078), (c, 0.0066)]);
    }
    let base = wrist + f * 0.022 + side * 0.028;
    let a = base + (f * 0.7 + side * 0.7 + n * 0.35).normalize() * 0.04;
    let b = a + (f * 0.9 + side * 0.25 + n * (0.3 + 0.5 * curl)).normalize() * 0.034;
    body.strand(0.01, &[(base, 0.0145), (a, 0.0108), (b, 0.0082)]);
}

/// Adds a foot to the group: from the ankle, toes along `forward`, sole towards `down`.
pub(super) fn foot(body: &mut Body, ankle: DVec3, forward: DVec3, down: DVec3) {
    let f = forward.normalize();
    let d = (down - f * down.dot(f)).normalize();
    let heel = ankle - f * 0.045 + d * 0.045;
    let ball = ankle + f * 0.125 + d * 0.055;
    let toe = ball + f * 0.062 + d * 0.006;
    body.join(0.03, Shape::cone(ankle, heel, 0.034, 0.032));
    body.join(0.04, Shape::cone(ankle + d * 0.004 + f * 0.02, ball, 0.034, 0.026));
    body.join(0.03, Shape::cone(heel, ball, 0.028, 0.024));
    let side = f.cross(d);
    for toes in 0..3 {
        let i = f64::from(toes) - 1.0;
        body.join(0.02, Shape::cone(ball + side * (0.024 * i), toe + side * (0.02 * i), 0.023, 0.017));
    }
}

/// A smooth periodic bump: 0 at phase 0, 1 at phase 0.5.
pub(super) fn pulse(phase: f64) -> f64 {
    0.5 - 0.5 * (TAU * phase).cos()
}
