//! Points per second from files in the page cache: `cargo bench -p autosplats-formats --bench read [-- POINTS |
//! FILE...]`.
//!
//! Without files, some are generated. Each file is written once and read five times. The best time is printed, since
//! other rounds include other work of the computer.

#![allow(clippy::unwrap_used, reason = "a benchmark that cannot run should say so and stop")]

use std::{path::Path, time::Instant};

use autosplats_cloud::{FieldValues, PointCloud, glam::DVec3};
use autosplats_formats::{read, write};

fn main() {
    // Cargo adds `--bench`.
    let args: Vec<String> = std::env::args().skip(1).filter(|arg| arg != "--bench").collect();
    let points = match args.first().map(|arg| arg.parse()) {
        Some(Err(_)) => return args.iter().for_each(|file| time(file.as_ref(), file)),
        Some(Ok(points)) => points,
        None => 10_000_000,
    };
    let folder = tempfile::tempdir().unwrap();
    println!("{points} points, {} threads", std::thread::available_parallelism().unwrap());

    let bare = PointCloud::new(DVec3::ZERO, positions(points));
    measure(&folder.path().join("bare.ply"), "PLY, xyz float", &bare);
    let colors = (0..points).map(|i| [i as u8, (i >> 8) as u8, (i >> 16) as u8]).collect();
    let colored = bare.clone().with_colors(colors).unwrap();
    measure(&folder.path().join("colored.ply"), "PLY, xyz float, rgb", &colored);
    let rich = colored.with_field("Intensity", FieldValues::U16((0..points).map(|i| i as u16).collect())).unwrap();
    measure(&folder.path().join("rich.ply"), "PLY, xyz float, rgb, intensity", &rich);
    let far = PointCloud::new(DVec3::new(5e5, 5e6, 100.0), positions(points));
    measure(&folder.path().join("far.ply"), "PLY, xyz double, UTM", &far);

    let text = folder.path().join("points.xyz");
    let lines: String =
        bare.positions()[..points / 10].iter().map(|[x, y, z]| format!("{x:.4} {y:.4} {z:.4}\n")).collect();
    std::fs::write(&text, lines).unwrap();
    time(&text, "text, xyz");
}

fn positions(points: usize) -> Vec<[f32; 3]> {
    (0..points).map(|i| [(i % 1000) as f32 * 0.37, (i / 1000 % 1000) as f32 * 0.11, (i / 1_000_000) as f32]).collect()
}

fn measure(path: &Path, what: &str, cloud: &PointCloud) {
    let start = Instant::now();
    write(cloud, path, &()).unwrap();
    print!("{:>7.1} M points/s written, ", rate(cloud.len(), start));
    time(path, what);
    std::fs::remove_file(path).unwrap();
}

fn time(path: &Path, what: &str) {
    let best = (0..5)
        .map(|_| {
            let start = Instant::now();
            let cloud = read(path, &()).unwrap();
            rate(cloud.len(), start)
        })
        .fold(0.0, f64::max);
    println!("{best:>7.1} M points/s read: {what}");
}

fn rate(points: usize, start: Instant) -> f64 {
    points as f64 / start.elapsed().as_secs_f64() / 1e6
}
