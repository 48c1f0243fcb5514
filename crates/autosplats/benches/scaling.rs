//! Cost of a frame by the size of the cloud: `cargo bench -p autosplats --bench scaling [-- quick | full]`.
//!
//! The cathedral with rising numbers of points, seen from within by the same camera. `full` goes up to 100 million
//! points, which takes minutes to generate and about 2 GB. `quick` only shows that the benchmark runs. Times are
//! medians of seven frames.

mod common;

use autosplats::{Reconstruction, Renderer, Settings, Timings};

use common::{args, frame, machine, median, scene, short};

fn main() {
    let has = |name: &str| args().iter().any(|arg| arg == name);
    let counts: &[usize] = match () {
        () if has("quick") => &[30_000, 100_000],
        () if has("full") => &[1_000_000, 3_000_000, 10_000_000, 30_000_000, 100_000_000],
        () => &[1_000_000, 3_000_000, 10_000_000, 30_000_000],
    };
    println!("{}, the cathedral\n", machine());
    // The table has a column for each of the paper's stages.
    let reconstruction = Reconstruction::paper();
    let settings = Settings { reconstruction, ..Settings::default() };
    println!(
        "| points | visible | project | search | fit | splat | shade | frame ms | project, ns a point \
         | the rest, ns a visible point | cloud MB | peak MB |"
    );
    println!("|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|");
    for &points in counts {
        let (cloud, camera) = scene("cathedral", points);
        let mut renderer = Renderer::new();
        let mut visible = 0;
        // The first frame makes the buffers.
        let frames: Vec<_> = (0..8)
            .map(|_| {
                let (timings, count) = frame(&mut renderer, &cloud, &camera, &settings);
                visible = count;
                timings
            })
            .skip(1)
            .collect();
        let middle = |stage: fn(&Timings) -> f64| median(frames.iter().map(stage));
        let [project, search, fit] = [middle(|t| t.project), middle(|t| t.search), middle(|t| t.fit)];
        let [splat, shade, whole] = [middle(|t| t.splat), middle(|t| t.shade), middle(|t| t.frame)];
        println!(
            "| {} | {} | {project:.1} | {search:.1} | {fit:.1} | {splat:.1} | {shade:.1} | {whole:.1} | {:.2} | {:.0} | {:.0} | {} |",
            short(points),
            short(visible),
            project * 1e6 / points as f64,
            (search + fit + splat) * 1e6 / visible as f64,
            cloud.byte_len() as f64 / 1e6,
            peak_megabytes().map_or_else(|| "n/a".into(), |peak| format!("{peak:.0}")),
        );
    }
}

/// Peak memory of this process in megabytes, if the system provides it.
fn peak_megabytes() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024.0 / 1e6)
}
