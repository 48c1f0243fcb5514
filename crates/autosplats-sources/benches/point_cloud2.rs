//! Points per second from PointCloud2 messages in memory, on one core: `cargo bench -p autosplats-sources --bench
//! point_cloud2 [-- POINTS | RECORDING...]`.
//!
//! For recordings: the time to open and to play them, on all cores.
//!
//! Each layout is compared with copying the same bytes into fresh memory. The general path handles any layout; here x
//! and y are swapped. The best of many rounds is printed, since other rounds include other work of the computer.

#![allow(clippy::unwrap_used, reason = "a benchmark that cannot run should say so and stop")]

#[allow(dead_code, reason = "tests use the rest")]
#[path = "../tests/it/common/ros.rs"]
mod ros;

use std::{
    hint::black_box,
    path::Path,
    time::{Duration, Instant},
};

use autosplats_formats::ReadOptions;
use autosplats_sources::{
    Next, Recording, RecordingOptions, Stream as _,
    point_cloud2::{Encoding, decode},
};
use ros::{Cloud2, F32};

fn main() {
    // Cargo adds `--bench`.
    let args: Vec<String> = std::env::args().skip(1).filter(|arg| arg != "--bench").collect();
    let points = match args.first().map(|arg| arg.parse()) {
        Some(Err(_)) => return args.iter().for_each(|file| play(Path::new(file))),
        Some(Ok(points)) => points,
        None => 1_000_000,
    };
    rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global().unwrap();
    println!("{points} points, one core");
    let positions: Vec<[f32; 3]> =
        (0..points).map(|i| [(i % 1000) as f32 * 0.37 + 1.0, (i / 1000) as f32 * 0.11, 2.5]).collect();
    for step in [12, 16, 32, 48] {
        let mut message = Cloud2::xyz(&positions, step);
        let cdr = message.cdr();
        let copy = best(|| message.data.clone());
        let fast = time(&format!("xyz at every {step} bytes"), points, copy, &cdr);
        (message.fields[0].1, message.fields[1].1) = (4, 0);
        let general = time("  in any order, the general path", points, copy, &message.cdr());
        println!("        the general path takes {:.2} times as long", general / fast);
        if step == 32 {
            message.fields.extend([("intensity", 16, F32, 1), ("ring", 20, 4, 1), ("t", 24, 6, 1)]);
            time("  with intensity, ring and t", points, copy, &message.cdr());
        }
    }
}

fn time(what: &str, points: usize, copy: f64, message: &[u8]) -> f64 {
    let options = ReadOptions::default();
    let seconds = best(|| decode(Path::new("/points"), message, Encoding::Cdr, &options).unwrap());
    let rate = points as f64 / seconds / 1e6;
    println!("{rate:>7.1} M points/s, {:.2} copies of its bytes: {what}", seconds / copy);
    seconds
}

fn play(path: &Path) {
    let open = || Recording::open(path, &RecordingOptions::default(), &()).unwrap();
    let opening = best(open);
    let mut recording = open();
    let frames = recording.timeline().unwrap().len();
    let start = Instant::now();
    let (mut points, rounds) = (0, 10);
    for _ in 0..rounds {
        recording.seek(0);
        while let Next::Update(update) = recording.next(Duration::ZERO, &()).unwrap() {
            points += update.cloud.len();
        }
    }
    let seconds = start.elapsed().as_secs_f64();
    println!(
        "opened in {:.2} ms, {:.1} frames and {:.1} M points/s: {}",
        opening * 1e3,
        (rounds * frames) as f64 / seconds,
        points as f64 / seconds / 1e6,
        path.display()
    );
}

/// Seconds of the fastest round.
fn best<T>(work: impl Fn() -> T) -> f64 {
    let round = |_| {
        let start = Instant::now();
        let made = black_box(work());
        let seconds = start.elapsed().as_secs_f64();
        drop(made);
        seconds
    };
    (0..50).map(round).fold(f64::INFINITY, f64::min)
}
