//! Normals of whole clouds against the fastest kd-tree: `cargo bench -p autosplats --bench normals [-- quick]`.
//!
//! The estimate of normal, curvature and density radius of every point, including the tree, is timed. kiddo builds a
//! tree of the same points and only finds as many nearest neighbours of each, in the faster of two ways. Both run on
//! the same threads and alternate; columns show medians. Processor time is the sum over all threads, for comparison
//! with single-threaded programs.

#[allow(dead_code, reason = "the other benchmarks use the rest")]
mod common;

use std::hint::black_box;
use std::num::NonZero;
use std::time::Instant;

use autosplats::cloud::{PointCloud, glam::DVec3};
use autosplats::{NormalSettings, Orientation, estimate_normals};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;

use common::{args, median, scene, short};

fn main() {
    let quick = args().iter().any(|arg| arg == "quick");
    let (points, rounds) = if quick { (50_000, 2) } else { (1_000_000, 5) };
    println!("{}, {} threads\n", common::processor(), rayon::current_num_threads());
    println!("| scene | points | k | wall ms | processor ms | million points/s | kiddo wall ms | kiddo processor ms |");
    println!("|---|--:|--:|--:|--:|--:|--:|--:|");
    for name in ["statue", "cathedral"] {
        let (cloud, _) = scene(name, points);
        for k in [10, 40] {
            compare(name, &cloud, k, rounds);
        }
    }
}

/// Times one cloud and prints a line of the table.
fn compare(name: &str, cloud: &PointCloud, k: u32, rounds: usize) {
    let settings = NormalSettings { k, orientation: Orientation::Direction(DVec3::Z) };
    let estimate = || {
        black_box(estimate_normals(cloud, &settings, &()).expect("valid settings"));
    };
    // The first round starts the threads.
    estimate();
    let (mut own, mut others) = (Vec::new(), Vec::new());
    for _ in 0..rounds {
        own.push(timed(estimate));
        let ways = [false, true].map(|batch| timed(|| neighbors(cloud.positions(), k, batch)));
        others.push(ways.into_iter().min_by(|a, b| a.wall.total_cmp(&b.wall)).expect("two ways"));
    }
    let wall = |times: &[Times]| median(times.iter().map(|times| times.wall));
    let processor = |times: &[Times]| median(times.iter().map(|times| times.processor));
    println!(
        "| {name} | {} | {k} | {:.0} | {:.0} | {:.1} | {:.0} | {:.0} |",
        short(cloud.len()),
        wall(&own),
        processor(&own),
        cloud.len() as f64 / wall(&own) / 1e3,
        wall(&others),
        processor(&others),
    );
}

/// Times in milliseconds.
struct Times {
    wall: f64,
    processor: f64,
}

fn timed(work: impl FnOnce()) -> Times {
    let before = processor_ms();
    let start = Instant::now();
    work();
    Times { wall: start.elapsed().as_secs_f64() * 1e3, processor: processor_ms() - before }
}

/// Processor time of this process so far in milliseconds; NaN if the system does not provide it.
fn processor_ms() -> f64 {
    let Ok(threads) = std::fs::read_dir("/proc/self/task") else { return f64::NAN };
    let nanoseconds = threads.flatten().filter_map(|thread| {
        let text = std::fs::read_to_string(thread.path().join("schedstat")).ok()?;
        text.split(' ').next()?.parse::<f64>().ok()
    });
    nanoseconds.sum::<f64>() / 1e6
}

/// Finds the nearest neighbours of all points with kiddo; each point also finds itself.
fn neighbors(points: &[[f32; 3]], k: u32, batch: bool) {
    type Metric = SquaredEuclidean<f32>;
    let nearest = NonZero::new(k as usize + 1).expect("not zero");
    let tree = ImmutableKdTree::<f32, 3>::new_from_slice(points).expect("a tree");
    if batch {
        tree.query_batch(points).nearest_n::<Metric>(nearest).unsorted().for_each(|_, found| {
            black_box(found);
        });
    } else {
        points.par_iter().for_each(|point| {
            black_box(tree.query(point).nearest_n::<Metric>(nearest).unsorted().execute());
        });
    }
}
