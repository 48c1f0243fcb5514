//! The fit against covariances in `f64`, diagonalised by the characteristic polynomial and checked by reconstruction.

use autosplats_cloud::glam::{DMat3, DVec3};

use super::alone::{
    FEW_NEIGHBORS, FEW_NEIGHBORS_FIRST_RADII, MAX_MEAN_OFFSET_K_RADII, MIN_COMPARED_NEIGHBORS, MIN_SURFACE_POINTS,
    SPARSE_FIRST_RADII,
};
use super::cpu::{LONGEST, MAX_CULLED_FIRST_RADII};
use super::{FitRules, Surfel, Surfels, fit};
use crate::camera::{Camera, Projection, View};
use crate::project::{DensityGrid, ScreenPoint, ScreenPoints};
use crate::search::{LANES, NeighborhoodBlock, Neighborhoods};
use crate::test_clouds::Random;

const RULES: FitRules = FitRules {
    k: 10,
    splat_scale: 1.0,
    longest: LONGEST,
    scan_lines: false,
    keep_outliers: false,
    compares_density: false,
    dot_px: None,
};

/// A point and its neighbours, in view space.
#[derive(Clone, Debug)]
struct Neighborhood {
    center: DVec3,
    offsets: Vec<DVec3>,
}

impl Neighborhood {
    fn k_radius(&self) -> f64 {
        self.offsets.iter().map(|offset| offset.length()).fold(0.0, f64::max)
    }

    fn mean(&self) -> DVec3 {
        self.offsets.iter().sum::<DVec3>() / (self.offsets.len() + 1) as f64
    }

    /// Covariance of the point and its neighbours about their mean, computed in two passes.
    fn covariance(&self) -> DMat3 {
        let about_mean = |offset: DVec3| {
            let v = offset - self.mean();
            DMat3::from_cols(v * v.x, v * v.y, v * v.z)
        };
        let points = self.offsets.iter().copied().chain([DVec3::ZERO]);
        points.map(about_mean).fold(DMat3::ZERO, |sum, m| sum + m) * (1.0 / (self.offsets.len() + 1) as f64)
    }
}

/// Eigenvalues, ascending, from the trigonometric solution of the characteristic polynomial.
pub(crate) fn eigenvalues(a: DMat3) -> [f64; 3] {
    let mean = (a.x_axis.x + a.y_axis.y + a.z_axis.z) / 3.0;
    let b = a - DMat3::from_diagonal(DVec3::splat(mean));
    let spread = ([b.x_axis, b.y_axis, b.z_axis].map(DVec3::length_squared).iter().sum::<f64>() / 6.0).sqrt();
    if spread == 0.0 {
        return [mean; 3];
    }
    let angle = (0.5 * (b * (1.0 / spread)).determinant()).clamp(-1.0, 1.0).acos() / 3.0;
    let value = |turn: f64| mean + 2.0 * spread * (angle + turn * std::f64::consts::TAU / 3.0).cos();
    [value(1.0), value(2.0), value(0.0)]
}

fn views() -> [View; 2] {
    [Projection::PerspectiveFovDeg(40.0), Projection::OrthographicHeight(4.0)].map(|projection| {
        let camera = Camera { eye: DVec3::ZERO, look_at: DVec3::Z, up: DVec3::NEG_Y, projection };
        camera.view(DVec3::ZERO, [100, 80]).expect("a view")
    })
}

/// First search radius at a depth, in the density grid of [`fitted`]: one cell of 200 pixels with one point.
fn first_radius(depth: f64, view: &View) -> f64 {
    let pixel = if view.perspective { depth } else { 1.0 } / f64::from(view.focal_px);
    200.0 * (10.0 / std::f64::consts::PI).sqrt() * pixel
}

/// Runs the stage on neighbourhoods with moments summed in `f64`.
fn fitted(neighborhoods: &[Neighborhood], view: &View, rules: &FitRules, culling: f32) -> Surfels {
    let pixel = 3 << 16 | 5;
    let at = |n: &Neighborhood| ScreenPoint { position_view: n.center.as_vec3().to_array(), pixel };
    let screen = ScreenPoints {
        points: neighborhoods.iter().map(at).collect(),
        source: (100..).take(neighborhoods.len()).collect(),
        // The first search radius is √(k/π) cells.
        density: DensityGrid { cell_px: 200, columns: 1, count: vec![1], nearest: vec![0.0], culling: vec![culling] },
        ..ScreenPoints::default()
    };
    let mut moments = Neighborhoods {
        blocks: vec![NeighborhoodBlock::default(); neighborhoods.len().div_ceil(LANES)],
        ..Default::default()
    };
    for (index, n) in neighborhoods.iter().enumerate() {
        let (block, lane) = (&mut moments.blocks[index / LANES], index % LANES);
        block.count.0[lane] = n.offsets.len() as f32;
        block.k_radius.0[lane] = n.k_radius() as f32;
        let sum = |term: &dyn Fn(&DVec3) -> f64| n.offsets.iter().map(term).sum::<f64>() as f32;
        for axis in 0..3 {
            block.offset[axis].0[lane] = sum(&|o| o[axis]);
        }
        for (term, (i, j)) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].into_iter().enumerate() {
            block.second[term].0[lane] = sum(&|o| o[i] * o[j]);
        }
    }
    let mut surfels = vec![Surfel::default(); 2];
    let queries: Vec<u32> = (0..neighborhoods.len() as u32).collect();
    fit(&screen, &queries, &moments, view, rules, &mut surfels, &crate::cancel::NEVER);
    assert_eq!(surfels[..2], [Surfel::default(); 2], "surfels from before are kept");
    surfels.split_off(2)
}

fn compare(n: &Neighborhood, surfel: &Surfel, view: &View, rules: &FitRules) -> Result<(), String> {
    let ensure = |ok: bool, what: &str| if ok { Ok(()) } else { Err(format!("{what}: {surfel:?}")) };
    let vector = |v: [f32; 3]| DVec3::from(v.map(f64::from));
    let (normal, major) = (vector(surfel.normal), vector(surfel.major_axis));
    let covariance = n.covariance();
    let [least, middle, largest] = eigenvalues(covariance);
    let variance = |direction: DVec3| direction.dot(covariance * direction);
    // f32 rounding of moments with the mean subtracted, and of some hundred operations.
    let tolerance = 4e-6 * n.k_radius().powi(2);
    ensure((normal.length() - 1.0).abs() < 1e-5, "the normal is not a unit vector")?;
    ensure((major.length() - 1.0).abs() < 1e-5, "the major axis is not a unit vector")?;
    ensure(normal.dot(major).abs() < 1e-5, "the major axis is not in the disc's plane")?;
    ensure((variance(normal) - least).abs() < tolerance, "the normal is not the direction of least variance")?;
    ensure((variance(major) - largest).abs() < tolerance, "the major axis is not the direction of largest variance")?;
    let to_eye = if view.perspective { -n.center.normalize() } else { DVec3::NEG_Z };
    ensure(normal.dot(to_eye) > -1e-6, "the normal points away from the eye")?;

    let near = |value: f32, expected: f64, tolerance: f64| (f64::from(value) - expected).abs() <= tolerance;
    let count = n.offsets.len() as f64;
    let lopsided = (n.mean() * (count + 1.0) / count).length() > f64::from(MAX_MEAN_OFFSET_K_RADII) * n.k_radius();
    let lopsided = lopsided && count >= f64::from(MIN_COMPARED_NEIGHBORS);
    // A neighbourhood cut short by a gap counts as k neighbours.
    let radius = f64::from(rules.splat_scale) * 2.0 * n.k_radius() / count.max(f64::from(rules.k)).sqrt();
    let radius = if lopsided && !rules.keep_outliers { 0.0 } else { radius };
    ensure(near(surfel.radius, radius, 1e-6 * radius), &format!("radius is not {radius}"))?;
    ensure(near(surfel.k_radius, n.k_radius(), 1e-6 * n.k_radius()), "k-radius")?;
    let curvature = least / (least + middle + largest);
    // Rounding of the eigenvalue, in units of the trace.
    let curvature_tolerance = tolerance / (least + middle + largest);
    ensure(near(surfel.curvature, curvature, curvature_tolerance), &format!("curvature is not {curvature}"))?;
    let ratio = (largest / middle).min(rules.longest.into());
    let ratio_tolerance = 4.0 * tolerance / middle;
    ensure(near(surfel.major_ratio, ratio, ratio_tolerance), &format!("ratio of axes is not {ratio}"))?;
    ensure(surfel.center == n.center.as_vec3().to_array() && surfel.pixel == 3 << 16 | 5, "centre or pixel")
}

/// Neighbourhoods of various thicknesses, elongations, sizes and directions.
fn random_neighborhoods(seed: u64, count: usize) -> Vec<Neighborhood> {
    let mut random = Random::new(seed);
    let one = |round: usize| {
        let scale = 10f64.powi(round as i32 % 7 - 3);
        let depth = 3.0 * (1.0 + f64::from(random.unit()));
        let center = DVec3::new(f64::from(random.signed()), f64::from(random.signed()), depth).as_vec3().as_dvec3();
        let normal = DVec3::from(random.direction().map(f64::from));
        let (a, b) = normal.any_orthonormal_pair();
        let thick = [0.0, 0.01, 0.1, 0.4][round % 4];
        let long = [1.0, 1.5, 4.0][round % 3];
        let neighbors = 4 + random.below(60);
        let shift = f64::from(random.unit()) * (round % 2) as f64;
        let mut signed = || f64::from(random.signed());
        let offset = |_| scale * (a * (signed() + shift) * long + b * signed() + normal * (thick * signed()));
        Neighborhood { center, offsets: (0..neighbors).map(offset).collect() }
    };
    (0..count).map(one).collect()
}

#[test]
fn random_neighborhoods_are_reconstructed() {
    for view in views() {
        for longest in [1.0, LONGEST] {
            let rules = FitRules { longest, splat_scale: 0.7, ..RULES };
            let neighborhoods = random_neighborhoods(21, 2000);
            let surfels = fitted(&neighborhoods, &view, &rules, f32::INFINITY);
            for (index, (n, surfel)) in neighborhoods.iter().zip(&surfels).enumerate() {
                assert_eq!(compare(n, surfel, &view, &rules), Ok(()), "neighbourhood {index}");
                assert_eq!(surfel.source as usize, 100 + index, "source of neighbourhood {index}");
            }
        }
    }
}

#[test]
fn comparison_sees_each_kind_of_error() {
    let view = views()[0];
    let neighborhoods = random_neighborhoods(22, 12);
    let surfels = fitted(&neighborhoods, &view, &RULES, f32::INFINITY);
    let (n, right) = (&neighborhoods[5], surfels[5]);
    let wrong = [
        Surfel { normal: right.normal.map(|c| -c), ..right },
        Surfel { normal: right.major_axis, major_axis: right.normal, ..right },
        Surfel { normal: surfels[6].normal, ..right },
        Surfel { normal: right.normal.map(|c| 1.001 * c), ..right },
        Surfel { radius: 1.001 * right.radius, ..right },
        Surfel { k_radius: 1.001 * right.k_radius, ..right },
        Surfel { curvature: right.curvature + 1e-3, ..right },
        Surfel { major_ratio: 1.01 * right.major_ratio, ..right },
        Surfel { pixel: 0, ..right },
    ];
    assert_eq!(compare(n, &right, &view, &RULES), Ok(()), "nothing is wrong yet");
    for surfel in wrong {
        assert!(compare(n, &surfel, &view, &RULES).is_err(), "not noticed: {surfel:?}");
    }
}

/// Few neighbours, neighbours in a line, all on one side, or none.
#[test]
fn degenerate_neighborhoods() {
    let center = DVec3::new(0.25, -0.5, 4.0);
    let one = |offsets: &[DVec3]| Neighborhood { center, offsets: offsets.to_vec() };
    let along = DVec3::new(0.01, 0.02, 0.005);
    let line: Vec<DVec3> = [-3.0, -2.0, -1.0, 1.0, 2.0, 3.0].map(|t| along * t).to_vec();
    for view in views() {
        let to_eye = if view.perspective { -center.normalize() } else { DVec3::NEG_Z };
        for (name, offsets) in [("one neighbour", &line[5..]), ("two in line", &line[2..4]), ("line", &line[..])] {
            for keep_outliers in [false, true] {
                let rules = FitRules { keep_outliers, ..RULES };
                let surfel = fitted(&[one(offsets)], &view, &rules, f32::INFINITY)[0];
                let normal = DVec3::from(surfel.normal.map(f64::from));
                // As close to the direction of the eye as the line allows.
                let expected = (to_eye - along.normalize() * along.normalize().dot(to_eye)).normalize();
                // The axis is exact to f32 rounding, where one neighbour gives a covariance of rank 1.
                assert!((normal - expected).length() < 2e-3, "{name}: normal {normal}, expected {expected}");
                assert_eq!(surfel.major_ratio, 1.0, "{name}: drawn as a circle");
                let radius = 2.0 * one(offsets).k_radius() / 10f64.sqrt();
                assert!((f64::from(surfel.radius) / radius - 1.0).abs() < 1e-6, "{name}: radius {}", surfel.radius);
            }
        }
        for keep_outliers in [false, true] {
            let rules = FitRules { keep_outliers, ..RULES };
            let surfel = fitted(&[one(&[])], &view, &rules, f32::INFINITY)[0];
            let normal = DVec3::from(surfel.normal.map(f64::from));
            assert!((normal - to_eye).length() < 1e-6, "no neighbour: normal {normal} is not towards the eye");
            let dot = if keep_outliers { view.pixel_size(4.0) } else { 0.0 };
            assert_eq!(surfel.radius, dot, "no neighbour: a dot if it is to be kept, otherwise nothing");
            assert_eq!([surfel.curvature, surfel.k_radius], [0.0; 2], "no neighbour: nothing else is known");
        }
        let far: Vec<DVec3> = line.iter().map(|o| DVec3::Z + *o * 3.0 + DVec3::new(o.z, 0.0, 0.0)).collect();
        for (keep_outliers, kept) in [(false, false), (true, true)] {
            let rules = FitRules { keep_outliers, ..RULES };
            let surfel = fitted(&[one(&far)], &view, &rules, f32::INFINITY)[0];
            assert_eq!(surfel.radius > 0.0, kept, "apart from all its neighbours: {surfel:?}");
        }
    }
}

/// The splats of points behind the culling plane are limited to a number of first search radii.
#[test]
fn splats_behind_the_culling_plane_are_limited() {
    for view in views() {
        let neighborhoods = random_neighborhoods(23, 700);
        let free = fitted(&neighborhoods, &view, &RULES, f32::INFINITY);
        let limited = fitted(&neighborhoods, &view, &RULES, 0.0);
        let mut narrowed = 0;
        for (free, limited) in free.iter().zip(&limited) {
            let first_radius = first_radius(free.center[2].into(), &view) as f32;
            let widest = 2.0 * MAX_CULLED_FIRST_RADII * first_radius / 10f32.sqrt();
            let expected = free.radius.min(widest);
            assert!((limited.radius - expected).abs() <= 1e-6 * expected, "{limited:?} is not {expected} wide");
            narrowed += usize::from(expected < free.radius);
        }
        assert!(narrowed > 50, "some are wider: {narrowed}");
    }
}

/// Fraction of `count` points that are drawn: neighbours from `offsets`, k-radius `sparser` first search radii.
fn kept(k: u32, sparser: f64, count: usize, mut offsets: impl FnMut(&mut Random) -> Vec<DVec3>) -> f64 {
    let view = views()[1];
    let first_radius = first_radius(4.0, &view);
    let mut random = Random::new(25);
    let mut one = || {
        let n = Neighborhood { center: DVec3::new(0.1, 0.2, 4.0), offsets: offsets(&mut random) };
        let scale = sparser * first_radius / n.k_radius();
        Neighborhood { offsets: n.offsets.iter().map(|offset| offset * scale).collect(), ..n }
    };
    let neighborhoods: Vec<_> = (0..count).map(|_| one()).collect();
    let surfels = fitted(
        &neighborhoods,
        &view,
        &FitRules { k, scan_lines: true, compares_density: true, ..RULES },
        f32::INFINITY,
    );
    surfels.iter().filter(|surfel| surfel.radius > 0.0).count() as f64 / count as f64
}

/// Ten random samples of the unit disc in a random orientation. `place` moves each, by a random number in -1..1.
fn strewn(random: &mut Random, place: impl Fn(f64, f64, f64) -> DVec3) -> Vec<DVec3> {
    let normal = DVec3::from(random.direction().map(f64::from));
    let (a, b) = normal.any_orthonormal_pair();
    let one = |_| {
        let [x, y] = std::iter::repeat_with(|| [0, 1].map(|_| f64::from(random.signed())))
            .find(|[x, y]| x * x + y * y < 1.0)
            .expect("endless");
        let DVec3 { x, y, z } = place(x, y, random.signed().into());
        a * x + b * y + normal * z
    };
    (0..10).map(one).collect()
}

#[test]
fn points_beside_a_surface_are_dropped() {
    let above = |height: f64, rough: f64| {
        kept(10, 1.0, 1000, |random| strewn(random, |x, y, noise| DVec3::new(x, y, rough * noise - height)))
    };
    for (height, rough, expected) in [
        (0.0, 0.0, 1.0..=1.0),
        (0.2, 0.0, 0.99..=1.0),
        (0.2, 0.2, 0.99..=1.0),
        (0.5, 0.0, 0.0..=0.1),
        (0.5, 0.05, 0.0..=0.1),
        (0.5, 0.5, 0.99..=1.0),
    ] {
        let share = above(height, rough);
        assert!(expected.contains(&share), "{height} above a surface, {rough} thick: {share} of the points are kept");
    }
    // Where the shape itself is not flat, its points stay.
    let cone = |random: &mut Random| strewn(random, |x, y, _| DVec3::new(x, y, x.hypot(y)));
    let ridge = |random: &mut Random| strewn(random, |x, y, _| DVec3::new(x, y, x.abs()));
    let corner = |random: &mut Random| {
        strewn(random, |x, y, side| {
            let [x, y] = [x.abs(), y.abs()];
            if side > 0.3 {
                DVec3::new(x, y, 0.0)
            } else if side > -0.3 {
                DVec3::new(x, 0.0, y)
            } else {
                DVec3::new(0.0, x, y)
            }
        })
    };
    for (name, share) in [
        ("cone", kept(10, 1.0, 1000, cone)),
        ("ridge", kept(10, 1.0, 1000, ridge)),
        ("corner", kept(10, 1.0, 1000, corner)),
    ] {
        assert!(share > 0.97, "a {name} keeps {share} of its tips");
    }
}

#[test]
fn points_much_sparser_than_their_surroundings_are_dropped() {
    // All on one side, their mean 0.71 k-radii away.
    let aside = |random: &mut Random| {
        let one = |step: usize| DVec3::new(1.0 - step as f64 * 0.58 / 9.0, 0.1 * f64::from(random.signed()), 0.0);
        (0..10).map(one).collect::<Vec<_>>()
    };
    for (sparser, expected) in [(0.9 * SPARSE_FIRST_RADII, 1.0), (1.1 * SPARSE_FIRST_RADII, 0.0)] {
        assert_eq!(kept(10, sparser.into(), 1000, aside), expected, "{sparser} times as far apart");
    }
    // Border points of a sparse surface stay, and two in three corner points.
    let border = |random: &mut Random| strewn(random, |x, y, _| DVec3::new(x.abs(), y, 0.0));
    let corner = |random: &mut Random| strewn(random, |x, y, _| DVec3::new(x.abs(), y.abs(), 0.0));
    for (name, offsets, least) in [("border", &border as &dyn Fn(&mut Random) -> _, 0.98), ("corner", &corner, 0.6)] {
        let share = kept(10, 1.1 * f64::from(SPARSE_FIRST_RADII), 1000, offsets);
        assert!(share > least, "{share} of the points at a {name} are kept");
    }
    for count in [1, 2, 3, FEW_NEIGHBORS as usize] {
        let few = |random: &mut Random| strewn(random, |x, y, _| DVec3::new(x, y, 0.0))[..count].to_vec();
        let is_few = (count as f32) < FEW_NEIGHBORS;
        for (sparser, expected) in
            [(0.9 * FEW_NEIGHBORS_FIRST_RADII, 1.0), (1.1 * FEW_NEIGHBORS_FIRST_RADII, if is_few { 0.0 } else { 1.0 })]
        {
            assert_eq!(
                kept(10, sparser.into(), 1000, few),
                expected,
                "{count} neighbours, {sparser} times as far apart"
            );
            assert_eq!(
                kept(10, sparser.into(), MIN_SURFACE_POINTS - 1, few),
                1.0,
                "a handful has nothing to compare with"
            );
            assert_eq!(kept(count as u32, sparser.into(), 1000, few), 1.0, "{count} of {count} are not few");
        }
    }
}

/// In any unit of the cloud, surfels are equal up to their size.
#[test]
fn units_do_not_matter() {
    let view = views()[1];
    let in_unit = |unit: f64| -> Surfels {
        let mut neighborhoods = random_neighborhoods(24, 500);
        let offsets = neighborhoods.iter_mut().flat_map(|n| &mut n.offsets);
        offsets.for_each(|offset| *offset = offset.as_vec3().as_dvec3() * unit);
        fitted(&neighborhoods, &view, &RULES, f32::INFINITY)
    };
    let base = in_unit(1.0);
    // Powers of two change no rounding; the smallest squares are still normal floats.
    for unit in [2f64.powi(-40), 2f64.powi(40)] {
        for (scaled, base) in in_unit(unit).iter().zip(&base) {
            let [radius, k_radius] = [base.radius, base.k_radius].map(|length| length * unit as f32);
            assert_eq!(*scaled, Surfel { radius, k_radius, ..*base }, "in units of {unit}");
        }
    }
}
