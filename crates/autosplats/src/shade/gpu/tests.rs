//! Shading on the GPU against the CPU, from the same layers.

use std::cell::RefCell;

use autosplats_cloud::glam::DVec3;
use autosplats_cloud::{PointCloud, ValueOrigin};

use super::super::cpu::{Scene, Shader, shade};
use super::super::{Background, Backs, ColorMap, ColorMode, Image, Shading};
use super::*;
use crate::camera::{Camera, Projection, View};
use crate::gpu::{Clock, FrameUniform, Recorder, read_back, test_gpu};
use crate::project::gpu::{COUNTERS, Counter};
use crate::splat::{GBuffer, upload_layers};
use crate::test_clouds::{self, EYE, Random};
use crate::{Renderer, Settings};

/// A device with its shading passes.
struct Device {
    gpu: Gpu,
    passes: RefCell<ShadePasses>,
}

/// The device's result.
struct Shaded {
    image: Image,
    range: [u32; 2],
}

impl Device {
    fn new() -> Option<Self> {
        let gpu = test_gpu()?;
        let passes = RefCell::new(ShadePasses::new(&gpu).expect("passes"));
        Some(Self { gpu, passes })
    }

    /// Runs the passes, and hands the buffers with the counters to `then`.
    fn run<T>(
        &self,
        layers: &GBuffer,
        scene: &Scene<'_>,
        shading: &Shading,
        keep_linear: bool,
        format: wgpu::TextureFormat,
        then: impl FnOnce(&ShadeBuffers, &wgpu::Buffer) -> T,
    ) -> T {
        let Self { gpu, passes } = self;
        let mut passes = passes.borrow_mut();
        let layers = upload_layers(gpu, layers);
        let mut buffers = ShadeBuffers::new(gpu, layers.size, keep_linear).expect("room");
        let frame = gpu.uniform::<FrameUniform>("frame").expect("room");
        gpu.queue.write_buffer(&frame, 0, bytemuck::bytes_of(&FrameUniform::new(scene.view, 10)));
        let counters = gpu.storage::<u32>("counters", COUNTERS).expect("room");
        let uniform = ShadeUniform::new(scene, shading, &layers, keep_linear).into_format(format);
        buffers.write(gpu, &uniform, shading);
        let mut recorder = Recorder::new(gpu, &Clock::Off);
        let steps = passes.steps(gpu, &frame, &layers, &counters, &buffers, shading).expect("passes");
        steps.iter().for_each(|step| recorder.run(step));
        recorder.finish();
        then(&buffers, &counters)
    }

    fn shade(&self, layers: &GBuffer, scene: &Scene<'_>, shading: &Shading, keep_linear: bool) -> Shaded {
        let gpu = &self.gpu;
        self.run(layers, scene, shading, keep_linear, wgpu::TextureFormat::Rgba8Unorm, |buffers, counters| {
            let bytes = |buffer: &wgpu::Buffer| read_back::<u8>(gpu, buffer, buffer.size() as usize).expect("bytes");
            let counters: Vec<u32> = read_back(gpu, counters, COUNTERS).expect("counters");
            let range = [Counter::RangeLow, Counter::RangeHigh].map(|counter| counters[counter as usize]);
            let linear = if keep_linear { bytes(&buffers.linear) } else { Vec::new() };
            let read = ReadPicture { size: buffers.size, image: &bytes(&buffers.image), linear: &linear, range };
            let mut image = Image::default();
            finish(&read, scene, shading, &mut image);
            Shaded { image, range }
        })
    }
}

fn on_host(layers: &GBuffer, scene: &Scene<'_>, shading: &Shading, keep_linear: bool) -> Image {
    let mut image = Image::default();
    shade(layers, scene, shading, keep_linear, None, &mut image, &crate::cancel::NEVER);
    image
}

/// Difference of two pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Difference {
    /// Largest difference of a channel, in 255ths.
    worst: u8,
    /// Share of pixels that differ.
    share: f64,
    /// Largest difference of a channel in linear light.
    linear: f32,
}

fn difference(a: &Image, b: &Image) -> Difference {
    assert_eq!((a.width, a.height, a.pixels.len()), (b.width, b.height, b.pixels.len()), "sizes");
    assert_eq!(a.linear.len(), b.linear.len(), "sizes in linear light");
    let apart = |(a, b): (&[u8; 4], &[u8; 4])| (0..4).map(|i| a[i].abs_diff(b[i])).max().unwrap_or_default();
    let pixels: Vec<u8> = a.pixels.iter().zip(&b.pixels).map(apart).collect();
    let linear = a.linear.iter().flatten().zip(b.linear.iter().flatten());
    Difference {
        worst: pixels.iter().copied().max().unwrap_or_default(),
        share: pixels.iter().filter(|&&pixel| pixel > 0).count() as f64 / pixels.len().max(1) as f64,
        // NaN in only one picture is the largest difference.
        linear: linear
            .map(|(a, b)| if a.to_bits() == b.to_bits() { 0.0 } else { (a - b).abs() })
            .fold(0.0, |a, b| if b <= a { a } else { b }),
    }
}

fn assert_same(host: &Image, device: &Image, shading: &Shading, case: &str) {
    let found = difference(host, device);
    // Divisions, powers and fused sums may be off by a few units in the last place. That may move a channel across one
    // of 255 steps, or a value across one of the 1024 steps of a colour map. The steepest steps, those of Turbo, are
    // two of 255 apart, or 0.02 in linear light.
    let (worst, linear) = if shading.color.usual_map().is_some() { (2, 0.02) } else { (1, 1e-5) };
    assert!(found.worst <= worst && found.linear <= linear, "{case}: {found:?}");
    // In small pictures a few pixels are a large share.
    let few = 3.0 / host.pixels.len() as f64;
    assert!(found.share <= f64::max(1e-3, few), "{case}: {found:?}");
}

fn layers_of(size: [u32; 2]) -> GBuffer {
    let [width, height] = size;
    GBuffer::new(width, height)
}

/// Blocks of pixels with random depths and normals, some of them empty, with every layer but colour.
fn blocks(seed: u64, size: [u32; 2]) -> GBuffer {
    let mut random = Random::new(seed);
    let mut layers = layers_of(size);
    let area = layers.weight.len();
    layers.scalar = vec![f32::NAN; area];
    (layers.radius, layers.k_radius, layers.curvature) = (vec![0.0; area], vec![0.0; area], vec![0.0; area]);
    let depths: Vec<f32> =
        (0..64).map(|_| if random.unit() < 0.2 { f32::INFINITY } else { 2.0 + random.unit() }).collect();
    let unknown = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.0, 0.0];
    for pixel in 0..(size[0] * size[1]) as usize {
        let [x, y] = [pixel % size[0] as usize, pixel / size[0] as usize];
        let at = layers.index(x, y);
        let depth = depths[(x / 7 + y / 5 * 3) % 64];
        if depth.is_finite() {
            let [nx, ny, nz] = random.direction();
            layers.weight[at] = 0.1 + random.unit();
            layers.depth[at] = depth + 0.01 * random.unit();
            layers.normal[at] = [nx, ny, -nz.abs()];
            layers.point[at] = pixel as u32;
            layers.scalar[at] = if random.unit() < 0.1 { unknown[random.below(5)] } else { 100.0 * random.signed() };
            layers.radius[at] = random.unit();
            layers.k_radius[at] = 0.3 * random.unit() * random.unit();
            layers.curvature[at] = random.unit() / 3.0;
        }
    }
    layers
}

/// Blocks with colours.
fn colored(seed: u64, size: [u32; 2]) -> GBuffer {
    let mut random = Random::new(seed ^ 77);
    let mut layers = blocks(seed, size);
    layers.color = layers.weight.iter().map(|_| [random.unit(), random.unit(), 1.1 * random.unit()]).collect();
    layers
}

/// The layers with random shares of back.
fn with_backs(layers: GBuffer) -> GBuffer {
    let mut random = Random::new(78);
    let back = layers.weight.iter().map(|_| (2.0 * random.unit() - 0.5).clamp(0.0, 1.0)).collect();
    GBuffer { back, ..layers }
}

/// The layers without measures.
fn without_measures(layers: GBuffer) -> GBuffer {
    GBuffer { radius: Vec::new(), k_radius: Vec::new(), curvature: Vec::new(), ..layers }
}

const MODES: usize = 11;

fn modes() -> [ColorMode; MODES] {
    [
        ColorMode::Auto,
        ColorMode::Rgb,
        ColorMode::Plain,
        ColorMode::Height,
        ColorMode::Classification,
        ColorMode::Field("intensity".into()),
        ColorMode::Normal,
        ColorMode::Curvature,
        ColorMode::Radius,
        ColorMode::KRadius,
        ColorMode::Depth,
    ]
}

fn view(size: [u32; 2], projection: Projection, origin: DVec3) -> View {
    let camera = Camera { eye: origin + EYE, look_at: origin, up: DVec3::new(0.1, -1.0, 0.0), projection };
    camera.view(origin, size).expect("a view")
}

const PROJECTIONS: [Projection; 2] = [Projection::PerspectiveFovDeg(30.0), Projection::OrthographicHeight(2.1)];
const BACKGROUNDS: [Background; 3] =
    [Background::Transparent, Background::Color([3, 120, 250]), Background::Gradient([0, 100, 40], [81, 100, 3])];
const MAPS: [Option<ColorMap>; 5] =
    [None, Some(ColorMap::Turbo), Some(ColorMap::Inferno), Some(ColorMap::Gray), Some(ColorMap::Reds)];

#[test]
fn every_setting_makes_the_same_picture() {
    let Some(device) = Device::new() else { return };
    let mut seed = 0;
    for size in [[1, 1], [3, 200], [97, 61], [256, 64], [300, 190]] {
        for projection in PROJECTIONS {
            let view = view(size, projection, DVec3::ZERO);
            let scene = Scene {
                view: &view,
                up: DVec3::new(0.6, 0.0, 0.8),
                origin: DVec3::ZERO,
                unit: 1.0,
                exposure: 1.7,
                values: ValueOrigin::default(),
            };
            for layers in [blocks(5, size), colored(6, size), with_backs(blocks(5, size)), with_backs(colored(6, size))]
            {
                for color in modes() {
                    for [lighting, occlusion, ranged] in [[0, 0, 0], [1, 0, 1], [0, 1, 1], [1, 1, 0]] {
                        // Settings that do not influence each other take turns.
                        seed += 1;
                        let shading = Shading {
                            color: color.clone(),
                            range: [None, Some([-0.2, 2.3])][ranged],
                            color_map: MAPS[seed % MAPS.len()],
                            legend: seed.is_multiple_of(2),
                            lighting: lighting == 1,
                            // The scene's exposure counts.
                            exposure: None,
                            occlusion: [0.0, 1.5][occlusion],
                            backs: if seed.is_multiple_of(3) { Backs::Same } else { Backs::Toned },
                            background: BACKGROUNDS[seed % BACKGROUNDS.len()],
                        };
                        let keep_linear = seed.is_multiple_of(5);
                        let shaded = device.shade(&layers, &scene, &shading, keep_linear);
                        let host = on_host(&layers, &scene, &shading, keep_linear);
                        assert_same(&host, &shaded.image, &shading, &format!("{size:?} {projection:?} {shading:?}"));
                    }
                }
            }
        }
    }
}

#[test]
fn pictures_of_clouds_are_the_same() {
    let Some(device) = Device::new() else { return };
    let mut renderer = Renderer::new();
    let size = [180, 130];
    for (name, positions) in test_clouds::all(6000) {
        let cloud = PointCloud::new(DVec3::ZERO, positions);
        for projection in PROJECTIONS {
            let camera = Camera { eye: EYE, look_at: DVec3::ZERO, up: DVec3::new(0.1, -1.0, 0.0), projection };
            let settings = Settings { all_layers: true, ..Settings::default() };
            let layers = renderer.render(&cloud, &camera, size, &settings).expect("a frame").layers.clone();
            let view = camera.view(DVec3::ZERO, size).expect("a view");
            let scene = Scene {
                view: &view,
                up: DVec3::Y,
                origin: DVec3::ZERO,
                unit: 1.0,
                exposure: 1.0,
                values: ValueOrigin::default(),
            };
            for color in modes() {
                if matches!(color, ColorMode::Field(_)) {
                    continue;
                }
                let shading = Shading { color, ..Shading::default() };
                let case = format!("{name} {projection:?} {:?}", shading.color);
                let host = on_host(&layers, &scene, &shading, true);
                assert_same(&host, &device.shade(&layers, &scene, &shading, true).image, &shading, &case);
            }
        }
    }
}

#[test]
fn a_difference_is_found() {
    let Some(device) = Device::new() else { return };
    let size = [64, 40];
    let view = view(size, PROJECTIONS[0], DVec3::ZERO);
    let scene = Scene {
        view: &view,
        up: DVec3::Y,
        origin: DVec3::ZERO,
        unit: 1.0,
        exposure: 1.0,
        values: ValueOrigin::default(),
    };
    let layers = blocks(1, size);
    let host = on_host(&layers, &scene, &Shading::default(), true);
    let other = Shading { occlusion: 2.0, ..Shading::default() };
    let found = difference(&host, &device.shade(&layers, &scene, &other, true).image);
    assert!(found.worst > 2 && found.share > 0.05 && found.linear > 0.02, "{found:?}");
    let layers = with_backs(layers);
    let same = Shading { backs: Backs::Same, ..Shading::default() };
    let found = difference(
        &on_host(&layers, &scene, &Shading::default(), true),
        &device.shade(&layers, &scene, &same, true).image,
    );
    assert!(found.worst > 2 && found.share > 0.05 && found.linear > 0.02, "backs: {found:?}");
}

#[test]
fn backs_are_toned_whatever_else_splats_carry() {
    let Some(device) = Device::new() else { return };
    let size = [97, 61];
    let view = view(size, PROJECTIONS[0], DVec3::ZERO);
    let scene = Scene {
        view: &view,
        up: DVec3::Y,
        origin: DVec3::ZERO,
        unit: 1.0,
        exposure: 1.0,
        values: ValueOrigin::default(),
    };
    for layers in [blocks(7, size), colored(8, size)].map(with_backs).map(without_measures) {
        let shading = Shading::default();
        let host = on_host(&layers, &scene, &shading, true);
        assert_same(&host, &device.shade(&layers, &scene, &shading, true).image, &shading, "without measures");
    }
}

#[test]
fn ranges_are_those_of_sorted_values() {
    let Some(device) = Device::new() else { return };
    let mut random = Random::new(3);
    let shading = Shading { color: ColorMode::Field("any".into()), ..Shading::default() };
    for size in [[1, 1], [10, 10], [199, 1], [64, 65], [250, 200], [251, 200], [410, 300]] {
        let view = view(size, PROJECTIONS[0], DVec3::ZERO);
        let scene = Scene {
            view: &view,
            up: DVec3::Y,
            origin: DVec3::ZERO,
            unit: 1.0,
            exposure: 1.0,
            values: ValueOrigin::default(),
        };
        for values in 0..7 {
            let mut layers = layers_of(size);
            layers.depth.fill(1.0);
            layers.weight.fill(1.0);
            let value = |random: &mut Random| match values {
                0 => f32::from_bits(random.bits() as u32 & 0xbfff_ffff | 0x0080_0000),
                1 => random.signed(),
                2 => [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][random.below(3)],
                3 => -7.25,
                4 => [-0.0, 0.0][random.below(2)],
                // The greatest values share their first byte with `NO_KEY`.
                5 => [f32::NAN, f32::MAX, f32::MIN, 1.0, 2.9e38, -2.9e38][random.below(6)],
                _ => 100.0 + random.unit() * random.unit(),
            };
            layers.scalar = (0..layers.weight.len()).map(|_| value(&mut random)).collect();
            for at in 0..layers.weight.len() {
                if random.unit() < 0.3 {
                    (layers.weight[at], layers.depth[at]) = (0.0, f32::INFINITY);
                }
            }
            let shader = Shader::new(&layers, &scene, &shading);
            let host = shader.usual_range();
            let found = device.shade(&layers, &scene, &shading, false).range;
            assert_eq!(found, host.map(f32::to_bits), "{size:?}, values {values}: {host:?}");
        }
    }
}

#[test]
fn heights_are_told_apart_in_survey_coordinates() {
    let Some(device) = Device::new() else { return };
    let size = [400, 300];
    let layers = blocks(9, size);
    let pictures = [DVec3::ZERO, DVec3::new(406_123.25, 5_100_211.5, 5_000_350.75)].map(|origin| {
        let view = view(size, PROJECTIONS[0], origin);
        let scene =
            Scene { view: &view, up: DVec3::Z, origin, unit: 1.0, exposure: 1.0, values: ValueOrigin::default() };
        let ranges = [None, Some([-1.0, 1.0].map(|end| origin.z + end))];
        ranges.map(|range| {
            let shading = Shading { color: ColorMode::Height, range, ..Shading::default() };
            for legend in [false, true] {
                let shading = Shading { legend, ..shading.clone() };
                let host = on_host(&layers, &scene, &shading, true);
                let shaded = device.shade(&layers, &scene, &shading, true).image;
                assert_same(&host, &shaded, &shading, &format!("{origin:?} {range:?}, legend {legend}"));
            }
            device.shade(&layers, &scene, &shading, true).image
        })
    });
    let [[here, _], [there, _]] = &pictures;
    assert_eq!(here, there, "where the origin lies does not matter");
}

#[test]
fn textures_get_the_picture() {
    let Some(device) = Device::new() else { return };
    let gpu = &device.gpu;
    let size = [97, 33];
    let view = view(size, PROJECTIONS[0], DVec3::ZERO);
    let scene = Scene {
        view: &view,
        up: DVec3::Y,
        origin: DVec3::ZERO,
        unit: 1.0,
        exposure: 1.0,
        values: ValueOrigin::default(),
    };
    let (layers, shading) = (colored(2, size), Shading::default());
    let texture = |format, [width, height]: [u32; 2], usage| {
        gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("target"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage,
            view_formats: &[],
        })
    };
    let usage = wgpu::TextureUsages::COPY_DST | wgpu::TextureUsages::COPY_SRC;
    let expected = device.shade(&layers, &scene, &shading, false).image;
    use wgpu::TextureFormat::{Bgra8Unorm, Bgra8UnormSrgb, R32Uint, Rgba8Unorm, Rgba8UnormSrgb};
    for (format, swapped) in [(Rgba8Unorm, false), (Rgba8UnormSrgb, false), (Bgra8Unorm, true), (Bgra8UnormSrgb, true)]
    {
        let target = texture(format, size, usage);
        let read = device.run(&layers, &scene, &shading, false, format, |buffers, _| {
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            buffers.copy_to_texture(&mut encoder, &target).expect("a texture that fits");
            // Copies the texture back into a buffer like the original.
            let back = gpu.storage::<u8>("read back", buffers.image.size() as usize).expect("room");
            let layout =
                wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * pitch(97)), rows_per_image: None };
            let into = wgpu::TexelCopyBufferInfo { buffer: &back, layout };
            encoder.copy_texture_to_buffer(target.as_image_copy(), into, target.size());
            gpu.queue.submit([encoder.finish()]);
            read_back::<[u8; 4]>(gpu, &back, (pitch(97) * 33) as usize).expect("a texture")
        });
        for (row, expected) in read.chunks(pitch(97) as usize).zip(expected.pixels.chunks(97)) {
            let row: Vec<_> =
                row[..97].iter().map(|&[r, g, b, a]| if swapped { [b, g, r, a] } else { [r, g, b, a] }).collect();
            assert_eq!(row, expected, "{format:?}");
        }
    }
    let refused = [
        (texture(R32Uint, size, usage), "R32Uint"),
        (texture(Rgba8Unorm, [97, 34], usage), "97x34"),
        (texture(Rgba8Unorm, size, wgpu::TextureUsages::COPY_SRC), "COPY_DST"),
    ];
    for (target, reason) in refused {
        let error = check_texture(&target, size).expect_err("a texture that does not fit").to_string();
        assert!(error.contains(reason), "{error} does not name {reason}");
    }
}

#[test]
fn tables_follow_the_settings() {
    let Some(device) = Device::new() else { return };
    let gpu = &device.gpu;
    let size = [70, 20];
    let view = view(size, PROJECTIONS[0], DVec3::ZERO);
    let scene = Scene {
        view: &view,
        up: DVec3::Y,
        origin: DVec3::ZERO,
        unit: 1.0,
        exposure: 1.0,
        values: ValueOrigin::default(),
    };
    let host = blocks(4, size);
    let layers = upload_layers(gpu, &host);
    let mut buffers = ShadeBuffers::new(gpu, size, false).expect("room");
    let frame = gpu.uniform::<FrameUniform>("frame").expect("room");
    gpu.queue.write_buffer(&frame, 0, bytemuck::bytes_of(&FrameUniform::new(&view, 10)));
    let counters = gpu.storage::<u32>("counters", COUNTERS).expect("room");
    let depth = Shading { color: ColorMode::Depth, ..Shading::default() };
    let mut passes = device.passes.borrow_mut();
    let steps = passes.steps(gpu, &frame, &layers, &counters, &buffers, &depth).expect("passes");
    // One set of buffers and steps serves frame after frame.
    for (color_map, background) in MAPS.into_iter().zip(BACKGROUNDS.into_iter().cycle()).cycle().take(8) {
        let shading = Shading { color_map, background, ..depth.clone() };
        buffers.write(gpu, &ShadeUniform::new(&scene, &shading, &layers, false), &shading);
        let mut recorder = Recorder::new(gpu, &Clock::Off);
        steps.iter().for_each(|step| recorder.run(step));
        recorder.finish();
        let bytes: Vec<u8> = read_back(gpu, &buffers.image, buffers.image.size() as usize).expect("a picture");
        let mut image = Image::default();
        let read = ReadPicture { size, image: &bytes, linear: &[], range: [0; 2] };
        finish(&read, &scene, &shading, &mut image);
        let case = format!("{color_map:?} {background:?}");
        assert_same(&on_host(&host, &scene, &shading, false), &image, &shading, &case);
    }
}
