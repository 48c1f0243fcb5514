//! Temporal smoothing: noise of live points is averaged over frames, and moving things do not lag.

use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::Relaxed;

use crate::test_clouds::Random;
use autosplats::cloud::PointCloud;
use autosplats::cloud::glam::{DVec2, DVec3, Vec3};
use autosplats::{Backend, Camera, Error, GBuffer, Projection, Reconstruction, Renderer, Settings};

const SIZE: [u32; 2] = [240, 180];

fn settings(frames_averaged: u32) -> Settings {
    let reconstruction = Reconstruction { frames_averaged, ..Reconstruction::default() };
    Settings { reconstruction, all_layers: true, ..Settings::default() }
}

fn camera(eye: DVec3) -> Camera {
    Camera { eye, look_at: DVec3::ZERO, up: DVec3::Y, projection: Projection::PerspectiveFovDeg(40.0) }
}

/// A wavy surface at `height`, two units wide, of points with noise.
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
    for mut renderer in crate::renderers() {
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
    for mut renderer in crate::renderers() {
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

/// Smoothing does not change a surface without noise.
#[test]
fn a_moving_camera_sees_the_same_surface() {
    for mut renderer in crate::renderers() {
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

/// Normals in the middle of the picture, in world coordinates.
fn normals(layers: &GBuffer, camera: &Camera) -> Vec<Vec3> {
    let axes = camera.axes().expect("a camera").map(|axis| axis.as_vec3());
    let middle = |side: u32| side as usize / 4..3 * side as usize / 4;
    let pixels = middle(SIZE[1]).flat_map(|y| middle(SIZE[0]).map(move |x| (x, y)));
    let world = |normal: [f32; 3]| normal[0] * axes[0] + normal[1] * axes[1] + normal[2] * axes[2];
    let normals: Vec<Vec3> = pixels.map(|(x, y)| world(layers.normal[layers.index(x, y)])).collect();
    assert!(normals.iter().all(|normal| normal.is_normalized()), "a closed surface");
    normals
}

fn mean_degrees(a: &[Vec3], b: &[Vec3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a.cross(*b).length().atan2(a.dot(*b)).to_degrees()).sum::<f32>() / a.len() as f32
}

/// Noise looks different in each view of the same points. Smoothed normals change less and are as accurate.
#[test]
fn the_same_points_are_steady_while_the_camera_moves() {
    for mut renderer in crate::renderers() {
        let adapter = renderer.adapter();
        let cloud = wave(0.0, 0.02, &mut Random::new(6));
        let truth = wave(0.0, 0.0, &mut Random::new(6));
        // A fifth of a pixel per frame: pixels keep showing the same place.
        let view = |frame: i32| camera(DVec3::new(0.3 + 0.002 * f64::from(frame), 0.2, 3.0));
        let still = Settings { all_layers: true, ..Settings::default() };
        let truth = normals(renderer.render(&truth, &view(9), SIZE, &still).expect("a picture").layers, &view(9));
        let mut shown = |steady: bool| {
            let reconstruction = Reconstruction { steady, ..Reconstruction::default() };
            let settings = Settings { reconstruction, ..still.clone() };
            let mut frames = (0..10).map(|frame| {
                normals(renderer.render(&cloud, &view(frame), SIZE, &settings).expect("a picture").layers, &view(frame))
            });
            let [before, last] = [frames.nth(8), frames.next()].map(|normals| normals.expect("ten frames"));
            [mean_degrees(&before, &last), mean_degrees(&last, &truth)]
        };
        let [alone, steady] = [false, true].map(&mut shown);
        assert!(steady[0] * 3.0 < alone[0], "{adapter:?}: {} degrees a frame, alone {}", steady[0], alone[0]);
        assert!(steady[1] < 1.05 * alone[1], "{adapter:?}: {} degrees wrong, alone {}", steady[1], alone[1]);
    }
}

/// Successive pictures are averaged, with the same result on both backends up to rounding.
#[test]
fn steady_pictures_flicker_less() {
    let cloud = wave(0.0, 0.004, &mut Random::new(9));
    let view = |frame: i32| camera(DVec3::new(0.3 + 0.002 * f64::from(frame), 0.2, 3.0));
    let mut steady_pictures = Vec::new();
    for mut renderer in crate::renderers() {
        let adapter = renderer.adapter();
        let mut shown = |steady: bool| {
            let reconstruction = Reconstruction { steady, ..Reconstruction::default() };
            let settings = Settings { reconstruction, ..Settings::default() };
            let frames = (0..6).map(|frame| {
                let image = renderer.render(&cloud, &view(frame), SIZE, &settings).expect("a picture").image;
                image.pixels.iter().map(|pixel| f32::from(pixel[1])).collect()
            });
            frames.collect::<Vec<Vec<f32>>>()
        };
        let [alone, steady] = [false, true].map(&mut shown);
        let [alone_change, steady_change] = [&alone, &steady].map(|frames| mean_difference(&frames[4], &frames[5]));
        assert!(steady_change < 0.6 * alone_change, "{adapter:?}: {steady_change} steps a frame, alone {alone_change}");
        assert!(alone[0] == steady[0], "{adapter:?}: the first has nothing before it");
        steady_pictures.push(steady);
    }
    for (frame, pictures) in steady_pictures[0].iter().enumerate() {
        let others = steady_pictures[1..].iter().map(|other| mean_difference(pictures, &other[frame]));
        assert!(others.clone().all(|off| off < 0.05), "{frame}: off by {:?}", others.collect::<Vec<_>>());
    }
}

/// A frame is not averaged with one of other settings, size or projection, or with a cancelled one.
#[test]
fn what_is_not_alike_begins_anew() {
    let cloud = wave(0.0, 0.02, &mut Random::new(8));
    let view = |frame: i32| camera(DVec3::new(0.3 + 0.02 * f64::from(frame), 0.2, 3.0));
    let with = |change: &dyn Fn(&mut Reconstruction)| {
        let mut settings = Settings { all_layers: true, ..Settings::default() };
        settings.reconstruction.steady = true;
        change(&mut settings.reconstruction);
        settings
    };
    let usual = with(&|_| ());
    let parallel = Camera { projection: Projection::OrthographicHeight(2.0), ..view(3) };
    let others: [(&str, Settings, Camera); 5] = [
        ("k", with(&|reconstruction| reconstruction.k = 14), view(3)),
        ("one point a pixel", with(&|reconstruction| reconstruction.points_per_pixel = 1), view(3)),
        ("larger splats", with(&|reconstruction| reconstruction.splat_scale = 1.3), view(3)),
        ("whole splats", with(&|reconstruction| reconstruction.trim = false), view(3)),
        ("projection", usual.clone(), parallel),
    ];
    for mut renderer in crate::renderers() {
        let backend = if renderer.adapter().is_some() { Backend::Gpu } else { Backend::Cpu };
        for (name, settings, camera) in &others {
            for frame in 0..3 {
                renderer.render(&cloud, &view(frame), SIZE, &usual).expect("a picture");
            }
            let after = depths(renderer.render(&cloud, camera, SIZE, settings).expect("a picture").layers);
            let mut fresh = renderer.another().expect("a renderer");
            let alone = depths(fresh.render(&cloud, camera, SIZE, settings).expect("a picture").layers);
            assert!(after == alone, "{backend:?}, {name}: not the same as the first of its kind");
        }
        for side in [100, 240] {
            renderer.render(&cloud, &view(4), [side, 180], &usual).expect("a picture of another size");
        }
    }
    // Checks that the past is used at all, and that a cancelled frame ends it.
    let mut renderer = Renderer::new();
    let mut last = |given_up: bool| {
        for frame in 0..3 {
            renderer.render(&cloud, &view(frame), SIZE, &usual).expect("a picture");
        }
        if given_up {
            let asked = AtomicUsize::new(0);
            let go_on = || asked.fetch_add(1, Relaxed) < 40;
            let outcome = renderer.render_while(&cloud, &view(3), SIZE, &usual, &go_on).map(|_| ());
            assert!(matches!(outcome, Err(Error::Cancelled)), "{outcome:?}");
        }
        depths(renderer.render(&cloud, &view(3), SIZE, &usual).expect("a picture").layers)
    };
    let [averaged, anew] = [false, true].map(&mut last);
    let alone = depths(Renderer::new().render(&cloud, &view(3), SIZE, &usual).expect("a picture").layers);
    assert!(anew == alone && averaged != alone, "given up: {}, not: {}", anew == alone, averaged == alone);
}

/// Detail as fine as the points is as accurate after several frames as in a single one.
#[test]
fn detail_is_not_blurred() {
    for mut renderer in crate::renderers() {
        let mut random = Random::new(7);
        let ripple = |random: &mut Random| {
            let [x, y] = [random.signed(), random.signed()];
            Vec3::new(x, y, 0.02 * (60.0 * x).sin()).to_array()
        };
        let cloud = PointCloud::new(DVec3::ZERO, (0..60_000).map(|_| ripple(&mut random)).collect());
        let view = |frame: i32| camera(DVec3::new(0.3 + 0.01 * f64::from(frame), 0.2, 3.0));
        let mut wrong = |steady: bool| {
            let reconstruction = Reconstruction { steady, ..Reconstruction::default() };
            let settings = Settings { reconstruction, all_layers: true, ..Settings::default() };
            for frame in 0..8 {
                renderer.render(&cloud, &view(frame), SIZE, &settings).expect("a picture");
            }
            let layers = renderer.render(&cloud, &view(8), SIZE, &settings).expect("a picture").layers;
            let depths = depths(layers);
            let place = |(index, &depth): (usize, &f32)| {
                let [x, y] = [index % (SIZE[0] / 2) as usize, index / (SIZE[0] / 2) as usize];
                let pixel = DVec2::new(x as f64, y as f64) + 0.25 * DVec2::from(SIZE.map(f64::from)) + 0.5;
                view(8).unproject(pixel, depth.into(), SIZE).expect("a camera")
            };
            let truth = depths.iter().enumerate().map(place).map(|place| {
                let slope = 1.2 * (60.0 * place.x).cos();
                DVec3::new(-slope, 0.0, 1.0).normalize().as_vec3()
            });
            mean_degrees(&normals(layers, &view(8)), &truth.collect::<Vec<_>>())
        };
        let [alone, steady] = [false, true].map(&mut wrong);
        assert!(alone < 20.0, "{alone} degrees wrong");
        assert!(steady < 1.01 * alone, "{:?}: {steady} degrees wrong, alone {alone}", renderer.adapter());
    }
}

/// Repeated frames give the same bytes, and both backends about the same depths, for new points in each frame and for
/// the same points.
#[test]
fn the_same_frames_again_are_the_same() {
    let film = |renderer: &mut Renderer| {
        let mut random = Random::new(4);
        let mut last = Vec::new();
        for frame in 0..4 {
            let cloud = wave(0.01 * frame as f32, 0.02, &mut random);
            for step in 0..3 {
                let view = camera(DVec3::new(0.3, 0.2 + 0.01 * f64::from(step), 3.0));
                last = depths(renderer.render(&cloud, &view, SIZE, &settings(8)).expect("a picture").layers);
            }
        }
        last
    };
    let mut of_backends = Vec::new();
    for renderer in crate::renderers() {
        let [first, again] = [0, 1].map(|_| film(&mut renderer.another().expect("a renderer")));
        assert!(first == again, "{:?}: bits differ", renderer.adapter());
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
