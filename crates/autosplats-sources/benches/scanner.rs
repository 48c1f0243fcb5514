//! Rays per second of simulated scanners: `cargo bench -p autosplats-sources --bench scanner [-- FILES_OR_SCENE...]`.
//!
//! Four scanners of 640 by 480 rays scan each argument: a folder of meshes, or `scene:NAME`.

#![allow(clippy::unwrap_used, reason = "a benchmark that cannot run should say so and stop")]

use std::{
    path::Path,
    time::{Duration, Instant},
};

use autosplats_formats::ReadOptions;
use autosplats_scenes::{SCENE_PREFIX, Scene};
use autosplats_sources::{Animation, Next, Stream as _};

/// Number of scanned frames. The best one counts, since the others include other work of the computer.
const FRAMES: usize = 8;

fn main() {
    // Cargo adds `--bench`.
    let named: Vec<String> = std::env::args().skip(1).filter(|arg| arg != "--bench").collect();
    let horse = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/animation/horse_gallop");
    let usual = [horse.to_str().unwrap(), "scene:figure", "scene:herd"].map(str::to_owned);
    println!("4 scanners of 640 x 480 rays, {} threads", std::thread::available_parallelism().unwrap());
    for name in if named.is_empty() { &usual[..] } else { &named } {
        let animation = match name.starts_with(SCENE_PREFIX) {
            true => Scene::parse(name).and_then(|(scene, count)| Animation::scene(&scene, count, 10.0)),
            false => Animation::sequence(name, 10.0, &ReadOptions::default(), &()),
        };
        let animation = animation.unwrap();
        let scanners = animation.scanners(4, &()).unwrap();
        let rays: u32 = scanners.iter().map(|scanner| scanner.columns * scanner.rows).sum();
        let scanned = animation.scanned(scanners, 1).unwrap();
        let mut best = (Duration::MAX, 0);
        for frame in 0..scanned.timeline().len().min(FRAMES) {
            // Each frame in a new stream, so that nothing is read ahead.
            let mut stream = scanned.play();
            stream.seek(frame);
            let start = Instant::now();
            let mut points = 0;
            for _ in 0..stream.updates_per_frame() {
                let Next::Update(update) = stream.next(Duration::ZERO, &()).unwrap() else { break };
                points += update.cloud.len();
            }
            best = best.min((start.elapsed(), points));
        }
        let (time, points) = best;
        let rate = f64::from(rays) / 1e6 / time.as_secs_f64();
        println!("{rate:>6.2} M rays/s, {time:.0?} a frame, {points} points: {name}");
    }
}
