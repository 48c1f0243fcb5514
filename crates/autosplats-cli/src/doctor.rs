//! `autosplats doctor`: reports what this machine can do and tests the program on it.

use std::time::Instant;

use autosplats::{
    AdapterSummary, BYTES_PER_PIXEL, Backend as BackendChoice, Frame, Renderer, Settings, adapters, still_supersample,
};
use autosplats_cloud::{Draft, available_memory, total_memory};
use autosplats_formats::{formats, read, write, written_formats};
use autosplats_scenes::Scene;
use pulp::{Arch, Simd, WithSimd};
use serde::Serialize;

use crate::args::DoctorArgs;
use crate::console::Console;
use crate::device::Device;
use crate::exit::{Exit, Failure};
use crate::info::wrapped;
use crate::render::scene_camera;

/// Memory of a point in bytes while a file is read and rendered: position and colour.
const BYTES_PER_POINT: u64 = 12 + 3;

/// Memory that the program takes beside points and pictures, in bytes.
const PROGRAM_BYTES: u64 = 40 << 20;

/// Size of the largest picture that is supersampled by default, in pixels.
const PICTURE: [u32; 2] = [1920, 1080];

/// Points and pixels of the self-test.
const TEST_POINTS: usize = 20_000;
const TEST_SIZE: [u32; 2] = [320, 200];

/// Indent of wrapped text in columns.
const INDENT: usize = 20;

/// All findings, in the shape of `--json`.
#[derive(Debug, Serialize)]
struct Findings {
    version: &'static str,
    system: String,
    /// Whether the self-test passed.
    ok: bool,
    backends: Vec<Backend>,
    /// Graphics devices; the first is used.
    adapters: Vec<AdapterSummary>,
    cpu: Cpu,
    memory: Memory,
    self_test: SelfTest,
    terminal: Terminal,
    formats: Formats,
}

#[derive(Debug, Serialize)]
struct Backend {
    name: &'static str,
    ready: bool,
    about: String,
}

#[derive(Debug, Serialize)]
struct Cpu {
    name: String,
    threads: usize,
    simd_found: Vec<&'static str>,
    simd_used: &'static str,
    /// Numbers that one instruction processes.
    lanes: usize,
}

#[derive(Debug, Serialize)]
struct Memory {
    total: Option<u64>,
    available: Option<u64>,
    /// Memory that rendering takes: of the program, of each coloured point, and at most of a still of `PICTURE`.
    program: u64,
    per_point: u64,
    picture: u64,
    /// Points of the largest coloured cloud that can be rendered to such a still in the available memory.
    largest_cloud: Option<u64>,
}

/// Times of the steps that worked, in milliseconds, and errors of the others.
#[derive(Debug, Default, Serialize)]
struct SelfTest {
    generate_ms: Option<f64>,
    render_ms: Option<f64>,
    /// Time of the same picture on the graphics device, if there is one.
    gpu_ms: Option<f64>,
    write_ms: Option<f64>,
    read_ms: Option<f64>,
    temporary_folder: String,
    errors: Vec<String>,
}

#[derive(Debug, Serialize)]
struct Terminal {
    standard_output: bool,
    standard_error: bool,
    kind: Option<String>,
}

#[derive(Debug, Serialize)]
struct Formats {
    read: Vec<Format>,
    written: Vec<Format>,
}

#[derive(Debug, Serialize)]
struct Format {
    name: &'static str,
    extensions: &'static [&'static str],
}

/// Examines the machine, tests the program on a small scene and prints the findings.
pub(crate) fn run(args: &DoctorArgs, console: &Console) -> Result<(), Failure> {
    let findings = Findings::new(console);
    if args.json {
        console.print_json(&findings)?;
    } else {
        console.print(findings.to_text())?;
    }
    if findings.backends.iter().all(|backend| !backend.ready) {
        return Err(Failure::new(Exit::Device, "no backend works; the self-test shows why"));
    }
    match findings.self_test.errors.first() {
        Some(error) => Err(Failure::new(Exit::Output, format!("self-test: {error}"))),
        None => Ok(()),
    }
}

impl Findings {
    fn new(console: &Console) -> Self {
        let self_test = SelfTest::run(console);
        let Device { name, threads, simd, .. } = Device::cpu();
        let (simd_used, lanes) = simd_used();
        let available = available_memory();
        let [width, height] = PICTURE.map(|side| u64::from(side * still_supersample(PICTURE)));
        let picture = width * height * BYTES_PER_PIXEL;
        let adapters = adapters();
        let about = "renders on the processor, all features".into();
        Self {
            version: env!("CARGO_PKG_VERSION"),
            system: format!("{} on {}", std::env::consts::OS, std::env::consts::ARCH),
            ok: self_test.errors.is_empty(),
            backends: vec![
                Backend { name: "cpu", ready: self_test.render_ms.is_some(), about },
                Backend { name: "gpu", ready: self_test.gpu_ms.is_some(), about: about_gpu(&adapters) },
            ],
            adapters,
            cpu: Cpu { name, threads, simd_found: simd, simd_used, lanes },
            memory: Memory {
                total: total_memory(),
                available,
                program: PROGRAM_BYTES,
                per_point: BYTES_PER_POINT,
                picture,
                largest_cloud: available.map(|bytes| bytes.saturating_sub(PROGRAM_BYTES + picture) / BYTES_PER_POINT),
            },
            self_test,
            terminal: Terminal {
                standard_output: console.data_to_terminal(),
                standard_error: console.messages_to_terminal(),
                kind: std::env::var("TERM").ok(),
            },
            formats: Formats {
                read: formats().map(|(name, extensions)| Format { name, extensions }).collect(),
                written: written_formats().map(|(name, extensions)| Format { name, extensions }).collect(),
            },
        }
    }

    fn to_text(&self) -> String {
        let mut lines = vec![format!("autosplats {}, {}", self.version, self.system), String::new()];
        let mut line = |good: bool, name: &str, what: String| {
            lines.push(format!("  {:<6} {name:<10} {what}", if good { "ok" } else { "-" }));
        };
        for Backend { name, ready, about } in &self.backends {
            let state = if *ready { "ready" } else { "not ready" };
            line(*ready, name, format!("{state}: {about}"));
        }
        for (number, adapter) in self.adapters.iter().enumerate() {
            line(!adapter.software, "adapter", format!("{number}: {}", about_adapter(adapter)));
        }
        let Cpu { name, threads, simd_found, simd_used, lanes } = &self.cpu;
        line(
            true,
            "processor",
            format!(
                "{name}; {} the work",
                if *threads == 1 { "one thread does".into() } else { format!("{threads} threads share") }
            ),
        );
        let found = if simd_found.is_empty() { "none known".into() } else { simd_found.join(" ") };
        let per = match lanes {
            1 => "one number at a time; rendering takes several times as long".into(),
            lanes => format!("{lanes} numbers at a time"),
        };
        line(*lanes > 1, "simd", format!("uses {simd_used}, {per}; found: {found}"));
        let Memory { total, available, picture, largest_cloud, .. } = &self.memory;
        match (available, largest_cloud) {
            (Some(available), Some(points)) => {
                let total = total.map_or_else(String::new, |total| format!(" of {}", gigabytes(total)));
                let what = format!(
                    "{}{total} available: up to {} million coloured points can be rendered, and octrees of any size; a \
                     picture takes up to {}",
                    gigabytes(*available),
                    points / 1_000_000,
                    gigabytes(*picture)
                );
                line(true, "memory", wrapped(&what, INDENT));
            }
            _ => line(false, "memory", "unknown here; too large a cloud ends the run without a message".into()),
        }
        let SelfTest { generate_ms, render_ms, gpu_ms, write_ms, read_ms, temporary_folder, errors } = &self.self_test;
        let took = [
            ("generated", generate_ms),
            ("rendered", render_ms),
            ("rendered on the GPU", gpu_ms),
            ("written", write_ms),
            ("read back", read_ms),
        ];
        let took: Vec<_> =
            took.into_iter().filter_map(|(what, ms)| Some(format!("{what} in {:.0} ms", (*ms)?))).collect();
        line(errors.is_empty(), "self-test", format!("{TEST_POINTS} points {}", took.join(", ")));
        line(
            write_ms.is_some(),
            "temporary",
            format!("{temporary_folder} can{} be written", if write_ms.is_some() { "" } else { "not" }),
        );
        for error in errors {
            lines.push(format!("  broken            {error}"));
        }
        let mut line = |name: &str, what: String| lines.push(format!("  {:<6} {name:<10} {what}", "ok"));
        let Terminal { standard_output, standard_error, kind } = &self.terminal;
        let progress =
            if *standard_error { "progress is shown" } else { "no terminal on standard error: progress is not shown" };
        let kind = kind
            .as_deref()
            .filter(|_| *standard_error || *standard_output)
            .map_or_else(String::new, |kind| format!(" ({kind})"));
        line("terminal", format!("{progress}{kind}"));
        for (name, list) in [("reads", &self.formats.read), ("writes", &self.formats.written)] {
            let shown = |format: &Format| format!("{} (.{})", format.name, format.extensions.join(" ."));
            line(name, wrapped(&list.iter().map(shown).collect::<Vec<_>>().join(", "), INDENT));
        }
        lines.join("\n") + "\n"
    }
}

impl SelfTest {
    /// Generates a small scene, renders it, writes it and reads it back.
    fn run(console: &Console) -> Self {
        let folder = std::env::temp_dir();
        let mut test = Self { temporary_folder: folder.display().to_string(), ..Self::default() };
        if let Err(error) = test.try_all(console) {
            test.errors.push(error);
        }
        test
    }

    fn try_all(&mut self, console: &Console) -> Result<(), String> {
        let said = |error: &dyn std::fmt::Display| error.to_string();
        let since = |start: Instant| Some(start.elapsed().as_secs_f64() * 1e3);
        let start = Instant::now();
        let (scene, count) = Scene::parse(&format!("scene:figure:{TEST_POINTS}")).map_err(|error| said(&error))?;
        let cloud = scene.sample(count, &()).map_err(|error| said(&error))?;
        self.generate_ms = since(start);

        let (mut cpu, mut pictures) = (Renderer::new(), Vec::new());
        let mut render = |renderer: &mut Renderer| {
            let start = Instant::now();
            let Frame { image, counts, .. } = renderer
                .render_while(&cloud, &scene_camera(&scene), TEST_SIZE, &Settings::default(), &console.goes_on())
                .map_err(|error| said(&error))?;
            if counts.covered * 50 < image.pixels.len() {
                return Err(format!("the picture of the test scene is nearly empty: {} pixels", counts.covered));
            }
            pictures.push(image.pixels.clone());
            Ok(since(start))
        };
        self.render_ms = render(&mut cpu)?;
        if !adapters().is_empty() {
            let mut gpu = Renderer::with_backend(BackendChoice::Gpu).map_err(|error| said(&error))?;
            let took = render(&mut gpu).map_err(|error| format!("on the GPU: {error}"))?;
            let unlike = |(a, b): &(&[u8; 4], &[u8; 4])| (0..4).any(|i| a[i].abs_diff(b[i]) > 2);
            let unlike = pictures[0].iter().zip(&pictures[1]).filter(unlike).count();
            if unlike * 1000 > pictures[0].len() {
                return Err(format!("the GPU's picture differs from the CPU's in {unlike} pixels; use --backend cpu"));
            }
            self.gpu_ms = took;
        }

        let start = Instant::now();
        let place = std::env::temp_dir().join(format!("autosplats-{}.ply", std::process::id()));
        // Never finished, so that nothing stays. The cloud is written in its place.
        let draft = Draft::begin(&place, ".ply").map_err(|error| {
            format!("{}: cannot be written ({error}); set the variable TMPDIR to another folder", self.temporary_folder)
        })?;
        let path = draft.path().to_owned();
        write(&cloud, &path, &()).map_err(|error| said(&error))?;
        self.write_ms = since(start);
        let start = Instant::now();
        let back = read(&path, &()).map_err(|error| said(&error))?;
        self.read_ms = since(start);
        if back.positions() != cloud.positions() || back.colors() != cloud.colors() {
            return Err("a cloud differs after writing and reading it".into());
        }
        Ok(())
    }
}

/// Description of the GPU backend's device.
fn about_gpu(adapters: &[AdapterSummary]) -> String {
    match adapters.first() {
        None => "no Vulkan, Metal or DirectX 12 device; pictures are rendered on the processor".into(),
        Some(AdapterSummary { name, software: true, .. }) => {
            format!("{name} is software on the processor, slower than the CPU backend; used only with --backend gpu")
        }
        Some(AdapterSummary { name, .. }) => format!("renders on {name}; used unless --backend cpu is given"),
    }
}

/// Description of a device's capabilities.
fn about_adapter(adapter: &AdapterSummary) -> String {
    let AdapterSummary { name, pci_bus_id, backend, kind, driver, software, int64_atomics, timestamps, .. } = adapter;
    let bus = if pci_bus_id.is_empty() { String::new() } else { format!(" at {pci_bus_id}") };
    let passes = if *int64_atomics { "one pass" } else { "two passes: no 64-bit atomics" };
    let timed = match (*software, *timestamps) {
        (true, _) => "passes are timed one by one",
        (_, true) => "passes are timed",
        _ => "passes are not timed",
    };
    let millions = adapter.points_per_binding / 1_000_000;
    wrapped(
        &format!(
            "{name}{bus} ({kind}, {backend}, {driver}): projection in {passes}; {timed}; clouds are split into runs of \
             {millions} million points"
        ),
        INDENT,
    )
}

/// SIMD instructions that the renderer uses here, and the numbers that one of them processes.
fn simd_used() -> (&'static str, usize) {
    struct Lanes;
    impl WithSimd for Lanes {
        type Output = usize;
        fn with_simd<S: Simd>(self, _simd: S) -> usize {
            S::F32_LANES
        }
    }
    let arch = Arch::new();
    let lanes = arch.dispatch(Lanes);
    let name = match (std::env::consts::ARCH, lanes) {
        (_, 1) => "no vector instruction",
        ("x86_64" | "x86", 16) => "AVX-512",
        ("x86_64" | "x86", 8) => "AVX2 with FMA",
        ("aarch64", _) => "NEON",
        _ => "vector instructions",
    };
    (name, lanes)
}

fn gigabytes(bytes: u64) -> String {
    format!("{:.1} GB", bytes as f64 / 1e9)
}
