//! Clouds in extraordinary units, and clusters far apart.
//!
//! The files lie beside the repository in `../shared/field`; without them only generated clouds are checked.

use std::path::Path;

use autosplats::cloud::glam::DVec3;
use autosplats::cloud::{Axes, PointCloud};
use autosplats::{Camera, ColorMode, NormalSettings, Projection, Renderer, Settings, ViewDirection, estimate_normals};

use crate::test_clouds;

const SIZE: [u32; 2] = [240, 160];

fn field(name: &str) -> Option<PointCloud> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/field").join(name);
    if !path.is_file() {
        println!("{} is absent: not checked", path.display());
        return None;
    }
    Some(autosplats_formats::read(&path, &()).expect(name))
}

fn camera(cloud: &PointCloud) -> Camera {
    let projection = Projection::PerspectiveFovDeg(Projection::USUAL_FOV_DEG);
    Camera::fit(cloud, Axes::ZUp, ViewDirection::Iso, 1.5, projection).expect("a camera")
}

/// Share of the pixels that differ in the pictures of two clouds, seen by a renderer from their own sides.
fn difference(renderer: &mut Renderer, clouds: [&PointCloud; 2]) -> f64 {
    let mut settings = Settings::default();
    settings.shading.color = ColorMode::Plain;
    let [a, b] = clouds
        .map(|cloud| renderer.render(cloud, &camera(cloud), SIZE, &settings).expect("a picture").image.pixels.clone());
    let differs = |(a, b): (&[u8; 4], &[u8; 4])| a.iter().zip(b).any(|(a, b)| a.abs_diff(*b) > 8);
    a.iter().zip(&b).filter(|&pair| differs(pair)).count() as f64 / a.len() as f64
}

fn renderers() -> impl Iterator<Item = Renderer> {
    [Some(Renderer::new()), crate::gpu()].into_iter().flatten()
}

/// A cloud times a factor, rounded to what a file of single precision holds.
fn times(cloud: &PointCloud, factor: f64) -> PointCloud {
    let place = |index| (cloud.world_position(index) * factor).as_vec3().to_array();
    PointCloud::new(DVec3::ZERO, (0..cloud.len()).map(place).collect())
}

#[test]
fn a_body_looks_the_same_in_extraordinary_units() {
    let files = [("V09_1e10.ply", 1e10), ("V09_1e-12.ply", 1e-12)];
    for (cloud, unit) in files.into_iter().filter_map(|(name, unit)| Some((field(name)?, unit))) {
        for mut renderer in renderers() {
            let differing = difference(&mut renderer, [&cloud, &times(&cloud, 1.0 / unit)]);
            assert!(differing < 0.01, "the file in units of {unit}: {differing}");
        }
    }
    let body = PointCloud::new(DVec3::ZERO, test_clouds::sphere(6000));
    for unit in [1e-30, 1e-20, 1e-12, 1e-9, 1e9, 1e15, 1e30] {
        for mut renderer in renderers() {
            let differing = difference(&mut renderer, [&times(&body, unit), &body]);
            assert!(differing < 0.01, "in units of {unit}: {differing}");
        }
    }
}

#[test]
fn normals_are_the_same_in_extraordinary_units() {
    let body = PointCloud::new(DVec3::ZERO, test_clouds::sphere(2000));
    let estimated = |cloud: &PointCloud| estimate_normals(cloud, &NormalSettings::default(), &()).expect("normals");
    let wanted = estimated(&body);
    for unit in [1e-30, 1e-12, 1e10, 1e30] {
        let found = estimated(&times(&body, unit));
        let near = |index: usize| {
            let [a, b] = [&wanted, &found].map(|normals| DVec3::from(normals.normals[index].map(f64::from)));
            a.dot(b) > 0.999
                && (f64::from(found.radius[index]) / unit / f64::from(wanted.radius[index]) - 1.0).abs() < 1e-3
        };
        let right = (0..body.len()).filter(|&index| near(index)).count();
        // Rounding decides between neighbours equally far away.
        assert!(100 * right >= 99 * body.len(), "{right} are right in units of {unit}");
    }
}

/// Thousands of points that hit a pixel or two are a dot, whether outliers are kept or not.
#[test]
fn clusters_far_apart_are_dots() {
    let cluster = |middle: [f32; 3]| {
        test_clouds::sphere(5000)
            .into_iter()
            .map(move |p| [0, 1, 2].map(|axis| middle[axis] + p[axis]))
            .collect::<Vec<_>>()
    };
    let apart = |distance: f32, clusters: usize| {
        let middles = [[0.0; 3], [distance, 0.0, 0.0], [0.0, distance, 0.0]];
        PointCloud::new(DVec3::ZERO, middles[..clusters].iter().flat_map(|&middle| cluster(middle)).collect())
    };
    let generated =
        [1e3, 1e5, 1e7, 1e9].into_iter().flat_map(|distance| [2, 3].map(|count| (apart(distance, count), count)));
    let file = field("V03_d100000.ply").map(|cloud| (cloud, 2));
    for (cloud, count) in generated.chain(file) {
        for mut renderer in renderers() {
            for outlier_expansions in [Some(1), None] {
                let mut settings = Settings::default();
                settings.reconstruction.outlier_expansions = outlier_expansions;
                let frame = renderer.render(&cloud, &camera(&cloud), SIZE, &settings).expect("a picture");
                let covered = frame.counts.covered;
                assert!((2 * count..40 * count).contains(&covered), "{count} clusters cover {covered} pixels");
            }
        }
    }
}

#[test]
fn one_far_stray_hides_nothing() {
    let body = test_clouds::sphere(5000);
    for stray in [1e9, 1e20, 1e37] {
        let cloud = PointCloud::new(DVec3::ZERO, body.iter().copied().chain([[stray, 0.0, 0.0]]).collect());
        let mut renderer = Renderer::new();
        let frame = renderer.render(&cloud, &camera(&cloud), SIZE, &Settings::default()).expect("a picture");
        assert!(frame.counts.covered > 5000, "{stray}: {}", frame.counts.covered);
    }
}
