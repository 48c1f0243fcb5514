//! A horse, standing or galloping.

use std::f64::consts::TAU;

use glam::{DMat3, DVec3};

use super::body::{Body, Op};
use super::limb::reach;
use super::paint::Paint;
use super::shape::{Placement, Shape};

/// Colours of a horse.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coat {
    fur: Paint,
    /// Colour of mane and tail.
    hair: Paint,
    /// Colour of the lower legs.
    legs: Paint,
    muzzle: Paint,
}

impl Coat {
    const DARK: Paint = Paint::Mottled { rgb: [50, 40, 34], grain: 0.05, depth: 0.15 };
    const MUZZLE: Paint = Paint::Plain(78, 62, 56);

    const fn new(fur: [u8; 3], hair: [u8; 3], legs: [u8; 3]) -> Self {
        Self {
            fur: Paint::Mottled { rgb: fur, grain: 0.16, depth: 0.10 },
            hair: Paint::Mottled { rgb: hair, grain: 0.04, depth: 0.15 },
            legs: Paint::Mottled { rgb: legs, grain: 0.06, depth: 0.12 },
            muzzle: Self::MUZZLE,
        }
    }

    pub(super) const BAY: Self = Self::new([134, 82, 50], [44, 34, 30], [54, 42, 36]);
    pub(super) const CHESTNUT: Self = Self::new([158, 94, 54], [172, 112, 68], [150, 88, 52]);
    pub(super) const GREY: Self = Self::new([186, 184, 180], [214, 212, 206], [128, 126, 124]);
    pub(super) const BLACK: Self = Self::new([66, 58, 54], [40, 36, 34], [52, 46, 44]);
    pub(super) const PALOMINO: Self = Self::new([200, 158, 100], [232, 220, 196], [206, 170, 118]);
}

/// How a horse moves.
#[derive(Clone, Copy, Debug)]
pub(super) enum Gait {
    Standing,
    /// Phase of the stride, 0 to 1.
    Gallop(f64),
}

/// Adds a horse as separate groups: 1.6 m high at the withers, hooves on z = 0, facing x. Returns the top of its head.
pub(super) fn horse(body: &mut Body, gait: Gait, coat: Coat) -> DVec3 {
    let stride = match gait {
        Gait::Standing => 0.0,
        Gait::Gallop(phase) => phase,
    };
    let moving = if matches!(gait, Gait::Standing) { 0.0 } else { 1.0 };
    let beat = TAU * stride;
    let trunk = Placement {
        origin: DVec3::new(0.0, 0.0, moving * (0.02 + 0.045 * (beat - 0.6).sin())),
        axes: DMat3::from_rotation_y(moving * 0.075 * (beat + 0.9).sin()),
    };
    body.group(Op::Join, 0.0);
    body.paint = coat.fur;
    barrel(body, trunk);
    let (poll, nose) = neck(body, trunk, moving, beat);
    let mut hooves = Vec::new();
    for side in [-1.0, 1.0] {
        let (fore, hind) = match gait {
            Gait::Standing => (None, None),
            // Left and right follow each other closely, hind legs before forelegs.
            Gait::Gallop(phase) => {
                let lag = if side > 0.0 { 0.0 } else { 0.11 };
                (Some((phase - 0.46 - lag).rem_euclid(1.0)), Some((phase - lag).rem_euclid(1.0)))
            }
        };
        hooves.push(fore_leg(body, trunk, side, fore, coat));
        hooves.push(hind_leg(body, trunk, side, hind, coat));
    }
    for foot in hooves {
        hoof(body, foot, coat);
    }
    head(body, poll, nose, coat);
    hair(body, trunk, poll, nose, moving, beat, coat);
    let top = poll + DVec3::Z * 0.098;
    body.frame.placement.world(top * body.frame.scale)
}

fn egg(at: Placement, center: [f64; 3], pitch: f64, radii: [f64; 3]) -> Shape {
    let axes = at.axes * DMat3::from_rotation_y(pitch);
    Shape::Ellipsoid { at: Placement { origin: at.world(DVec3::from(center)), axes }, radii: DVec3::from(radii) }
}

fn barrel(body: &mut Body, at: Placement) {
    body.join(0.0, egg(at, [0.16, 0.0, 1.16], 0.04, [0.50, 0.255, 0.30]));
    body.join(0.14, egg(at, [-0.26, 0.0, 1.21], -0.05, [0.42, 0.24, 0.255]));
    body.join(0.14, egg(at, [-0.58, 0.0, 1.27], 0.25, [0.32, 0.245, 0.255]));
    body.join(0.12, egg(at, [0.50, 0.0, 1.13], -0.6, [0.26, 0.205, 0.30]));
    let p = |x: f64, y: f64, z: f64| at.world(DVec3::new(x, y, z));
    body.join(0.14, Shape::cone(p(0.34, 0.0, 1.44), p(0.04, 0.0, 1.43), 0.085, 0.06));
    for side in [-1.0, 1.0] {
        body.join(0.09, egg(at, [-0.62, side * 0.125, 1.12], 0.15, [0.245, 0.135, 0.31]));
        body.join(0.07, egg(at, [0.43, side * 0.135, 1.14], -0.45, [0.13, 0.105, 0.31]));
        body.join(0.06, egg(at, [0.60, side * 0.085, 1.08], 0.0, [0.12, 0.10, 0.15]));
        body.join(0.05, Shape::cone(p(-0.40, side * 0.185, 1.385), p(-0.50, side * 0.17, 1.36), 0.035, 0.04));
    }
}

/// Adds the neck. Returns the poll and the nose.
fn neck(body: &mut Body, at: Placement, moving: f64, beat: f64) -> (DVec3, DVec3) {
    let nod = moving * 0.05 * (beat + 2.2).sin();
    let still = (DVec3::new(0.98, 0.0, 1.98), DVec3::new(1.36, 0.0, 1.55));
    let fast = (DVec3::new(1.16, 0.0, 1.78 + nod), DVec3::new(1.62, 0.0, 1.47 + 1.3 * nod));
    let poll = at.world(still.0.lerp(fast.0, moving));
    let nose = at.world(still.1.lerp(fast.1, moving));
    let throat = poll.lerp(nose, 0.14) + (nose - poll).cross(DVec3::Y).normalize() * -0.12;
    let base = at.world(DVec3::new(0.40, 0.0, 1.36));
    let chest = at.world(DVec3::new(0.58, 0.0, 1.16));
    let crest = base.lerp(poll, 0.5) + DVec3::new(-0.045, 0.0, 0.05);
    let gullet = chest.lerp(throat, 0.5) + DVec3::new(-0.03, 0.0, 0.03);
    body.join(0.12, Shape::cone(base, crest, 0.15, 0.105));
    body.join(0.10, Shape::cone(crest, poll + DVec3::new(-0.02, 0.0, 0.0), 0.105, 0.08));
    body.join(0.12, Shape::cone(chest, gullet, 0.185, 0.125));
    body.join(0.10, Shape::cone(gullet, throat, 0.125, 0.085));
    (poll, nose)
}

/// Position of a hoof in its stride: forward of the middle, above the ground, and how far it is folded back.
fn step(phase: Option<f64>, reach: f64, lift: f64) -> (f64, f64, f64) {
    const STANCE: f64 = 0.28;
    match phase {
        None => (0.0, 0.0, 0.0),
        Some(u) if u < STANCE => (reach * (1.0 - 2.0 * u / STANCE), 0.0, 0.0),
        Some(u) => {
            let s = (u - STANCE) / (1.0 - STANCE);
            let ease = s * s * (3.0 - 2.0 * s);
            let up = (std::f64::consts::PI * s).sin();
            (reach * (2.0 * ease - 1.0), lift * up, up * (1.0 - 0.55 * s))
        }
    }
}

/// A foot to add after the legs, in a group of its own, because its sole is cut flat.
#[derive(Clone, Copy, Debug)]
struct Hoof {
    fetlock: DVec3,
    fold: f64,
    thick: f64,
}

fn hoof(body: &mut Body, Hoof { fetlock, fold, thick }: Hoof, coat: Coat) {
    // The pastern slopes forward on the ground and is tucked under in the air.
    let angle = 0.55 - 2.1 * fold;
    let down = DVec3::new(angle.sin(), 0.0, -angle.cos());
    let coronet = fetlock + down * 0.095;
    body.group(Op::Join, 0.02);
    body.paint = coat.legs;
    body.join(0.0, Shape::cone(fetlock, coronet, 0.046 * thick, 0.043 * thick));
    let flat = DVec3::NEG_Z.lerp(down, (fold * 10.0).min(1.0)).normalize();
    let end = coronet + (flat + down * 0.25).normalize() * 0.062;
    body.paint = Coat::DARK;
    body.join(0.008, Shape::cone(coronet, end, 0.043, 0.06));
    body.cut(0.008, Shape::HalfSpace { normal: -flat, offset: -flat.dot(end) });
}

fn fore_leg(body: &mut Body, at: Placement, side: f64, phase: Option<f64>, coat: Coat) -> Hoof {
    let (x, z, fold) = step(phase, 0.50, 0.34);
    let swing = x / 0.50;
    let elbow = at.world(DVec3::new(0.42 + 0.05 * swing, side * 0.155, 0.98 + 0.02 * swing.max(0.0)));
    let stance = DVec3::new(0.46 + x, side * 0.14, 0.148 + z);
    let (knee, fetlock) = reach(elbow, stance, 0.43, 0.315 + 0.08, DVec3::X);
    body.paint = coat.fur;
    body.join(0.09, Shape::cone(elbow, knee, 0.098, 0.056));
    body.paint = coat.legs;
    body.join(0.03, Shape::ball(knee, 0.06));
    body.join(0.03, Shape::cone(knee, fetlock, 0.047, 0.038));
    body.join(0.02, Shape::ball(fetlock, 0.049));
    Hoof { fetlock, fold, thick: 1.0 }
}

fn hind_leg(body: &mut Body, at: Placement, side: f64, phase: Option<f64>, coat: Coat) -> Hoof {
    let (x, z, fold) = step(phase, 0.50, 0.30);
    let swing = x / 0.50;
    let stifle = at.world(DVec3::new(-0.50 + 0.11 * swing, side * 0.165, 0.96 + 0.03 * swing));
    let stance = DVec3::new(-0.78 + 0.10 * f64::from(phase.is_some()) + x, side * 0.13, 0.148 + z);
    let (hock, fetlock) = reach(stifle, stance, 0.46, 0.42, DVec3::NEG_X);
    body.paint = coat.fur;
    body.join(0.10, Shape::cone(stifle, hock, 0.125, 0.056));
    let point = hock + (hock - stifle).normalize() * 0.03 + DVec3::new(-0.035, 0.0, 0.02);
    body.paint = coat.legs;
    body.join(0.04, Shape::cone(hock, point, 0.055, 0.035));
    body.join(0.03, Shape::cone(hock, fetlock, 0.054, 0.041));
    body.join(0.02, Shape::ball(fetlock, 0.05));
    Hoof { fetlock, fold, thick: 1.05 }
}

fn head(body: &mut Body, poll: DVec3, nose: DVec3, coat: Coat) {
    let forward = (nose - poll).normalize();
    // Local x along the head, z out of the forehead.
    let at = Placement { origin: poll, axes: DMat3::from_cols(forward, DVec3::Y, forward.cross(DVec3::Y)) };
    let p = |x: f64, y: f64, z: f64| at.world(DVec3::new(x, y, z));
    let long = poll.distance(nose);
    body.group(Op::Join, 0.07);
    body.paint = coat.fur;
    body.join(0.0, Shape::cone(p(0.03, 0.0, -0.01), p(0.24, 0.0, 0.005), 0.095, 0.088));
    body.join(0.06, Shape::cone(p(0.22, 0.0, -0.005), p(long - 0.06, 0.0, -0.02), 0.082, 0.056));
    body.join(0.05, egg(at, [0.17, 0.0, -0.085], 0.15, [0.145, 0.068, 0.105]));
    body.join(0.05, Shape::cone(p(0.24, 0.0, -0.115), p(long - 0.06, 0.0, -0.078), 0.05, 0.038));
    for side in [-1.0, 1.0] {
        // Brow, cheekbone, eye.
        body.join(0.03, Shape::cone(p(0.11, side * 0.068, 0.04), p(0.19, side * 0.072, 0.03), 0.026, 0.02));
        body.join(0.03, Shape::cone(p(0.20, side * 0.066, -0.01), p(0.36, side * 0.05, -0.03), 0.02, 0.012));
        body.cut(0.02, Shape::ball(p(0.155, side * 0.108, 0.014), 0.018));
    }
    body.paint = coat.muzzle;
    body.join(0.05, egg(at, [long - 0.02, 0.0, -0.038], 0.3, [0.075, 0.062, 0.068]));
    body.join(0.03, egg(at, [long - 0.02, 0.0, -0.092], 0.2, [0.055, 0.045, 0.03]));
    for side in [-1.0, 1.0] {
        body.join(0.015, egg(at, [long + 0.012, side * 0.042, -0.012], 0.5, [0.034, 0.018, 0.026]));
        body.cut(0.008, egg(at, [long + 0.024, side * 0.06, -0.012], 0.5, [0.02, 0.014, 0.013]));
        body.cut(
            0.006,
            Shape::cone(p(long + 0.05, side * 0.03, -0.078), p(long - 0.07, side * 0.064, -0.072), 0.005, 0.003),
        );
    }
    body.group(Op::Join, 0.006);
    for side in [-1.0, 1.0] {
        body.paint = Paint::Plain(30, 24, 22);
        body.join(0.0, Shape::ball(p(0.155, side * 0.078, 0.014), 0.024));
        body.paint = coat.fur;
        let lid = [
            (p(0.125, side * 0.088, 0.012), 0.007),
            (p(0.15, side * 0.096, 0.034), 0.009),
            (p(0.185, side * 0.086, 0.016), 0.007),
        ];
        body.strand(0.006, &lid);
    }
    body.group(Op::Join, 0.03);
    for side in [-1.0, 1.0] {
        let root = p(-0.005, side * 0.052, 0.062);
        let up = (forward * -0.35 + DVec3::new(0.25, side * 0.22, 0.9)).normalize();
        body.strand(0.012, &[(root, 0.026), (root + up * 0.06, 0.032), (root + up * 0.15, 0.006)]);
        let open = root + up * 0.08 + DVec3::new(0.032, side * 0.012, 0.0);
        body.cut(0.012, Shape::cone(open - up * 0.035, open + up * 0.045, 0.018, 0.005));
    }
}

/// Mane, forelock and tail: locks that hang, or stream behind.
fn hair(body: &mut Body, at: Placement, poll: DVec3, nose: DVec3, moving: f64, beat: f64, coat: Coat) {
    body.group(Op::Join, 0.012);
    body.paint = coat.hair;
    let base = at.world(DVec3::new(0.30, 0.0, 1.50));
    let middle = base.lerp(poll, 0.5) + DVec3::new(-0.075, 0.0, 0.105);
    let top = poll + DVec3::new(-0.03, 0.0, 0.075);
    for i in 0..16 {
        let s = f64::from(i) / 15.0;
        let root = base.lerp(middle, s).lerp(middle.lerp(top, s), s);
        let wave = 0.035 * (beat - 5.0 * s + 1.7 * f64::from(i % 3)).sin();
        let hang = DVec3::new(-0.05, -0.15 - 0.02 * f64::from(i % 2), -0.20 - 0.03 * f64::from(i % 3));
        let stream = DVec3::new(-0.27, -0.07 - wave, 0.02 + wave + 0.03 * f64::from(i % 3));
        let fall = hang.lerp(stream, moving);
        let bend = DVec3::new(0.0, -0.055 * (1.0 - moving), 0.045);
        let points = [
            (root, 0.030),
            (root + fall * 0.35 + bend, 0.027),
            (root + fall * 0.7 + bend * 0.7 + DVec3::Z * wave * 0.5, 0.020),
            (root + fall * 1.1 - DVec3::Z * wave * 0.4, 0.006),
        ];
        body.strand(0.018, &points);
    }
    let forehead = poll.lerp(nose, 0.3) + (nose - poll).cross(DVec3::Y).normalize() * 0.098;
    for i in -1..=1 {
        let y = 0.024 * f64::from(i);
        let points = [
            (top + DVec3::new(0.02, 0.5 * y, 0.0), 0.022),
            (top.lerp(forehead, 0.5) + DVec3::new(0.035, y, 0.02), 0.018),
            (forehead + DVec3::new(0.0, 1.4 * y, 0.0), 0.006),
        ];
        body.strand(0.015, &points);
    }
    let dock = at.world(DVec3::new(-0.86, 0.0, 1.37));
    for i in 0..11 {
        let around = TAU * f64::from(i) / 11.0 * 2.4;
        let spread = 0.03 + 0.07 * f64::from(i) / 11.0;
        let (sin, cos) = around.sin_cos();
        let wave = 0.08 * (beat + 1.0).sin();
        let points = [0.0, 0.25, 0.5, 0.75, 1.0].map(|s: f64| {
            let hang = DVec3::new(-0.16 * (1.0 - (1.0 - s).powi(3)), 0.0, 0.05 * s - 0.85 * s * s.sqrt());
            let sway = wave * (4.0 * s - beat).sin() * s;
            let stream = DVec3::new(-0.80 * s, 0.5 * sway, 0.16 * (3.1 * s).sin() - 0.20 * s * s + sway);
            let bulge = spread * (std::f64::consts::PI * (0.12 + 0.8 * s)).sin();
            let offset = DVec3::new(0.35 * bulge * cos, bulge * sin, bulge * cos * moving);
            let thick = 0.034 * (1.0 - s).sqrt() + 0.007;
            (dock + hang.lerp(stream, moving) + offset, thick)
        });
        body.strand(0.02, &points);
    }
}
