//! Splatting on the GPU against the CPU, from the same surfels.

use autosplats_cloud::{FieldValues, RelativeValues};
use glam::Vec3;

use super::super::tests::{ALL_DISCS, Data, Discs, sixteenths, surfels, views};
use super::super::{Attributes, GBuffer, PointColors, Splatter, TrimRules};
use super::*;
use crate::adapt::Noise;
use crate::camera::View;
use crate::fit::Surfel;
use crate::gpu::{Clock, FrameUniform, Recorder, read_back, test_gpu};
use crate::project::gpu::tests::{find_work, held_by_blocks, run_round};
use crate::project::gpu::{COUNTERS, DensityCell};
use crate::project::{DensityGrid, ScreenPoint};
use crate::test_clouds::Random;

/// One pixel, patches and tiles that are cut off, and several tiles.
const SIZES: [[u32; 2]; 4] = [[1, 1], [71, 50], [64, 65], [133, 9]];
/// Splat scale, which matters to noise that grows with the k-radius.
const SPLAT_SCALE: f32 = 1.5;
const ALL: Channels = Channels { color: true, scalar: true, measures: true, backs: true };

/// Surfels and settings of a frame.
struct Scene<'a> {
    surfels: &'a [Surfel],
    /// Number of surfels in the first round.
    active: usize,
    view: &'a View,
    refinement: bool,
    data: &'a Data,
    noise: Noise,
}

/// Depth maps after visibility and after refinement, row by row, and the layers.
struct Drawn {
    depth: [Vec<f32>; 2],
    layers: GBuffer,
}

/// The buffers of a frame.
struct Buffers {
    frame: wgpu::Buffer,
    screen: ScreenBuffers,
    surfels: wgpu::Buffer,
    splats: SplatBuffers,
    layers: LayerBuffers,
}

impl Scene<'_> {
    fn size(&self) -> [u32; 2] {
        [self.view.width, self.view.height]
    }

    fn upload(&self, gpu: &Gpu, channels: Channels) -> Buffers {
        let size = self.size();
        let mut screen = ScreenBuffers::new(gpu, size, false, 0, 0).expect("room");
        // There may be more surfels than pixels.
        screen.capacity = self.surfels.len() as u32;
        let values = self.surfels.iter().flat_map(|surfel| {
            let [r, g, b] = self.data.colors[surfel.source as usize];
            let color = channels.color.then(|| u32::from_le_bytes([r, g, b, 0]));
            let scalar = channels.scalar.then(|| self.data.scalars[surfel.source as usize].to_bits());
            [color, scalar].into_iter().flatten()
        });
        screen.values = gpu.storage_with("values", &values.collect::<Vec<u32>>()).expect("room");
        let none = vec![no_depth(); (size[0] * size[1]) as usize];
        gpu.queue.write_buffer(&screen.depth, 0, bytemuck::cast_slice(&none));
        let words = sixteenths(self.surfels, self.view).words();
        gpu.queue.write_buffer(&screen.sixteenths, 0, bytemuck::cast_slice(&words));
        gpu.queue.write_buffer(&screen.held, 0, bytemuck::cast_slice(&held_by_blocks(&words, size)));
        let frame = gpu.uniform::<FrameUniform>("frame").expect("room");
        let uniform = FrameUniform { splat_scale: SPLAT_SCALE, ..FrameUniform::new(self.view, 1) };
        gpu.queue.write_buffer(&frame, 0, bytemuck::bytes_of(&uniform));
        Buffers {
            frame,
            surfels: gpu.storage_with("surfels", self.surfels).expect("room"),
            splats: SplatBuffers::new(gpu, screen.capacity, size).expect("room"),
            layers: LayerBuffers::new(gpu, size, channels).expect("room"),
            screen,
        }
    }

    fn device(&self, gpu: &Gpu, passes: &SplatPasses, channels: Channels) -> Drawn {
        let buffers = self.upload(gpu, channels);
        let Buffers { frame, screen, surfels, splats, layers } = &buffers;
        let run = |steps: Vec<Step>| {
            let mut recorder = Recorder::new(gpu, &Clock::Off);
            steps.iter().for_each(|step| recorder.run(step));
            recorder.finish();
        };
        let pixels = (screen.size[0] * screen.size[1]) as usize;
        let depth = || read_depth(gpu, screen, pixels);
        let visibility = |round| {
            run_round(gpu, screen, round, &passes.steps_visibility(gpu, frame, screen, surfels, splats, round));
        };
        set_counter(gpu, screen, Counter::Active, self.active);
        visibility(Round::Active);
        set_counter(gpu, screen, Counter::Recovered, self.surfels.len() - self.active);
        visibility(Round::Recovered);
        let before = depth();
        let statistics = FrameStatistics { noise: self.noise, k_radius: 0.0, sheet_level: 0 };
        let noise = gpu.storage_with("noise", &[statistics]).expect("room");
        let rules = LayerRules { depth_refinement: self.refinement, noise: Some(&noise) };
        run(passes.steps_layers(gpu, frame, screen, surfels, splats, layers, rules));
        Drawn { depth: [before, depth()], layers: read_layers(gpu, layers) }
    }

    fn host(&self, channels: Channels) -> (Splatter, GBuffer) {
        let Self { surfels, view, data, .. } = *self;
        let mut splatter = Splatter::default();
        splatter.begin(view);
        splatter.add(&surfels[..self.active], 0, view, &crate::cancel::NEVER);
        splatter.add(surfels, self.active, view, &crate::cancel::NEVER);
        if self.refinement {
            (0..2).for_each(|_| splatter.refine(surfels, view, &crate::cancel::NEVER));
        }
        let scalars = FieldValues::F32(data.scalars.clone());
        let color = PointColors { srgb: &data.colors, linear: &data.linear };
        let attributes = Attributes {
            color: channels.color.then_some(color),
            scalar: channels.scalar.then(|| RelativeValues::new(&scalars)),
            measures: channels.measures,
            backs: channels.backs,
        };
        splatter.attributes(surfels, view, &attributes, &crate::cancel::NEVER);
        let rules = TrimRules { k_radius_per_radius: 0.5 / SPLAT_SCALE };
        splatter.trim(view, &sixteenths(surfels, view), self.noise, &rules, &crate::cancel::NEVER);
        let layers = splatter.last().clone();
        (splatter, layers)
    }
}

/// The depth map as depths.
/// The key of no depth in `shared/depth_map.wgsl`.
fn no_depth() -> u32 {
    f32::INFINITY.to_bits() ^ 0x8000_0000
}

fn read_depth(gpu: &Gpu, screen: &ScreenBuffers, pixels: usize) -> Vec<f32> {
    let keys: Vec<u32> = read_back(gpu, &screen.depth, pixels).expect("a depth map");
    let mask = |key: u32| if key >= 0x8000_0000 { 0x8000_0000 } else { u32::MAX };
    keys.into_iter().map(|key| f32::from_bits(key ^ mask(key))).collect()
}

fn set_counter(gpu: &Gpu, screen: &ScreenBuffers, counter: Counter, value: usize) {
    gpu.queue.write_buffer(&screen.counters, 4 * counter as u64, bytemuck::bytes_of(&(value as u32)));
    find_work(gpu, screen);
}

pub(crate) fn read_layers(gpu: &Gpu, layers: &LayerBuffers) -> GBuffer {
    let read = |buffer: &wgpu::Buffer| read_back::<u8>(gpu, buffer, buffer.size() as usize).expect("a layer");
    layers.to_host(0, &read(&layers.surface), &read(&layers.cover), &read(&layers.extras))
}

/// Number of pixels where the splatter hides a point just before `depth`, or does not hide one just behind. The
/// tolerance covers rounding of gradients, about a millionth.
fn other_depths(splatter: &Splatter, depth: &[f32], view: &View) -> usize {
    let wrong = |&pixel: &usize| {
        let at = [pixel % view.width as usize, pixel / view.width as usize];
        let near = depth[pixel].abs() * 1e-5;
        let hides = |depth: f32| splatter.hides(at, depth.min(f32::MAX), 0.0, view);
        hides(depth[pixel] - near) || (depth[pixel].is_finite() && !hides(depth[pixel] + near))
    };
    (0..depth.len()).filter(wrong).count()
}

/// Number of pixels at which any layer differs.
fn other_layers(device: &GBuffer, host: &GBuffer) -> usize {
    let [width, height] = [host.width as usize, host.height as usize];
    let empty = |l: &GBuffer| [l.color.is_empty(), l.scalar.is_empty(), l.radius.is_empty(), l.back.is_empty()];
    assert_eq!(empty(device), empty(host), "layers");
    // The tolerance covers f32 rounding of gradients, about 1e-5 after the kernel's eighth power and sums that cancel.
    let near = |a: f32, b: f32, scale: f32| {
        a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan()) || (a - b).abs() <= 1e-4 * b.abs() + 1e-4 * scale
    };
    let same = |x: usize, y: usize| {
        let [i, j] = [device, host].map(|layers| layers.index(x, y));
        let scalar_of = |a: &[f32], b: &[f32], scale: f32| a.is_empty() || near(a[i], b[j], scale);
        let vector_of =
            |a: &[[f32; 3]], b: &[[f32; 3]]| a.is_empty() || a[i].iter().zip(b[j]).all(|(&a, b)| near(a, b, 1.0));
        scalar_of(&device.weight, &host.weight, 0.1)
            && scalar_of(&device.depth, &host.depth, 0.0)
            && vector_of(&device.normal, &host.normal)
            && device.point[i] == host.point[j]
            && vector_of(&device.color, &host.color)
            && scalar_of(&device.scalar, &host.scalar, 100.0)
            && scalar_of(&device.radius, &host.radius, 0.0)
            && scalar_of(&device.k_radius, &host.k_radius, 0.0)
            && scalar_of(&device.curvature, &host.curvature, 0.0)
            && scalar_of(&device.back, &host.back, 1.0)
    };
    (0..width * height).filter(|pixel| !same(pixel % width, pixel / width)).count()
}

/// At a few pixels rounding decides what covers a pixel, what is in front, or which of two splats is heavier. Hardware
/// may fuse products and sums, so more pixels differ there.
fn assert_few(gpu: &Gpu, other: usize, pixels: usize, what: &str) {
    let allowed = if gpu.is_software() { pixels / 1000 } else { 5 + pixels / 200 };
    assert!(other <= allowed, "{what}: {other} of {pixels} pixels differ");
}

fn assert_same(gpu: &Gpu, passes: &SplatPasses, scene: &Scene<'_>, case: &str) {
    let drawn = scene.device(gpu, passes, ALL);
    let pixels = drawn.depth[0].len();
    let (splatter, layers) = Scene { refinement: false, ..*scene }.host(ALL);
    assert_few(gpu, other_depths(&splatter, &drawn.depth[0], scene.view), pixels, &format!("{case}: depth map"));
    let (splatter, layers) = if scene.refinement { scene.host(ALL) } else { (splatter, layers) };
    assert_few(gpu, other_depths(&splatter, &drawn.depth[1], scene.view), pixels, &format!("{case}: last depth map"));
    assert_few(gpu, other_layers(&drawn.layers, &layers), pixels, &format!("{case}: layers"));
}

#[test]
fn the_device_draws_what_the_host_draws() {
    let Some(gpu) = test_gpu() else { return };
    let data = Data::new(2000);
    let passes = SplatPasses::new(&gpu, ALL, true, &data.linear).expect("passes");
    for size in SIZES {
        for view in views(size) {
            for discs in ALL_DISCS {
                let surfels = surfels(41, 5 + (size[0] * size[1]) as usize / 20, discs, &view);
                for refinement in [false, true] {
                    let scene = Scene {
                        surfels: &surfels,
                        active: surfels.len() * 2 / 3,
                        view: &view,
                        refinement,
                        data: &data,
                        noise: Noise::NONE,
                    };
                    let case = format!("{discs:?}, {size:?}, perspective {}, {refinement}", view.perspective);
                    assert_same(&gpu, &passes, &scene, &case);
                }
            }
        }
    }
}

/// A disc of points with this sine of tilt from the eye, its border blurred by noise.
fn blurred_disc(count: u32, away_px: f32, noise_px: f32, tilt: f32, view: &View) -> Vec<Surfel> {
    let depth = 4.0;
    let pixel = view.pixel_size(depth);
    let mut random = Random::new(47);
    let mut surfel = || {
        let (angle, away) = (6.3 * random.unit(), away_px * random.unit().sqrt());
        let place = [angle.cos(), angle.sin()].map(|along| away * along + noise_px * random.gaussian());
        let mut surfel = Surfel {
            radius: 2.5 * pixel,
            normal: [tilt, 0.0, -(1.0 - tilt * tilt).sqrt()],
            k_radius: 1.25 * pixel,
            major_axis: [0.0, 1.0, 0.0],
            major_ratio: 1.0,
            ..Surfel::default()
        };
        surfel.move_to(Vec3::new(place[0] * pixel, place[1] * pixel, depth), view);
        surfel
    };
    let seen = (0..count).map(|_| surfel()).filter(|surfel| surfel.center[2] > 0.0);
    seen.zip(0..).map(|(surfel, source)| Surfel { source, screen_and_flags: source, ..surfel }).collect()
}

#[test]
fn the_device_ends_blurred_borders_where_the_host_does() {
    let Some(gpu) = test_gpu() else { return };
    let data = Data::new(40_000);
    let passes = SplatPasses::new(&gpu, ALL, true, &data.linear).expect("passes");
    let (small, large) = (([233, 190], 16_000, 70.0), ([411, 390], 40_000, 120.0));
    for ((size, count, away_px), noise_px, power, tilt) in [
        (small, 0.1, 0.0, 0.8),
        (([120, 100], 40_000, 30.0), 0.6, 0.0, 0.8),
        (small, 1.0, 0.0, 0.8),
        (small, 2.5, 1.5, 0.6),
        (small, 6.0, 0.0, 0.8),
        (small, 6.0, 0.0, 0.0),
        (large, 20.0, 0.0, 0.9),
    ] {
        // In perspective, a disc that faces the eye in its middle is tilted towards its sides.
        for view in views(size).into_iter().filter(|view| tilt > 0.0 || !view.perspective) {
            let surfels = blurred_disc(count, away_px, noise_px, tilt, &view);
            let pixel = view.pixel_size(4.0);
            let noise = Noise { level: noise_px * pixel, power, most: 2.0 * pixel, sure: 1.0 };
            let active = surfels.len();
            let blurred = Scene { surfels: &surfels, active, view: &view, refinement: true, data: &data, noise };
            let case = format!("noise of {noise_px} pixels, tilt {tilt}, perspective {}", view.perspective);
            assert_same(&gpu, &passes, &blurred, &case);
            let covered = |noise: Noise| {
                let (_, layers) = Scene { noise, ..blurred }.host(ALL);
                layers.weight.iter().filter(|&&weight| weight > 0.0).count()
            };
            let [with, without] = [noise, Noise::NONE].map(covered);
            let fewer = 1.0 - with as f64 / without as f64;
            // Certain thin noise among dense points: the result differs by more than the device may.
            let differs = covered(Noise { sure: 0.0, ..noise }) - covered(noise) > (size[0] * size[1] / 1000) as usize;
            assert_eq!(differs, noise_px == 0.6, "{case}: what sure noise takes off");
            // Where a surface faces the eye its border counts as sharp.
            assert!((fewer > 0.01) == (noise_px > 0.5 && tilt > 0.5), "{case}: takes off {fewer}");
        }
    }
    // Pictures in which the disc hardly fits.
    for size in SIZES {
        let view = views(size)[0];
        let surfels = blurred_disc(5 + size[0] * size[1] / 4, 20.0, 3.0, 0.3, &view);
        let noise = Noise { level: 3.0 * view.pixel_size(4.0), ..Noise::NONE };
        let active = surfels.len();
        let scene = Scene { surfels: &surfels, active, view: &view, refinement: true, data: &data, noise };
        assert_same(&gpu, &passes, &scene, &format!("{size:?}"));
    }
}

#[test]
fn many_splats_and_none() {
    let Some(gpu) = test_gpu() else { return };
    let data = Data::new(300_000);
    let passes = SplatPasses::new(&gpu, ALL, true, &data.linear).expect("passes");
    let view = views([150, 90])[0];
    // More than the root's first 64 children hold, so that lists are filled more than once.
    for (count, discs) in [(0, Discs::Small), (64, Discs::Surface), (270_000, Discs::Small)] {
        let surfels = surfels(42, count, discs, &view);
        for active in [0, count / 3, count] {
            let scene =
                Scene { surfels: &surfels, active, view: &view, refinement: true, data: &data, noise: Noise::NONE };
            assert_same(&gpu, &passes, &scene, &format!("{active} of {count}"));
        }
    }
    // Each splat covers nearly the whole picture, and none meets the plane of the eye.
    for (size, count) in [([150, 90], 3000), ([20, 9], 100_000)] {
        let view = views(size)[0];
        let mut surfels = surfels(43, count, Discs::Circles, &view);
        surfels.iter_mut().for_each(|surfel| surfel.radius = 0.35 * surfel.center[2]);
        let scene =
            Scene { surfels: &surfels, active: count, view: &view, refinement: true, data: &data, noise: Noise::NONE };
        assert_same(&gpu, &passes, &scene, &format!("{count} huge splats"));
    }
}

#[test]
fn layers_that_are_not_wanted_change_no_other() {
    let Some(gpu) = test_gpu() else { return };
    let data = Data::new(1000);
    let view = views([71, 50])[0];
    let surfels = surfels(44, 300, Discs::Ellipses, &view);
    let scene =
        Scene { surfels: &surfels, active: 200, view: &view, refinement: true, data: &data, noise: Noise::NONE };
    for bits in 0..16 {
        let [color, scalar, measures, backs] = [1, 2, 4, 8].map(|bit| bits & bit != 0);
        let channels = Channels { color, scalar, measures, backs };
        let passes = SplatPasses::new(&gpu, channels, true, &data.linear).expect("passes");
        let drawn = scene.device(&gpu, &passes, channels);
        assert_few(&gpu, other_layers(&drawn.layers, &scene.host(channels).1), 71 * 50, &format!("{channels:?}"));
        let again = scene.device(&gpu, &passes, channels);
        let bits = |layers: &GBuffer| -> Vec<u32> {
            let vectors = layers.normal.iter().chain(&layers.color).flatten();
            let scalars =
                [&layers.weight, &layers.depth, &layers.scalar, &layers.radius, &layers.k_radius, &layers.back];
            vectors
                .chain(scalars.into_iter().flatten())
                .map(|value| value.to_bits())
                .chain(layers.point.clone())
                .collect()
        };
        assert!(bits(&drawn.layers) == bits(&again.layers), "{channels:?}: another picture the second time");
    }
}

#[test]
fn hidden_points_are_not_recovered() {
    let Some(gpu) = test_gpu() else { return };
    let data = Data::new(5000);
    let passes = SplatPasses::new(&gpu, Channels::default(), true, &data.linear).expect("passes");
    let view = views([133, 90])[0];
    let surfels = surfels(45, 500, Discs::Circles, &view);
    let scene =
        Scene { surfels: &surfels, active: 500, view: &view, refinement: false, data: &data, noise: Noise::NONE };
    let mut buffers = scene.upload(&gpu, Channels::default());
    let mut random = Random::new(46);
    let points: Vec<ScreenPoint> = (0..4500)
        .map(|_| {
            let pixel = random.below(133) as u32 | (random.below(90) as u32) << 16;
            ScreenPoint { position_view: [0.0, 0.0, 1.0 + 5.0 * random.unit()], pixel }
        })
        .collect();
    let passive: Vec<u32> = (0..4500).filter(|index| index % 3 != 0).collect();
    let screen = &mut buffers.screen;
    screen.capacity = 5000;
    screen.points = gpu.storage_with("points", &points).expect("room");
    screen.passive = gpu.storage_with("passive", &passive).expect("room");
    screen.queries = gpu.storage::<u32>("queries", 5000).expect("room");
    // One density cell holds all points.
    let density = DensityGrid { cell_px: 200, columns: 1, count: vec![1500], ..DensityGrid::default() };
    screen.density =
        gpu.storage_with("density", &[DensityCell { count: density.count[0], nearest: 0.0 }]).expect("room");
    set_counter(&gpu, screen, Counter::CellPx, density.cell_px);
    set_counter(&gpu, screen, Counter::CellColumns, density.columns);
    set_counter(&gpu, screen, Counter::Active, 500);
    set_counter(&gpu, screen, Counter::Passive, passive.len());
    let Buffers { frame, screen, surfels: on_device, splats, .. } = &buffers;
    let mut steps = passes.steps_visibility(&gpu, frame, screen, on_device, splats, Round::Active);
    steps.extend(passes.steps_recover(&gpu, frame, screen));
    run_round(&gpu, screen, Round::Active, &steps);

    let (splatter, _) = scene.host(Channels::default());
    let seen = |&index: &u32| {
        let point = &points[index as usize];
        let radius_px = density.initial_radius_px(point, 1);
        !splatter.hides(point.pixel_xy(), point.position_view[2], radius_px, &view)
    };
    let expected: Vec<u32> = passive.iter().copied().filter(seen).collect();
    assert!(expected.len() > 500 && expected.len() + 500 < passive.len(), "some of each: {}", expected.len());
    let counters: Vec<u32> = read_back(&gpu, &screen.counters, COUNTERS).expect("counters");
    let recovered = counters[Counter::Recovered as usize] as usize;
    let round = [Counter::Round, Counter::RoundFirst, Counter::RoundLen].map(|counter| counters[counter as usize]);
    assert_eq!(round, [1, 500, recovered as u32], "the second round begins");
    let queries: Vec<u32> = read_back(&gpu, &screen.queries, 500 + recovered).expect("queries");
    // Depths are random, so rounding decides none.
    assert_eq!(queries[500..], expected, "recovered points, in order");
}

#[test]
fn comparisons_see_each_kind_of_error() {
    let data = Data::new(1000);
    let view = views([70, 50])[0];
    let surfels = surfels(47, 200, Discs::Circles, &view);
    let scene =
        Scene { surfels: &surfels, active: 200, view: &view, refinement: true, data: &data, noise: Noise::NONE };
    let (_, right) = scene.host(ALL);
    assert_eq!(other_layers(&right, &right), 0, "nothing is wrong yet");
    let (splatter, other) = Scene { refinement: false, ..scene }.host(ALL);
    assert!(other_layers(&other, &right) > 50, "not noticed: no refinement");
    let flat = vec![3.0; 70 * 50];
    assert!(other_depths(&splatter, &flat, &view) > 3000, "not noticed: another depth map");
    assert!(other_depths(&splatter, &[f32::INFINITY; 70 * 50], &view) > 3000, "not noticed: no depth map");
    let at = (0..right.weight.len())
        .find(|&at| right.weight[at] > 0.1 && right.scalar[at].is_finite())
        .expect("a covered pixel");
    type Spoil = fn(&mut GBuffer, usize);
    let spoils: [(&str, Spoil); 10] = [
        ("weight", |l, i| l.weight[i] *= 1.001),
        ("depth", |l, i| l.depth[i] *= 1.001),
        ("normal", |l, i| l.normal[i][0] += 0.001),
        ("colour", |l, i| l.color[i][1] += 0.001),
        ("scalar", |l, i| l.scalar[i] = f32::NAN),
        ("radius", |l, i| l.radius[i] *= 1.001),
        ("k-radius", |l, i| l.k_radius[i] *= 1.001),
        ("curvature", |l, i| l.curvature[i] *= 1.001),
        ("back", |l, i| l.back[i] += 0.001),
        ("point", |l, i| l.point[i] += 1),
    ];
    for (name, spoil) in spoils {
        let mut wrong = right.clone();
        spoil(&mut wrong, at);
        assert_eq!(other_layers(&wrong, &right), 1, "not noticed: {name}");
    }
}
