//! Quadrics against known surfaces.

use autosplats_cloud::glam::DVec3;
use glam::Vec3;
use pulp::Simd;

use super::{Gathered, Plane, Quadric, tangents};
use crate::adapt::STEP;
use crate::adapt::cells::{CellRow, Cells, Cluster, Level};
use crate::adapt::choose::choose;
use crate::adapt::rules::Goal;
use crate::adapt::tests::angle;
use crate::camera::{Camera, Projection, View};

/// One cluster in each cell of the surface z = `depth`(x, y).
fn cells_on(depth: impl Fn(f32, f32) -> f32) -> (Cells, View) {
    let projection = Projection::OrthographicHeight(2.0);
    let camera = Camera { eye: DVec3::ZERO, look_at: DVec3::Z, up: DVec3::NEG_Y, projection };
    let view = camera.view(DVec3::ZERO, [200, 200]).expect("a view");
    let side_px = 4;
    let cluster = |column: usize, row: usize| {
        let pixel = [column, row].map(|at| (side_px * at + side_px / 2) as f32);
        let [x, y, _] = view.unproject(pixel, 1.0).to_array();
        Cluster { mean: [x, y, depth(x, y)], count: 1.0 }
    };
    let row = |row: usize| CellRow::of((0..50).map(|column| std::iter::once(cluster(column, row))));
    let level = Level { side_px, columns: 50, rows: (0..50).map(row).collect() };
    (Cells { levels: vec![level] }, view)
}

/// The quadric fitted about a point `above` the surface z = `depth`(x, y).
fn quadric_on(depth: impl Fn(f32, f32) -> f32, at: [f32; 2], above: f32, radius: f32) -> Quadric {
    let (cells, view) = cells_on(&depth);
    let center = [at[0], at[1], depth(at[0], at[1]) - above];
    let mut gathered = Gathered::default();
    assert!(gathered.read(pulp::Scalar, &cells, center, radius, &view) > 100, "clusters in the ball");
    let curvature = gathered.plane(pulp::Scalar).curvature();
    gathered.quadric(pulp::Scalar, radius, Vec3::Z, curvature)
}

#[test]
fn a_quadric_is_found_again() {
    let radius = 0.4;
    for at in [[0.0, 0.0], [0.113, -0.237]] {
        for above in [0.0, 0.05] {
            for bend in [0.0, 0.3] {
                let depth = |x: f32, y: f32| 4.0 + 0.1 * x - 0.05 * y + bend * (x * x - 0.7 * x * y + 0.3 * y * y);
                let [x, y] = at;
                let slope = [0.1 + bend * (2.0 * x - 0.7 * y), -0.05 + bend * (0.6 * y - 0.7 * x)];
                let found = quadric_on(depth, at, above, radius);
                let normal = Vec3::new(-slope[0], -slope[1], 1.0).normalize();
                let case = format!("{at:?} {above} {bend}: {found:?}");
                // The ridge pulls curvatures towards 0 by some hundredths, which moves a bent surface.
                let bent = bend * radius;
                assert!(angle(found.normal.into(), normal.into()) < 0.05 + 4.0 * bent, "{case}");
                assert!((found.height - above).abs() < radius * (1e-4 + 0.05 * bent), "{case}");
                assert!(found.scatter < radius * (1e-3 + 0.1 * bent), "{case}");
            }
        }
    }
}

/// A bent surface with a normal 24° off its axis. The tangents turn much further.
fn leaning() -> Quadric {
    let axis = Vec3::new(0.7, -0.5, 0.05).normalize();
    let (u, v) = tangents(axis);
    let slope = [-0.33, 0.3];
    Quadric {
        normal: (axis - u * slope[0] - v * slope[1]).normalize(),
        height: 0.008,
        axis,
        scatter: 0.01,
        error: 2.0,
        curvature: 0.01,
        radius: 0.4,
        slope,
        bend: [0.2, -0.14, 0.06],
    }
}

/// Height of a place on the first quadric above the second, in radii of the second.
fn above(from: &Quadric, at: [f32; 2], to: &Quadric) -> f32 {
    let height = |quadric: &Quadric, [x, y]: [f32; 2]| {
        let ([sx, sy], [xx, xy, yy]) = (quadric.slope, quadric.bend);
        quadric.height / quadric.radius + x * (sx + xx * x + xy * y) + y * (sy + yy * y)
    };
    let (u, v) = tangents(from.axis);
    let place = (u * at[0] + v * at[1] + from.axis * height(from, at)) * (from.radius / to.radius);
    let (u, v) = tangents(to.axis);
    to.axis.dot(place) - height(to, [u.dot(place), v.dot(place)])
}

#[test]
fn upright_quadrics_are_the_same_surface() {
    let leaning = leaning();
    let upright = leaning.upright();
    assert_eq!((upright.axis, upright.slope), (leaning.normal, [0.0; 2]));
    let places = [[0.3, 0.0], [0.0, 0.3], [-0.3, 0.0], [0.0, -0.3], [0.2, 0.2], [-0.2, 0.2]];
    let most_off = |other: &Quadric| places.map(|at| above(&leaning, at, other).abs()).into_iter().fold(0.0, f32::max);
    assert!(above(&leaning, [0.0, 0.0], &upright).abs() < 1e-3, "{upright:?}");
    // The rest is of third order.
    let (off, flat_off) = (most_off(&upright), most_off(&Quadric { bend: [0.0; 3], ..upright }));
    assert!(off < 0.12 * flat_off, "{off}, and {flat_off} without curvature");
}

#[test]
fn between_quadrics_of_two_balls() {
    let smaller = leaning().upright();
    let slope = [0.2, -0.1];
    let (u, v) = tangents(smaller.axis);
    let larger = Quadric {
        normal: (smaller.axis - u * slope[0] - v * slope[1]).normalize(),
        height: smaller.height + 0.01,
        scatter: 2.0 * smaller.scatter,
        radius: 1.6 * smaller.radius,
        slope,
        error: 0.5 * smaller.error,
        bend: smaller.bend.map(|bend| 2.0 * bend),
        ..smaller
    };
    let numbers = |quadric: &Quadric| {
        let Quadric { normal, height, scatter, error, radius, slope, bend, .. } = *quadric;
        let curvatures = bend.map(|bend| bend / radius);
        [&normal.to_array()[..], &[height, scatter, error, radius], &slope, &curvatures].concat()
    };
    let off = |share: f32, expected: &[f32]| {
        let found = numbers(&smaller.towards(&larger, share));
        found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    };
    let ends = [&smaller, &larger].map(numbers);
    let half: Vec<f32> = ends[0].iter().zip(&ends[1]).map(|(a, b)| 0.5 * (a + b)).collect();
    assert!(off(0.0, &ends[0]) < 1e-6 && off(1.0, &ends[1]) < 1e-6);
    // Slopes are exactly in the middle, normals nearly.
    assert!(off(0.5, &half) < 0.01, "{}", off(0.5, &half));
    assert!(off(0.5, &ends[0]) > 0.1 && off(0.5, &ends[1]) > 0.1);
}

/// The surface bends more than a quadric with distance: larger balls agree less and less with the smaller ones.
#[test]
fn a_ball_that_agrees_by_half_counts_by_half() {
    let radius = 0.2;
    let goal = Goal { noise: 0.003, enough: 1e-4, scatter: 0.1 };
    let found = |bend: f32| {
        let (cells, view) = cells_on(|x, y| 4.0 + bend * x * (x * x + y * y));
        choose(pulp::Scalar, [0.0, 0.0, 4.0], radius, None, &goal, (&cells, &view), &mut Gathered::default())
            .expect("one")
    };
    let is_ball = |found: f32| {
        let scale = (found / radius).ln() / STEP.ln();
        (scale - scale.round()).abs() < 0.01
    };
    let radii: Vec<f32> = (0..40).map(|bend| found(0.002 * bend as f32).radius).collect();
    assert!(is_ball(radii[0]) && radii.is_sorted_by(|less, more| less >= more), "{radii:?}");
    let between = radii.iter().filter(|&&radius| !is_ball(radius)).count();
    assert!(between > 30, "{between} of 40 are between two balls");
}

#[pulp::with_simd(read_and_fit = pulp::Arch::new())]
#[inline(always)]
fn read_and_fit_with<'a, S: Simd>(
    simd: S,
    cells: &'a Cells,
    center: [f32; 3],
    radius: f32,
    view: &'a View,
    gathered: &'a mut Gathered,
) -> (usize, Quadric) {
    let len = gathered.read(simd, cells, center, radius, view);
    let Plane { axis, .. } = gathered.plane(simd);
    (len, gathered.quadric(simd, radius, axis, 0.1))
}

#[test]
fn any_width_of_vectors_fits_to_the_same_bits() {
    let (cells, view) = cells_on(|x, y| 4.0 + 0.1 * x + 0.3 * (x * x - y));
    let [mut gathered, mut alone]: [Gathered; 2] = Default::default();
    // The second ball reads less than the first has left behind.
    for radius in [0.9, 0.21, 0.4] {
        let center = [0.113, -0.237, 4.08];
        let found = read_and_fit(&cells, center, radius, &view, &mut gathered);
        assert_eq!(found, read_and_fit_with(pulp::Scalar, &cells, center, radius, &view, &mut alone), "{radius}");
        let places = (0..50 * 50).flat_map(|cell| cells.levels[0].clusters([cell % 50, cell / 50]));
        let inside = places.filter(|place| Vec3::from(place.mean).distance(center.into()) < radius);
        assert_eq!(found.0, inside.count(), "clusters within {radius}");
    }
}
