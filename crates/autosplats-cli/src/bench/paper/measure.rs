//! What is measured of each scene, and the measuring.

use autosplats::{
    Backend, Camera, Counts, Error, Image, NormalSettings, PassTime, RadiusTrial, Reconstruction, Renderer,
    SearchEngine, Settings, Timings, best_first_radius, estimate_normals,
};
use autosplats_cloud::PointCloud;
use serde::{Deserialize, Serialize};

use super::scenes::PaperScene;
use crate::bench::{BUILD, median};
use crate::device::Device;
use crate::exit::Failure;
use crate::render::render_failure;

/// The k of Table 1.
pub(super) const K: u32 = 10;
/// Part of the points whose k-radius is to be exact, the paper's.
const ACCURACY: f64 = 0.999;
/// A frame that takes longer is measured once, the first time.
const SLOW_MS: f64 = 3000.0;
/// Radii of neighbourhoods that differ by a greater part are not the same.
const SAME: f32 = 1e-4;
/// Brightness, of 255, by which pixels may differ and still look the same.
const SEEN: u8 = 2;

/// A way to find neighbours, and where.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Method {
    GridCpu,
    GridGpu,
    /// The paper's own.
    Communication,
    /// Its rival.
    KdTree,
}

impl Method {
    pub(super) const ALL: [Self; 4] = [Self::GridCpu, Self::GridGpu, Self::Communication, Self::KdTree];
    /// Those that Figure 10 shows: the paper has it for its own search, of which a frame of any k is taken as it comes.
    pub(super) const BY_STAGE: [Self; 3] = [Self::GridCpu, Self::GridGpu, Self::Communication];

    /// How tables call it.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::GridCpu => "screen grid, CPU",
            Self::GridGpu => "screen grid, GPU",
            Self::Communication => "splat communication, GPU",
            Self::KdTree => "kd-tree, GPU",
        }
    }

    /// The engine; a kd-tree has a first radius.
    fn engine(self, first_radius: f32) -> SearchEngine {
        match self {
            Self::GridCpu | Self::GridGpu => SearchEngine::ScreenGrid,
            Self::Communication => SearchEngine::SplatCommunication,
            Self::KdTree => SearchEngine::KdTree { first_radius },
        }
    }

    pub(super) fn is_on_gpu(self) -> bool {
        self != Self::GridCpu
    }
}

/// A measurement, or why the device refused it.
pub(super) type Outcome<T> = Result<T, String>;

/// Medians of some frames; milliseconds.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Timing {
    /// Points of the cloud.
    pub(super) points: usize,
    pub(super) visible: usize,
    /// Points reconstructed, of those.
    pub(super) reconstructed: usize,
    pub(super) frames: usize,
    pub(super) project: f64,
    pub(super) search: f64,
    /// Of the search, making a tree.
    pub(super) build: f64,
    pub(super) fit: f64,
    pub(super) splat: f64,
    pub(super) shade: f64,
    pub(super) frame: f64,
    /// Points searched for in the last frame, and after each iteration those without a radius yet; empty where nothing
    /// iterates.
    pub(super) convergence: Vec<u32>,
}

/// The first radius of the kd-tree search that was best, as the paper chose it.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct FirstRadius {
    pub(super) radius: f32,
    /// Part of the visible points whose k-radius is exact with it.
    pub(super) accuracy: f64,
}

/// How well an engine's neighbourhoods agree with exact ones.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Accuracy {
    /// Part of the visible points whose k-radius is the exact one among visible points.
    pub(super) on_screen: f64,
    /// Part whose k-radius is the exact one among all points.
    pub(super) in_space: f64,
    /// Part whose neighbourhood a rule cut short, a gap or the bound on work, or that has none.
    pub(super) cut_short: f64,
    /// Points searched for.
    pub(super) searched: usize,
    /// Iterations that took; 0 where nothing iterates.
    pub(super) iterations: usize,
}

/// Times of kiddo's kd-tree: built, and asked for the neighbours of each point.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct KiddoTimes {
    pub(super) visible_ms: f64,
    pub(super) all_ms: f64,
}

/// The renderers, and what they run on.
#[derive(Debug)]
pub(super) struct Renderers {
    cpu: Renderer,
    gpu: Result<Renderer, String>,
}

impl Renderers {
    pub(super) fn new() -> Self {
        Self { cpu: Renderer::new(), gpu: Renderer::with_backend(Backend::Gpu).map_err(|error| error.to_string()) }
    }

    /// One line for each.
    pub(super) fn describe(&self) -> Vec<String> {
        let gpu = match &self.gpu {
            Ok(renderer) => Device::of(renderer).describe(),
            Err(error) => format!("gpu: none: {error}"),
        };
        vec![Device::of(&self.cpu).describe(), gpu]
    }

    /// What tells a method's measurements on this device from those on others.
    pub(super) fn device(&self, method: Method) -> String {
        match &self.gpu {
            Ok(renderer) if method.is_on_gpu() => Device::of(renderer).name,
            _ if method.is_on_gpu() => "no GPU".into(),
            _ => Device::of(&self.cpu).name,
        }
    }

    /// Whether the GPU is a program on the processor.
    pub(super) fn is_software(&self) -> bool {
        self.gpu.as_ref().is_ok_and(|gpu| gpu.adapter().is_some_and(|adapter| adapter.software))
    }

    fn of(&mut self, method: Method) -> Result<&mut Renderer, String> {
        if method.is_on_gpu() { self.gpu.as_mut().map_err(|error| error.clone()) } else { Ok(&mut self.cpu) }
    }
}

/// A scene ready to be rendered.
#[derive(Debug)]
pub(super) struct Loaded<'a> {
    pub(super) scene: &'a PaperScene,
    pub(super) cloud: PointCloud,
    pub(super) camera: Camera,
}

/// The settings of a measurement: the paper's, but these.
pub(super) fn settings(method: Method, first_radius: f32, k: u32, culled: bool) -> Settings {
    let engine = method.engine(first_radius);
    let reconstruction = Reconstruction { k, engine, grid_culling: culled, ..Reconstruction::paper() };
    Settings { reconstruction, ..Settings::default() }
}

/// Takes what a device refuses as an outcome, everything else as a failure.
fn outcome<T>(result: Result<T, Error>) -> Result<Outcome<T>, Failure> {
    match result {
        Ok(value) => Ok(Ok(value)),
        Err(error @ (Error::Device(_) | Error::DeviceLimit { .. } | Error::DeviceMemory(_) | Error::DeviceLost(_))) => {
            Ok(Err(error.to_string()))
        }
        Err(error) => Err(render_failure(error)),
    }
}

/// Renders frames of a scene and takes the medians of their times.
pub(super) fn time(
    renderers: &mut Renderers,
    loaded: &Loaded<'_>,
    method: Method,
    settings: &Settings,
    frames: usize,
) -> Result<Outcome<Timing>, Failure> {
    let Loaded { scene, cloud, camera } = loaded;
    let renderer = match renderers.of(method) {
        Ok(renderer) => renderer,
        Err(why) => return Ok(Err(why)),
    };
    let mut samples: Vec<(Timings, f64)> = Vec::new();
    let mut counts = Counts::default();
    // The first frame makes the buffers, and does not count unless it is one of few.
    for frame in 0..=frames {
        let rendered = match outcome(renderer.render(cloud, camera, scene.size, settings))? {
            Ok(rendered) => rendered,
            Err(why) => return Ok(Err(why)),
        };
        if method.is_on_gpu() && rendered.passes.is_empty() {
            return Ok(Err("this device does not time its passes".into()));
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
    let convergence = renderer.convergence().map_err(render_failure)?;
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
pub(super) fn first_radius(renderers: &mut Renderers, loaded: &Loaded<'_>) -> Result<Outcome<FirstRadius>, Failure> {
    let Loaded { scene, cloud, camera } = loaded;
    let renderer = match renderers.of(Method::KdTree) {
        Ok(renderer) => renderer,
        Err(why) => return Ok(Err(why)),
    };
    let settings = settings(Method::KdTree, f32::NAN, K, false);
    let best = outcome(best_first_radius(renderer, cloud, camera, scene.size, &settings, ACCURACY))?;
    Ok(best.map(|RadiusTrial { first_radius, accuracy, .. }| FirstRadius { radius: first_radius, accuracy }))
}

/// Whether a pass makes a search structure that other points could be looked up in.
fn is_build(time: &PassTime) -> bool {
    time.pass.starts_with(BUILD)
}

/// Distances to the exact k-th neighbours among some points of a cloud, by index in the cloud.
#[derive(Debug)]
pub(super) struct Exact {
    on_screen: Vec<f32>,
    in_space: Vec<f32>,
    /// Index in the cloud of each of `on_screen`.
    visible: Vec<u32>,
}

impl Exact {
    /// Finds them in a kd-tree of the visible points, and in one of all.
    pub(super) fn new(renderers: &mut Renderers, loaded: &Loaded<'_>) -> Result<Self, Failure> {
        let Loaded { scene, cloud, camera } = loaded;
        let settings = settings(Method::GridCpu, f32::NAN, K, false);
        renderers.cpu.render(cloud, camera, scene.size, &settings).map_err(render_failure)?;
        let mut visible: Vec<u32> =
            renderers.cpu.surfels().map_err(render_failure)?.iter().map(|surfel| surfel.point).collect();
        visible.sort_unstable();
        let positions = visible.iter().map(|&point| cloud.positions()[point as usize]).collect();
        let seen = PointCloud::new(cloud.origin(), positions);
        Ok(Self { on_screen: exact_radii(&seen)?, in_space: exact_radii(cloud)?, visible })
    }
}

/// Distance of each point to its k-th neighbour.
fn exact_radii(cloud: &PointCloud) -> Result<Vec<f32>, Failure> {
    let settings = NormalSettings { k: K, ..NormalSettings::default() };
    let normals = estimate_normals(cloud, &settings, &()).map_err(render_failure)?;
    // The radius there is 2·√(r²/k).
    Ok(normals.radius.into_iter().map(|radius| 0.5 * radius * (K as f32).sqrt()).collect())
}

/// Iterations after which nothing changed any more, of how many points were left before the first and after each.
pub(super) fn iterations(left: &[u32]) -> usize {
    (1..left.len()).rev().find(|&at| left[at] < left[at - 1]).unwrap_or(0)
}

/// Compares an engine's k-radii with exact ones.
pub(super) fn accuracy(
    renderers: &mut Renderers,
    loaded: &Loaded<'_>,
    method: Method,
    first_radius: f32,
    exact: &Exact,
) -> Result<Outcome<Accuracy>, Failure> {
    let Loaded { scene, cloud, camera } = loaded;
    let renderer = match renderers.of(method) {
        Ok(renderer) => renderer,
        Err(why) => return Ok(Err(why)),
    };
    let settings = settings(method, first_radius, K, false);
    let counts = match outcome(renderer.render(cloud, camera, scene.size, &settings))? {
        Ok(frame) => frame.counts,
        Err(why) => return Ok(Err(why)),
    };
    let left = renderer.convergence().map_err(render_failure)?;
    let surfels = renderer.surfels().map_err(render_failure)?;
    let same = |found: f32, exact: f32| (found - exact).abs() <= SAME * exact;
    let [mut on_screen, mut in_space] = [0; 2];
    for surfel in &surfels {
        let seen = exact.visible.binary_search(&surfel.point).map(|at| exact.on_screen[at]);
        on_screen += usize::from(seen.is_ok_and(|exact| same(surfel.k_radius, exact)));
        in_space += usize::from(same(surfel.k_radius, exact.in_space[surfel.point as usize]));
    }
    // No two visible points are in one place.
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

/// Times of kiddo, if the program was built with it.
#[cfg(feature = "kiddo")]
pub(super) fn kiddo(loaded: &Loaded<'_>, exact: &Exact) -> Outcome<KiddoTimes> {
    let positions = loaded.cloud.positions();
    let visible: Vec<[f32; 3]> = exact.visible.iter().map(|&point| positions[point as usize]).collect();
    Ok(KiddoTimes { visible_ms: kiddo_ms(&visible), all_ms: kiddo_ms(positions) })
}

#[cfg(feature = "kiddo")]
fn kiddo_ms(points: &[[f32; 3]]) -> f64 {
    use kiddo::{ImmutableKdTree, SquaredEuclidean};
    let start = std::time::Instant::now();
    let Ok(tree) = ImmutableKdTree::<f32, 3>::new_from_slice(points) else { return f64::NAN };
    // The point itself is found too.
    let nearest = std::num::NonZero::new(K as usize + 1).unwrap_or(std::num::NonZero::<usize>::MIN);
    tree.query_batch(points).nearest_n::<SquaredEuclidean<f32>>(nearest).for_each(|_, found| {
        std::hint::black_box(found);
    });
    start.elapsed().as_secs_f64() * 1e3
}

/// Says how to have kiddo.
#[cfg(not(feature = "kiddo"))]
pub(super) fn kiddo(_: &Loaded<'_>, _: &Exact) -> Outcome<KiddoTimes> {
    Err("this program was built without kiddo; build it with cargo build --release --features kiddo".into())
}

/// Part of the pixels that look different with grid culling.
pub(super) fn culling_difference(renderers: &mut Renderers, loaded: &Loaded<'_>) -> Result<f64, Failure> {
    let Loaded { scene, cloud, camera } = loaded;
    let mut images: Vec<Image> = Vec::new();
    for culled in [false, true] {
        let settings = settings(Method::GridCpu, f32::NAN, K, culled);
        let frame = renderers.cpu.render(cloud, camera, scene.size, &settings).map_err(render_failure)?;
        images.push(frame.image.clone());
    }
    let differs = |(a, b): &(&[u8; 4], &[u8; 4])| (0..4).any(|i| a[i].abs_diff(b[i]) > SEEN);
    let pixels = &images[0].pixels;
    Ok(pixels.iter().zip(&images[1].pixels).filter(differs).count() as f64 / pixels.len() as f64)
}
