//! What temporal coherence saves: `cargo bench -p autosplats --bench coherence [-- quick] [gpu]`.
//!
//! Cameras that orbit and walk, and points that are new in each frame, rendered by two renderers in turns: one starts its
//! searches from the last frame's k-radii, the other from densities. Their pictures have to be equal. `gpu` is for the search
//! engines on a device; `quick` only shows that the benchmark runs. Times are medians.

mod common;

use autosplats::cloud::glam::{DQuat, DVec3};
use autosplats::cloud::{PointCloud, Scene};
use autosplats::{Backend, Camera, Reconstruction, Renderer, SearchEngine, Settings, Timings};

use common::{SIZE, args, machine, median, scene, short};

/// Frames of each motion; the first of them has no past.
const FRAMES: usize = 8;

/// How the picture changes from frame to frame.
#[derive(Clone, Copy, Debug)]
enum Motion {
    /// Nothing moves.
    Still,
    /// The camera turns about what it looks at, so many degrees a frame.
    Orbit(f64),
    /// The eye goes forward by this part of the distance to what it looks at.
    Walk(f64),
    /// The points are those of an animation's next moment, at 24 a second.
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

/// What a renderer took for a motion.
struct Measured {
    search: f64,
    frame: f64,
    /// Mean number, of an engine that iterates.
    iterations: f64,
}

fn measured(frames: &[(Timings, usize)]) -> Measured {
    let middle = |of: fn(&Timings) -> f64| median(frames.iter().map(|(timings, _)| of(timings)));
    let iterations = frames.iter().map(|&(_, iterations)| iterations as f64).sum::<f64>() / frames.len() as f64;
    Measured { search: middle(|t| t.search), frame: middle(|t| t.frame), iterations }
}

fn main() {
    let has = |name: &str| args().iter().any(|arg| arg == name);
    let (quick, gpu) = (has("quick"), has("gpu"));
    let backend = if gpu { Backend::Gpu } else { Backend::Cpu };
    let paper = Reconstruction { engine: SearchEngine::SplatCommunication, ..Reconstruction::paper() };
    let ways: &[(&str, Reconstruction)] = &[
        ("screen grid", Reconstruction::default()),
        ("screen grid, k = 17", Reconstruction { k: 17, ..Reconstruction::default() }),
        ("splat communication", paper),
    ];
    let cases = [
        ("statue", 1_000_000, Motion::Still),
        ("statue", 1_000_000, Motion::Orbit(1.0)),
        ("statue", 1_000_000, Motion::Orbit(5.0)),
        ("two-scales", 100_000, Motion::Orbit(1.0)),
        ("cathedral", 3_000_000, Motion::Walk(0.01)),
        ("figure", 200_000, Motion::Animation),
    ];
    println!("{}\n", machine());
    println!(
        "| scene | points | motion | engine | search ms without | with | ratio | frame ms without | with | iterations |"
    );
    println!("|---|--:|---|---|--:|--:|--:|--:|--:|--:|");
    let named: Vec<_> = args().into_iter().filter(|arg| cases.iter().any(|(name, ..)| name == arg)).collect();
    for (name, points, motion) in cases {
        if !named.is_empty() && !named.iter().any(|wanted| wanted == name) {
            continue;
        }
        let points = if quick { points / 50 } else { points };
        let (cloud, camera) = scene(name, points);
        let frames = if quick { 3 } else { FRAMES };
        let clouds = clouds(name, points, motion, frames, cloud);
        for (engine, reconstruction) in ways.iter().filter(|(_, way)| gpu || way.engine == SearchEngine::ScreenGrid) {
            let [without, with] = compare(backend, reconstruction, &clouds, &|frame| motion.camera(&camera, frame));
            let iterations = match reconstruction.engine {
                SearchEngine::SplatCommunication => format!("{:.1} and {:.1}", without.iterations, with.iterations),
                _ => String::new(),
            };
            println!(
                "| {name} | {} | {motion:?} | {engine} | {:.1} | {:.1} | {:.2} | {:.1} | {:.1} | {iterations} |",
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

/// The points of each frame; one cloud for all if they do not move.
fn clouds(name: &str, points: usize, motion: Motion, frames: usize, still: PointCloud) -> Vec<PointCloud> {
    let Motion::Animation = motion else { return vec![still; frames] };
    let (scene, _) = Scene::parse(name).expect("a scene of this name");
    let moment = |frame: usize| scene.at(frame as f64 / 24.0).sample(points, &|_| true).expect("enough memory");
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
            let iterations = renderer.convergence().expect("a device").len().saturating_sub(1);
            // The first frame makes the buffers.
            if at > 0 {
                times.push((timings, iterations));
            }
            pixels
        });
        if reconstruction.engine == SearchEngine::ScreenGrid {
            assert!(without == with, "the past changed frame {at}");
        }
    }
    renderers.map(|(_, _, times)| measured(&times))
}
