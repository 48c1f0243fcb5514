//! Projection on the GPU against that on the CPU.

use autosplats_cloud::PointCloud;
use autosplats_cloud::glam::DVec3;

use super::*;
use crate::camera::{Camera, Projection, View};
use crate::gpu::{Clock, FrameUniform, Recorder, read_back, test_gpu};
use crate::points::Points;
use crate::project::{COUNTED_BLOCK_PX, PointValues, ProjectRules, Projector, ScreenPoints, SlotTable, Uploader};
use crate::test_clouds::{self, EYE};

const K: u32 = 10;

/// A device's screen in the host's form, and its counters.
pub(crate) fn read_screen(gpu: &Gpu, screen: &ScreenBuffers) -> (ScreenPoints, Vec<u32>) {
    let counters: Vec<u32> = read_back(gpu, &screen.counters, COUNTERS).expect("counters");
    let counter = |counter: Counter| counters[counter as usize] as usize;
    let list = |buffer, len| read_back::<u32>(gpu, buffer, len).expect("a list");
    let [width, height] = screen.size.map(|side| side as usize);
    let (strip_px, cell_px) = (counter(Counter::StripPx), counter(Counter::CellPx));
    let columns = counter(Counter::CellColumns);
    let cells = columns * height.div_ceil(cell_px);
    let density: Vec<DensityCell> = read_back(gpu, &screen.density, cells).expect("a grid");
    let mut read = ScreenPoints {
        points: read_back(gpu, &screen.points, counter(Counter::Visible)).expect("points"),
        source: list(&screen.source, counter(Counter::Visible)),
        active: list(&screen.queries, counter(Counter::Active)),
        passive: list(&screen.passive, counter(Counter::Passive)),
        near_first: counter(Counter::NearFirst),
        ..ScreenPoints::default()
    };
    read.cells.strip_px = strip_px;
    read.cells.columns = width;
    read.cells.start = list(&screen.cell_start, height.div_ceil(strip_px) * width + 1);
    read.density.cell_px = cell_px;
    read.density.columns = columns;
    read.density.count = density.iter().map(|cell| cell.count).collect();
    read.density.nearest = density.iter().map(|cell| cell.nearest).collect();
    read.dropped.not_finite = counter(Counter::NotFinite);
    read.dropped.behind = counter(Counter::Behind);
    read.dropped.outside = counter(Counter::Outside);
    (read, counters)
}

/// A host's screen in the device's form: active points are queries, passive points are recovered queries.
pub(crate) fn upload_screen(gpu: &Gpu, screen: &ScreenPoints, view: &View) -> ScreenBuffers {
    let buffers = ScreenBuffers::new(gpu, [view.width, view.height], true, screen.points.len(), 0).expect("room");
    let mut counters = [0u32; COUNTERS];
    for (counter, value) in [
        (Counter::Visible, screen.points.len()),
        (Counter::NearFirst, screen.near_first),
        (Counter::StripPx, screen.cells.strip_px),
        (Counter::CellPx, screen.density.cell_px),
        (Counter::CellColumns, screen.density.columns),
        (Counter::Active, screen.active.len()),
        (Counter::Passive, screen.passive.len()),
        (Counter::Recovered, screen.passive.len()),
    ] {
        counters[counter as usize] = value as u32;
    }
    let cells = screen.density.count.iter().zip(&screen.density.nearest);
    let density: Vec<_> = cells.map(|(&count, &nearest)| DensityCell { count, nearest }).collect();
    let queries = [&screen.active[..], &screen.passive].concat();
    let write = |buffer: &wgpu::Buffer, bytes: &[u8]| gpu.queue.write_buffer(buffer, 0, bytes);
    write(&buffers.counters, bytemuck::cast_slice(&counters));
    write(&buffers.density, bytemuck::cast_slice(&density));
    write(&buffers.cell_start, bytemuck::cast_slice(&screen.cells.start));
    write(&buffers.source, bytemuck::cast_slice(&screen.source));
    write(&buffers.points, bytemuck::cast_slice(&screen.points));
    write(&buffers.queries, bytemuck::cast_slice(&queries));
    write(&buffers.passive, bytemuck::cast_slice(&screen.passive));
    find_work(gpu, &buffers);
    buffers
}

/// Computes the number of workgroups of each kind of work, after the host has written the counters.
pub(crate) fn find_work(gpu: &Gpu, screen: &ScreenBuffers) {
    let frame = gpu.uniform::<FrameUniform>("frame").expect("room");
    let mut recorder = Recorder::new(gpu, &Clock::Off);
    WorkPass::new(gpu).expect("a pass").steps_all(gpu, &frame, screen).iter().for_each(|step| recorder.run(step));
    recorder.finish();
}

/// Runs steps of a round, which it begins as `split` and `recover` do.
pub(crate) fn run_round(gpu: &Gpu, screen: &ScreenBuffers, round: Round, steps: &[Step]) {
    let counters: Vec<u32> = read_back(gpu, &screen.counters, COUNTERS).expect("counters");
    let [active, recovered] = [Counter::Active, Counter::Recovered].map(|counter| counters[counter as usize]);
    let [first, len] = [[0, active], [active, recovered]][round as usize];
    for (counter, value) in [(Counter::Round, round as u32), (Counter::RoundFirst, first), (Counter::RoundLen, len)] {
        gpu.queue.write_buffer(&screen.counters, 4 * counter as u64, bytemuck::bytes_of(&value));
    }
    let mut recorder = Recorder::new(gpu, &Clock::Off);
    steps.iter().for_each(|step| recorder.run(step));
    recorder.finish();
}

/// Projects a cloud on the device; returns the screen and the words of its sixteenths.
fn project<'a>(
    gpu: &Gpu,
    passes: &ProjectPasses,
    points: impl Into<Points<'a>>,
    view: &View,
    rules: &ProjectRules,
) -> (ScreenPoints, Vec<u32>) {
    let points = points.into();
    let screen = ScreenBuffers::new(gpu, [view.width, view.height], rules.halves, points.room(), 0).expect("room");
    project_into(gpu, passes, points, view, rules, &screen)
}

/// Like [`project`], into buffers that may have seen other frames.
fn project_into(
    gpu: &Gpu,
    passes: &ProjectPasses,
    points: Points<'_>,
    view: &View,
    rules: &ProjectRules,
    screen: &ScreenBuffers,
) -> (ScreenPoints, Vec<u32>) {
    let written = points.written_since(None);
    let mut uploader = Uploader::default();
    let mut device_cloud = DeviceCloud::default();
    device_cloud.resize(gpu, points).expect("room");
    uploader.positions(gpu, points.positions(), &written, &device_cloud, &|_| true).expect("an upload");
    uploader.values(gpu, &PointValues::default(), &written, &device_cloud, &|_| true).expect("an upload");
    device_cloud.write_slots(gpu, &SlotTable::new(points, view));
    let frame = gpu.uniform::<FrameUniform>("frame").expect("room");
    let told = FrameUniform {
        halves: rules.halves.into(),
        grid_culling: rules.grid_culling.into(),
        near_cells: (rules.near && view.perspective).into(),
        ..FrameUniform::new(view, K)
    };
    gpu.queue.write_buffer(&frame, 0, bytemuck::bytes_of(&told));
    let mut recorder = Recorder::new(gpu, &Clock::Off);
    passes.steps(gpu, &frame, &device_cloud, screen).iter().for_each(|step| recorder.run(step));
    recorder.finish();
    let pixels = view.width as usize * view.height as usize;
    let sixteenths = read_back(gpu, &screen.sixteenths, pixels.div_ceil(2)).expect("sixteenths");
    let expected = held_by_blocks(&sixteenths, screen.size);
    assert!(read_back::<u32>(gpu, &screen.held, expected.len()).expect("counts") == expected, "sixteenths of blocks");
    (read_screen(gpu, screen).0, sixteenths)
}

/// Number of sixteenths with points in each small block, from their words.
pub(crate) fn held_by_blocks(words: &[u32], [width, height]: [u32; 2]) -> Vec<u32> {
    let [columns, rows] = [width, height].map(|side| (side as usize).div_ceil(COUNTED_BLOCK_PX));
    let mut held = vec![0; columns * rows];
    for pixel in 0..(width * height) as usize {
        let [x, y] = [pixel % width as usize, pixel / width as usize].map(|at| at / COUNTED_BLOCK_PX);
        held[y * columns + x] += ((words[pixel / 2] >> (16 * (pixel % 2))) & 0xffff).count_ones();
    }
    held
}

/// Fraction of the points of `a` that own another pixel, or none, in `b`.
fn moved(a: &ScreenPoints, b: &ScreenPoints) -> f64 {
    let owners = |screen: &ScreenPoints| -> std::collections::HashSet<(u32, u32)> {
        screen.source.iter().copied().zip(screen.points.iter().map(|point| point.pixel)).collect()
    };
    owners(a).difference(&owners(b)).count() as f64 / a.source.len().max(1) as f64
}

#[test]
fn the_device_finds_what_the_host_finds() {
    let Some(gpu) = test_gpu() else { return };
    let ways = [Nearest::InLanes, Nearest::Once, Nearest::Twice].into_iter().filter(|way| way.fits(&gpu));
    let forms: Vec<_> = ways.map(|way| (way, ProjectPasses::new(&gpu, way).expect("passes"))).collect();
    for (name, mut positions) in test_clouds::all(4000) {
        positions.extend([[f32::NAN, 0.0, 0.0], [f32::INFINITY, 1.0, 0.0], [3e38, 3e38, -3e38]]);
        let cloud = PointCloud::new(DVec3::ZERO, positions);
        for projection in [Projection::PerspectiveFovDeg(30.0), Projection::OrthographicHeight(2.1)] {
            let camera = Camera { eye: EYE, look_at: DVec3::ZERO, up: DVec3::new(0.1, -1.0, 0.0), projection };
            for (size, margin, [halves, grid_culling]) in [
                ([1, 1], 0, [true, true]),
                ([300, 2], 1, [true, false]),
                ([121, 90], 0, [true, true]),
                ([121, 90], 20, [false, true]),
                ([97, 250], 0, [false, false]),
                ([60, 41], 31, [true, false]),
            ] {
                let rules = ProjectRules { k: K, halves, grid_culling, near: margin > 0 };
                let view = camera.view(DVec3::ZERO, size).expect("a view").with_margin(margin);
                let mut projector = Projector::default();
                let host = projector.project(&cloud, &view, &rules, &crate::cancel::NEVER);
                for (way, passes) in &forms {
                    let (device, sixteenths) = project(&gpu, passes, &cloud, &view, &rules);
                    let case = format!("{name} {projection:?} {size:?} {rules:?} {way:?}");
                    assert_eq!(device.dropped, host.dropped, "{case}");
                    // Divisions on a device can be off by some units in the last place, which moves a few of ten
                    // thousand points over the border of a pixel.
                    let moved = moved(host, &device);
                    assert!(moved < 2e-3, "{case}: {moved} of the points own another pixel");
                    let words = host.sixteenths.words();
                    assert_eq!(sixteenths.len(), words.len(), "{case}: words of sixteenths");
                    let other: u32 = sixteenths.iter().zip(&words).map(|(a, b)| (a ^ b).count_ones()).sum();
                    assert!(f64::from(other) < 8e-3 * cloud.len() as f64, "{case}: {other} sixteenths are others");
                    if moved == 0.0 {
                        assert_same(host, &device, &case);
                    }
                }
            }
        }
    }
}

fn assert_same(host: &ScreenPoints, device: &ScreenPoints, case: &str) {
    assert_eq!(device.near_first, host.near_first, "{case}: screen points");
    assert_eq!(device.source, host.source, "{case}: order");
    assert_eq!(device.cells.strip_px, host.cells.strip_px, "{case}: strips");
    assert_eq!(device.cells.start, host.cells.start, "{case}: cells");
    assert_eq!(device.density.cell_px, host.density.cell_px, "{case}: size of density cells");
    assert_eq!(device.density.count, host.density.count, "{case}: density");
    assert_eq!(device.active, host.active, "{case}: active points");
    assert_eq!(device.passive, host.passive, "{case}: passive points");
    for (a, b) in device.points.iter().zip(&host.points) {
        let near = (0..3).all(|axis| {
            let [a, b] = [a.position_view[axis], b.position_view[axis]];
            // Sums of three products about the eye, whose distance is 4: some units in the last place.
            (a - b).abs() <= 4e-6 * b.abs().max(4.0)
        });
        assert!(near && a.pixel == b.pixel, "{case}: {a:?} is not {b:?}");
    }
}

/// Keys stay from frame to frame. They must be empty then, whatever was seen.
#[test]
fn screens_keep_no_keys() {
    let Some(gpu) = test_gpu() else { return };
    let ways = [Nearest::InLanes, Nearest::Once, Nearest::Twice].into_iter().filter(|way| way.fits(&gpu));
    let clouds: Vec<_> = test_clouds::all(3000)
        .into_iter()
        .map(|(name, positions)| (name, PointCloud::new(DVec3::ZERO, positions)))
        .collect();
    let room = clouds.iter().map(|(_, cloud)| cloud.len()).max().expect("clouds");
    let projection = Projection::PerspectiveFovDeg(40.0);
    for way in ways {
        let passes = ProjectPasses::new(&gpu, way).expect("passes");
        for (size, halves) in [([121, 90], true), ([121, 90], false), ([33, 47], true)] {
            let screen = ScreenBuffers::new(&gpu, size, halves, room, 0).expect("room");
            let slots = slots(size, halves);
            assert_eq!(screen.keys.size() as usize, slots * size_of::<u64>());
            // From afar and from within, where points are near the eye.
            for (frame, (name, cloud)) in clouds.iter().enumerate() {
                let eye = if frame % 3 == 2 { 0.2 * EYE } else { EYE };
                let look_at = DVec3::new(0.1 * (frame % 2) as f64, 0.0, 0.0);
                let camera = Camera { eye, look_at, up: DVec3::new(0.1, -1.0, 0.0), projection };
                let view = camera.view(DVec3::ZERO, size).expect("a view");
                let rules = ProjectRules { k: K, halves, grid_culling: true, near: true };
                let after = project_into(&gpu, &passes, cloud.into(), &view, &rules, &screen);
                let keys: Vec<u64> = read_back(&gpu, &screen.keys, slots).expect("keys");
                let case = format!("{name} {size:?} {halves} {way:?}");
                assert_eq!(keys.iter().filter(|&&key| key != 0).count(), 0, "{case}: keys are left");
                let (fresh, sixteenths) = project(&gpu, &passes, cloud, &view, &rules);
                assert_eq!(after.1, sixteenths, "{case}: sixteenths");
                assert_eq!(
                    bytemuck::cast_slice::<_, u32>(&after.0.points),
                    bytemuck::cast_slice::<_, u32>(&fresh.points),
                    "{case}"
                );
                assert_same(&fresh, &after.0, &case);
            }
        }
    }
}
