//! Time saved by temporal coherence: `cargo bench -p autosplats --bench coherence [-- quick] [gpu] [SCENE]`.
//!
//! Two renderers take turns: one starts its searches from the last frame's k-radii, the other from densities. Cameras
//! orbit and walk, or points are new in each frame. The pictures have to be equal. `gpu` selects a device; `quick` only
//! shows that the benchmark runs. Times are medians.

#[allow(dead_code, reason = "others use the rest")]
mod common;

use autosplats::cloud::PointCloud;
use autosplats::cloud::glam::{DQuat, DVec3};
use autosplats::{Backend, Camera, Reconstruction, Renderer, Settings, Timings};
use autosplats_scenes::Scene;

use common::{SIZE, args, machine, median, scene, short};

/// Frames of each motion; the first frame has no past.
const FRAMES: usize = 8;

/// Change of the picture from frame to frame.
#[derive(Clone, Copy, Debug)]
enum Motion {
    /// Nothing moves.
    Still,
    /// The camera turns about its target, in degrees per frame.
    Orbit(f64),
    /// The eye moves towards its target by this fraction of the distance per frame.
    Walk(f64),
    /// The points are those of an animation at 24 frames per second.
    Animation,
}

impl Motion {
    fn camera(self, camera: &Camera, frame: usize) -> Camera {
        let away = camera.eye - camera.look_at;
        match self {
            Self::Still | Self::Animation => *camera,
            Self::Orbit(degrees) => {
                let turn = DQuat::from_axis_angle(DVec3::Z, degrees.to_radians() * frame as f64);
                Camera { eye: camera.look_at + turn * away, ..*camera }
            }
            Self::Walk(part) => {
                let step = -away * part * frame as f64;
                Camera { eye: camera.eye + step, look_at: camera.look_at + step, ..*camera }
            }
        }
    }
}

/// Median times of a motion, in milliseconds.
struct Measured {
    search: f64,
    frame: f64,
}

fn measured(frames: &[Timings]) -> Measured {
    let middle = |of: fn(&Timings) -> f64| median(frames.iter().map(of));
    Measured { search: middle(|t| t.search), frame: middle(|t| t.frame) }
}

fn main() {
    let has = |name: &str| args().iter().any(|arg| arg == name);
    let (quick, gpu) = (has("quick"), has("gpu"));
    let backend = if gpu { Backend::Gpu } else { Backend::Cpu };
    let ways: &[(&str, Reconstruction)] =
        &[("10", Reconstruction::default()), ("17", Reconstruction { k: 17, ..Reconstruction::default() })];
    let cases = [
        ("statue", 1_000_000, Motion::Still),
        ("statue", 1_000_000, Motion::Orbit(1.0)),
        ("statue", 1_000_000, Motion::Orbit(5.0)),
        ("two-scales", 100_000, Motion::Orbit(1.0)),
        ("cathedral", 3_000_000, Motion::Walk(0.01)),
        ("figure", 200_000, Motion::Animation),
    ];
    println!("{}\n", machine());
    println!("| scene | points | motion | k | search ms without | with | ratio | frame ms without | with |");
    println!("|---|--:|---|--:|--:|--:|--:|--:|--:|");
    let named: Vec<_> = args().into_iter().filter(|arg| cases.iter().any(|(name, ..)| name == arg)).collect();
    for (name, points, motion) in cases {
        if !named.is_empty() && !named.iter().any(|wanted| wanted == name) {
            continue;
        }
        let points = if quick { points / 50 } else { points };
        let (cloud, camera) = scene(name, points);
        let frames = if quick { 3 } else { FRAMES };
        let clouds = clouds(name, points, motion, frames, cloud);
        for (k, reconstruction) in ways {
            let [without, with] = compare(backend, reconstruction, &clouds, &|frame| motion.camera(&camera, frame));
            println!(
                "| {name} | {} | {motion:?} | {k} | {:.1} | {:.1} | {:.2} | {:.1} | {:.1} |",
                short(points),
                without.search,
                with.search,
                without.search / with.search,
                without.frame,
                with.frame,
            );
        }
    }
}

/// Cloud of each frame; a single cloud if the points do not move.
fn clouds(name: &str, points: usize, motion: Motion, frames: usize, still: PointCloud) -> Vec<PointCloud> {
    let Motion::Animation = motion else { return vec![still; frames] };
    let (scene, _) = Scene::parse(name).expect("a scene of this name");
    let moment = |frame: usize| scene.at(frame as f64 / 24.0).sample(points, &()).expect("enough memory");
    (0..frames).map(moment).collect()
}

/// Renders every frame twice, without and with the past.
fn compare(
    backend: Backend,
    reconstruction: &Reconstruction,
    clouds: &[PointCloud],
    camera: &dyn Fn(usize) -> Camera,
) -> [Measured; 2] {
    let mut renderers = [false, true].map(|coherent| {
        let reconstruction = Reconstruction { coherent, ..reconstruction.clone() };
        let settings = Settings { reconstruction, ..Settings::default() };
        (Renderer::with_backend(backend).expect("a device"), settings, Vec::new())
    });
    for (at, cloud) in clouds.iter().enumerate() {
        let [without, with] = renderers.each_mut().map(|(renderer, settings, times)| {
            let frame = renderer.render(cloud, &camera(at), SIZE, settings).expect("valid settings");
            let (timings, pixels) = (frame.timings, frame.image.pixels.clone());
            // The first frame makes the buffers.
            if at > 0 {
                times.push(timings);
            }
            pixels
        });
        assert!(without == with, "the past changed frame {at}");
    }
    renderers.map(|(_, _, times)| measured(&times))
}
