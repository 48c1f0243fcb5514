//! The inside of a vaulted cathedral: a nave between two aisles, seven bays long.
//!
//! # How it works
//! The spaces are cut from a block of stone. The model has only one half bay of one side, and an end; folding space
//! makes the rest. In the half bay, x goes from the window's middle at 0 to the column at 3, then to the building's
//! end. y goes outward from the nave's middle, with the column at 5 and the outer wall at 9.5. z is up, from the floor.

use std::f64::consts::FRAC_PI_2;

use glam::{DMat3, DVec2, DVec3};

use super::body::{Body, Op};
use super::fold::Fold;
use super::model::{Model, Points};
use super::octree::Octree;
use super::paint::Paint;
use super::shape::{Placement, Shape};

const STONE: Paint = Paint::Courses;
const TRIM: Paint = Paint::Mottled { rgb: [206, 194, 172], grain: 0.3, depth: 0.05 };
const PLASTER: Paint = Paint::Mottled { rgb: [214, 205, 188], grain: 0.6, depth: 0.05 };
const WOOD: Paint = Paint::Mottled { rgb: [112, 74, 46], grain: 0.09, depth: 0.14 };
const GOLD: Paint = Paint::Mottled { rgb: [204, 164, 82], grain: 0.1, depth: 0.05 };

const HALF_BAY: f64 = 3.0;
/// Middle of the last bay.
const LAST_BAY_X: f64 = 18.0;
/// Column axis, and the plane of the arcade.
const ARCADE_Y: f64 = 5.0;
/// Inner face of the nave's wall.
const NAVE_WALL_Y: f64 = 4.6;
/// Inner face of the outer wall.
const OUTER_WALL_Y: f64 = 9.5;
/// Inner face of the end wall.
const END_WALL_X: f64 = 7.5;

/// The cathedral, scanned from six places.
pub(super) fn scene() -> Model {
    let mut body = Body::new(STONE);
    mass(&mut body);
    windows(&mut body);
    ribs(&mut body);
    mouldings(&mut body);
    column(&mut body);
    pews(&mut body);
    end(&mut body);
    let fold = Fold::Bays { half_bay: HALF_BAY, last: LAST_BAY_X };
    let tree = Octree::new(body, fold, DVec3::new(0.0, 0.0, -1.0), 24.0, 8);
    let stations = [
        DVec3::new(-14.2, 0.12, 1.75),
        DVec3::new(0.4, -0.15, 1.75),
        DVec3::new(14.6, 0.2, 1.75),
        DVec3::new(-6.3, 7.3, 1.7),
        DVec3::new(7.1, -7.4, 1.7),
        DVec3::new(21.2, -2.9, 1.9),
    ];
    Model { tree, points: Points::Scanned(stations.to_vec()) }
}

fn block(low: [f64; 3], high: [f64; 3], round: f64) -> Shape {
    let (low, high) = (DVec3::from(low), DVec3::from(high));
    Shape::Block { at: Placement::at(0.5 * (low + high)), half: 0.5 * (high - low), round }
}

/// A vault or arch along x, centred on `y`, with its floor at `floor`. `spring` counts from z = 0.
fn along_x(y: f64, floor: f64, half_width: f64, spring: f64, radius: f64) -> Shape {
    let at = Placement { origin: DVec3::new(0.0, y, floor), axes: DMat3::from_rotation_z(FRAC_PI_2) };
    Shape::Passage { at, half_width, spring: spring - floor, radius, half_length: END_WALL_X }
}

/// A vault or arch along y, in the middle of the bay, from y = `from` to `to`.
fn along_y(from: f64, to: f64, floor: f64, half_width: f64, spring: f64, radius: f64) -> Shape {
    let at = Placement::at(DVec3::new(0.0, 0.5 * (from + to), floor));
    Shape::Passage { at, half_width, spring: spring - floor, radius, half_length: 0.5 * (to - from) }
}

/// Inner faces of the nave's vaults, `inset` metres into the room.
fn nave_vault(inset: f64) -> [Shape; 2] {
    [
        along_x(0.0, -0.1, NAVE_WALL_Y - inset, 10.6, 6.9 - inset),
        along_y(-5.2, 5.2, 9.75, 2.72 - inset, 13.3, 4.1 - inset),
    ]
}

fn aisle_vault(inset: f64) -> [Shape; 2] {
    [
        along_x(7.45, -0.1, 2.05 - inset, 5.3, 2.9 - inset),
        along_y(5.0, OUTER_WALL_Y - 0.05, -0.1, 2.62 - inset, 5.3, 3.25 - inset),
    ]
}

/// The stone and the large spaces cut from it.
fn mass(body: &mut Body) {
    body.group(Op::Join, 0.0);
    body.paint = STONE;
    body.join(0.0, block([-30.0, -30.0, -0.9], [9.5, 10.9, 19.5], 0.0));
    body.paint = PLASTER;
    for vault in nave_vault(0.0).into_iter().chain(aisle_vault(0.0)) {
        body.cut(0.0, vault);
    }
    body.paint = STONE;
    // The arcade, in two orders, and the space around the columns below it.
    body.cut(0.0, along_y(ARCADE_Y - 0.6, ARCADE_Y + 0.6, -0.1, 2.15, 5.3, 3.0));
    body.cut(0.0, along_y(ARCADE_Y - 0.6, ARCADE_Y - 0.18, -0.1, 2.38, 5.3, 3.2));
    body.cut(0.0, along_y(ARCADE_Y + 0.18, ARCADE_Y + 0.6, -0.1, 2.38, 5.3, 3.2));
    body.cut(0.0, block([-1.0, ARCADE_Y - 0.6, -0.1], [END_WALL_X, ARCADE_Y + 0.6, 5.15], 0.0));
    // The gallery above the arcade: three niches per half bay.
    for x in [0.5, 1.5] {
        let at = Placement::at(DVec3::new(x, NAVE_WALL_Y, 8.95));
        body.cut(0.0, Shape::Passage { at, half_width: 0.3, spring: 0.28, radius: 0.36, half_length: 0.32 });
    }
    body.paint = Paint::Tiles;
    body.join(0.0, block([-30.0, -30.0, -0.9], [9.5, 10.9, 0.0], 0.0));
}

/// Lancets in the aisles and pairs of lancets under the vault, with stone bars in front of coloured glass.
fn windows(body: &mut Body) {
    for (wall, sill, half, spring, radius) in [(OUTER_WALL_Y - 0.05, 1.9, 1.15, 5.0, 1.7), (5.2, 10.2, 1.35, 13.0, 2.1)]
    {
        body.group(Op::Cut, 0.02);
        body.paint = STONE;
        for (grow, depth) in [(0.12, 0.16), (0.0, 0.5)] {
            body.join(0.0, along_y(wall - 0.3, wall + depth, sill - grow, half + grow, spring, radius + grow));
        }
        body.group(Op::Join, 0.0);
        body.paint = Paint::Glass;
        let glass = wall + 0.42;
        body.join(0.0, block([-2.0, glass, sill - 0.2], [2.0, glass + 0.3, spring + 2.2], 0.0));
        // The bars are visible only in the opening; the rest lies inside the wall.
        body.group(Op::Join, 0.01);
        body.paint = TRIM;
        let bar = glass - 0.06;
        let p = |x: f64, z: f64| DVec3::new(x, bar, z);
        body.join(0.01, Shape::cone(p(0.0, sill), p(0.0, spring + 0.55), 0.075, 0.07));
        // Two small pointed arches, with a ring and leaves above them.
        let small = 0.5 * half;
        for side in [-1.0, 1.0] {
            let turn = |angle: f64| {
                let (sin, cos) = angle.sin_cos();
                p(small + side * (small * 1.35 * cos - small * 0.35), spring - 0.25 + small * 1.35 * sin)
            };
            let arc = [0.0, 0.35, 0.7, 1.05, 1.31].map(|angle| (turn(angle), 0.055));
            body.strand(0.01, &arc);
        }
        let ring = p(0.0, spring + 0.52 * half + 0.12);
        let facing = Placement::along(ring, DVec3::Y, DVec3::X);
        body.join(0.02, Shape::Ring { at: facing, major: 0.40 * half, minor: 0.055 });
        for (sin, cos) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0)] {
            let at = Placement { origin: ring + DVec3::new(cos, 0.0, sin) * (0.2 * half), axes: facing.axes };
            body.join(0.02, Shape::Ring { at, major: 0.15 * half, minor: 0.035 });
        }
        for i in 1..7 {
            let z = sill + f64::from(i) * (spring - 0.3 - sill) / 7.0;
            body.join(0.01, Shape::cone(p(0.0, z), p(half, z), 0.017, 0.017));
        }
    }
}

/// Ribs: slabs along the diagonals of the vault and across it, from which slightly smaller vaults are cut.
fn ribs(body: &mut Body) {
    let upright = |a: DVec2, b: DVec2, thick: f64, low: f64, high: f64| {
        let middle = 0.5 * (a + b);
        let along = (b - a).extend(0.0);
        let at = Placement::along(middle.extend(0.5 * (low + high)), DVec3::Z, along);
        Shape::Block { at, half: DVec3::new(0.5 * along.length(), thick, 0.5 * (high - low)), round: 0.0 }
    };
    body.paint = TRIM;
    let corner = DVec2::new(HALF_BAY, NAVE_WALL_Y);
    for (thick, inset) in [(0.17, 0.12), (0.085, 0.22)] {
        body.group(Op::Join, 0.02);
        body.join(0.0, upright(DVec2::ZERO, corner, thick, 10.9, 18.5));
        body.join(0.0, upright(DVec2::new(HALF_BAY, 0.0), corner, thick * 1.7, 10.6, 18.5));
        for vault in nave_vault(inset) {
            body.cut(0.0, vault);
        }
    }
    for (thick, inset) in [(0.12, 0.09), (0.06, 0.16)] {
        body.group(Op::Join, 0.015);
        let (near, far) = (ARCADE_Y + 0.4, OUTER_WALL_Y);
        let middle = 7.45;
        body.join(0.0, upright(DVec2::new(0.0, middle), DVec2::new(HALF_BAY, near), thick, 5.3, 9.5));
        body.join(0.0, upright(DVec2::new(0.0, middle), DVec2::new(HALF_BAY, far), thick, 5.3, 9.5));
        body.join(0.0, upright(DVec2::new(HALF_BAY, near), DVec2::new(HALF_BAY, far), thick * 1.8, 5.3, 9.5));
        for vault in aisle_vault(inset) {
            body.cut(0.0, vault);
        }
    }
    // Bosses where ribs meet.
    body.group(Op::Join, 0.03);
    body.paint = GOLD;
    for (y, z) in [(0.0, 16.72), (7.45, 7.98)] {
        let at = Placement::at(DVec3::new(0.0, y, z));
        body.join(0.0, Shape::Cylinder { at, radius: 0.30, half_height: 0.16, round: 0.08 });
        body.join(0.02, Shape::ball(at.origin - DVec3::Z * 0.16, 0.14));
        body.join(0.02, Shape::Ring { at: Placement::at(at.origin - DVec3::Z * 0.14), major: 0.21, minor: 0.04 });
    }
}

/// String courses, the gallery's sill and colonnettes, and the shafts that carry the vault.
fn mouldings(body: &mut Body) {
    body.paint = TRIM;
    body.group(Op::Join, 0.03);
    for (z, out, high) in [(8.68, 0.13, 0.09), (9.62, 0.15, 0.11)] {
        body.join(0.0, block([-9.0, NAVE_WALL_Y - out, z - high], [END_WALL_X, NAVE_WALL_Y + 0.2, z + high], 0.05));
        body.join(
            0.02,
            block([-9.0, NAVE_WALL_Y - 0.55 * out, z - high - 0.08], [END_WALL_X, NAVE_WALL_Y + 0.2, z], 0.03),
        );
    }
    for x in [0.0, 1.0, 2.0] {
        let p = |z: f64| DVec3::new(x, NAVE_WALL_Y - 0.02, z);
        body.join(0.01, Shape::cone(p(8.75), p(9.25), 0.055, 0.05));
        body.join(0.02, Shape::cone(p(9.25), p(9.33), 0.05, 0.10));
    }
    body.join(0.0, block([-9.0, OUTER_WALL_Y - 0.16, 1.62], [END_WALL_X, OUTER_WALL_Y + 0.2, 1.78], 0.06));
    body.join(0.0, block([-9.0, OUTER_WALL_Y - 0.55, -0.2], [END_WALL_X, OUTER_WALL_Y + 0.2, 0.46], 0.04));
    // Three shafts on a corbel over each column, with capitals at the springing.
    body.group(Op::Join, 0.03);
    for (dx, radius) in [(0.0, 0.17), (0.27, 0.11)] {
        for side in [-1.0, 1.0] {
            let p = |z: f64| DVec3::new(HALF_BAY + side * dx, NAVE_WALL_Y - 0.06, z);
            body.join(0.02, Shape::cone(p(6.0), p(10.5), radius, radius * 0.96));
            for z in [8.68, 9.62] {
                let at = Placement::at(p(z));
                body.join(0.01, Shape::Ring { at, major: radius, minor: 0.045 });
            }
            body.join(0.03, Shape::cone(p(10.35), p(10.72), radius, radius * 1.75));
        }
    }
    let p = |z: f64| DVec3::new(HALF_BAY, NAVE_WALL_Y - 0.05, z);
    body.join(0.05, Shape::cone(p(5.62), p(6.02), 0.06, 0.25));
    body.join(
        0.02,
        block([HALF_BAY - 0.55, NAVE_WALL_Y - 0.40, 10.74], [HALF_BAY + 0.55, NAVE_WALL_Y + 0.2, 10.90], 0.04),
    );
    // Half columns on the outer wall.
    body.group(Op::Join, 0.03);
    let p = |z: f64| DVec3::new(HALF_BAY, OUTER_WALL_Y - 0.05, z);
    body.join(0.0, Shape::cone(p(0.0), p(5.0), 0.26, 0.25));
    body.join(0.03, Shape::cone(p(4.75), p(5.12), 0.25, 0.40));
    body.join(
        0.02,
        block([HALF_BAY - 0.5, OUTER_WALL_Y - 0.52, 5.13], [HALF_BAY + 0.5, OUTER_WALL_Y + 0.2, 5.30], 0.04),
    );
    for z in [0.5, 0.66, 4.7] {
        body.join(0.02, Shape::Ring { at: Placement::at(p(z)), major: 0.27, minor: 0.06 });
    }
}

/// A round column with base, shaft, eight thin shafts around it and a capital of leaves.
fn column(body: &mut Body) {
    body.paint = TRIM;
    let p = |z: f64| DVec3::new(HALF_BAY, ARCADE_Y, z);
    let drum = |radius: f64, low: f64, high: f64, round: f64| Shape::Cylinder {
        at: Placement::at(p(0.5 * (low + high))),
        radius,
        half_height: 0.5 * (high - low),
        round,
    };
    let square = |half: f64, low: f64, high: f64, round: f64| {
        block([HALF_BAY - half, ARCADE_Y - half, low], [HALF_BAY + half, ARCADE_Y + half, high], round)
    };
    body.group(Op::Join, 0.01);
    body.join(0.0, square(0.82, -0.2, 0.28, 0.03));
    body.join(0.0, square(0.72, 0.2, 0.42, 0.05));
    for (radius, z, minor) in [(0.56, 0.48, 0.10), (0.52, 0.60, 0.045), (0.50, 0.70, 0.07)] {
        body.join(0.01, Shape::Ring { at: Placement::at(p(z)), major: radius, minor });
    }
    body.join(0.02, drum(0.55, 0.2, 0.66, 0.02));
    body.paint = STONE;
    body.join(0.02, drum(0.43, 0.4, 4.6, 0.0));
    body.paint = TRIM;
    for i in 0..8 {
        let (sin, cos) = (std::f64::consts::TAU * (f64::from(i) + 0.5) / 8.0).sin_cos();
        let q = |z: f64| p(z) + DVec3::new(cos, sin, 0.0) * 0.45;
        body.join(0.015, Shape::cone(q(0.5), q(4.4), 0.095, 0.09));
    }
    body.group(Op::Join, 0.01);
    body.join(0.0, Shape::Ring { at: Placement::at(p(4.28)), major: 0.52, minor: 0.055 });
    body.join(0.03, Shape::cone(p(4.4), p(4.78), 0.40, 0.56));
    for (row, (count, low, out)) in [(12, 4.32, 0.60), (12, 4.55, 0.70)].into_iter().enumerate() {
        for i in 0..count {
            let turn = f64::from(i) + 0.5 * row as f64;
            let (sin, cos) = (std::f64::consts::TAU * turn / f64::from(count)).sin_cos();
            let q = |r: f64, z: f64| p(low + z) + DVec3::new(cos, sin, 0.0) * r;
            let leaf = [
                (q(0.46, 0.0), 0.055),
                (q(out - 0.10, 0.17), 0.075),
                (q(out, 0.30), 0.065),
                (q(out + 0.05, 0.25), 0.04),
            ];
            body.strand(0.02, &leaf);
        }
    }
    body.join(0.01, square(0.70, 4.90, 5.02, 0.03));
    body.join(0.01, square(0.78, 5.0, 5.18, 0.05));
    body.join(0.0, square(0.66, 5.1, 5.4, 0.0));
}

/// Benches on either side of the middle aisle. Mirroring puts them back to back.
fn pews(body: &mut Body) {
    for x in [0.5, 1.5, 2.5] {
        body.group(Op::Join, 0.0);
        body.paint = WOOD;
        for y in [1.15, 3.75] {
            body.join(0.0, block([x - 0.30, y - 0.045, 0.0], [x + 0.30, y + 0.045, 0.62], 0.03));
            body.join(0.04, block([x - 0.13, y - 0.045, 0.5], [x + 0.13, y + 0.045, 0.98], 0.03));
            let knob = Placement::along(DVec3::new(x, y, 0.98), DVec3::Y, DVec3::X);
            body.join(0.02, Shape::Cylinder { at: knob, radius: 0.13, half_height: 0.05, round: 0.02 });
        }
        body.join(0.0, block([x - 0.28, 1.15, 0.41], [x + 0.28, 3.75, 0.455], 0.015));
        body.join(0.0, block([x - 0.03, 1.15, 0.40], [x + 0.03, 3.75, 0.93], 0.02));
        body.join(0.01, Shape::cone(DVec3::new(x, 1.15, 0.93), DVec3::new(x, 3.75, 0.93), 0.045, 0.045));
    }
}

/// The end: steps, an altar with cross and candles, and a rose window above a blind arcade.
fn end(body: &mut Body) {
    let rose = DVec3::new(END_WALL_X, 0.0, 11.6);
    let facing = |origin: DVec3| Placement::along(origin, DVec3::X, DVec3::Y);
    body.group(Op::Cut, 0.03);
    body.paint = STONE;
    for (radius, depth) in [(3.3, 0.15), (3.05, 0.34), (2.85, 0.6)] {
        body.join(0.0, Shape::Cylinder { at: facing(rose), radius, half_height: depth, round: 0.0 });
    }
    for y in [0.62, 1.86, 3.10] {
        let at = Placement { origin: DVec3::new(END_WALL_X, y, 2.6), axes: DMat3::from_rotation_z(FRAC_PI_2) };
        body.join(0.0, Shape::Passage { at, half_width: 0.5, spring: 2.6, radius: 0.75, half_length: 0.3 });
    }
    body.group(Op::Join, 0.0);
    body.paint = Paint::Glass;
    body.join(0.0, Shape::Cylinder { at: facing(rose + DVec3::X * 0.7), radius: 3.0, half_height: 0.2, round: 0.0 });
    body.group(Op::Join, 0.02);
    body.paint = TRIM;
    let hub = rose + DVec3::X * 0.42;
    for (major, minor) in [(0.5, 0.11), (0.28, 0.05), (1.75, 0.085), (2.86, 0.12)] {
        body.join(0.02, Shape::Ring { at: facing(hub), major, minor });
    }
    for i in 0..9 {
        // Only the half on this side of the fold.
        let (sin, cos) = (std::f64::consts::PI * (f64::from(i) / 8.0 - 0.5)).sin_cos();
        let out = DVec3::new(0.0, cos, sin);
        body.join(0.02, Shape::cone(hub + out * 0.5, hub + out * 1.75, 0.07, 0.065));
        body.join(0.02, Shape::Ring { at: facing(hub + out * 1.45), major: 0.25, minor: 0.04 });
        let (sin, cos) = (std::f64::consts::PI * ((f64::from(i) + 0.5) / 8.0 - 0.5)).sin_cos();
        let between = DVec3::new(0.0, cos, sin);
        body.join(0.02, Shape::Ring { at: facing(hub + between * 2.30), major: 0.42, minor: 0.06 });
        for turn in 0..4 {
            let (s, c) = (FRAC_PI_2 * f64::from(turn)).sin_cos();
            let leaf = hub + between * (2.30 + 0.2 * c) + out.cross(DVec3::X) * (0.2 * s);
            body.join(0.01, Shape::Ring { at: facing(leaf), major: 0.17, minor: 0.03 });
        }
    }
    body.join(0.0, block([END_WALL_X - 0.14, -1.0, 7.75], [END_WALL_X + 0.2, NAVE_WALL_Y + 0.1, 7.95], 0.05));
    body.join(0.0, block([END_WALL_X - 0.12, -1.0, 2.38], [END_WALL_X + 0.2, NAVE_WALL_Y + 0.1, 2.55], 0.05));
    for y in [0.0, 1.24, 2.48, 3.72] {
        let p = |z: f64| DVec3::new(END_WALL_X - 0.02, y, z);
        body.join(0.01, Shape::cone(p(2.5), p(5.1), 0.075, 0.07));
        body.join(0.03, Shape::cone(p(5.05), p(5.2), 0.075, 0.14));
    }
    altar(body);
}

fn altar(body: &mut Body) {
    body.group(Op::Join, 0.0);
    body.paint = TRIM;
    for (i, x) in [3.9, 4.3, 4.7].into_iter().enumerate() {
        let top = 0.17 * (i as f64 + 1.0);
        body.join(0.0, block([x, -5.0, -0.2], [END_WALL_X + 0.1, 4.3 - 0.4 * i as f64, top], 0.02));
    }
    body.join(0.0, block([5.6, -1.6, 0.4], [6.5, 1.6, 1.42], 0.03));
    body.join(0.0, block([5.5, -1.75, 1.40], [6.6, 1.75, 1.54], 0.03));
    for y in [0.35, 1.05] {
        let at = Placement { origin: DVec3::new(5.6, y, 0.62), axes: DMat3::from_rotation_z(FRAC_PI_2) };
        body.cut(0.01, Shape::Passage { at, half_width: 0.26, spring: 0.36, radius: 0.36, half_length: 0.1 });
    }
    body.group(Op::Join, 0.01);
    body.paint = GOLD;
    let p = |y: f64, z: f64| DVec3::new(6.2, y, z);
    body.join(0.0, Shape::cone(p(0.0, 1.5), p(0.0, 1.62), 0.17, 0.06));
    body.join(0.01, Shape::cone(p(0.0, 1.6), p(0.0, 2.9), 0.045, 0.045));
    body.join(0.01, Shape::cone(p(-0.4, 2.5), p(0.4, 2.5), 0.045, 0.045));
    body.join(0.01, Shape::Ring { at: Placement::along(p(0.0, 2.5), DVec3::X, DVec3::Y), major: 0.2, minor: 0.022 });
    for y in [0.7, 1.1, 1.5] {
        body.join(0.0, Shape::cone(p(y, 1.5), p(y, 1.6), 0.12, 0.04));
        body.join(0.01, Shape::cone(p(y, 1.58), p(y, 1.95), 0.03, 0.03));
        body.join(0.01, Shape::Ring { at: Placement::at(p(y, 1.95)), major: 0.05, minor: 0.02 });
        body.paint = Paint::Plain(236, 226, 204);
        body.join(0.0, Shape::cone(p(y, 1.95), p(y, 2.35), 0.032, 0.03));
        body.paint = GOLD;
    }
}
