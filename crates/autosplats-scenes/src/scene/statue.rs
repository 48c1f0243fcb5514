//! A robed statue on its pedestal, with relief at every scale from the pose down to single curls.

use std::f64::consts::TAU;

use glam::{DMat3, DVec3};

use super::body::{Body, Op};
use super::fold::Fold;
use super::head::{HeadColors, head};
use super::limb::{Hand, foot, hand, reach};
use super::model::{Model, Points};
use super::octree::Octree;
use super::paint::{Paint, lattice};
use super::pedestal::pedestal;
use super::shape::{Placement, Shape, Similarity};

const STONE: Paint = Paint::Marble;

/// Positions of the joints of a figure 1.75 m high.
const WAIST: DVec3 = DVec3::new(0.012, 0.0, 1.10);
const CHEST: DVec3 = DVec3::new(0.0, 0.0, 1.30);
const NECK: DVec3 = DVec3::new(-0.008, 0.02, 1.475);

/// The statue.
pub(super) fn scene() -> Model {
    let mut body = Body::new(STONE);
    pedestal(&mut body);
    body.frame = Similarity { placement: Placement::at(DVec3::new(0.0, 0.0, 0.98)), scale: 1.12 };
    figure(&mut body);
    let tree = Octree::new(body, Fold::None, DVec3::new(-1.7, -1.7, -0.1), 3.4, 8);
    Model { tree, points: Points::Sampled(vec![1.0]) }
}

fn figure(body: &mut Body) {
    robe(body);
    mantle(body);
    arms(body);
    let turn = DMat3::from_rotation_z(0.32) * DMat3::from_rotation_x(0.06);
    let middle = NECK + turn * DVec3::new(0.0, -0.022, 0.18);
    body.group(Op::Join, 0.015);
    body.join(0.0, Shape::cone(NECK - DVec3::Z * 0.05, middle + turn * DVec3::new(0.0, 0.03, -0.05), 0.062, 0.055));
    let at = Placement { origin: middle, axes: turn };
    head(body, at, HeadColors { skin: STONE, lips: STONE, eyes: STONE, irises: STONE, brows: STONE });
    curls(body, at);
}

/// A fixed pseudo-random number from -1 to 1.
fn jitter(i: i32, salt: i64) -> f64 {
    f64::from(lattice(i64::from(i), salt, 77)) * 2.0 - 1.0
}

/// The long robe: a body under cloth, with folds from the girdle to the feet.
fn robe(body: &mut Body) {
    let egg = |x: f64, y: f64, z: f64, radii: [f64; 3]| Shape::Ellipsoid {
        at: Placement::at(DVec3::new(x, y, z)),
        radii: DVec3::from(radii),
    };
    body.group(Op::Join, 0.0);
    body.join(0.0, egg(0.0, 0.01, 1.30, [0.15, 0.105, 0.17]));
    body.join(0.08, egg(0.012, 0.0, 1.11, [0.125, 0.095, 0.13]));
    body.join(0.08, egg(0.02, 0.01, 0.93, [0.17, 0.125, 0.14]));
    for side in [-1.0, 1.0] {
        body.join(0.03, Shape::ball(DVec3::new(side * 0.066, -0.07, 1.305), 0.056));
        body.join(0.05, Shape::cone(NECK, DVec3::new(side * 0.165, 0.012, 1.43), 0.055, 0.056));
    }
    // The free leg's knee and thigh press through the cloth.
    let knee = DVec3::new(-0.115, -0.135, 0.52);
    body.join(0.05, Shape::cone(DVec3::new(-0.085, -0.01, 0.90), knee, 0.095, 0.068));
    body.join(0.05, Shape::cone(knee, DVec3::new(-0.13, -0.02, 0.12), 0.066, 0.06));
    body.join(0.08, Shape::cone(DVec3::new(0.09, 0.02, 0.88), DVec3::new(0.10, 0.03, 0.10), 0.105, 0.12));
    body.join(0.08, Shape::cone(DVec3::new(0.0, 0.03, 0.80), DVec3::new(0.0, 0.05, 0.08), 0.12, 0.17));
    body.group(Op::Join, 0.022);
    const FOLDS: i32 = 34;
    for i in 0..FOLDS {
        let angle = TAU * (f64::from(i) + 0.3 * jitter(i, 1)) / f64::from(FOLDS);
        let (sin, cos) = angle.sin_cos();
        let at = |rx: f64, ry: f64, z: f64, lag: f64| {
            let (s, c) = (angle + lag).sin_cos();
            DVec3::new(rx * c, 0.015 + ry * s, z)
        };
        // The folds part over the free leg, front left.
        let part = (-(angle - 4.25) * (angle - 4.25) * 3.0).exp();
        let deep = 0.75 + 0.35 * jitter(i, 2);
        let push = -0.07 * part;
        let points = [
            (at(0.128, 0.098, 1.075, 0.0), 0.010),
            (at(0.175, 0.132, 0.93, 0.02 * jitter(i, 3)), 0.014 * deep),
            (at(0.190, 0.142, 0.72 + 0.05 * jitter(i, 12), 0.04 * jitter(i, 4)) + DVec3::Y * push, 0.019 * deep),
            (at(0.207, 0.162, 0.45 + 0.06 * jitter(i, 13), 0.07 * jitter(i, 5)) + DVec3::Y * push, 0.023 * deep),
            (at(0.235, 0.196, 0.20 + 0.04 * jitter(i, 14), 0.09 * jitter(i, 6)), 0.028 * deep),
            (at(0.270, 0.235, 0.035, 0.10 * jitter(i, 7)) + DVec3::new(cos, sin, 0.0) * 0.015, 0.033 * deep),
        ];
        body.strand(0.02, &points);
    }
    // Cloth that breaks on the ground.
    for i in 0..22 {
        let angle = TAU * (f64::from(i) + 0.4 * jitter(i, 8)) / 22.0;
        let (sin, cos) = angle.sin_cos();
        let out = 0.27 + 0.03 * jitter(i, 9);
        let p = DVec3::new(out * cos, 0.015 + 0.87 * out * sin, 0.02);
        let q = p + DVec3::new(-sin, cos, 0.0) * 0.06 + DVec3::new(cos, sin, 0.0) * 0.02;
        body.join(0.02, Shape::cone(p, q, 0.028, 0.02));
    }
    for (ankle, forward) in [
        (DVec3::new(-0.125, -0.15, 0.085), DVec3::new(-0.3, -1.0, 0.0)),
        (DVec3::new(0.11, -0.13, 0.085), DVec3::new(0.25, -1.0, 0.0)),
    ] {
        body.group(Op::Join, 0.012);
        foot(body, ankle, forward, DVec3::NEG_Z);
    }
    // The blouse above the girdle, with thin folds that gather under the chest, and the girdle itself.
    body.group(Op::Join, 0.012);
    for i in 0..26 {
        let angle = TAU * (f64::from(i) + 0.35 * jitter(i, 10)) / 26.0;
        let (sin, cos) = angle.sin_cos();
        let lower = WAIST + DVec3::new(0.126 * cos, 0.099 * sin, -0.005);
        let bulge = WAIST + DVec3::new(0.139 * cos, 0.112 * sin, 0.055);
        let upper = CHEST + DVec3::new(0.128 * cos, 0.094 * sin - 0.012 * (1.0 - sin), -0.035 + 0.02 * jitter(i, 11));
        body.strand(0.012, &[(lower, 0.012), (bulge, 0.0125), (upper, 0.006)]);
    }
    body.group(Op::Join, 0.004);
    for i in 0..40 {
        // A twisted cord.
        let point = |i: i32, strand: f64| {
            let angle = TAU * f64::from(i) / 40.0;
            let (sin, cos) = (angle * 20.0 + strand).sin_cos();
            let (s, c) = angle.sin_cos();
            WAIST + DVec3::new((0.139 + 0.006 * cos) * c, (0.111 + 0.006 * cos) * s, -0.012 + 0.007 * sin)
        };
        for strand in [0.0, 0.5 * TAU] {
            body.join(0.002, Shape::cone(point(i, strand), point(i + 1, strand), 0.0085, 0.0085));
        }
    }
}

/// The mantle: from the left shoulder across the chest to the right hip, and down the back.
fn mantle(body: &mut Body) {
    body.group(Op::Join, 0.010);
    for i in 0..5 {
        let s = f64::from(i) / 4.0;
        let sag = 0.012 * jitter(i, 20);
        let deep = 1.0 + 0.25 * jitter(i, 23);
        let points = [
            (DVec3::new(0.185 - 0.05 * s, 0.07 - 0.03 * s, 1.43 + 0.035 * s), 0.0125 * deep),
            (DVec3::new(0.165 - 0.075 * s, -0.07, 1.435 - 0.01 * s), 0.0115 * deep),
            (DVec3::new(0.115 - 0.075 * s, -0.142 + 0.02 * s, 1.32 + 0.02 * s), 0.0105 * deep),
            (DVec3::new(0.02 - 0.05 * s, -0.142 + 0.02 * s, 1.16 + 0.055 * s + sag), 0.0115 * deep),
            (DVec3::new(-0.10 - 0.025 * s, -0.115, 1.005 + 0.075 * s + sag), 0.0135 * deep),
            (DVec3::new(-0.185, -0.02, 0.90 + 0.09 * s + sag), 0.0145 * deep),
            (DVec3::new(-0.14, 0.12, 0.87 + 0.10 * s), 0.0135 * deep),
        ];
        body.strand(0.008, &points);
    }
    // Cloth that hangs in front of the right hip, over the bundle.
    for i in 0..6 {
        let s = f64::from(i) / 5.0;
        let x = -0.21 + 0.12 * s;
        let points = [
            (DVec3::new(x, -0.10 - 0.03 * s, 0.99 - 0.03 * s), 0.012),
            (DVec3::new(x - 0.035 + 0.02 * s, -0.145 - 0.035 * s, 0.80), 0.014),
            (DVec3::new(x - 0.04 + 0.02 * s, -0.165 - 0.03 * s, 0.62 - 0.05 * f64::from(i % 2)), 0.017),
            (DVec3::new(x - 0.05 + 0.03 * s, -0.172 - 0.03 * s, 0.50 - 0.10 * s - 0.03 * f64::from(i % 2)), 0.016),
        ];
        body.strand(0.014, &points);
    }
    body.group(Op::Join, 0.02);
    // A sheet behind the ridges, which fills the gaps between them.
    for side in [-0.6, 0.0, 0.6] {
        let p = |spread: f64, y: f64, z: f64| DVec3::new(side * spread, y, z);
        let sheet = [
            (p(0.13, 0.06, 1.36), 0.07),
            (p(0.17, 0.07, 1.0), 0.08),
            (p(0.19, 0.08, 0.65), 0.10),
            (p(0.22, 0.10, 0.06), 0.15),
        ];
        body.strand(0.08, &sheet);
    }
    for i in 0..15 {
        let s = f64::from(i) / 14.0 * 2.0 - 1.0;
        let wave = 0.012 * jitter(i, 21);
        // Ridges and hollows alternate.
        let ridge = if i % 2 == 0 { 0.014 } else { -0.010 };
        let points = [
            (DVec3::new(0.165 * s, 0.055, 1.45 + 0.015 * (1.0 - s * s)), 0.022),
            (DVec3::new(0.19 * s + wave, 0.5 * ridge + 0.125 - 0.03 * s * s, 1.28), 0.0161),
            (DVec3::new(0.20 * s - wave, ridge + 0.155 - 0.03 * s * s, 1.0), 0.0186),
            (DVec3::new(0.225 * s + wave, ridge + 0.19 - 0.03 * s * s, 0.65), 0.0205),
            (DVec3::new(0.26 * s - 2.0 * wave, ridge + 0.235 - 0.04 * s * s, 0.28), 0.0223),
            (DVec3::new(0.29 * s, 1.4 * ridge + 0.275 - 0.05 * s * s, 0.04), 0.0236),
        ];
        body.strand(0.016, &points);
    }
}

fn arms(body: &mut Body) {
    // The right arm, raised, holds a staff; the left carries a book on the hip.
    let staff = DVec3::new(-0.40, -0.20, 0.0);
    let grip = staff + DVec3::Z * 1.36;
    let book = DVec3::new(0.235, -0.15, 1.085);
    for (side, target, pole) in [
        (-1.0, grip + DVec3::new(0.05, 0.045, -0.045), DVec3::new(-0.5, 0.5, -1.0)),
        (1.0, book + DVec3::new(0.045, 0.01, -0.095), DVec3::new(0.6, 1.0, -0.4)),
    ] {
        let shoulder = DVec3::new(side * 0.172, 0.012, 1.425);
        let (elbow, wrist) = reach(shoulder, target, 0.285, 0.25, pole);
        body.group(Op::Join, 0.03);
        body.join(0.0, Shape::cone(shoulder, elbow, 0.054, 0.042));
        body.join(0.03, Shape::cone(elbow, wrist, 0.04, 0.026));
        // The sleeve, gathered in rings of cloth and open at the elbow.
        body.group(Op::Join, 0.010);
        let along = (elbow - shoulder).normalize();
        for i in 0..9 {
            let s = f64::from(i) / 8.0;
            let tilt = along + DVec3::new(0.25 * jitter(i, 30 + side as i64), 0.25 * jitter(i, 33), 0.0);
            let at = Placement::along(shoulder.lerp(elbow, 0.12 + 0.74 * s), tilt, DVec3::X);
            body.join(0.012, Shape::Ring { at, major: 0.047 - 0.004 * s, minor: 0.0125 + 0.003 * jitter(i, 31) });
        }
        for i in 0..7 {
            let s = f64::from(i) / 6.0 - 0.5;
            let top = shoulder.lerp(elbow, 0.86) + DVec3::new(0.05 * s, 0.10 * s, -0.02);
            let low = top + DVec3::new(0.02 * side + 0.03 * s, 0.05 * s, -0.17 - 0.03 * jitter(i, 32));
            body.strand(
                0.012,
                &[(top, 0.018), (top.lerp(low, 0.5) + DVec3::Y * 0.012 * jitter(i, 34), 0.018), (low, 0.014)],
            );
        }
        body.group(Op::Join, 0.012);
        if side < 0.0 {
            let forward = DVec3::new(-0.55, -0.35, 0.25);
            hand(body, Hand { wrist, forward, palm: DVec3::new(-0.35, -0.5, -0.15), thumb: -1.0, curl: 1.05 });
        } else {
            hand(
                body,
                Hand {
                    wrist,
                    forward: DVec3::new(-0.45, -0.75, 0.2),
                    palm: DVec3::new(-0.3, 0.1, 1.0),
                    thumb: -1.0,
                    curl: 0.35,
                },
            );
        }
    }
    staff_and_finial(body, staff);
    body.group(Op::Join, 0.002);
    let axes = DMat3::from_rotation_z(0.5) * DMat3::from_rotation_x(0.16) * DMat3::from_rotation_y(-0.08);
    let at = |x: f64, y: f64, z: f64| Placement { origin: book + axes * DVec3::new(x, y, z), axes };
    body.join(0.0, Shape::Block { at: at(0.0, 0.0, 0.0), half: DVec3::new(0.075, 0.024, 0.105), round: 0.004 });
    for y in [-0.026, 0.026] {
        body.join(0.002, Shape::Block { at: at(-0.003, y, 0.0), half: DVec3::new(0.083, 0.0045, 0.112), round: 0.003 });
        let frame = Shape::Block { at: at(0.0, 1.16 * y, 0.0), half: DVec3::new(0.06, 0.003, 0.088), round: 0.002 };
        body.join(0.001, frame);
    }
    for i in -2..=2 {
        let ridge = at(-0.086, 0.0, 0.042 * f64::from(i));
        body.join(0.003, Shape::Block { at: ridge, half: DVec3::new(0.005, 0.029, 0.006), round: 0.004 });
    }
    let boss = at(0.0, -0.029, 0.0);
    body.join(
        0.002,
        Shape::Ring { at: Placement::along(boss.origin, axes.y_axis, DVec3::X), major: 0.026, minor: 0.0045 },
    );
    body.join(0.002, Shape::ball(boss.origin, 0.011));
}

fn staff_and_finial(body: &mut Body, foot: DVec3) {
    let p = |z: f64| foot + DVec3::Z * z;
    body.group(Op::Join, 0.004);
    body.join(0.0, Shape::cone(p(0.0), p(1.93), 0.0175, 0.0145));
    for z in [0.02, 0.06, 1.80, 1.835, 1.87] {
        body.join(0.004, Shape::Ring { at: Placement::at(p(z)), major: 0.017, minor: 0.0085 });
    }
    // An orb between leaves, with a pine cone on top.
    body.join(0.008, Shape::ball(p(1.955), 0.05));
    for i in 0..8 {
        let (sin, cos) = (TAU * f64::from(i) / 8.0).sin_cos();
        let leaf = |r: f64, z: f64| p(1.90 + z) + DVec3::new(r * cos, r * sin, 0.0);
        body.strand(
            0.006,
            &[
                (leaf(0.02, -0.01), 0.008),
                (leaf(0.056, 0.03), 0.0115),
                (leaf(0.062, 0.075), 0.008),
                (leaf(0.084, 0.095), 0.004),
            ],
        );
    }
    for i in 0..26 {
        let s = f64::from(i) / 25.0;
        let (sin, cos) = (2.399_963 * f64::from(i)).sin_cos();
        let radius = 0.034 * (1.0 - s).powf(0.6);
        body.join(
            0.004,
            Shape::ball(p(2.0 + 0.085 * s) + DVec3::new(radius * cos, radius * sin, 0.0), 0.012 - 0.003 * s),
        );
    }
}

/// Short coiled curls all over, with a laurel wreath around them.
fn curls(body: &mut Body, at: Placement) {
    const CURLS: i32 = 150;
    body.group(Op::Join, 0.004);
    let cap = Placement { origin: at.world(DVec3::new(0.0, 0.024, 0.04)), axes: at.axes };
    body.join(0.0, Shape::Ellipsoid { at: cap, radii: DVec3::new(0.079, 0.092, 0.083) });
    let face = Placement { origin: at.world(DVec3::new(0.0, -0.088, -0.025)), axes: at.axes };
    body.cut(0.01, Shape::Ellipsoid { at: face, radii: DVec3::new(0.066, 0.075, 0.098) });
    for i in 0..CURLS {
        let z = 1.0 - 1.72 * (f64::from(i) + 0.5) / f64::from(CURLS);
        let angle = 2.399_963 * f64::from(i);
        let r = (1.0 - z * z).max(0.0).sqrt();
        let out = DVec3::new(r * angle.cos(), r * angle.sin(), z);
        // The face and the ears stay free.
        let forehead = out.y < -0.25 && z < 0.45 - 0.5 * out.x.abs();
        let ear = out.x.abs() > 0.72 && out.y < 0.35 && z < 0.08;
        if forehead || ear {
            continue;
        }
        let root = at.world(DVec3::new(0.0, 0.024, 0.035) + out * DVec3::new(0.083, 0.096, 0.09));
        let n = at.axes * out;
        let curl = Placement::along(root, n + 0.35 * DVec3::new(jitter(i, 40), jitter(i, 41), jitter(i, 42)), DVec3::X);
        let turn = jitter(i, 43) * 3.0;
        let big = 1.0 + 0.2 * jitter(i, 44);
        let points = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0].map(|k: f64| {
            let (sin, cos) = (turn + 1.25 * k).sin_cos();
            let radius = big * (0.0150 - 0.0015 * k);
            (curl.world(DVec3::new(radius * cos, radius * sin, 0.0018 * k - 0.002)), big * (0.0060 - 0.0003 * k))
        });
        body.strand(0.001, &points);
    }
    body.group(Op::Join, 0.002);
    for side in [-1.0, 1.0] {
        for i in 0..13 {
            let s = f64::from(i) / 12.0;
            let angle = -1.45 + 2.95 * s;
            let (sin, cos) = angle.sin_cos();
            let root = DVec3::new(side * 0.094 * cos, 0.022 + 0.106 * sin, 0.066 - 0.012 * sin);
            let along = DVec3::new(side * sin, -cos, 0.0);
            for lean in [-1.0, 0.25] {
                let out = DVec3::new(side * cos, sin, 0.0);
                let tip = (along * 0.9 + out * 0.38 + DVec3::Z * (0.55 * lean + 0.35)).normalize();
                let leaf = Placement::along(at.world(root + tip * 0.016), at.axes * tip, at.axes * out);
                body.join(0.001, Shape::Ellipsoid { at: leaf, radii: DVec3::new(0.0038, 0.0095, 0.024) });
            }
        }
    }
}
