//! The statue's pedestal: plinth, mouldings, a die with sunk panels, dentils and a cornice.

use std::f64::consts::TAU;

use glam::DVec3;

use super::body::{Body, Op};
use super::paint::Paint;
use super::shape::{Placement, Shape};

const STONE: Paint = Paint::Mottled { rgb: [176, 168, 156], grain: 0.07, depth: 0.07 };

/// Adds the pedestal, 1 m high.
pub(super) fn pedestal(body: &mut Body) {
    let slab = |half: f64, low: f64, high: f64, round: f64| Shape::Block {
        at: Placement::at(DVec3::Z * (0.5 * (low + high))),
        half: DVec3::new(half, half, 0.5 * (high - low)),
        round,
    };
    body.paint = STONE;
    body.group(Op::Join, 0.0);
    // From bottom to top. A rounding of half the height turns a slab into a torus.
    for (half, low, high, round) in [
        (0.62, 0.0, 0.11, 0.006),
        (0.575, 0.11, 0.165, 0.026),
        (0.535, 0.16, 0.185, 0.003),
        (0.52, 0.18, 0.225, 0.022),
        (0.475, 0.22, 0.24, 0.003),
        (0.44, 0.235, 0.765, 0.006),
        (0.46, 0.755, 0.778, 0.011),
        (0.475, 0.778, 0.83, 0.004),
        (0.545, 0.828, 0.856, 0.012),
        (0.575, 0.853, 0.905, 0.006),
        (0.555, 0.904, 0.930, 0.012),
        (0.50, 0.928, 0.948, 0.004),
    ] {
        body.join(0.004, slab(half, low, high, round));
    }
    let round = |radius: f64, low: f64, high: f64, round: f64| Shape::Cylinder {
        at: Placement::at(DVec3::Z * (0.5 * (low + high))),
        radius,
        half_height: 0.5 * (high - low),
        round,
    };
    body.join(0.004, round(0.47, 0.94, 0.985, 0.02));
    body.join(0.004, round(0.44, 0.98, 1.0, 0.004));
    // Four sides: local x to the right, z out of the face. All stone is removed before anything is carved, because a
    // cut affects only solids already in the group.
    let sides = [0.0, 1.0, 2.0, 3.0].map(|quarter: f64| {
        let (sin, cos) = (0.25 * TAU * quarter).sin_cos();
        let (out, right) = (DVec3::new(sin, -cos, 0.0), DVec3::new(cos, sin, 0.0));
        move |x: f64, z: f64, depth: f64| Placement::along(right * x + DVec3::Z * z + out * depth, out, right)
    });
    for at in &sides {
        body.cut(0.005, Shape::Block { at: at(0.0, 0.5, 0.44), half: DVec3::new(0.355, 0.20, 0.022), round: 0.004 });
        for i in 0..17 {
            let x = 0.0588 * (f64::from(i) - 8.0);
            let half = DVec3::new(0.017, 0.017, 0.03);
            body.join(0.002, Shape::Block { at: at(x, 0.808, 0.482), half, round: 0.003 });
        }
    }
    for (turn, at) in (0..).zip(&sides) {
        panel(body, at, turn);
    }
}

/// The carving in the panel of a side: a wreath with a rosette, between lines of an inscription.
fn panel(body: &mut Body, at: &dyn Fn(f64, f64, f64) -> Placement, turn: i32) {
    body.group(Op::Join, 0.003);
    let ground = 0.42;
    let frame = [(0.0, 0.5 + 0.178, 0.333, 0.006), (0.0, 0.5 - 0.178, 0.333, 0.006)];
    for (x, z, wide, high) in frame {
        body.join(0.003, Shape::Block { at: at(x, z, ground), half: DVec3::new(wide, high, 0.008), round: 0.005 });
    }
    for x in [-0.333, 0.333] {
        body.join(0.003, Shape::Block { at: at(x, 0.5, ground), half: DVec3::new(0.006, 0.178, 0.008), round: 0.005 });
    }
    if turn % 2 == 0 {
        for i in 0..28 {
            let angle = TAU * f64::from(i) / 28.0;
            let (sin, cos) = angle.sin_cos();
            for (radius, lean) in [(0.100, 0.45), (0.124, -0.45)] {
                let center = at(radius * cos, 0.5 + radius * sin, ground + 0.006);
                let (s, c) = (angle + 0.25 * TAU + lean).sin_cos();
                let along = center.axes.x_axis * c + DVec3::Z * s;
                let leaf = Placement::along(center.origin, along, center.axes.z_axis);
                body.join(0.003, Shape::Ellipsoid { at: leaf, radii: DVec3::new(0.010, 0.009, 0.024) });
            }
        }
        for i in 0..8 {
            let (sin, cos) = (TAU * f64::from(i) / 8.0).sin_cos();
            let a = at(0.018 * cos, 0.5 + 0.018 * sin, ground + 0.004).origin;
            let b = at(0.050 * cos, 0.5 + 0.050 * sin, ground + 0.002).origin;
            body.join(0.003, Shape::cone(a, b, 0.009, 0.0165));
        }
        body.join(0.003, Shape::ball(at(0.0, 0.5, ground + 0.008).origin, 0.018));
        for side in [-1.0, 1.0] {
            // Scrolls on either side of the wreath.
            let points = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0].map(|k: f64| {
                let (sin, cos) = (0.72 * k).sin_cos();
                let radius = 0.075 - 0.0055 * k;
                (at(side * (0.235 + radius * cos), 0.5 + radius * sin, ground + 0.003).origin, 0.0105 - 0.0004 * k)
            });
            body.strand(0.003, &points);
        }
    } else {
        for line in 0..4 {
            let z = 0.5 + 0.105 - 0.07 * f64::from(line);
            for letter in 0..13 {
                let x = 0.045 * (f64::from(letter) - 6.0);
                glyph(body, at, x, z, ground, (line * 13 + letter) * 7 % 5);
            }
        }
    }
}

/// One raised letter of a made-up capital script.
fn glyph(body: &mut Body, at: &dyn Fn(f64, f64, f64) -> Placement, x: f64, z: f64, depth: f64, kind: i32) {
    let p = |dx: f64, dz: f64| at(x + dx, z + dz, depth).origin;
    let mut stroke = |a: DVec3, b: DVec3| {
        body.join(0.001, Shape::cone(a, b, 0.0052, 0.0052));
    };
    match kind {
        0 => {
            stroke(p(-0.012, -0.02), p(0.0, 0.02));
            stroke(p(0.012, -0.02), p(0.0, 0.02));
        }
        1 => {
            stroke(p(-0.010, -0.02), p(-0.010, 0.02));
            stroke(p(-0.010, 0.02), p(0.012, 0.02));
            stroke(p(-0.010, 0.0), p(0.008, 0.0));
        }
        2 => {
            stroke(p(-0.012, -0.02), p(-0.012, 0.02));
            stroke(p(0.012, -0.02), p(0.012, 0.02));
            stroke(p(-0.012, 0.02), p(0.012, -0.02));
        }
        3 => {
            stroke(p(0.0, -0.02), p(0.0, 0.02));
            stroke(p(-0.014, 0.02), p(0.014, 0.02));
        }
        _ => {
            let at = at(x, z, depth);
            body.join(0.001, Shape::Ring { at, major: 0.016, minor: 0.0052 });
        }
    }
}
