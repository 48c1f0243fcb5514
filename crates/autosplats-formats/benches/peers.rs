//! Compares reading with other programs, side by side in one run: `cargo bench -p autosplats-formats --bench peers --
//! PYTHON [POINTS]`.
//!
//! PYTHON is an interpreter with some of open3d, laspy[lazrs], pye57, plyfile and numpy. The command `pdal` is used if
//! present. Each format's file is written once, and every program reads it three times. The best time is printed.

#![allow(clippy::unwrap_used, reason = "a benchmark that cannot run should say so and stop")]

use std::{path::Path, process::Command, time::Instant};

use autosplats_cloud::{FieldValues, PointCloud, glam::DVec3};
use autosplats_formats::{read, write};
use autosplats_scenes::Scene;

const REPEATS: usize = 3;

fn main() {
    // Cargo adds `--bench`.
    let args: Vec<String> = std::env::args().skip(1).filter(|arg| arg != "--bench").collect();
    let Some(python) = args.first() else {
        println!("which Python? cargo bench -p autosplats-formats --bench peers -- PYTHON [POINTS]");
        return;
    };
    let points = args.get(1).map_or(2_000_000, |count| count.parse().unwrap());
    let cloud = survey(points);
    let folder = tempfile::tempdir().unwrap();
    println!("{points} points with colour, intensity and time, {} threads\n", rayon::current_num_threads());
    println!("| file | MB | reader | wall s | CPU s | wall ratio |\n|---|---|---|---|---|---|");
    for extension in ["ply", "pcd", "xyz", "las", "laz", "e57"] {
        let path = folder.path().join(format!("a.{extension}"));
        write(&cloud, &path, &()).unwrap();
        compare(python, &path, extension);
        std::fs::remove_file(path).unwrap();
    }
}

/// A coloured statue in survey coordinates, like a recorded scan.
fn survey(points: usize) -> PointCloud {
    let (scene, _) = Scene::parse("statue").unwrap();
    let statue = scene.sample(points, &()).unwrap();
    let colors = statue.colors().map_or_else(|| vec![[200, 180, 160]; points], <[_]>::to_vec);
    let wave = |i: usize| (i as f64 * 0.37).sin();
    PointCloud::new(DVec3::new(512_000.0, 5_403_000.0, 300.0), statue.positions().to_vec())
        .with_resolution(DVec3::splat(0.0001))
        .with_colors(colors)
        .unwrap()
        .with_field("Intensity", FieldValues::U16((0..points).map(|i| (2000.0 + 1500.0 * wave(i)) as u16).collect()))
        .unwrap()
        .with_field("GpsTime", FieldValues::F64((0..points).map(|i| 3e5 + i as f64 * 1e-5).collect()))
        .unwrap()
}

fn compare(python: &str, path: &Path, extension: &str) {
    let megabytes = std::fs::metadata(path).unwrap().len() as f64 / 1e6;
    let row = |reader: &str, wall: f64, cpu: f64, ratio: f64| {
        println!("| {extension} | {megabytes:.0} | {reader} | {wall:.3} | {cpu:.3} | {ratio:.1} |");
    };
    let ours = (0..REPEATS)
        .map(|_| {
            let (cpu, wall) = (cpu_seconds(), Instant::now());
            let cloud = read(path, &()).unwrap();
            assert!(!cloud.is_empty(), "points were read");
            (wall.elapsed().as_secs_f64(), cpu_seconds() - cpu)
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .unwrap();
    row("autosplats", ours.0, ours.1, 1.0);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peers.py");
    let output = Command::new(python).arg(script).arg(path).arg(REPEATS.to_string()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    for line in String::from_utf8(output.stdout).unwrap().lines().filter(|line| line.starts_with('{')) {
        let value = |name: &str| {
            let (_, rest) = line.split_once(&format!("\"{name}\": "))?;
            Some(rest.trim_start_matches('"').split(['"', ',', '}']).next().unwrap_or_default().to_owned())
        };
        let name = value("name").unwrap();
        if let Some(missing) = value("missing") {
            println!("| {extension} | {megabytes:.0} | {name} | {missing} | | |");
            continue;
        }
        let [wall, cpu] = ["wall", "cpu"].map(|name| value(name).unwrap().parse::<f64>().unwrap());
        row(&name, wall, cpu, wall / ours.0);
    }
}

/// CPU time of this process and all its threads.
fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after_name = stat.rsplit(')').next().unwrap_or_default();
    let ticks = after_name.split_whitespace().skip(11).take(2).filter_map(|ticks| ticks.parse::<f64>().ok());
    ticks.sum::<f64>() / 100.0
}
