//! Shared parts of the benchmarks: scenes with cameras, medians, and the machine.

use std::path::Path;

use autosplats::cloud::PointCloud;
use autosplats::{Camera, Projection, Renderer, Settings, Timings};
use autosplats_scenes::Scene;

/// Size of every picture in pixels, as in the paper.
pub(crate) const SIZE: [u32; 2] = [1760, 900];

/// Arguments without those that Cargo adds.
pub(crate) fn args() -> Vec<String> {
    std::env::args().skip(1).filter(|arg| !arg.starts_with("--")).collect()
}

/// The generated scene `name` with `count` points, and its camera.
pub(crate) fn scene(name: &str, count: usize) -> (PointCloud, Camera) {
    let (scene, _) = Scene::parse(name).expect("a scene of this name");
    let cloud = scene.sample(count, &()).expect("enough memory");
    let view = scene.view();
    let projection = Projection::PerspectiveFovDeg(view.fov_degrees);
    (cloud, Camera { eye: view.eye, look_at: view.look_at, up: view.up, projection })
}

/// Renders one frame and returns its times and the number of visible points.
pub(crate) fn frame(
    renderer: &mut Renderer,
    cloud: &PointCloud,
    camera: &Camera,
    settings: &Settings,
) -> (Timings, usize) {
    let frame = renderer.render(cloud, camera, SIZE, settings).expect("valid settings");
    (frame.timings, frame.counts.visible)
}

/// Median; the mean of the two middle values if their number is even.
pub(crate) fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len().is_multiple_of(2) { 0.5 * (values[middle - 1] + values[middle]) } else { values[middle] }
}

/// A number in thousands or millions, if large: 36K, 1M.
pub(crate) fn short(count: usize) -> String {
    match count {
        1_000_000.. if count.is_multiple_of(1_000_000) => format!("{}M", count / 1_000_000),
        1_000.. => format!("{}K", count / 1000),
        _ => count.to_string(),
    }
}

/// One line about the computer and the picture.
pub(crate) fn machine() -> String {
    let threads = rayon::current_num_threads();
    let [width, height] = SIZE;
    format!("{}, {threads} threads, {width}x{height} pixels, k = 10", processor())
}

/// Name of the processor.
pub(crate) fn processor() -> String {
    let info = std::fs::read_to_string(Path::new("/proc/cpuinfo")).unwrap_or_default();
    let name = info.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    name.map_or_else(|| std::env::consts::ARCH.into(), |(_, name)| name.trim().into())
}
