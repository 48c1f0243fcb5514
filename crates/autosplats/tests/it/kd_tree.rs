//! The kd-tree engine through the public API.

use crate::test_clouds::EYE;
use autosplats::cloud::PointCloud;
use autosplats::cloud::glam::DVec3;
use autosplats::{Camera, Error, Image, Projection, Renderer, SearchEngine, Settings, best_first_radius, wgpu};

const SIZE: [u32; 2] = [320, 240];
const CAMERA: Camera = Camera {
    eye: EYE,
    look_at: DVec3::ZERO,
    up: DVec3::new(0.1, -1.0, 0.0),
    projection: Projection::PerspectiveFovDeg(35.0),
};

fn kd_tree(first_radius: f32, k: u32) -> Settings {
    let mut settings = Settings::default();
    settings.reconstruction.engine = SearchEngine::KdTree { first_radius };
    settings.reconstruction.k = k;
    settings
}

fn cloud(positions: Vec<[f32; 3]>) -> PointCloud {
    PointCloud::new(DVec3::ZERO, positions)
}

fn different(a: &Image, b: &Image, steps: u8) -> f64 {
    let differs = |(a, b): &(&[u8; 4], &[u8; 4])| (0..4).any(|i| a[i].abs_diff(b[i]) > steps);
    a.pixels.iter().zip(&b.pixels).filter(differs).count() as f64 / a.pixels.len() as f64
}

/// Visible neighbours and neighbours in the cloud are nearly the same if pixels are no coarser than the points.
#[test]
fn pictures_are_nearly_those_of_the_screen_grid() {
    let Some(mut gpu) = crate::gpu() else { return };
    let cloud = cloud(crate::test_clouds::sphere(30_000));
    let mut settings = kd_tree(0.1, 10);
    let tree = gpu.render(&cloud, &CAMERA, SIZE, &settings).expect("a picture");
    let (image, counts) = (tree.image.clone(), tree.counts);
    settings.reconstruction.engine = SearchEngine::ScreenGrid;
    let grid = gpu.render(&cloud, &CAMERA, SIZE, &settings).expect("a picture");
    assert_eq!(counts.visible, grid.counts.visible, "what is seen does not depend on the search");
    assert!(counts.covered.abs_diff(grid.counts.covered) * 100 < counts.covered, "nor how much is covered");
    // Normals differ at the silhouette, where the screen grid does not see the neighbours behind.
    let unlike = different(&image, grid.image, 12);
    assert!(unlike < 0.04, "{unlike} of the pixels differ");
}

#[test]
fn every_test_cloud_and_every_k() {
    let Some(mut gpu) = crate::gpu() else { return };
    for (name, positions) in crate::test_clouds::all(3000) {
        let cloud = cloud(positions);
        for k in [1, 10, 64] {
            for first_radius in [1e-30, 0.1, 1e30] {
                let frame = gpu.render(&cloud, &CAMERA, SIZE, &kd_tree(first_radius, k));
                let counts = frame.unwrap_or_else(|error| panic!("{name}: {error}")).counts;
                let visible = counts.visible > 0;
                // A tiny radius contains only points at the same position. A cloud of few points is drawn as dots.
                let is_surface = cloud.len() >= 64;
                assert!(first_radius > 1e-20 || counts.covered == 0 || !is_surface, "{name}, k = {k}: {counts:?}");
                assert!(
                    first_radius < 1e20 || !visible || name == "one point" || counts.covered > 0 || k == 1,
                    "{name}, k = {k}: {counts:?}"
                );
            }
        }
    }
}

/// A visible point whose neighbours are all at its position has no surface. The screen grid finds other neighbours,
/// because only one such point is visible.
#[test]
fn points_in_one_place_have_no_surface() {
    let Some(mut gpu) = crate::gpu() else { return };
    let mut positions = crate::test_clouds::plane(3000);
    let seen = gpu.render(&cloud(positions.clone()), &CAMERA, SIZE, &kd_tree(0.3, 10)).expect("a picture").counts;
    positions.extend([[0.0, 0.0, -0.5]; 3000]);
    let counts = gpu.render(&cloud(positions), &CAMERA, SIZE, &kd_tree(0.3, 10)).expect("a picture").counts;
    assert_eq!(counts.outliers, seen.outliers + 1, "one more is seen, and dropped");
}

#[test]
fn the_best_radius_is_accurate() {
    let Some(mut gpu) = crate::gpu() else { return };
    let cloud = cloud(crate::test_clouds::sphere(8000));
    for k in [1, 10] {
        let best =
            best_first_radius(&mut gpu, &cloud, &CAMERA, SIZE, &kd_tree(1.0, k), 0.99, &|| true).expect("a radius");
        assert!(best.accuracy >= 0.99, "k = {k}: {best:?}");
        assert!((0.01..1.0).contains(&best.first_radius) && best.search_ms > 0.0, "k = {k}: {best:?}");
    }
    let none = best_first_radius(&mut gpu, &cloud, &CAMERA, SIZE, &kd_tree(1.0, 10), 1.1, &|| true).expect("a radius");
    assert!(none.accuracy > 0.9, "the most accurate where none suffices: {none:?}");
    let behind = self::cloud(crate::test_clouds::behind(100));
    let nothing = best_first_radius(&mut gpu, &behind, &CAMERA, SIZE, &kd_tree(1.0, 10), 0.99, &|| true);
    assert!(matches!(nothing, Err(Error::NothingVisible(_))), "{nothing:?}");
}

#[test]
fn what_cannot_be_is_refused() {
    let cloud = cloud(crate::test_clouds::sphere(100));
    let refused = Renderer::new().render(&cloud, &CAMERA, SIZE, &kd_tree(0.1, 10)).err();
    assert!(matches!(&refused, Some(Error::Device(why)) if why.contains("screen-grid")), "{refused:?}");
    for radius in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let checked = kd_tree(radius, 10).check();
        assert!(matches!(checked, Err(Error::Setting { name: "first_radius", .. })), "{radius}: {checked:?}");
    }
}

/// The cloud fits the device, in two bindings; its tree does not.
#[test]
fn a_tree_beyond_the_limit_is_refused() {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::PRIMARY;
    let instance = wgpu::Instance::new(descriptor);
    let Ok(adapter) = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default())) else {
        assert!(std::env::var_os("CI").is_none(), "no adapter");
        return;
    };
    let limits = wgpu::Limits { max_storage_buffer_binding_size: 4 << 20, ..wgpu::Limits::default() };
    let device = wgpu::DeviceDescriptor { required_limits: limits, ..Default::default() };
    let (device, queue) = pollster::block_on(adapter.request_device(&device)).expect("a device");
    let mut renderer = Renderer::with_device(device, queue).expect("a renderer");
    for (points, fits) in [(240_000, true), (280_000, false)] {
        let cloud = cloud(crate::test_clouds::sphere(points));
        let rendered = renderer.render(&cloud, &CAMERA, [64, 48], &kd_tree(0.05, 10)).map(|frame| frame.counts);
        match rendered {
            Ok(counts) => assert!(fits && counts.covered > 0, "{points}: {counts:?}"),
            Err(error) => {
                assert!(!fits && matches!(error, Error::DeviceLimit { allowed: 4_194_304, .. }), "{points}: {error}");
            }
        }
        let grid = renderer.render(&cloud, &CAMERA, [64, 48], &Settings::default());
        assert!(grid.is_ok(), "{points}: other engines go on");
    }
}
