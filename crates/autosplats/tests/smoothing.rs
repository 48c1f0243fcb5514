//! Temporal smoothing: noise of live points is averaged over frames, what moves is not held back.

#[path = "../src/test_clouds.rs"]
mod test_clouds;

use autosplats::cloud::PointCloud;
use autosplats::cloud::glam::{DVec3, Vec3};
use autosplats::{Backend, Camera, Error, GBuffer, Projection, Reconstruction, Renderer, Settings};
use test_clouds::Random;

const SIZE: [u32; 2] = [240, 180];

/// Both backends, as far as they are there.
fn renderers() -> Vec<Renderer> {
    let gpu = Renderer::with_backend(Backend::Gpu);
    if let Err(error) = &gpu {
        assert!(std::env::var_os("CI").is_none(), "{error}");
        eprintln!("checked on the CPU only: {error}");
    }
    [Some(Renderer::new()), gpu.ok()].into_iter().flatten().collect()
}

fn settings(frames_averaged: u32) -> Settings {
    let reconstruction = Reconstruction { frames_averaged, ..Reconstruction::default() };
    Settings { reconstruction, all_layers: true, ..Settings::default() }
}

fn camera(eye: DVec3) -> Camera {
    Camera { eye, look_at: DVec3::ZERO, up: DVec3::Y, projection: Projection::PerspectiveFovDeg(40.0) }
}

/// A gently waved surface at this height, two units wide, each point off by noise.
fn wave(height: f32, sigma: f32, random: &mut Random) -> PointCloud {
    let point = |random: &mut Random| {
        let [x, y] = [random.signed(), random.signed()];
        Vec3::new(x, y, height + 0.1 * (3.0 * x).sin() + sigma * random.gaussian()).to_array()
    };
    PointCloud::new(DVec3::ZERO, (0..20_000).map(|_| point(random)).collect())
}

/// Depths in the middle of the picture.
fn depths(layers: &GBuffer) -> Vec<f32> {
    let middle = |side: u32| side as usize / 4..3 * side as usize / 4;
    let pixels = middle(SIZE[1]).flat_map(|y| middle(SIZE[0]).map(move |x| (x, y)));
    pixels.map(|(x, y)| layers.depth[layers.index(x, y)]).collect()
}

fn mean_difference(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f32>() / a.len() as f32
}

#[test]
fn noise_is_averaged_over_frames() {
    for mut renderer in renderers() {
        let adapter = renderer.adapter();
        let mut shivers = |frames_averaged: u32| {
            let mut random = Random::new(1);
            let mut last: Option<Vec<f32>> = None;
            let mut shiver = 0.0;
            for frame in 0..14 {
                let cloud = wave(0.0, 0.02, &mut random);
                let seen =
                    renderer.render(&cloud, &camera(DVec3::new(0.3, 0.2, 3.0)), SIZE, &settings(frames_averaged));
                let now = depths(seen.expect("a picture").layers);
                assert!(now.iter().all(|depth| depth.is_finite()), "a closed surface");
                if let Some(last) = last.replace(now.clone()).filter(|_| frame >= 8) {
                    shiver += mean_difference(&last, &now) / 6.0;
                }
            }
            shiver
        };
        let [alone, over_four, over_sixteen] = [1, 4, 16].map(&mut shivers);
        assert!(over_four * 2.0 < alone, "{adapter:?}: {over_four}, each frame by itself {alone}");
        assert!(over_sixteen * 4.0 < alone, "{adapter:?}: {over_sixteen}, each frame by itself {alone}");
    }
}

#[test]
fn another_surface_is_not_held_back() {
    for mut renderer in renderers() {
        let mut random = Random::new(2);
        let [near, far] = [0.4, 0.0].map(|height| wave(height, 0.0, &mut random));
        let view = camera(DVec3::new(0.3, 0.2, 3.0));
        let alone = depths(renderer.render(&far, &view, SIZE, &settings(1)).expect("a picture").layers);
        for _ in 0..3 {
            renderer.render(&near, &view, SIZE, &settings(16)).expect("a picture");
        }
        let after = depths(renderer.render(&far, &view, SIZE, &settings(16)).expect("a picture").layers);
        let apart = mean_difference(&alone, &after);
        assert!(apart < 1e-4, "{:?}: {apart} off", renderer.adapter());
    }
}

/// Around a surface without noise the picture is what it would be anyway.
#[test]
fn a_moving_camera_sees_the_same_surface() {
    for mut renderer in renderers() {
        let cloud = wave(0.0, 0.0, &mut Random::new(3));
        let view = |frame: i32| camera(DVec3::new(0.3 + 0.05 * f64::from(frame), 0.2, 3.0 - 0.04 * f64::from(frame)));
        for frame in 0..8 {
            renderer.render(&cloud, &view(frame), SIZE, &settings(8)).expect("a picture");
        }
        let smooth = depths(renderer.render(&cloud, &view(8), SIZE, &settings(8)).expect("a picture").layers);
        let alone = depths(renderer.render(&cloud, &view(8), SIZE, &settings(1)).expect("a picture").layers);
        let apart = mean_difference(&alone, &smooth);
        // A tenth of the distance between points is 1.4e-3.
        assert!(apart < 3e-4, "{:?}: {apart} off", renderer.adapter());
    }
}

/// The same frames give the same bytes, and both backends about the same depths.
#[test]
fn the_same_frames_again_are_the_same() {
    let film = |renderer: &mut Renderer| {
        let mut random = Random::new(4);
        let mut last = Vec::new();
        for frame in 0..4 {
            let cloud = wave(0.01 * frame as f32, 0.02, &mut random);
            let seen = renderer.render(&cloud, &camera(DVec3::new(0.3, 0.2, 3.0)), SIZE, &settings(8));
            last = depths(seen.expect("a picture").layers);
        }
        last
    };
    let mut of_backends = Vec::new();
    for backend in
        renderers().iter().map(|renderer| if renderer.adapter().is_some() { Backend::Gpu } else { Backend::Cpu })
    {
        let [first, again] = [0, 1].map(|_| film(&mut Renderer::with_backend(backend).expect("a device")));
        assert!(first == again, "{backend:?}: bits differ");
        of_backends.push(first);
    }
    if let [cpu, gpu] = &of_backends[..] {
        let apart = mean_difference(cpu, gpu);
        assert!(apart < 1e-5, "backends differ by {apart}");
    }
}

#[test]
fn only_so_many_frames() {
    let cloud = wave(0.0, 0.0, &mut Random::new(5));
    for frames_averaged in [0, 33] {
        let outcome = Renderer::new().render(&cloud, &camera(DVec3::Z), SIZE, &settings(frames_averaged)).map(|_| ());
        assert!(matches!(outcome, Err(Error::Setting { name: "frames_averaged", .. })), "{outcome:?}");
    }
}
