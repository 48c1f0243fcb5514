//! Both backends make the same picture of the same input.
//!
//! Any GPU serves, including software devices. Without one, these tests report that they check nothing; with `CI` set,
//! they fail.

pub(crate) mod devices;
mod splat_communication;
use std::collections::HashMap;

use crate::test_clouds::EYE;
use autosplats::cloud::glam::{DMat4, DVec3};
use autosplats::cloud::{FieldValues, PointCloud, Scan};
use autosplats::{
    Backend, Background, Camera, ColorMode, Counts, Error, GBuffer, Image, Projection, Reconstruction, Renderer,
    SearchEngine, Settings, Shading, wgpu,
};
use autosplats_scenes::Scene;

const SIZE: [u32; 2] = [480, 300];

/// Fraction of the pixels that may differ by more than two steps of brightness. Divisions on a device may be off in the
/// last place, which moves a few points in ten thousand to the next pixel.
pub(crate) const MAX_DIFFERENT_SHARE: f64 = 1e-3;

/// Settings with one point per pixel, as on small devices and in splat communication.
fn a_point_a_pixel() -> Settings {
    let reconstruction = Reconstruction { points_per_pixel: 1, ..Reconstruction::default() };
    Settings { reconstruction, ..Settings::default() }
}

/// A generated scene with its camera.
pub(crate) fn scene(name: &str, count: usize) -> (PointCloud, Camera) {
    let (scene, _) = Scene::parse(name).expect("a scene");
    let view = scene.view();
    let projection = Projection::PerspectiveFovDeg(view.fov_degrees);
    let camera = Camera { eye: view.eye, look_at: view.look_at, up: view.up, projection };
    (scene.sample(count, &()).expect("points"), camera)
}

/// Fraction of the pixels that differ by more than two steps in any channel.
pub(crate) fn unlike(a: &Image, b: &Image) -> f64 {
    assert_eq!([a.width, a.height], [b.width, b.height], "sizes");
    let differs = |(a, b): &(&[u8; 4], &[u8; 4])| (0..4).any(|i| a[i].abs_diff(b[i]) > 2);
    a.pixels.iter().zip(&b.pixels).filter(differs).count() as f64 / a.pixels.len() as f64
}

/// Renders on both backends and compares pictures and counts.
fn compare(gpu: &mut Renderer, cloud: &PointCloud, camera: &Camera, size: [u32; 2], settings: &Settings, case: &str) {
    let mut cpu = Renderer::new();
    let host = cpu.render(cloud, camera, size, settings).expect("a picture on the CPU");
    let device = gpu.render(cloud, camera, size, settings).unwrap_or_else(|error| panic!("{case}: {error}"));
    let unlike = unlike(host.image, device.image);
    // One pixel of a small picture is more than a thousandth.
    let allowed = MAX_DIFFERENT_SHARE.max(1.0 / host.image.pixels.len() as f64);
    assert!(unlike <= allowed, "{case}: {unlike} of the pixels differ");
    let near = |a: usize, b: usize, name: &str| {
        assert!(a.abs_diff(b) <= 2 + a / 100, "{case}: {name} {a} on the CPU, {b} on the GPU");
    };
    let [a, b] = [host.counts, device.counts];
    assert_eq!([a.points, a.dropped, a.not_finite], [b.points, b.dropped, b.not_finite], "{case}");
    assert_eq!([a.behind, a.outside], [b.behind, b.outside], "{case}");
    near(a.visible, b.visible, "visible");
    near(a.active, b.active, "active");
    near(a.passive, b.passive, "passive");
    near(a.recovered, b.recovered, "recovered");
    near(a.outliers, b.outliers, "outliers");
    near(a.clamped, b.clamped, "clamped");
    near(a.bounded, b.bounded, "bounded");
    near(a.covered, b.covered, "covered");
    let [a, b] = [a, b].map(|counts| counts.value_range);
    let alike = match (a, b) {
        // Percentiles of nearly the same values; the tolerance is half a colour step.
        (Some(a), Some(b)) => (0..2).all(|end| (a[end] - b[end]).abs() <= 0.02 * (a[1] - a[0]) + 1e-6 * a[end].abs()),
        (a, b) => a == b,
    };
    assert!(alike, "{case}: the range is {a:?} on the CPU, {b:?} on the GPU");
    if settings.all_layers {
        compare_layers(host.layers, device.layers, case);
    }
}

/// Asserts that coverage, depths, normals and attributes agree except in a few pixels.
fn compare_layers(a: &GBuffer, b: &GBuffer, case: &str) {
    let [width, height] = [a.width as usize, a.height as usize];
    let near = |a: f32, b: f32| a.to_bits() == b.to_bits() || (a - b).abs() <= 1e-3 * a.abs().max(1e-2);
    assert_eq!([a.width, a.height], [b.width, b.height], "{case}: sizes");
    let pixels = (0..width * height).map(|pixel| [a, b].map(|layers| layers.index(pixel % width, pixel / width)));
    let differing = pixels.filter(|&[i, j]| {
        let normals = (0..3).all(|axis| (a.normal[i][axis] - b.normal[j][axis]).abs() < 1e-2);
        let colors = a.color.is_empty() || (0..3).all(|axis| (a.color[i][axis] - b.color[j][axis]).abs() < 1e-2);
        let scalars = a.scalar.is_empty() || near(a.scalar[i], b.scalar[j]);
        // Curvature is a difference of sums, in units of its own size.
        let measures = near(a.radius[i], b.radius[j])
            && near(a.k_radius[i], b.k_radius[j])
            && (a.curvature[i] - b.curvature[j]).abs() < 1e-3
            && a.point[i] == b.point[j];
        !(near(a.weight[i], b.weight[j]) && near(a.depth[i], b.depth[j]) && normals && colors && scalars && measures)
    });
    let differing = differing.count();
    assert!(
        differing as f64 <= 2.0 * MAX_DIFFERENT_SHARE * (width * height) as f64 + 1.0,
        "{case}: {differing} pixels of the layers"
    );
}

#[test]
fn comparison_sees_another_picture() {
    let (cloud, camera) = scene("statue", 20_000);
    let mut renderer = Renderer::new();
    let mut image = |splat_scale| {
        let settings = Settings {
            reconstruction: Reconstruction { splat_scale, ..Reconstruction::default() },
            ..Settings::default()
        };
        renderer.render(&cloud, &camera, SIZE, &settings).expect("a picture").image.clone()
    };
    assert!(unlike(&image(1.0), &image(1.2)) > 2.0 * MAX_DIFFERENT_SHARE, "splats a fifth wider make another picture");
}

#[test]
fn every_scene() {
    let Some(mut gpu) = crate::gpu() else { return };
    for (name, _) in Scene::names() {
        for count in [3_000, 150_000] {
            let (cloud, camera) = scene(name, count);
            compare(&mut gpu, &cloud, &camera, SIZE, &Settings::default(), &format!("{name}, {count} points"));
        }
    }
}

#[test]
fn depth_cameras_and_what_comes_after() {
    let Some(mut gpu) = crate::gpu() else { return };
    let positions = crate::test_clouds::room(240, |depth| crate::test_clouds::stepped(depth, 0.0029));
    let scan = |points: std::ops::Range<usize>| Scan { name: None, world_from_sensor: DMat4::IDENTITY, points };
    let half = positions.len() / 2;
    let camera = Camera {
        eye: DVec3::new(0.4, -0.3, 0.1),
        look_at: DVec3::new(0.0, 0.0, 3.0),
        up: DVec3::NEG_Y,
        projection: Projection::PerspectiveFovDeg(42.0),
    };
    let mut pictures = Vec::new();
    // One renderer for all clouds: knowledge of a cloud must not affect the next.
    for scans in
        [vec![scan(0..2 * half)], vec![], vec![scan(0..half), scan(half..2 * half)], vec![scan(0..half)], vec![]]
    {
        let case = format!("{} scans", scans.len());
        let cloud = PointCloud::new(DVec3::ZERO, positions.clone()).with_scans(scans);
        compare(&mut gpu, &cloud, &camera, SIZE, &Settings::default(), &case);
        pictures.push(Renderer::new().render(&cloud, &camera, SIZE, &Settings::default()).expect("one").image.clone());
    }
    assert!(unlike(&pictures[0], &pictures[1]) > 0.1, "steps are to be seen where nothing is known");
    assert_eq!(pictures[1].pixels, pictures[4].pixels, "nothing is known again");
}

#[test]
fn every_test_cloud_with_both_projections() {
    let Some(mut gpu) = crate::gpu() else { return };
    // Layers without adaptation. In clumps, which are no surface, rounding decides between two fits shared by all
    // splats around. The layers then differ, though the picture does not.
    let fixed = Reconstruction { adaptive: false, ..Reconstruction::default() };
    let layers = Settings { reconstruction: fixed, all_layers: true, ..Settings::default() };
    for (name, mut positions) in crate::test_clouds::all(4000) {
        positions.extend([[f32::NAN, 0.0, 0.0], [f32::INFINITY, 1.0, 0.0], [3e38, 3e38, -3e38]]);
        let cloud = PointCloud::new(DVec3::ZERO, positions);
        for projection in [Projection::PerspectiveFovDeg(36.0), Projection::OrthographicHeight(2.4)] {
            let camera = Camera { eye: EYE, look_at: DVec3::ZERO, up: DVec3::new(0.1, -1.0, 0.0), projection };
            for size in [[1, 1], [7, 300], [150, 110]] {
                let case = format!("{name} {projection:?} {size:?}");
                compare(&mut gpu, &cloud, &camera, size, &layers, &case);
                compare(&mut gpu, &cloud, &camera, size, &Settings::default(), &case);
            }
        }
    }
}

#[test]
fn every_setting() {
    let Some(mut gpu) = crate::gpu() else { return };
    let (cloud, camera) = scene("cathedral", 60_000);
    let usual = Reconstruction::default;
    let cases = [
        ("k 1", Reconstruction { k: 1, ..usual() }),
        ("k 16", Reconstruction { k: 16, ..usual() }),
        ("k 17", Reconstruction { k: 17, ..usual() }),
        ("k 64", Reconstruction { k: 64, ..usual() }),
        ("outliers kept", Reconstruction { outlier_expansions: None, ..usual() }),
        ("three expansions", Reconstruction { outlier_expansions: Some(3), ..usual() }),
        ("gaps bridged", Reconstruction { gap_factor: None, ..usual() }),
        ("small splats", Reconstruction { splat_scale: 0.3, ..usual() }),
        ("huge splats", Reconstruction { splat_scale: 10.0, ..usual() }),
        ("ellipses", Reconstruction { ellipses: true, ..usual() }),
        ("one point a pixel", Reconstruction { points_per_pixel: 1, ..usual() }),
        ("no culling", Reconstruction { grid_culling: false, ..usual() }),
        ("no refinement", Reconstruction { depth_refinement: false, ..usual() }),
    ];
    for (name, reconstruction) in cases {
        let settings = Settings { reconstruction, ..Settings::default() };
        compare(&mut gpu, &cloud, &camera, SIZE, &settings, name);
    }
}

#[test]
fn whole_splats() {
    let Some(mut gpu) = crate::gpu() else { return };
    let (cloud, camera) = scene("statue", 60_000);
    let mut covered = |trim: bool| {
        let reconstruction = Reconstruction { trim, ..Reconstruction::default() };
        let settings = Settings { reconstruction, all_layers: true, ..Settings::default() };
        compare(&mut gpu, &cloud, &camera, SIZE, &settings, &format!("trim {trim}"));
        gpu.render(&cloud, &camera, SIZE, &settings).expect("a picture").counts.covered
    };
    let [trimmed, whole] = [true, false].map(&mut covered);
    assert!(1.01 * trimmed as f64 <= whole as f64, "whole splats cover {whole} pixels, trimmed ones {trimmed}");
}

/// A scene with noise of standard deviation `sigma` along each axis.
fn noisy_scene(name: &str, count: usize, sigma: f32) -> (PointCloud, Camera) {
    let (cloud, camera) = scene(name, count);
    let moved = crate::test_clouds::noisy(cloud.positions().to_vec(), sigma);
    (PointCloud::new(cloud.origin(), moved), camera)
}

#[test]
fn adapted_to_noise() {
    let Some(mut gpu) = crate::gpu() else { return };
    for (name, count, sigma) in
        [("statue", 60_000, 0.0), ("statue", 60_000, 0.01), ("cathedral", 60_000, 0.02), ("figure", 150_000, 0.01)]
    {
        let (cloud, camera) = noisy_scene(name, count, sigma);
        for (k, grid_culling) in [(10, true), (16, false)] {
            let reconstruction = Reconstruction { k, grid_culling, adaptive: true, ..Reconstruction::default() };
            let settings = Settings { reconstruction, all_layers: true, ..Settings::default() };
            let case = format!("{name} {count} {sigma} {k}");
            compare(&mut gpu, &cloud, &camera, SIZE, &settings, &case);
            // Without adaptation, the picture is unchanged.
            let settings = Settings { reconstruction: Reconstruction::paper(), ..Settings::default() };
            compare(&mut gpu, &cloud, &camera, SIZE, &settings, &case);
        }
    }
    // A device with only WebGPU's core features gives the same picture.
    let (cloud, camera) = noisy_scene("statue", 60_000, 0.01);
    let (device, queue) = devices::own_device(128 << 20).expect("a device");
    let mut own = Renderer::with_device(device, queue).expect("a renderer");
    let reconstruction = Reconstruction { adaptive: true, ..Reconstruction::default() };
    let settings = Settings { reconstruction, ..Settings::default() };
    compare(&mut own, &cloud, &camera, SIZE, &settings, "the caller's own device");
}

#[test]
fn adapted_or_not_is_seen_by_the_comparison() {
    let (cloud, camera) = noisy_scene("statue", 60_000, 0.01);
    let mut renderer = Renderer::new();
    let mut image = |adaptive| {
        let reconstruction = Reconstruction { adaptive, ..Reconstruction::default() };
        let settings = Settings { reconstruction, ..Settings::default() };
        renderer.render(&cloud, &camera, SIZE, &settings).expect("a picture").image.clone()
    };
    assert!(
        unlike(&image(false), &image(true)) > 10.0 * MAX_DIFFERENT_SHARE,
        "noise shows where nothing is adapted to it"
    );
}

#[test]
fn every_colour() {
    let Some(mut gpu) = crate::gpu() else { return };
    let (cloud, camera) = scene("figure", 40_000);
    let values = (0..cloud.len()).map(|i| if i % 7 == 0 { f32::NAN } else { (i % 1000) as f32 }).collect();
    let classes = (0..cloud.len()).map(|i| (i * 8 / cloud.len()) as u8).collect();
    let colors = (0..cloud.len()).map(|i| [(i % 251) as u8, (i % 13) as u8 * 19, 128]).collect();
    let cloud = cloud
        .with_field("Value", FieldValues::F32(values))
        .and_then(|cloud| cloud.with_field("Classification", FieldValues::U8(classes)))
        .and_then(|cloud| cloud.with_colors(colors))
        .expect("a value each");
    let modes = [
        ColorMode::Auto,
        ColorMode::Rgb,
        ColorMode::Plain,
        ColorMode::Height,
        ColorMode::Classification,
        ColorMode::Field("Value".into()),
        ColorMode::Normal,
        ColorMode::Curvature,
        ColorMode::Radius,
        ColorMode::KRadius,
        ColorMode::Depth,
    ];
    for color in modes {
        for all_layers in [false, true] {
            let shading = Shading { color: color.clone(), legend: true, ..Shading::default() };
            let settings = Settings { shading, all_layers, ..Settings::default() };
            compare(&mut gpu, &cloud, &camera, SIZE, &settings, &format!("{color:?}, all layers {all_layers}"));
        }
    }
    let backgrounds = [Background::Transparent, Background::Color([10, 200, 30]), Shading::default().background];
    for background in backgrounds {
        let shading =
            Shading { background, lighting: false, occlusion: 0.0, range: Some([0.0, 1.0]), ..Shading::default() };
        let settings = Settings { shading, ..Settings::default() };
        compare(&mut gpu, &cloud, &camera, SIZE, &settings, &format!("{background:?}"));
    }
}

#[test]
fn the_same_frame_twice_is_the_same_to_the_byte() {
    let Some(mut gpu) = crate::gpu() else { return };
    let settings = Settings { all_layers: true, ..Settings::default() };
    let (cloud, camera) = scene("herd", 200_000);
    let (other, _) = scene("statue", 50_000);
    let mut picture = |cloud: &PointCloud| {
        let frame = gpu.render(cloud, &camera, SIZE, &settings).expect("a picture");
        let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        (frame.image.pixels.clone(), frame.counts, bits(&frame.layers.depth), bits(&frame.layers.weight))
    };
    let first = picture(&cloud);
    let _another = picture(&other);
    assert!(first == picture(&cloud), "what was rendered in between leaves no trace");
}

/// A renderer that has rendered other views, sizes and points makes the same picture, to the byte.
#[test]
fn the_frames_before_leave_no_trace() {
    let (cloud, camera) = scene("herd", 100_000);
    let (other, _) = scene("statue", 50_000);
    let step = |part: f64| Camera { eye: camera.eye + part * (camera.look_at - camera.eye), ..camera };
    let frames = [
        (&cloud, step(0.0), SIZE, 2),
        (&cloud, step(0.0), SIZE, 2),
        (&cloud, step(0.02), SIZE, 2),
        (&cloud, step(0.3), SIZE, 2),
        (&other, step(0.3), SIZE, 2),
        (&cloud, step(0.31), [SIZE[0] / 2, SIZE[1]], 2),
        (&cloud, step(0.31), SIZE, 1),
        (&other, step(0.0), SIZE, 1),
        (&cloud, step(0.31), SIZE, 2),
    ];
    let renderers = [10, 17].into_iter().flat_map(|k| [(Some(Renderer::new()), k), (crate::gpu(), k)]);
    for (mut renderer, k) in renderers.filter_map(|(renderer, k)| Some((renderer?, k))) {
        for (at, (cloud, camera, size, points_per_pixel)) in frames.iter().enumerate() {
            let reconstruction = Reconstruction { k, points_per_pixel: *points_per_pixel, ..Reconstruction::default() };
            let settings = Settings { reconstruction, all_layers: true, ..Settings::default() };
            let picture = |renderer: &mut Renderer, settings: &Settings| {
                let frame = renderer.render(*cloud, camera, *size, settings).expect("a picture");
                let depths: Vec<u32> = frame.layers.depth.iter().map(|depth| depth.to_bits()).collect();
                (frame.image.pixels.clone(), frame.counts, depths)
            };
            let after = picture(&mut renderer, &settings);
            let backend = if renderer.adapter().is_some() { Backend::Gpu } else { Backend::Cpu };
            let mut fresh = renderer.another().expect("a renderer");
            assert!(picture(&mut fresh, &settings) == after, "{backend:?}, k = {k}, frame {at}");
            let reconstruction = Reconstruction { coherent: false, ..settings.reconstruction.clone() };
            let alone = Settings { reconstruction, ..settings.clone() };
            assert!(picture(&mut fresh, &alone) == after, "{backend:?}, frame {at}, each by itself");
        }
    }
}

#[test]
fn nothing_to_see_is_no_trouble() {
    let Some(mut gpu) = crate::gpu() else { return };
    let camera =
        Camera { eye: EYE, look_at: DVec3::ZERO, up: DVec3::NEG_Y, projection: Projection::PerspectiveFovDeg(36.0) };
    let settings = Settings { all_layers: true, ..Settings::default() };
    let clouds = [
        ("no point", Vec::new()),
        ("one point", vec![[0.0; 3]]),
        ("no finite point", vec![[f32::NAN; 3]; 5000]),
        ("all behind", crate::test_clouds::behind(5000)),
        ("fewer than k", crate::test_clouds::plane(4)),
    ];
    for (name, positions) in clouds {
        let cloud = PointCloud::new(DVec3::ZERO, positions);
        compare(&mut gpu, &cloud, &camera, [64, 48], &settings, name);
    }
    let bad = Settings { reconstruction: Reconstruction { k: 0, ..Reconstruction::default() }, ..Settings::default() };
    let cloud = PointCloud::new(DVec3::ZERO, crate::test_clouds::plane(100));
    let refused = |outcome: Result<Counts, Error>| outcome.expect_err("refused").to_string();
    let mut counts = |size, settings: &Settings| gpu.render(&cloud, &camera, size, settings).map(|frame| frame.counts);
    assert!(refused(counts([64, 48], &bad)).contains("k is 0"), "settings are checked");
    assert!(refused(counts([0, 48], &settings)).contains("image size"), "and sizes");
    let coloured = Settings { shading: Shading { color: ColorMode::Rgb, ..Shading::default() }, ..Settings::default() };
    assert!(refused(counts([64, 48], &coloured)).contains("no colours"), "and attributes");
}

/// Few points are drawn as dots at their positions, at any distance from each other. Two of them are close together on
/// the screen but far apart in depth.
#[test]
fn a_handful_of_points_is_dots() {
    let places =
        [[0.0, 0.0, 0.0], [0.03, 0.1, 1.0], [1.0, 0.7, 0.3], [-0.3, -0.15, -4.0], [0.9, -0.6, 2.0], [0.9, -0.5, 2.0]];
    let cloud = PointCloud::new(DVec3::ZERO, places.to_vec());
    let projection = Projection::PerspectiveFovDeg(40.0);
    let camera = Camera { eye: 5.0 * DVec3::NEG_Z, look_at: DVec3::ZERO, up: DVec3::Y, projection };
    let settings = Settings { all_layers: true, ..Settings::default() };
    let mut cpu = Renderer::new();
    let host = cpu.render(&cloud, &camera, SIZE, &settings).expect("a picture");
    let [width, height] = [host.layers.width as usize, host.layers.height as usize];
    let pixels = (0..width * height).map(|pixel| host.layers.index(pixel % width, pixel / width));
    let mut covered = [0; 6];
    pixels.enumerate().filter(|&(_, pixel)| host.layers.weight[pixel] > 0.0).for_each(|(at, pixel)| {
        let point = host.layers.point[pixel] as usize;
        covered[point] += 1;
        let normal = host.layers.normal[pixel];
        assert!(-normal[2] > 0.9, "{normal:?} does not face the eye");
        // Seen from -Z with Y up, X is to the left.
        let [x, y, z] = places[point];
        let per_unit = 0.5 * height as f32 / (20f32.to_radians().tan() * (z + 5.0));
        let seen = [0.5 * width as f32 - x * per_unit, 0.5 * height as f32 - y * per_unit];
        let middle = [at % width, at / width].map(|along| along as f32 + 0.5);
        let off = (middle[0] - seen[0]).hypot(middle[1] - seen[1]);
        assert!(off < 3.0, "{off} pixels from point {point}");
    });
    assert!(covered.iter().all(|&pixels| (4..20).contains(&pixels)), "pixels of each: {covered:?}");
    let nowhere = PointCloud::new(DVec3::ZERO, [&places[..], &[[f32::NAN; 3]; 100]].concat());
    let picture = host.image.clone();
    assert!(
        *cpu.render(&nowhere, &camera, SIZE, &settings).expect("a picture").image == picture,
        "points that are nowhere"
    );
    if let Some(mut gpu) = crate::gpu() {
        compare(&mut gpu, &cloud, &camera, SIZE, &settings, "a handful");
    }
}

#[test]
fn a_picture_of_8192_pixels_a_side() {
    let Some(mut gpu) = crate::gpu() else { return };
    let (cloud, camera) = scene("figure", 20_000);
    let most = gpu.adapter().expect("a device").points_per_binding * 12;
    let enough = most >= 8192 * 8192 * 16;
    match gpu.render(&cloud, &camera, [8192, 8192], &Settings::default()) {
        Ok(frame) => assert!(frame.counts.covered > 1_000_000, "{:?}", frame.counts),
        Err(Error::DeviceLimit { .. } | Error::DeviceMemory(_)) => assert!(!enough, "{most} bytes are enough"),
        Err(error) => panic!("{error}"),
    }
    compare(&mut gpu, &cloud, &camera, SIZE, &Settings::default(), "after that");
}

#[test]
fn colours_come_and_go_without_the_points() {
    let Some(mut gpu) = crate::gpu() else { return };
    let (cloud, camera) = scene("statue", 30_000);
    let colors = (0..cloud.len()).map(|i| [(i % 255) as u8, 10, 200]).collect();
    let cloud = cloud.with_colors(colors).expect("a colour each");
    for color in [ColorMode::Auto, ColorMode::Height, ColorMode::Rgb, ColorMode::Plain, ColorMode::Auto] {
        let settings =
            Settings { shading: Shading { color: color.clone(), ..Shading::default() }, ..Settings::default() };
        compare(&mut gpu, &cloud, &camera, SIZE, &settings, &format!("{color:?}"));
    }
}
