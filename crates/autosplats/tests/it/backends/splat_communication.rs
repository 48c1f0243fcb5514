//! The paper's own search, in compute shaders and on the raster pipeline.

use super::devices::{own_device, own_device_with};
use super::*;

fn by(engine: SearchEngine) -> Settings {
    // Not adaptive, because the exact search would then have a margin, which splat communication has not.
    let reconstruction = Reconstruction { points_per_pixel: 1, adaptive: false, engine, ..Reconstruction::default() };
    Settings { reconstruction, ..Settings::default() }
}

fn by_communication() -> Settings {
    by(SearchEngine::SplatCommunication)
}

fn by_raster() -> Settings {
    by(SearchEngine::SplatCommunicationRaster)
}

/// The paper's search finds the same as the exact one, except for unfinished points, at most one in a thousand. It
/// takes at most ten iterations. Its forms find the same k-radii in the same iterations, to the last bit.
#[test]
fn splat_communication_in_every_scene() {
    let Some(mut gpu) = crate::gpu() else { return };
    for (name, _) in Scene::names() {
        let (cloud, camera) = scene(name, 20_000);
        let exact = gpu.render(&cloud, &camera, SIZE, &by(SearchEngine::ScreenGrid)).expect("a picture").image.clone();
        assert!(gpu.convergence().expect("none").is_empty(), "{name}: the screen grid does not iterate");
        let radii = |gpu: &mut Renderer| -> HashMap<u32, f32> {
            gpu.surfels().expect("surfels").iter().map(|surfel| (surfel.point, surfel.k_radius)).collect()
        };
        let exact_radii = radii(&mut gpu);
        let frame = gpu.render(&cloud, &camera, SIZE, &by_communication()).expect("a picture");
        let (counts, unlike) = (frame.counts, unlike(&exact, frame.image));
        assert!(unlike <= 2.0 * MAX_DIFFERENT_SHARE, "{name}: {unlike} of the pixels differ");

        let found = radii(&mut gpu);
        // Points hidden or exposed by unfinished points may be recovered or not.
        let both: Vec<_> = found.iter().filter_map(|(point, found)| Some((found, exact_radii.get(point)?))).collect();
        assert!(both.len() * 1000 >= 999 * exact_radii.len(), "{name}: the same points are searched for");
        let wrong = both.iter().filter(|(found, exact)| !((*found - *exact).abs() <= 1e-5 * *exact)).count();
        assert!(wrong * 1000 <= both.len(), "{name}: {wrong} of {} k-radii differ", both.len());

        let curve = gpu.convergence().expect("a curve");
        assert_eq!(curve[0] as usize, counts.active + counts.recovered, "{name}: what was searched for");
        let left = curve.get(10).or(curve.last()).copied().unwrap_or_default();
        assert!(left * 1000 <= curve[0], "{name}: after ten iterations: {curve:?}");
        let left = curve.get(7).copied().unwrap_or_default();
        assert!(left * 100 <= curve[0], "{name}: after seven iterations: {curve:?}");

        // Without culling, as the forms round sums in another order, and a splat may then hide another point.
        let [(computed, computed_radii, computed_curve), (drawn, drawn_radii, drawn_curve)] =
            [by_communication(), by_raster()].map(|mut settings| {
                settings.reconstruction.grid_culling = false;
                let image = frame_of(&mut gpu, &cloud, &camera, &settings);
                let bits: HashMap<u32, u32> =
                    radii(&mut gpu).into_iter().map(|(at, radius)| (at, radius.to_bits())).collect();
                (image, bits, gpu.convergence().expect("a curve"))
            });
        assert!(computed_radii.len() > 1000 && computed_curve.len() > 4, "{name}: {computed_curve:?}");
        assert_eq!(computed_curve, drawn_curve, "{name}: the same iterations");
        assert!(computed_radii == drawn_radii, "{name}: the same k-radii");
        let unlike = super::unlike(&computed, &drawn);
        assert!(unlike <= MAX_DIFFERENT_SHARE, "{name}: {unlike} of the pixels differ");
    }
}

fn frame_of(gpu: &mut Renderer, cloud: &PointCloud, camera: &Camera, settings: &Settings) -> Image {
    gpu.render(cloud, camera, SIZE, settings).expect("a picture").image.clone()
}

#[test]
fn splat_communication_is_refused_where_it_cannot_run() {
    let (cloud, camera) = scene("statue", 2_000);
    let refused = |renderer: &mut Renderer, settings: &Settings| {
        let outcome = renderer.render(&cloud, &camera, SIZE, settings).map(|frame| frame.counts);
        outcome.expect_err("refused").to_string()
    };
    let mut cpu = Renderer::new();
    for settings in [by_communication(), by_raster()] {
        let message = refused(&mut cpu, &settings);
        assert!(message.contains("runs on a GPU only") && message.contains("screen-grid"), "{message}");
    }
    assert!(cpu.convergence().expect("none").is_empty(), "nothing was searched for");
    if crate::gpu().is_none() {
        return;
    }
    let (device, queue) = own_device(128 << 20).expect("a device");
    let mut own = Renderer::with_device(device, queue).expect("a renderer");
    let message = refused(&mut own, &by_raster());
    assert!(message.contains("FLOAT32_BLENDABLE") && message.contains("--engine splat-communication)"), "{message}");
    let early = own.check(&by_raster()).expect_err("refused before there is a cloud").to_string();
    assert_eq!(early, message);
    assert!(own.check(&Settings::default()).is_ok(), "other engines run");
    compare(&mut own, &cloud, &camera, SIZE, &Settings::default(), "after a refusal");

    // The raster form runs with this one feature and WebGPU's default limits, also in debug builds, which check
    // indirect draws. The compute form needs no feature.
    let (device, queue) = own_device_with(wgpu::Features::FLOAT32_BLENDABLE, 128 << 20).expect("a device");
    let mut able = Renderer::with_device(device, queue).expect("a renderer");
    let drawn = frame_of(&mut able, &cloud, &camera, &by_raster());
    let computed = frame_of(&mut own, &cloud, &camera, &by_communication());
    let exact = frame_of(&mut own, &cloud, &camera, &by(SearchEngine::ScreenGrid));
    for found in [drawn, computed] {
        assert!(unlike(&found, &exact) <= 2.0 * MAX_DIFFERENT_SHARE, "the pictures are alike");
    }
}
