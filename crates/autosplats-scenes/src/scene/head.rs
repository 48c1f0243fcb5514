//! A human head with its face.

use glam::DVec3;

use super::body::{Body, Op};
use super::paint::Paint;
use super::shape::{Placement, Shape};

/// The colours of a head.
#[derive(Clone, Copy, Debug)]
pub(super) struct HeadColors {
    pub(super) skin: Paint,
    pub(super) lips: Paint,
    pub(super) eyes: Paint,
    pub(super) irises: Paint,
    pub(super) brows: Paint,
}

/// Joins a bald head, 23 cm high, to the group. The placement's origin is its centre; it looks along local -y.
pub(super) fn head(body: &mut Body, at: Placement, looks: HeadColors) {
    let p = |x: f64, y: f64, z: f64| at.world(DVec3::new(x, y, z));
    let egg = |x: f64, y: f64, z: f64, radii: [f64; 3]| {
        let origin = at.world(DVec3::new(x, y, z));
        Shape::Ellipsoid { at: Placement { origin, axes: at.axes }, radii: DVec3::from(radii) }
    };
    body.paint = looks.skin;
    body.join(0.03, egg(0.0, 0.014, 0.03, [0.075, 0.096, 0.086]));
    body.join(0.035, egg(0.0, -0.032, -0.032, [0.062, 0.056, 0.076]));
    body.join(0.022, egg(0.0, -0.073, -0.101, [0.019, 0.016, 0.015]));
    for side in [-1.0, 1.0] {
        let q = |x: f64, y: f64, z: f64| p(side * x, y, z);
        body.join(0.025, Shape::cone(q(0.052, 0.012, -0.05), q(0.012, -0.066, -0.102), 0.016, 0.013));
        body.join(0.025, egg(side * 0.044, -0.056, -0.02, [0.022, 0.02, 0.018]));
        body.join(0.016, Shape::cone(q(0.012, -0.082, 0.026), q(0.05, -0.062, 0.025), 0.0125, 0.01));
        body.cut(0.016, egg(side * 0.031, -0.093, 0.004, [0.019, 0.013, 0.010]));
        // Ear: a rim, a lobe and the part between.
        body.strand(
            0.004,
            &[
                (q(0.074, -0.004, -0.008), 0.005),
                (q(0.08, -0.002, 0.018), 0.0045),
                (q(0.087, 0.012, 0.027), 0.0045),
                (q(0.09, 0.024, 0.016), 0.0045),
                (q(0.085, 0.02, -0.006), 0.0045),
                (q(0.077, 0.006, -0.026), 0.0065),
                (q(0.073, -0.001, -0.02), 0.005),
            ],
        );
        body.join(0.006, Shape::cone(q(0.074, 0.006, -0.008), q(0.079, 0.012, 0.014), 0.009, 0.008));
    }
    body.join(0.014, Shape::cone(p(0.0, -0.086, 0.016), p(0.0, -0.111, -0.028), 0.0075, 0.0105));
    for side in [-1.0, 1.0] {
        body.join(0.007, egg(side * 0.0125, -0.1, -0.0325, [0.0082, 0.0105, 0.0075]));
        body.cut(0.003, egg(side * 0.0068, -0.107, -0.0415, [0.0032, 0.0055, 0.004]));
    }
    // The hollow under the nose, then lips and the line between them.
    body.cut(0.006, Shape::cone(p(0.0, -0.1015, -0.046), p(0.0, -0.1005, -0.055), 0.0028, 0.0036));
    body.paint = looks.lips;
    for side in [-1.0, 1.0] {
        let q = |x: f64, y: f64, z: f64| p(side * x, y, z);
        body.strand(
            0.006,
            &[
                (q(0.0245, -0.0795, -0.0655), 0.002),
                (q(0.009, -0.0905, -0.0618), 0.0044),
                (q(0.0, -0.0915, -0.063), 0.004),
            ],
        );
        body.strand(
            0.006,
            &[
                (q(0.022, -0.0795, -0.068), 0.0028),
                (q(0.009, -0.0893, -0.0722), 0.0052),
                (q(0.0, -0.0903, -0.0726), 0.0053),
            ],
        );
    }
    body.cut(0.003, Shape::cone(p(-0.024, -0.086, -0.0672), p(0.0, -0.1005, -0.0675), 0.0012, 0.0016));
    body.cut(0.003, Shape::cone(p(0.024, -0.086, -0.0672), p(0.0, -0.1005, -0.0675), 0.0012, 0.0016));
    body.group(Op::Join, 0.002);
    for side in [-1.0, 1.0] {
        let q = |x: f64, y: f64, z: f64| p(side * x, y, z);
        body.paint = looks.eyes;
        body.join(0.0, Shape::ball(q(0.0305, -0.0735, 0.0015), 0.0122));
        body.paint = looks.irises;
        body.join(0.0, Shape::ball(q(0.0295, -0.0815, 0.0015), 0.0052));
        body.paint = looks.skin;
        body.strand(
            0.004,
            &[
                (q(0.0165, -0.0795, -0.0005), 0.0018),
                (q(0.023, -0.0843, 0.0062), 0.0026),
                (q(0.031, -0.0856, 0.0088), 0.0028),
                (q(0.039, -0.0818, 0.0068), 0.0027),
                (q(0.0465, -0.0728, 0.0), 0.0022),
            ],
        );
        body.strand(
            0.004,
            &[
                (q(0.0165, -0.0795, -0.0005), 0.0016),
                (q(0.024, -0.0835, -0.0055), 0.0019),
                (q(0.034, -0.083, -0.0072), 0.002),
                (q(0.0465, -0.0728, 0.0), 0.0017),
            ],
        );
        body.paint = looks.brows;
        body.strand(
            0.004,
            &[
                (q(0.013, -0.0925, 0.0255), 0.0022),
                (q(0.022, -0.0915, 0.0295), 0.0025),
                (q(0.033, -0.0868, 0.0325), 0.0024),
                (q(0.043, -0.0775, 0.0315), 0.002),
                (q(0.052, -0.066, 0.027), 0.0012),
            ],
        );
    }
}
