//! `autosplats bench`: times each stage of a frame, on each requested backend, and each pass if asked.

mod clocks;
mod paper;

use std::time::{Duration, Instant};

use autosplats::{Counts, PassTime, Renderer, Settings, StageWork, Timings};
use autosplats_cloud::PointCloud;
use autosplats_scenes::SCENE_PREFIX;
use serde::Serialize;

use self::clocks::{Clock, ClockReader};
use crate::args::{BenchArgs, Evaluation};
use crate::console::Console;
use crate::device::Device;
use crate::exit::Failure;
use crate::first_radius::settle_first_radius;
use crate::input::Inputs;
use crate::progress::Bar;
use crate::render::scene_camera;
use crate::values::Neighbors;

/// Time and least number of frames before the measured ones. Buffers are created, caches filled, and the clocks of an
/// idle device raised, which takes longer than a few frames.
const WARM_UP: Duration = Duration::from_secs(1);
const WARM_UP_FRAMES: usize = 3;

/// Prefix of the passes that build the kd-tree, as opposed to searching it.
const TREE_BUILD_PREFIX: &str = "search/kd_tree/build/";

/// The object that `--json` prints.
#[derive(Debug, Serialize)]
struct Bench<'a> {
    version: &'static str,
    scene: &'a str,
    size: [u32; 2],
    k: Neighbors,
    points_per_pixel: u32,
    /// Whether silhouettes were trimmed.
    trim: bool,
    /// Standard deviation of the added noise, in the scene's units.
    #[serde(skip_serializing_if = "Option::is_none")]
    noise: Option<f64>,
    engine: String,
    /// Number of measured frames; times are medians over them.
    frames: usize,
    /// Whether the points were new in each frame.
    stream: bool,
    runs: Vec<Run>,
}

/// Measurements of one backend.
#[derive(Debug, Serialize)]
struct Run {
    device: Device,
    counts: Counts,
    /// Upload time of the first frame, which creates and fills the buffers, in milliseconds. Later uploads are in the
    /// timings.
    first_upload_ms: f64,
    /// Time to the finished picture of the first frame, in milliseconds: that of a still, in memory never used before.
    first_picture_ms: f64,
    /// Time from the request for a picture to the finished picture, in milliseconds.
    picture_ms: f64,
    timings_ms: Timings,
    /// Each pass if asked, else runs of passes of a stage.
    passes: Vec<PassTime>,
    /// The frame's time that no pass took; only if each pass is timed.
    #[serde(skip_serializing_if = "Option::is_none")]
    between_passes_ms: Option<f64>,
    /// What each stage asks of a GPU in a frame: dispatches, their longest chain, bytes bound.
    #[serde(skip_serializing_if = "Option::is_none")]
    work: Option<Vec<StageWork>>,
    /// Clock of the device's processors while it rendered, where its driver tells.
    #[serde(skip_serializing_if = "Option::is_none")]
    clock: Option<Clock>,
    /// Points without a complete neighbourhood, before the first iteration and after each; only of iterative engines.
    unconverged: Vec<u32>,
}

/// Renders the same frame repeatedly and prints the medians.
pub(crate) fn run(args: &BenchArgs, console: &Console) -> Result<(), Failure> {
    let BenchArgs { evaluation, scene, neighbors, backends, no_trim, noise, size, frames, stream, .. } = args;
    if let Some(Evaluation::Paper(args)) = evaluation {
        return paper::run(args, console);
    }
    let mut settings = Settings::default();
    neighbors.set(&mut settings.reconstruction);
    settings.reconstruction.trim = !no_trim;
    settings.check()?;
    let name = scene.strip_prefix(SCENE_PREFIX).unwrap_or(scene);
    let inputs = Inputs::scene(name)?;
    // Missing devices fail before points are generated.
    let mut renderers = Vec::new();
    for &backend in backends {
        let renderer = Renderer::with_backend(backend.into())?;
        renderer.check(&settings)?;
        renderers.push(renderer);
    }
    let mut cloud = inputs.read(console)?;
    if let Some(sigma) = *noise {
        cloud.add_noise(sigma, 0, &Bar::new("adding noise", console))?;
    }
    let mut bench = Bench {
        version: env!("CARGO_PKG_VERSION"),
        scene,
        size: *size,
        k: neighbors.k,
        points_per_pixel: neighbors.points_per_pixel,
        trim: !no_trim,
        noise: *noise,
        engine: neighbors.engine.name(),
        frames: *frames,
        stream: *stream,
        runs: Vec::new(),
    };
    for mut renderer in renderers {
        bench.runs.push(measure(&mut renderer, &inputs, &cloud, settings.clone(), args, console)?);
    }
    if args.json { console.print_json(&bench) } else { console.print_line(bench.table(&cloud)) }
}

fn measure(
    renderer: &mut Renderer,
    inputs: &Inputs,
    cloud: &PointCloud,
    mut settings: Settings,
    args: &BenchArgs,
    console: &Console,
) -> Result<Run, Failure> {
    let device = Device::of(renderer);
    let scene = inputs.only_scene().ok_or_else(|| Failure::usage("a bench needs a scene"))?;
    let camera = scene_camera(scene);
    let first_radius = args.neighbors.first_radius;
    settle_first_radius(&mut settings, first_radius, renderer, cloud, &camera, args.size, console)?;
    let bar = Bar::spinner(&format!("{} frames on {}", args.frames, device.name), console);
    renderer.time_passes(args.passes);
    let mut samples: Vec<(f64, Timings, Vec<PassTime>)> = Vec::new();
    let (mut counts, mut first_upload_ms, mut first_picture_ms) = (Counts::default(), 0.0, 0.0);
    // A renderer takes clouds of another identity as new points, so two alternating clouds are always new.
    let other = args.stream.then(|| copy(cloud)).transpose()?;
    let began = Instant::now();
    let mut clocks = None;
    for frame in 0.. {
        let cloud = other.as_ref().filter(|_| frame % 2 == 1).unwrap_or(cloud);
        let is_warm = frame >= WARM_UP_FRAMES && (clocks.is_some() || began.elapsed() >= WARM_UP);
        if is_warm && clocks.is_none() {
            clocks = Some(ClockReader::start(device.adapter.as_ref()));
        }
        let started = Instant::now();
        let rendered = renderer.render_while(cloud, &camera, args.size, &settings, &console.goes_on())?;
        let picture_ms = started.elapsed().as_secs_f64() * 1e3;
        if frame == 0 {
            (counts, first_upload_ms, first_picture_ms) = (rendered.counts, rendered.timings.upload, picture_ms);
        }
        if is_warm {
            samples.push((picture_ms, rendered.timings, rendered.passes.to_vec()));
        }
        if samples.len() == args.frames {
            break;
        }
    }
    drop(bar);
    let of = |value: &dyn Fn(&Timings) -> f64| median(samples.iter().map(|(_, timings, _)| value(timings)));
    let passes = samples[0].2.iter().enumerate().map(|(pass, first)| PassTime {
        pass: first.pass,
        ms: median(samples.iter().map(|(.., passes)| passes[pass].ms)),
    });
    let between =
        samples.iter().map(|(_, timings, passes)| timings.frame - passes.iter().map(|time| time.ms).sum::<f64>());
    Ok(Run {
        counts,
        first_upload_ms,
        first_picture_ms,
        picture_ms: median(samples.iter().map(|(picture_ms, ..)| *picture_ms)),
        timings_ms: Timings {
            upload: of(&|timings| timings.upload),
            project: of(&|timings| timings.project),
            search: of(&|timings| timings.search),
            fit: of(&|timings| timings.fit),
            adapt: of(&|timings| timings.adapt),
            splat: of(&|timings| timings.splat),
            shade: of(&|timings| timings.shade),
            frame: of(&|timings| timings.frame),
        },
        passes: passes.collect(),
        between_passes_ms: (args.passes && renderer.adapter().is_some()).then(|| median(between)),
        work: renderer.stage_work(),
        clock: clocks.and_then(ClockReader::finish),
        unconverged: renderer.convergence()?,
        device,
    })
}

/// A copy of the cloud with an identity of its own.
fn copy(cloud: &PointCloud) -> Result<PointCloud, Failure> {
    let copy = PointCloud::new(cloud.origin(), cloud.positions().to_vec());
    let Some(colors) = cloud.colors() else { return Ok(copy) };
    Ok(copy.with_colors(colors.to_vec())?)
}

/// The median of at least one value.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_unstable_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Passes in the order of their first run, each with its number of runs and their total milliseconds.
fn summed(passes: &[PassTime]) -> Vec<(&'static str, usize, f64)> {
    let mut sums: Vec<(&'static str, usize, f64)> = Vec::new();
    for &PassTime { pass, ms } in passes {
        match sums.iter_mut().find(|(other, ..)| *other == pass) {
            Some((_, times, sum)) => (*times, *sum) = (*times + 1, *sum + ms),
            None => sums.push((pass, 1, ms)),
        }
    }
    sums
}

impl Bench<'_> {
    fn table(&self, cloud: &PointCloud) -> String {
        let Self { scene, size: [width, height], k, points_per_pixel, trim, noise, engine, frames, runs, .. } = self;
        let whole = if *trim { "" } else { ", untrimmed" };
        let noise = noise.map(|noise| format!("noise {noise}, ")).unwrap_or_default();
        let mut lines = vec![format!(
            "{scene}: {} points, {noise}{width}x{height}, k {k}, {points_per_pixel} per pixel{whole}, {engine}; milliseconds, medians \
             of {frames} frames",
            cloud.len()
        )];
        for run in runs {
            let Run {
                device,
                counts,
                first_upload_ms,
                first_picture_ms,
                picture_ms,
                timings_ms,
                passes,
                unconverged,
                ..
            } = run;
            lines.push(String::new());
            lines.push(device.describe());
            if let Some(Clock { median_mhz, most_mhz }) = run.clock {
                lines.push(format!("  its clock: {median_mhz} MHz of {most_mhz}"));
            }
            let Counts { visible, active, recovered, .. } = counts;
            lines.push(format!("  {visible} points visible, {active} reconstructed at first, {recovered} recovered"));
            if let [queries, left @ ..] = &unconverged[..] {
                let percent = |left: &u32| format!("{:.2}", 100.0 - 100.0 * f64::from(*left) / f64::from(*queries));
                let percents: Vec<_> = left.iter().map(percent).collect();
                lines.push(format!("  found after each iteration, %: {}", percents.join(" ")));
            }
            let mut line = |name: &str, ms: f64| lines.push(format!("  {name:<32} {ms:>10.3}"));
            let Timings { project, search, fit, adapt, splat, shade, frame, .. } = timings_ms;
            let stages = [("project", project), ("search", search), ("fit", fit), ("adapt", adapt), ("splat", splat)];
            for (stage, ms) in stages.into_iter().chain([("shade", shade)]) {
                line(stage, *ms);
                let prefix = format!("{stage}/");
                for (pass, times, ms) in summed(passes).into_iter().filter(|(pass, ..)| pass.starts_with(&prefix)) {
                    let repeated = if times > 1 { format!(" x{times}") } else { String::new() };
                    line(&format!("  {}{repeated}", &pass[prefix.len()..]), ms);
                }
                let build: f64 =
                    passes.iter().filter(|time| time.pass.starts_with(TREE_BUILD_PREFIX)).map(|time| time.ms).sum();
                if stage == "search" && build > 0.0 {
                    line("  build the tree", build);
                    line("  search the tree", search - build);
                }
            }
            if let Some(ms) = run.between_passes_ms {
                line("between passes", ms);
            }
            line("frame", *frame);
            line("picture on the host", *picture_ms);
            line("first picture", *first_picture_ms);
            if timings_ms.upload > 0.01 {
                line("upload of new points", timings_ms.upload);
            }
            if *first_upload_ms > 0.0 {
                line("first upload of the points", *first_upload_ms);
            }
        }
        lines.join("\n")
    }
}
