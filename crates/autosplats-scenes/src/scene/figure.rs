//! A dancer in a wide skirt, and the small model on the head of a large one.

use std::f64::consts::TAU;

use glam::{DMat3, DVec3};

use super::body::{Body, Op};
use super::fold::Fold;
use super::head::{HeadColors, head};
use super::horse::{Coat, Gait, horse};
use super::limb::{Hand, foot, hand, pulse, reach};
use super::model::{Model, Points};
use super::octree::Octree;
use super::paint::Paint;
use super::shape::{Placement, Shape, Similarity};

const SKIN: Paint = Paint::Mottled { rgb: [216, 174, 144], grain: 0.05, depth: 0.03 };
const CLOTH: Paint = Paint::Mottled { rgb: [150, 58, 52], grain: 0.03, depth: 0.05 };
const SASH: Paint = Paint::Mottled { rgb: [214, 176, 104], grain: 0.02, depth: 0.05 };
const HAIR: Paint = Paint::Mottled { rgb: [66, 44, 33], grain: 0.02, depth: 0.12 };
const SHOES: Paint = Paint::Plain(92, 52, 46);

/// The dancer at a phase of her dance, 0 to 1.
pub(super) fn scene(phase: f64) -> Model {
    let mut body = Body::new(SKIN);
    dancer(&mut body, phase);
    let tree = Octree::new(body, Fold::None, DVec3::new(-1.2, -1.2, -0.1), 2.4, 8);
    Model { tree, points: Points::Sampled(vec![1.0]) }
}

/// A small horse on the head of a large one, with as many points on each.
pub(super) fn two_scales() -> Model {
    let mut body = Body::new(SKIN);
    let frame = |origin: DVec3, turn: f64, scale: f64| Similarity {
        placement: Placement { origin, axes: DMat3::from_rotation_z(turn) },
        scale,
    };
    body.frame = frame(DVec3::new(-0.35, 0.0, 0.0), -0.35, 1.0);
    let crown = horse(&mut body, Gait::Standing, Coat::BAY);
    body.zone = 1;
    body.frame = frame(crown, -0.9, 0.16);
    horse(&mut body, Gait::Standing, Coat::GREY);
    let tree = Octree::new(body, Fold::None, DVec3::new(-1.9, -1.8, -0.2), 3.6, 9);
    Model { tree, points: Points::Sampled(vec![0.5, 0.5]) }
}

fn dancer(body: &mut Body, phase: f64) {
    // At phase 0 one leg is already raised, for a livelier pose.
    let a = TAU * (phase + 0.19);
    let (sway, cosine) = a.sin_cos();
    let pelvis = DVec3::new(0.055 * sway, 0.01 * cosine, 0.935 + 0.018 * (2.0 * a).cos());
    let hips = DMat3::from_rotation_z(0.22 * sway) * DMat3::from_rotation_y(0.10 * sway);
    let chest_turn = DMat3::from_rotation_z(-0.30 * sway) * DMat3::from_rotation_y(-0.13 * sway);
    let waist = pelvis + hips * DVec3::new(0.0, 0.0, 0.16);
    let chest = waist + chest_turn * DVec3::new(0.0, 0.0, 0.18);
    let neck = chest + chest_turn * DVec3::new(0.0, 0.02, 0.20);

    body.group(Op::Join, 0.0);
    legs(body, pelvis, hips, sway);
    torso(body, [pelvis, waist, chest, neck], hips, chest_turn);
    body.group(Op::Join, 0.03);
    for side in [-1.0, 1.0] {
        arm(body, side, chest, chest_turn, side * sway, a);
    }
    skirt(body, waist, hips, a);

    let turn = DMat3::from_rotation_z(0.35 * sway) * DMat3::from_rotation_y(0.08 * sway);
    let middle = neck + turn * DVec3::new(0.0, -0.022, 0.185);
    body.group(Op::Join, 0.03);
    body.paint = SKIN;
    body.join(0.0, Shape::cone(neck - DVec3::Z * 0.03, middle + turn * DVec3::new(0.0, 0.025, -0.06), 0.058, 0.05));
    let looks = HeadColors {
        skin: SKIN,
        lips: Paint::Plain(176, 98, 88),
        eyes: Paint::Plain(232, 226, 216),
        irises: Paint::Plain(62, 44, 34),
        brows: HAIR,
    };
    head(body, Placement { origin: middle, axes: turn }, looks);
    hair(body, Placement { origin: middle, axes: turn }, a);
}

fn legs(body: &mut Body, pelvis: DVec3, hips: DMat3, sway: f64) {
    for side in [-1.0, 1.0] {
        // The free leg is the one that the hips move away from.
        let lift = (-side * sway).max(0.0).powi(2);
        let hip = pelvis + hips * DVec3::new(side * 0.09, 0.0, -0.03);
        let ground = DVec3::new(side * (0.085 + 0.03 * lift), 0.02, 0.085);
        let raised = DVec3::new(side * 0.14, 0.15, 0.26);
        let target = ground.lerp(raised, lift);
        let (knee, ankle) = reach(hip, target, 0.43, 0.425, DVec3::new(side * (0.12 + 0.35 * lift), -1.0, 0.3 * lift));
        // The thigh presses through the skirt, so it has the colour of cloth.
        body.paint = CLOTH;
        body.join(0.06, Shape::cone(hip, knee, 0.088, 0.054));
        body.paint = SKIN;
        body.join(0.03, Shape::cone(knee, ankle, 0.053, 0.035));
        let shin = (ankle - knee).normalize();
        let back = DVec3::new(0.0, 1.0, 0.0);
        let back = (back - shin * back.dot(shin)).normalize();
        let calf = Placement::along(knee + shin * 0.12 + back * 0.018, shin, back);
        body.join(0.04, Shape::Ellipsoid { at: calf, radii: DVec3::new(0.045, 0.047, 0.13) });
        body.paint = SHOES;
        let flat = DVec3::new(side * 0.25, -1.0, 0.0);
        let forward = flat.normalize().lerp(shin, 0.72 * lift);
        let down = DVec3::NEG_Z.lerp(back, lift);
        foot(body, ankle, forward, down);
    }
}

fn torso(body: &mut Body, [pelvis, waist, chest, neck]: [DVec3; 4], hips: DMat3, turn: DMat3) {
    let egg = |origin: DVec3, axes: DMat3, radii: [f64; 3]| Shape::Ellipsoid {
        at: Placement { origin, axes },
        radii: DVec3::from(radii),
    };
    body.paint = CLOTH;
    body.join(0.07, egg(pelvis + hips * DVec3::new(0.0, 0.01, 0.01), hips, [0.158, 0.115, 0.12]));
    body.join(0.09, egg(waist, turn, [0.118, 0.09, 0.13]));
    body.join(0.08, egg(chest + turn * DVec3::new(0.0, 0.01, 0.0), turn, [0.138, 0.102, 0.165]));
    for side in [-1.0, 1.0] {
        body.join(0.035, Shape::ball(chest + turn * DVec3::new(side * 0.066, -0.072, -0.015), 0.058));
        body.join(
            0.04,
            Shape::cone(
                chest + turn * DVec3::new(side * 0.10, 0.055, 0.06),
                chest + turn * DVec3::new(side * 0.06, 0.06, -0.05),
                0.045,
                0.03,
            ),
        );
    }
    body.paint = SKIN;
    for side in [-1.0, 1.0] {
        let shoulder = chest + turn * DVec3::new(side * 0.165, 0.015, 0.13);
        body.join(0.05, Shape::cone(neck, shoulder, 0.05, 0.048));
        let inner = chest + turn * DVec3::new(side * 0.02, -0.058, 0.157);
        body.join(0.015, Shape::cone(inner, shoulder + turn * DVec3::new(0.0, -0.02, 0.03), 0.011, 0.009));
    }
}

fn arm(body: &mut Body, side: f64, chest: DVec3, turn: DMat3, raise: f64, a: f64) {
    let shoulder = chest + turn * DVec3::new(side * 0.17, 0.015, 0.13);
    let lift = 0.45 + 0.75 * raise;
    let (sin, cos) = lift.sin_cos();
    let inward = 0.10 * (1.0 + raise);
    let target = shoulder + turn * DVec3::new(side * (0.50 * cos - inward), -0.14 - 0.05 * a.cos(), 0.50 * sin);
    let (elbow, wrist) = reach(shoulder, target, 0.285, 0.25, DVec3::new(side * 0.8, 0.6, -0.5 + 0.2 * raise));
    body.paint = SKIN;
    body.join(0.04, Shape::cone(shoulder, elbow, 0.048, 0.036));
    body.join(0.03, Shape::cone(elbow, wrist, 0.037, 0.0235));
    let fore = (wrist - elbow).normalize();
    body.join(0.03, Shape::ball(elbow + fore * 0.06, 0.04));
    let forward = fore + DVec3::new(side * (0.35 - 0.5 * raise), -0.1, 0.15);
    let palm = DVec3::new(-side * 0.3, -0.3, -0.8 + 0.7 * raise);
    let f = forward.normalize();
    let n = (palm - f * palm.dot(f)).normalize();
    // Thumbs point to the front.
    let thumb = if f.cross(n).dot(DVec3::NEG_Y) > 0.0 { 1.0 } else { -1.0 };
    hand(body, Hand { wrist, forward, palm, thumb, curl: 0.18 + 0.12 * pulse(a / TAU) });
}

/// A bell of cloth: radial folds that spread towards the hem, hollow from below.
fn skirt(body: &mut Body, waist: DVec3, hips: DMat3, a: f64) {
    const FOLDS: i32 = 22;
    let axis = hips * DVec3::NEG_Z;
    // The hem lags behind the hips.
    let hem = waist + axis * 0.50 + DVec3::new(-0.05 * (a - 0.9).sin(), 0.02, 0.0);
    body.group(Op::Join, 0.012);
    body.paint = CLOTH;
    body.join(0.0, Shape::cone(waist, hem, 0.105, 0.325));
    for i in 0..FOLDS {
        let angle = TAU * f64::from(i) / f64::from(FOLDS);
        let at = |radius: f64, down: f64, lag: f64| {
            let (sin, cos) = (angle + lag * (a - 0.6).cos()).sin_cos();
            waist.lerp(hem, down) + hips * DVec3::new(radius * cos, radius * sin, 0.0)
        };
        let flare = 0.035 * (3.0 * angle + a).sin() + 0.03 * (angle * 2.0 - a).sin();
        let points = [
            (at(0.092, 0.02, 0.0), 0.016),
            (at(0.185, 0.30, 0.10), 0.023),
            (at(0.280 + 0.5 * flare, 0.64, 0.22), 0.029),
            (at(0.352 + flare, 1.06, 0.34), 0.035),
        ];
        body.strand(0.05, &points);
    }
    let down = hem - waist;
    body.cut(0.012, Shape::HalfSpace { normal: -down.normalize(), offset: -down.normalize().dot(hem + axis * 0.012) });
    let lining = (waist + down * 0.62, hem + down * 0.3);
    body.cut(0.02, Shape::cone(lining.0, lining.1, 0.11, 0.30));
    body.group(Op::Join, 0.006);
    body.paint = SASH;
    let band = Placement { origin: waist + hips * DVec3::new(0.0, 0.002, -0.012), axes: hips };
    for row in [-0.018, 0.0, 0.018] {
        let around = std::array::from_fn::<_, 25, _>(|i| {
            let (sin, cos) = (TAU * i as f64 / 24.0).sin_cos();
            (band.world(DVec3::new(0.132 * cos, 0.106 * sin, row)), 0.013)
        });
        body.strand(0.004, &around);
    }
    let knot = band.world(DVec3::new(0.095, -0.088, 0.0));
    body.join(0.01, Shape::ball(knot, 0.026));
    for (i, swing) in [(0.0, 0.1), (1.0, -0.1)] {
        let end =
            knot + axis * 0.26 + hips * DVec3::new(0.09 + 0.05 * i + swing * 0.3 * a.sin(), -0.13 - 0.02 * i, 0.0);
        let middle = knot.lerp(end, 0.5) + hips * DVec3::new(0.02, -0.02, 0.01);
        body.strand(0.02, &[(knot, 0.012), (middle, 0.02), (end, 0.026)]);
    }
}

fn hair(body: &mut Body, at: Placement, a: f64) {
    let p = |x: f64, y: f64, z: f64| at.world(DVec3::new(x, y, z));
    body.group(Op::Join, 0.004);
    body.paint = HAIR;
    let cap = Placement { origin: p(0.0, 0.026, 0.042), axes: at.axes };
    body.join(0.0, Shape::Ellipsoid { at: cap, radii: DVec3::new(0.08, 0.092, 0.084) });
    let face = Placement { origin: p(0.0, -0.085, -0.02), axes: at.axes };
    body.cut(0.012, Shape::Ellipsoid { at: face, radii: DVec3::new(0.066, 0.075, 0.1) });
    // Hair combed back from a parting into a bun.
    let bun = p(0.0, 0.122, 0.085);
    for i in 0..9 {
        for side in [-1.0, 1.0] {
            let s = 0.06 + 0.94 * f64::from(i) / 8.0;
            let front = p(side * 0.077 * s, -0.062 + 0.07 * s * s, 0.112 - 0.085 * s * s);
            let top = p(side * 0.079 * s.sqrt(), 0.04, 0.124 - 0.10 * s * s);
            body.strand(0.006, &[(front, 0.0065), (top, 0.0085), (bun, 0.012)]);
        }
    }
    body.join(0.015, Shape::ball(bun, 0.036));
    let twist = Placement::along(bun, at.axes * DVec3::new(0.0, 0.8, 0.6), DVec3::X);
    for i in 0..3 {
        let lift = 0.012 * f64::from(i);
        let ring = Placement { origin: twist.world(DVec3::new(0.0, 0.0, lift)), axes: twist.axes };
        body.join(0.004, Shape::Ring { at: ring, major: 0.034 - 0.010 * f64::from(i), minor: 0.009 });
    }
    for side in [-1.0, 1.0] {
        // A loose lock on either side, which swings.
        let swing = 0.02 * (a - 1.0).sin();
        body.strand(
            0.004,
            &[
                (p(side * 0.072, -0.04, 0.03), 0.005),
                (p(side * 0.083 + 0.4 * swing, -0.045, -0.02), 0.0045),
                (p(side * 0.077 + swing, -0.042, -0.06), 0.004),
                (p(side * 0.085 + 1.5 * swing, -0.05, -0.09), 0.002),
            ],
        );
    }
}
