//! Measurements of a scene.

use autosplats::{
    Backend, Camera, Counts, Error, Image, NormalSettings, PassTime, RadiusTrial, Reconstruction, Renderer,
    SearchEngine, Settings, Timings, best_first_radius, estimate_normals,
};
use autosplats_cloud::{ErrorKind, PointCloud};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use serde::{Deserialize, Serialize};

use super::scenes::PaperScene;
use crate::bench::{TREE_BUILD_PREFIX, median};
use crate::console::Console;
use crate::device::Device;
use crate::exit::Failure;
use crate::first_radius::ACCURACY;

/// The k of Table 1.
pub(super) const K: u32 = 10;
/// Time in milliseconds above which a frame is measured only once, at its first run.
const SLOW_MS: f64 = 3000.0;
/// Largest relative difference of equal k-radii.
const MAX_RADIUS_DIFFERENCE: f32 = 1e-4;
/// Largest difference of equal pixels, in levels of 255.
const MAX_LEVEL_DIFFERENCE: u8 = 2;

/// A search engine on a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Method {
    GridCpu,
    GridGpu,
    /// The paper's engine, in compute shaders.
    Communication,
    /// The paper's engine, on the raster pipeline as in the paper.
    CommunicationRaster,
    /// The paper's baseline.
    KdTree,
}

impl Method {
    pub(super) const ALL: [Self; 5] =
        [Self::GridCpu, Self::GridGpu, Self::Communication, Self::CommunicationRaster, Self::KdTree];
    /// Methods in Figure 10. The paper shows its own search, which takes any k without preparation.
    pub(super) const BY_STAGE: [Self; 4] =
        [Self::GridCpu, Self::GridGpu, Self::Communication, Self::CommunicationRaster];

    /// Name in tables.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::GridCpu => "screen grid, CPU",
            Self::GridGpu => "screen grid, GPU",
            Self::Communication => "splat communication, GPU",
            Self::CommunicationRaster => "splat communication by raster, GPU",
            Self::KdTree => "kd-tree, GPU",
        }
    }

    /// The engine. Only the kd-tree uses `first_radius`.
    fn engine(self, first_radius: f32) -> SearchEngine {
        match self {
            Self::GridCpu | Self::GridGpu => SearchEngine::ScreenGrid,
            Self::Communication => SearchEngine::SplatCommunication,
            Self::CommunicationRaster => SearchEngine::SplatCommunicationRaster,
            Self::KdTree => SearchEngine::KdTree { first_radius },
        }
    }

    /// Whether it is a form of splat communication.
    pub(super) fn communicates(self) -> bool {
        matches!(self, Self::Communication | Self::CommunicationRaster)
    }

    pub(super) fn is_on_gpu(self) -> bool {
        self != Self::GridCpu
    }
}

/// A measurement, or why the device refused it.
pub(super) type Outcome<T> = Result<T, String>;

/// Medians of several frames, in milliseconds.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Timing {
    pub(super) points: usize,
    pub(super) visible: usize,
    /// Reconstructed points among the visible ones.
    pub(super) reconstructed: usize,
    pub(super) frames: usize,
    pub(super) project: f64,
    pub(super) search: f64,
    /// Time to build a tree, part of the search.
    pub(super) build: f64,
    pub(super) fit: f64,
    pub(super) splat: f64,
    pub(super) shade: f64,
    pub(super) frame: f64,
    /// Points of the last frame without a k-radius, before the first iteration and after each; empty without
    /// iterations.
    pub(super) convergence: Vec<u32>,
}

/// The best first radius of the kd-tree search, chosen as in the paper.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct FirstRadius {
    pub(super) radius: f32,
    /// Fraction of the visible points whose k-radius is exact with this radius.
    pub(super) accuracy: f64,
}

/// Agreement of an engine's neighbourhoods with exact ones.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Accuracy {
    /// Fraction of the visible points whose k-radius is exact among the visible points.
    pub(super) on_screen: f64,
    /// Fraction whose k-radius is exact among all points.
    pub(super) in_space: f64,
    /// Fraction whose neighbourhood is empty, or ended at a gap or at the limit of work.
    pub(super) cut_short: f64,
    /// Number of points that were searched for.
    pub(super) searched: usize,
    /// Number of iterations; 0 without iterations.
    pub(super) iterations: usize,
}

/// Times of kiddo's kd-tree: building it and finding the neighbours of each point.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct KiddoTimes {
    pub(super) visible_ms: f64,
    pub(super) all_ms: f64,
}

/// The renderers and their devices.
#[derive(Debug)]
pub(super) struct Renderers {
    cpu: Renderer,
    gpu: Result<Renderer, String>,
}

impl Renderers {
    pub(super) fn new() -> Self {
        Self { cpu: Renderer::new(), gpu: Renderer::with_backend(Backend::Gpu).map_err(|error| error.to_string()) }
    }

    /// One line per device.
    pub(super) fn describe(&self) -> Vec<String> {
        let gpu = match &self.gpu {
            Ok(renderer) => Device::of(renderer).describe(),
            Err(error) => format!("gpu: none: {error}"),
        };
        vec![Device::of(&self.cpu).describe(), gpu]
    }

    /// Name of the method's device, part of the measurement's key.
    pub(super) fn device(&self, method: Method) -> String {
        match &self.gpu {
            Ok(renderer) if method.is_on_gpu() => Device::of(renderer).name,
            _ if method.is_on_gpu() => "no GPU".into(),
            _ => Device::of(&self.cpu).name,
        }
    }

    /// Whether the GPU is a software renderer.
    pub(super) fn is_software(&self) -> bool {
        self.gpu.as_ref().is_ok_and(|gpu| gpu.adapter().is_some_and(|adapter| adapter.software))
    }

    fn of(&mut self, method: Method) -> Result<&mut Renderer, String> {
        if method.is_on_gpu() { self.gpu.as_mut().map_err(|error| error.clone()) } else { Ok(&mut self.cpu) }
    }
}

/// A scene ready for rendering.
pub(super) struct LoadedScene<'a> {
    pub(super) scene: &'a PaperScene,
    pub(super) cloud: PointCloud,
    pub(super) camera: Camera,
    pub(super) console: &'a Console,
}

/// Settings of a measurement: those of the paper with these values.
pub(super) fn settings(method: Method, first_radius: f32, k: u32, culled: bool) -> Settings {
    let engine = method.engine(first_radius);
    let reconstruction = Reconstruction { k, engine, grid_culling: culled, ..Reconstruction::paper() };
    Settings { reconstruction, ..Settings::default() }
}

/// Turns a device's refusal into an outcome; other errors are failures.
fn outcome<T>(result: Result<T, Error>) -> Result<Outcome<T>, Failure> {
    match result {
        Ok(value) => Ok(Ok(value)),
        Err(error) if [ErrorKind::Device, ErrorKind::Memory].contains(&error.kind()) => Ok(Err(error.to_string())),
        Err(error) => Err(error.into()),
    }
}

/// Renders frames of a scene and returns the medians of their times.
pub(super) fn time(
    renderers: &mut Renderers,
    loaded: &LoadedScene<'_>,
    method: Method,
    settings: &Settings,
    frames: usize,
) -> Result<Outcome<Timing>, Failure> {
    let LoadedScene { scene, cloud, camera, console } = loaded;
    let renderer = match renderers.of(method) {
        Ok(renderer) => renderer,
        Err(why) => return Ok(Err(why)),
    };
    // Of the tree's passes, those that build it are told apart.
    renderer.time_passes(matches!(method, Method::KdTree));
    let mut samples: Vec<(Timings, f64)> = Vec::new();
    let mut counts = Counts::default();
    // The first frame creates the buffers and is not counted, unless it is slow.
    for frame in 0..=frames {
        let rendered = match outcome(renderer.render_while(cloud, camera, scene.size, settings, &console.goes_on()))? {
            Ok(rendered) => rendered,
            Err(why) => return Ok(Err(why)),
        };
        if method.is_on_gpu() && rendered.passes.is_empty() {
            return Ok(Err("the device does not time passes".into()));
        }
        counts = rendered.counts;
        // An empty sum of floats is -0.
        let built = rendered.passes.iter().filter(|time| is_build(time)).map(|time| time.ms).sum::<f64>() + 0.0;
        let sample = (rendered.timings, built);
        if frame > 0 || sample.0.frame > SLOW_MS {
            samples.push(sample);
        }
        if sample.0.frame > SLOW_MS {
            break;
        }
    }
    let convergence = renderer.convergence()?;
    let of = |value: &dyn Fn(&(Timings, f64)) -> f64| median(samples.iter().map(value));
    Ok(Ok(Timing {
        points: counts.points,
        visible: counts.visible,
        reconstructed: counts.active + counts.recovered,
        frames: samples.len(),
        project: of(&|(timings, _)| timings.project),
        search: of(&|(timings, _)| timings.search),
        build: of(&|(_, built)| *built),
        fit: of(&|(timings, _)| timings.fit),
        splat: of(&|(timings, _)| timings.splat),
        shade: of(&|(timings, _)| timings.shade),
        frame: of(&|(timings, _)| timings.frame),
        convergence,
    }))
}

/// Finds the kd-tree's best first radius.
pub(super) fn first_radius(
    renderers: &mut Renderers,
    loaded: &LoadedScene<'_>,
) -> Result<Outcome<FirstRadius>, Failure> {
    let LoadedScene { scene, cloud, camera, console } = loaded;
    let renderer = match renderers.of(Method::KdTree) {
        Ok(renderer) => renderer,
        Err(why) => return Ok(Err(why)),
    };
    let settings = settings(Method::KdTree, f32::NAN, K, false);
    let best =
        outcome(best_first_radius(renderer, cloud, camera, scene.size, &settings, ACCURACY, &console.goes_on()))?;
    Ok(best.map(|RadiusTrial { first_radius, accuracy, .. }| FirstRadius { radius: first_radius, accuracy }))
}

/// Whether a pass builds the search structure.
fn is_build(time: &PassTime) -> bool {
    time.pass.starts_with(TREE_BUILD_PREFIX)
}

/// True k-radii among the visible points and among all points of a cloud.
#[derive(Debug)]
pub(super) struct ExactRadii {
    on_screen: Vec<f32>,
    in_space: Vec<f32>,
    /// Indices in the cloud of the points of `on_screen`.
    visible: Vec<u32>,
}

impl ExactRadii {
    /// Computes the radii with a kd-tree of the visible points and one of all points.
    pub(super) fn new(renderers: &mut Renderers, loaded: &LoadedScene<'_>) -> Result<Self, Failure> {
        let LoadedScene { scene, cloud, camera, console } = loaded;
        let settings = settings(Method::GridCpu, f32::NAN, K, false);
        renderers.cpu.render_while(cloud, camera, scene.size, &settings, &console.goes_on())?;
        let mut visible: Vec<u32> = renderers.cpu.surfels()?.iter().map(|surfel| surfel.point).collect();
        visible.sort_unstable();
        let positions = visible.iter().map(|&point| cloud.positions()[point as usize]).collect();
        let seen = PointCloud::new(cloud.origin(), positions);
        Ok(Self { on_screen: exact_radii(&seen, console)?, in_space: exact_radii(cloud, console)?, visible })
    }
}

/// Distance of each point to its k-th neighbour.
fn exact_radii(cloud: &PointCloud, console: &Console) -> Result<Vec<f32>, Failure> {
    let settings = NormalSettings { k: K, ..NormalSettings::default() };
    let normals = estimate_normals(cloud, &settings, console.interrupt())?;
    // The density radius is 2·√(r²/k).
    Ok(normals.radius.into_iter().map(|radius| 0.5 * radius * (K as f32).sqrt()).collect())
}

/// Number of iterations until the last change, from the counts of unfinished points before the first and after each.
pub(super) fn iterations(left: &[u32]) -> usize {
    (1..left.len()).rev().find(|&at| left[at] < left[at - 1]).unwrap_or(0)
}

/// Compares an engine's k-radii with exact ones.
pub(super) fn accuracy(
    renderers: &mut Renderers,
    loaded: &LoadedScene<'_>,
    method: Method,
    first_radius: f32,
    exact: &ExactRadii,
) -> Result<Outcome<Accuracy>, Failure> {
    let LoadedScene { scene, cloud, camera, console } = loaded;
    let renderer = match renderers.of(method) {
        Ok(renderer) => renderer,
        Err(why) => return Ok(Err(why)),
    };
    let settings = settings(method, first_radius, K, false);
    let counts = match outcome(renderer.render_while(cloud, camera, scene.size, &settings, &console.goes_on()))? {
        Ok(frame) => frame.counts,
        Err(why) => return Ok(Err(why)),
    };
    let left = renderer.convergence()?;
    let surfels = renderer.surfels()?;
    let same = |found: f32, exact: f32| (found - exact).abs() <= MAX_RADIUS_DIFFERENCE * exact;
    let [mut on_screen, mut in_space] = [0; 2];
    for surfel in &surfels {
        let seen = exact.visible.binary_search(&surfel.point).map(|at| exact.on_screen[at]);
        on_screen += usize::from(seen.is_ok_and(|exact| same(surfel.k_radius, exact)));
        in_space += usize::from(same(surfel.k_radius, exact.in_space[surfel.point as usize]));
    }
    // Visible points have distinct positions, so a k-radius of 0 means no neighbour.
    let alone = surfels.iter().filter(|surfel| surfel.k_radius == 0.0).count();
    let count = surfels.len().max(1) as f64;
    Ok(Ok(Accuracy {
        on_screen: on_screen as f64 / count,
        in_space: in_space as f64 / count,
        cut_short: (counts.clamped + alone) as f64 / count,
        searched: if method == Method::KdTree { cloud.len() } else { surfels.len() },
        iterations: iterations(&left),
    }))
}

/// Measures kiddo.
pub(super) fn kiddo(loaded: &LoadedScene<'_>, exact: &ExactRadii) -> KiddoTimes {
    let positions = loaded.cloud.positions();
    let visible: Vec<[f32; 3]> = exact.visible.iter().map(|&point| positions[point as usize]).collect();
    KiddoTimes { visible_ms: kiddo_ms(&visible), all_ms: kiddo_ms(positions) }
}

fn kiddo_ms(points: &[[f32; 3]]) -> f64 {
    let start = std::time::Instant::now();
    let Ok(tree) = ImmutableKdTree::<f32, 3>::new_from_slice(points) else { return f64::NAN };
    // kiddo also finds the point itself.
    let nearest = std::num::NonZero::new(K as usize + 1).unwrap_or(std::num::NonZero::<usize>::MIN);
    tree.query_batch(points).nearest_n::<SquaredEuclidean<f32>>(nearest).for_each(|_, found| {
        std::hint::black_box(found);
    });
    start.elapsed().as_secs_f64() * 1e3
}

/// Fraction of the pixels that look different with grid culling.
pub(super) fn culling_difference(renderers: &mut Renderers, loaded: &LoadedScene<'_>) -> Result<f64, Failure> {
    let LoadedScene { scene, cloud, camera, console } = loaded;
    let mut images: Vec<Image> = Vec::new();
    for culled in [false, true] {
        let settings = settings(Method::GridCpu, f32::NAN, K, culled);
        let frame = renderers.cpu.render_while(cloud, camera, scene.size, &settings, &console.goes_on())?;
        images.push(frame.image.clone());
    }
    let differs = |(a, b): &(&[u8; 4], &[u8; 4])| (0..4).any(|i| a[i].abs_diff(b[i]) > MAX_LEVEL_DIFFERENCE);
    let pixels = &images[0].pixels;
    Ok(pixels.iter().zip(&images[1].pixels).filter(differs).count() as f64 / pixels.len() as f64)
}
