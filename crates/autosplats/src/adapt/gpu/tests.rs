//! The stage on the GPU against the CPU, with the same surfels.

use autosplats_cloud::glam::DVec3;

use super::super::cells::{CellRow, Cells, Cluster, Level};
use super::super::noise::Noise;
use super::super::tests::{Case, K, PROJECTIONS, angle};
use super::*;
use crate::fit::gpu::surfel_buffer;
use crate::fit::{Surfel, Surfels};
use crate::gpu::{FrameUniform, read_back, test_gpu};
use crate::project::gpu::tests::{run_round, upload_screen};
use crate::test_clouds::{self, Random, noisy};

/// Share of cells that may differ: rounding moves a few means into the next slab.
const UNLIKE_CELLS: f64 = 1e-3;
/// Share of surfels that may differ: rounding decides whether a ball is the last.
const UNLIKE_SURFELS: f64 = 1e-2;

/// Results of the device.
struct DeviceResults {
    /// Clusters of each cell, level by level.
    cells: Cells,
    usual: FrameStatistics,
    /// Whether the ball sizes that are measured at first did not tell the noise.
    goes_on: bool,
    /// Of both rounds.
    surfels: Surfels,
}

fn on_device(gpu: &Gpu, passes: &AdaptPasses, case: &Case) -> DeviceResults {
    let screen = upload_screen(gpu, &case.screen, &case.view);
    let mut known = DepthNoiseBuffer::new(gpu).expect("room");
    known.write(gpu, &case.known).expect("room");
    let buffers = AdaptBuffers::new(gpu, screen.size, &known).expect("room");
    let fitted = case.fitted.concat();
    let surfels = surfel_buffer(gpu, screen.capacity).expect("room");
    gpu.queue.write_buffer(&surfels, 0, bytemuck::cast_slice(&fitted));
    let frame = gpu.uniform::<FrameUniform>("frame").expect("room");
    let told = FrameUniform { longest: f32::MAX, ..FrameUniform::new(&case.view, K) };
    gpu.queue.write_buffer(&frame, 0, bytemuck::bytes_of(&told));
    run_round(gpu, &screen, Round::Active, &passes.steps_cells(gpu, &frame, &screen, &buffers));
    for round in [Round::Active, Round::Recovered] {
        run_round(gpu, &screen, round, &passes.steps(gpu, &frame, &screen, &surfels, &buffers, round));
    }
    DeviceResults {
        cells: read_cells(gpu, &buffers, screen.size),
        usual: read_back(gpu, &buffers.statistics, 1).expect("statistics")[0],
        goes_on: read_back::<u32>(gpu, &buffers.picked, MOST_SAMPLED + 2).expect("a sample")[MOST_SAMPLED + 1] > 0,
        surfels: read_back(gpu, &surfels, fitted.len()).expect("surfels"),
    }
}

fn read_cells(gpu: &Gpu, buffers: &AdaptBuffers, size: [u32; 2]) -> Cells {
    let levels: Vec<[u32; 4]> = read_back(gpu, &buffers.levels, MOST_LEVELS).expect("levels");
    let cells = most_cells(size, most_finest(gpu.most_bound()));
    let clusters: Vec<[[f32; 4]; BUNCH]> = read_back(gpu, &buffers.clusters, cells * SLABS / BUNCH).expect("clusters");
    let of_level = |&[side_px, columns, rows, first]: &[u32; 4]| {
        let [first, columns, rows] = [first, columns, rows].map(|count| count as usize);
        let clusters = &clusters;
        let in_cell = |cell: usize| {
            let bunches = (0..SLABS / BUNCH).flat_map(move |bunch| &clusters[bunch * cells + first + cell]);
            bunches.take_while(|cluster| cluster[3] > 0.0).map(|&[x, y, z, count]| Cluster { mean: [x, y, z], count })
        };
        let row = |row: usize| CellRow::of((row * columns..(row + 1) * columns).map(in_cell));
        Level { side_px: side_px as usize, columns, rows: (0..rows).map(row).collect() }
    };
    Cells { levels: levels.iter().filter(|level| level[0] > 0).map(of_level).collect() }
}

/// Number of filled cells that differ, and of all filled cells.
fn unlike_cells(device: &Cells, host: &Cells) -> Result<[usize; 2], String> {
    let layout = |cells: &Cells| -> Vec<_> {
        cells.levels.iter().map(|level| [level.side_px, level.columns, level.rows.len()]).collect()
    };
    let [a, b] = [layout(device), layout(host)];
    if a != b {
        return Err(format!("levels {a:?}, on the host {b:?}"));
    }
    let mut counts = [0, 0];
    for (device, host) in device.levels.iter().zip(&host.levels) {
        for cell in 0..host.columns * host.rows.len() {
            let cell = [cell % host.columns, cell / host.columns];
            let [device, host] = [device, host].map(|level| level.clusters(cell).collect::<Vec<_>>());
            let points = |clusters: &[Cluster]| clusters.iter().map(|cluster| cluster.count).sum::<f32>();
            if points(&device) != points(&host) {
                return Err(format!("points of a cell: {device:?}, {host:?}"));
            }
            // Sums of up to hundreds of terms as large as the depth.
            let near = |a: f32, b: f32, depth: f32| (a - b).abs() <= 1e-5 * depth;
            let is_like = |a: &Cluster, b: &Cluster| {
                a.count == b.count && (0..3).all(|axis| near(a.mean[axis], b.mean[axis], b.mean[2].max(1.0)))
            };
            let same = device.len() == host.len() && device.iter().zip(&host).all(|(a, b)| is_like(a, b));
            counts[0] += usize::from(!same);
            counts[1] += usize::from(!host.is_empty());
        }
    }
    Ok(counts)
}

fn compare_cells(device: &Cells, host: &Cells) -> Result<[usize; 2], String> {
    let [unlike, filled] = unlike_cells(device, host)?;
    let is_enough = unlike as f64 <= UNLIKE_CELLS * filled as f64;
    if is_enough { Ok([unlike, filled]) } else { Err(format!("{unlike} of {filled} cells differ")) }
}

fn compare_usual(device: FrameStatistics, host: FrameStatistics) -> Result<(), String> {
    // Without scatter, the rounding of positions a few units away remains.
    let near = |a: f32, b: f32| (a - b).abs() <= 0.01 * b.abs() + 1e-6;
    let same = near(device.noise.level, host.noise.level)
        && near(device.noise.most, host.noise.most)
        && near(device.noise.power, host.noise.power)
        && near(device.noise.sure, host.noise.sure)
        // Rounding decides on the cell of a few points, and so on the sample.
        && (device.k_radius - host.k_radius).abs() <= 1e-3 * host.k_radius
        && device.sheet_level == host.sheet_level;
    if same { Ok(()) } else { Err(format!("{device:?}, on the host {host:?}")) }
}

fn is_like(device: &Surfel, host: &Surfel) -> bool {
    let apart = (0..3).map(|axis| (device.center[axis] - host.center[axis]).powi(2)).sum::<f32>().sqrt();
    let of_fit = |surfel: &Surfel| (surfel.k_radius, surfel.source, surfel.screen());
    of_fit(device) == of_fit(host)
        && (device.radius - host.radius).abs() <= 1e-5 * host.radius
        && angle(device.normal, host.normal) < 0.5
        && angle(device.major_axis, host.major_axis) < 1.0
        && apart <= 0.01 * host.k_radius
        && (device.curvature - host.curvature).abs() < 1e-3
        && (device.major_ratio - host.major_ratio).abs() <= 0.02 * host.major_ratio
}

/// Number of surfels that differ.
fn compare_surfels(device: &[Surfel], host: &[Surfel]) -> Result<usize, String> {
    let unlike = device.iter().zip(host).filter(|(device, host)| !is_like(device, host)).count();
    let all = host.len();
    if device.len() != all || unlike as f64 > UNLIKE_SURFELS * all as f64 {
        let first = device.iter().zip(host).find(|(device, host)| !is_like(device, host));
        return Err(format!("{unlike} of {all} surfels differ: {first:?}"));
    }
    Ok(unlike)
}

#[test]
fn the_device_fills_the_cells_that_the_host_fills() {
    let Some(gpu) = test_gpu() else { return };
    let kinds = [false, true].map(|software| AdaptPasses::for_kind(&gpu, software).expect("passes"));
    let mut all = [0, 0];
    for count in [300, 4000, 60_000] {
        for (name, positions) in test_clouds::all(count) {
            for projection in PROJECTIONS {
                for size in [[1, 1], [300, 2], [121, 90], [330, 250]] {
                    let case = Case::new(&positions, projection, size);
                    let host = case.cells();
                    for passes in &kinds {
                        let found = compare_cells(&on_device(&gpu, passes, &case).cells, &host);
                        let found =
                            found.unwrap_or_else(|error| panic!("{name} {count} {projection:?} {size:?}: {error}"));
                        all = [all[0] + found[0], all[1] + found[1]];
                    }
                }
            }
        }
    }
    assert!(all[1] > 100_000, "there is something to compare: {all:?}");
}

/// Name, whether noisy, and points of noisy and clean surfaces.
fn surfaces() -> Vec<(&'static str, bool, test_clouds::Positions)> {
    vec![
        ("noisy plane", true, noisy(test_clouds::plane(12_000), 0.02)),
        ("noisy sphere", true, noisy(test_clouds::sphere(20_000), 0.02)),
        ("very noisy sphere", true, noisy(test_clouds::sphere(20_000), 0.06)),
        ("noisy bumps", true, noisy(test_clouds::bumpy(20_000), 0.015)),
        ("noisy edge", true, noisy(test_clouds::edge(20_000), 0.01)),
        ("scans that do not fit", true, test_clouds::misfit(40_000, 0.02)),
        ("noise and structure", true, noisy(test_clouds::bumpy(6_000), 0.02)),
        ("receding", true, test_clouds::receding(30_000, 0.0008)),
        ("clean sphere", false, test_clouds::sphere(20_000)),
        ("clean bumps", false, test_clouds::bumpy(20_000)),
    ]
}

/// Few surfels shrink, so they are compared separately.
#[test]
fn the_device_shrinks_what_the_host_does() {
    let Some(gpu) = test_gpu() else { return };
    let passes = AdaptPasses::new(&gpu).expect("passes");
    let compare = |name: &str, case: &Case, is_asked: &dyn Fn(u32) -> bool, least: f64| {
        let fitted = case.fitted.concat();
        // Of the surfels that the fit leaves.
        let is_left = |surfel: &Surfel| is_asked(surfel.source) && surfel.radius > 0.0;
        let of = |surfels: Surfels| -> Surfels {
            surfels.into_iter().zip(&fitted).filter(|(_, fitted)| is_left(fitted)).map(|(surfel, _)| surfel).collect()
        };
        let [device, host, fitted] = [on_device(&gpu, &passes, case).surfels, case.adapted(), fitted.clone()].map(of);
        assert!(host.len() > 30, "{name}: the fit leaves {}", host.len());
        let shrunk = host.iter().zip(&fitted).filter(|(host, fitted)| host.radius < fitted.radius).count();
        assert!(shrunk as f64 > least * host.len() as f64, "{name}: {shrunk} of {}", host.len());
        compare_surfels(&device, &host).unwrap_or_else(|error| panic!("{name}: {error}"));
    };
    for projection in PROJECTIONS {
        let (positions, surface) = test_clouds::beyond_a_border();
        let case = Case::new(&positions, projection, [400, 300]);
        compare("beyond a border", &case, &|source| source >= surface, 0.66);
        let (case, is_stray) = Case::noisy_with_strays(projection);
        compare("before noise", &case, &is_stray, 0.8);
        let (positions, sheet) = test_clouds::before_a_wall(0.07);
        let case = Case::new(&positions, projection, [400, 300]);
        compare("before a wall", &case, &|source| source < sheet, 0.6);
        let case = Case::new(&noisy(positions, 0.01), projection, [400, 300]);
        assert!(case.noise().level > 0.0, "{projection:?}: noise is told");
        compare("before a noisy wall", &case, &|source| source < sheet, 0.5);
    }
    let (room, is_stray) = Case::stepped_with_strays();
    compare("in a room", &room, &is_stray, 0.2);
}

/// Only one kind of device is available for tests, so the passes of the other kind are tested on it too.
#[test]
fn however_many_sum_up_a_ball_the_device_adapts_as_the_host_does() {
    let Some(gpu) = test_gpu() else { return };
    let noisy = noisy(test_clouds::bumpy(20_000), 0.015);
    let cases = [("noisy bumps", Case::new(&noisy, PROJECTIONS[0], [320, 240])), ("rows", Case::swept())];
    for software in [false, true] {
        let passes = AdaptPasses::for_kind(&gpu, software).expect("passes");
        for (name, case) in &cases {
            let made = on_device(&gpu, &passes, case);
            compare_usual(made.usual, case.usual()).unwrap_or_else(|error| panic!("{name}, {software}: {error}"));
            compare_surfels(&made.surfels, &case.adapted())
                .unwrap_or_else(|error| panic!("{name}, {software}: {error}"));
        }
    }
}

/// The smallest balls tell what balls of all sizes do, or the others are measured too.
#[test]
fn sizes_that_are_measured_in_parts_tell_the_same() {
    let Some(gpu) = test_gpu() else { return };
    let mut random = Random::new(7);
    let filled = (0..40_000).map(|_| std::array::from_fn(|_| 0.7 * random.signed())).collect();
    let clouds = [
        ("clean", test_clouds::sphere(20_000)),
        ("noisy", noisy(test_clouds::bumpy(20_000), 0.015)),
        ("few", test_clouds::sphere(100)),
        ("filled", filled),
    ];
    for software in [false, true] {
        let [parts, whole] = [FIRST_SCALES[1], SCALES]
            .map(|first| AdaptPasses::with_first_scales(&gpu, software, first).expect("passes"));
        let mut went_on = Vec::new();
        for (name, positions) in &clouds {
            let case = Case::new(positions, PROJECTIONS[0], [320, 240]);
            let [in_parts, at_once] = [&parts, &whole].map(|passes| on_device(&gpu, passes, &case));
            let [a, b] = [&in_parts, &at_once].map(|made| bytemuck::bytes_of(&made.usual).to_vec());
            assert!(a == b, "{name}: {:?}, at once {:?}", in_parts.usual, at_once.usual);
            assert!(in_parts.surfels == at_once.surfels && !at_once.goes_on, "{name}, {software}: other surfels");
            went_on.push(in_parts.goes_on);
        }
        assert!(went_on.contains(&false) && went_on.contains(&true), "some need all sizes: {went_on:?}");
    }
}

#[test]
fn the_device_adapts_as_the_host_does() {
    let Some(gpu) = test_gpu() else { return };
    let passes = AdaptPasses::new(&gpu).expect("passes");
    for (name, is_noisy, positions) in surfaces() {
        for projection in PROJECTIONS {
            let case = Case::new(&positions, projection, [320, 240]);
            let made = on_device(&gpu, &passes, &case);
            let (host, fitted, usual) = (case.adapted(), case.fitted.concat(), case.usual());
            let changed = host.iter().zip(&fitted).filter(|(a, b)| a != b).count();
            compare_usual(made.usual, usual).unwrap_or_else(|error| panic!("{name} {projection:?}: {error}"));
            compare_surfels(&made.surfels, &host).unwrap_or_else(|error| panic!("{name} {projection:?}: {error}"));
            if is_noisy {
                assert!(2 * changed > host.len(), "{name} {projection:?}: {changed} of {} adapted", host.len());
            } else {
                // Except neighbours that form a line by chance.
                assert!(changed <= host.len() / 400, "{name} {projection:?}: {changed} changed");
            }
        }
    }
}

#[test]
fn the_device_knows_the_noise_of_a_depth_camera_as_the_host_does() {
    let Some(gpu) = test_gpu() else { return };
    let passes = AdaptPasses::new(&gpu).expect("passes");
    let mut case = Case::stepped();
    assert_eq!(case.known.on_device().len(), 1, "one scan");
    let made = on_device(&gpu, &passes, &case);
    let host = case.adapted();
    let changed = host.iter().zip(&case.fitted.concat()).filter(|(a, b)| a != b).count();
    assert!(2 * changed > host.len(), "{changed} of {} adapted", host.len());
    compare_surfels(&made.surfels, &host).unwrap_or_else(|error| panic!("{error}"));
    // Noise is known for points from one index on, and unknown before.
    let half = host.len() as u32 / 2;
    case.known.runs.insert(0, bytemuck::Zeroable::zeroed());
    case.known.runs[1].first = half;
    let made = on_device(&gpu, &passes, &case);
    compare_surfels(&made.surfels, &case.adapted()).unwrap_or_else(|error| panic!("two runs: {error}"));
    assert!(made.surfels != host, "less is known");
}

#[test]
fn the_device_closes_what_is_between_rows_as_the_host_does() {
    let Some(gpu) = test_gpu() else { return };
    let passes = AdaptPasses::new(&gpu).expect("passes");
    let case = Case::swept();
    let (made, host) = (on_device(&gpu, &passes, &case), case.adapted());
    compare_surfels(&made.surfels, &host).unwrap_or_else(|error| panic!("{error}"));
}

#[test]
fn whatever_the_cloud_the_device_adapts_as_the_host_does() {
    let Some(gpu) = test_gpu() else { return };
    let passes = AdaptPasses::new(&gpu).expect("passes");
    let (mut unlike, mut all) = (0, 0);
    for (name, positions) in test_clouds::all(4000) {
        for projection in PROJECTIONS {
            for size in [[1, 1], [7, 300], [121, 90]] {
                let case = Case::new(&positions, projection, size);
                let made = on_device(&gpu, &passes, &case);
                let host = case.adapted();
                let different = made.surfels.iter().zip(&host).filter(|(a, b)| !is_like(a, b)).count();
                compare_usual(made.usual, case.usual())
                    .unwrap_or_else(|error| panic!("{name} {projection:?} {size:?}: {error}"));
                unlike += different;
                all += host.len();
            }
        }
    }
    assert!(unlike as f64 <= UNLIKE_SURFELS * all as f64, "{unlike} of {all} surfels differ");
}

#[test]
fn comparison_sees_what_is_wrong() {
    let case = Case::new(&noisy(test_clouds::sphere(20_000), 0.02), PROJECTIONS[0], [240, 180]);
    let right = case.cells();
    assert!(compare_cells(&right, &right).is_ok(), "nothing is wrong yet");
    // Changes the clusters of one cell or of all.
    let changed = |index: usize, only: Option<[usize; 2]>, change: fn(Cluster) -> Cluster| {
        let mut cells = right.clone();
        let level = &mut cells.levels[index];
        let cell = |at: [usize; 2]| {
            let is_changed = only.is_none_or(|only| only == at);
            let change = move |cluster| if is_changed { change(cluster) } else { cluster };
            right.levels[index].clusters(at).map(change)
        };
        let row = |row: usize| CellRow::of((0..level.columns).map(|column| cell([column, row])));
        level.rows = (0..level.rows.len()).map(row).collect();
        cells
    };
    let moved = changed(1, None, |Cluster { mean: [x, y, z], count }| Cluster { mean: [1.001 * x, y, z], count });
    assert!(compare_cells(&moved, &right).is_err(), "means that are off");
    let finest = &right.levels[0];
    let mut all = (0..finest.columns * finest.rows.len()).map(|cell| [cell % finest.columns, cell / finest.columns]);
    let filled = all.find(|&cell| !finest.is_empty(cell));
    let more = changed(0, filled, |Cluster { mean, count }| Cluster { mean, count: count + 1.0 });
    assert!(compare_cells(&more, &right).is_err(), "a point too many");
    let mut fewer = right.clone();
    fewer.levels.pop();
    assert!(compare_cells(&fewer, &right).is_err(), "a level too few");

    let usual = case.usual();
    assert!(compare_usual(usual, usual).is_ok(), "nothing is wrong yet");
    let FrameStatistics { noise, k_radius, sheet_level } = usual;
    let Noise { level, power, sure, .. } = noise;
    let with = |level: f32, power: f32, k_radius: f32| {
        let noise = Noise { level, power, ..noise };
        FrameStatistics { noise, k_radius, ..usual }
    };
    assert!(compare_usual(with(1.02 * level, power, k_radius), usual).is_err(), "more noise");
    assert!(compare_usual(with(level, 0.1, k_radius), usual).is_err(), "that grows");
    let less_sure = FrameStatistics { noise: Noise { sure: 0.9 * sure, ..noise }, ..usual };
    assert!(compare_usual(less_sure, usual).is_err(), "that is less sure");
    assert!(compare_usual(with(level, power, 1.002 * k_radius), usual).is_err(), "points further apart");
    assert!(
        compare_usual(FrameStatistics { sheet_level: 3 - sheet_level, ..usual }, usual).is_err(),
        "sheets of other cells"
    );

    let adapted = case.adapted();
    assert!(compare_surfels(&adapted, &adapted).is_ok(), "nothing is wrong yet");
    assert!(compare_surfels(&case.fitted.concat(), &adapted).is_err(), "surfels as the fit leaves them");
    let changed = |change: fn(&mut Surfel)| {
        let mut surfels = adapted.clone();
        surfels.iter_mut().for_each(change);
        surfels
    };
    let wrong = [
        changed(|surfel| surfel.center[0] += 0.02 * surfel.k_radius),
        changed(|surfel| surfel.normal = surfel.normal.map(|c| -c)),
        changed(|surfel| surfel.curvature += 0.01),
        changed(|surfel| surfel.radius *= 1.01),
        changed(|surfel| surfel.major_ratio *= 1.05),
    ];
    for surfels in wrong {
        assert!(compare_surfels(&surfels, &adapted).is_err(), "not noticed: {:?}", surfels[0]);
    }
}

#[test]
fn cells_of_any_picture_fit_into_what_devices_bind() {
    for size in [
        [1, 1],
        [1760, 900],
        [3200, 1800],
        [3840, 2160],
        [16_384, 16_384],
        [16_384, 1],
        [1, 16_384],
        [16_384, 700],
        [19_116, 19_116],
        [16_502, 818],
    ] {
        // The limit of every device, and of nearly all.
        for bound in [128 << 20, 1 << 31] {
            let most_finest = most_finest(bound);
            let clusters = most_cells(size, most_finest) * size_of::<[Cluster; SLABS]>();
            let sheets = most_sheet_cells(size, most_finest) * size_of::<[Sheet; SHEETS]>();
            assert!(clusters.max(sheets) as u64 <= bound, "{size:?} takes {clusters} and {sheets} bytes of {bound}");
        }
    }
}

/// Where coordinates are those of a map, sums with the eye would round to whole cells of the sample.
#[test]
fn the_device_samples_what_the_host_does_far_from_the_origin() {
    let Some(gpu) = test_gpu() else { return };
    let passes = AdaptPasses::new(&gpu).expect("passes");
    let positions = noisy(test_clouds::bumpy(20_000), 0.015);
    let case = Case::around(DVec3::new(636_600.5, 7_405_500.25, 430.0), &positions, PROJECTIONS[0], [320, 240], 1.0);
    let (device, host) = (on_device(&gpu, &passes, &case), case.usual());
    compare_usual(device.usual, host).unwrap_or_else(|error| panic!("{error}"));
    // The median tells that the sample is the same.
    assert_eq!(device.usual.k_radius, host.k_radius, "median k-radius");
    assert!(host.noise.level > 0.0, "noise is told");
    compare_surfels(&device.surfels, &case.adapted()).unwrap_or_else(|error| panic!("{error}"));
}
