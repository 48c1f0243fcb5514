//! Devices: the caller's own, small ones, lost ones; uploads and textures.

use autosplats::cloud::PointCloud;
use autosplats::cloud::glam::DVec3;
use autosplats::{Backend, Error, Renderer, Settings, wgpu};

use super::*;

/// A device of the caller's own, without optional features and with bindings of at most `binding` bytes.
pub(crate) fn own_device(binding: u64) -> Option<(wgpu::Device, wgpu::Queue)> {
    own_device_with(wgpu::Features::empty(), binding)
}

pub(super) fn own_device_with(required_features: wgpu::Features, binding: u64) -> Option<(wgpu::Device, wgpu::Queue)> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default())).ok()?;
    let limits = wgpu::Limits { max_storage_buffer_binding_size: binding, ..wgpu::Limits::default() };
    let descriptor = wgpu::DeviceDescriptor { required_features, required_limits: limits, ..Default::default() };
    Some(pollster::block_on(adapter.request_device(&descriptor)).expect("a device within WebGPU's default limits"))
}

#[test]
fn a_cloud_larger_than_a_binding_on_the_callers_own_device() {
    if crate::gpu().is_none() {
        return;
    }
    let (cloud, camera) = scene("statue", 1_000_000);
    let (device, queue) = own_device(4 << 20).expect("a device");
    let mut own = Renderer::with_device(device, queue).expect("a renderer");
    assert!(!own.adapter().expect("a device").int64_atomics, "the device has no 64-bit atomics");
    assert!(cloud.len() * 12 > 2 * (4 << 20), "the points take three bindings");
    compare(&mut own, &cloud, &camera, [170, 120], &Settings::default(), "three bindings");
    // There is room for two points per pixel, but not for a margin: only the picture's edges differ.
    let size = [200, 140];
    let near = Camera { eye: camera.eye + 0.6 * (camera.look_at - camera.eye), ..camera };
    let host = Renderer::new().render(&cloud, &near, size, &Settings::default()).expect("a picture").image.clone();
    let device = own.render(&cloud, &near, size, &Settings::default()).expect("a picture").image;
    let inner = |image: &Image| {
        let rows = image.pixels.chunks(200).skip(20).take(100).flat_map(|row| &row[20..180]).copied();
        Image { width: 160, height: 100, pixels: rows.collect(), linear: Vec::new() }
    };
    let [all, inside] = [unlike(&host, device), unlike(&inner(&host), &inner(device))];
    assert!(inside <= 4.0 * MAX_DIFFERENT_SHARE, "{inside} of the pixels that are not along edges differ");
    assert!(all > 2.0 * inside, "{all} of all pixels, {inside} of those that are not along edges");
    // Surfels of two points per pixel exceed the device's bindings: one point is used instead.
    let size = [250, 170];
    compare(&mut own, &cloud, &camera, size, &a_point_a_pixel(), "a point a pixel");
    let asked = own.render(&cloud, &camera, size, &a_point_a_pixel()).expect("a picture").image.clone();
    let made = own.render(&cloud, &camera, size, &Settings::default()).expect("a picture").image;
    assert_eq!(&asked, made, "no room for two points a pixel");
    // A picture that is too large for the device is an error, not garbage.
    match own.render(&cloud, &camera, [2000, 2000], &Settings::default()) {
        Err(Error::DeviceLimit { needed, allowed, .. }) => assert!(needed > allowed, "{needed} {allowed}"),
        other => panic!("{:?}", other.map(|frame| frame.counts)),
    }
    compare(&mut own, &cloud, &camera, size, &a_point_a_pixel(), "after a refusal");
}

/// Without subgroups and 64-bit atomics, and within WebGPU's default limits.
#[test]
fn a_device_without_features_gives_the_same_picture() {
    let Some(mut usual) = crate::gpu() else { return };
    let (device, queue) = own_device(128 << 20).expect("a device");
    let mut bare = Renderer::with_device(device, queue).expect("a renderer");
    // Hardware may fuse products and sums of one form of a pass and not of another.
    let allowed = if usual.adapter().expect("a device").software { 0.0 } else { MAX_DIFFERENT_SHARE };
    for (name, count) in [("statue", 60_000), ("herd", 80_000)] {
        let (cloud, camera) = scene(name, count);
        for settings in [Settings::default(), a_point_a_pixel()] {
            let [usual, bare] = [&mut usual, &mut bare].map(|renderer| {
                renderer.render(&cloud, &camera, [200, 140], &settings).expect("a picture").image.clone()
            });
            let different = unlike(&usual, &bare);
            assert!(different <= allowed, "{name}: {different} of the pixels differ");
        }
    }
}

#[test]
fn clouds_of_any_size_follow_each_other() {
    let Some(mut gpu) = crate::gpu() else { return };
    let (whole, camera) = scene("statue", 60_000);
    for points in [60_000, 30_000, 61, 45_000, 59_000, 2_000] {
        let mut cloud = whole.clone();
        cloud.retain(|index| index < points);
        compare(&mut gpu, &cloud, &camera, [200, 160], &Settings::default(), &format!("{points} points"));
    }
    let moved = whole.positions().iter().map(|&[x, y, z]| [x + 0.05, y, z]).collect();
    let moved = PointCloud::new(whole.origin(), moved);
    compare(&mut gpu, &moved, &camera, [200, 160], &Settings::default(), "as many points elsewhere");
}

#[test]
fn a_callers_texture_gets_the_same_picture() {
    if crate::gpu().is_none() {
        return;
    }
    let (device, queue) = own_device(128 << 20).expect("a device");
    let mut renderer = Renderer::with_device(device.clone(), queue.clone()).expect("a renderer");
    let (cloud, camera) = scene("figure", 50_000);
    let size = [250, 170];
    let settings = Settings::default();
    renderer.upload(&cloud, &settings, &|_| true).expect("an upload");
    let frame = renderer.render(&cloud, &camera, size, &settings).expect("a picture");
    let (expected, counts) = (frame.image.clone(), frame.counts);
    let texture = |format, usage| {
        device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage,
            view_formats: &[],
        })
    };
    let both = wgpu::TextureUsages::COPY_DST | wgpu::TextureUsages::COPY_SRC;
    for (format, swapped) in [(wgpu::TextureFormat::Rgba8Unorm, false), (wgpu::TextureFormat::Bgra8UnormSrgb, true)] {
        let texture = texture(format, both);
        renderer.render_to_texture(&cloud, &camera, &texture, &settings).expect("a picture in a texture");
        let pixels = read_texture(&device, &queue, &texture, size);
        let expected = expected.pixels.iter().map(|&[r, g, b, a]| if swapped { [b, g, r, a] } else { [r, g, b, a] });
        let expected: Vec<[u8; 4]> = expected.collect();
        assert_eq!(pixels, expected, "{format:?}");
    }
    for turns in [false, true] {
        for all_layers in [false, true] {
            let own = renderer.texture(size, wgpu::TextureFormat::Rgba8Unorm).expect("a texture");
            assert!(own.usage().contains(wgpu::TextureUsages::TEXTURE_BINDING), "the window's shader reads it");
            let texture = texture(wgpu::TextureFormat::Rgba8Unorm, both);
            renderer.take_turns(turns);
            let settings = Settings { all_layers, ..settings.clone() };
            let frame = renderer.render_to_texture_while(&cloud, &camera, &own, &settings, &|| true);
            assert_eq!(frame.expect("a picture").counts, counts, "of another texture");
            let frame = renderer.render_to_texture_while(&cloud, &camera, &texture, &settings, &|| true);
            let frame = frame.expect("a picture in a texture");
            assert_eq!(frame.counts, counts);
            assert!(frame.image.pixels.is_empty(), "the picture stays on the device");
            assert_eq!(frame.layers.depth.is_empty(), !all_layers);
            assert!(frame.timings.frame > 0.0 && frame.timings.project > 0.0, "{:?}", frame.timings);
            assert_eq!(read_texture(&device, &queue, &texture, size), expected.pixels, "turns {turns}");
        }
    }
    let refused = renderer.render_to_texture_while(
        &cloud,
        &camera,
        &texture(wgpu::TextureFormat::Rgba8Unorm, both),
        &settings,
        &|| false,
    );
    assert!(matches!(refused, Err(Error::Cancelled)));
    assert!(matches!(renderer.texture([1 << 20, 1], wgpu::TextureFormat::Rgba8Unorm), Err(Error::DeviceLimit { .. })));
    let wrong = [
        texture(wgpu::TextureFormat::R32Float, both),
        texture(wgpu::TextureFormat::Rgba8Unorm, both - wgpu::TextureUsages::COPY_DST),
    ];
    for texture in wrong {
        let refused = renderer.render_to_texture(&cloud, &camera, &texture, &settings);
        assert!(refused.is_err(), "{:?} {:?}", texture.format(), texture.usage());
    }
    assert!(
        Renderer::new().render_to_texture(&cloud, &camera, &wrong_backend(&texture), &settings).is_err(),
        "the CPU has none"
    );
}

fn wrong_backend(texture: &impl Fn(wgpu::TextureFormat, wgpu::TextureUsages) -> wgpu::Texture) -> wgpu::Texture {
    texture(wgpu::TextureFormat::Rgba8Unorm, wgpu::TextureUsages::COPY_DST)
}

fn read_texture(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    texture: &wgpu::Texture,
    [width, height]: [u32; 2],
) -> Vec<[u8; 4]> {
    let pitch = (4 * width).next_multiple_of(256);
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: u64::from(pitch * height),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(pitch), rows_per_image: None };
    let to = wgpu::TexelCopyBufferInfo { buffer: &buffer, layout };
    encoder.copy_texture_to_buffer(texture.as_image_copy(), to, texture.size());
    queue.submit([encoder.finish()]);
    buffer.map_async(wgpu::MapMode::Read, .., |_| {});
    device.poll(wgpu::PollType::wait_indefinitely()).expect("the device answers");
    let bytes = buffer.get_mapped_range(..).expect("mapped");
    let row = |y: u32| &bytes[(y * pitch) as usize..][..4 * width as usize];
    (0..height).flat_map(|y| row(y).chunks_exact(4).map(|p| [p[0], p[1], p[2], p[3]]).collect::<Vec<_>>()).collect()
}

#[test]
fn an_upload_can_be_stopped() {
    let Some(mut gpu) = crate::gpu() else { return };
    // More points than one upload step takes.
    let cloud = PointCloud::new(DVec3::ZERO, crate::test_clouds::plane(12_000_000));
    let stopped = gpu.upload(&cloud, &Settings::default(), &|fraction| fraction < 0.1);
    assert!(matches!(stopped, Err(Error::Cancelled)), "{stopped:?}");
    let (cloud, camera) = scene("figure", 20_000);
    compare(&mut gpu, &cloud, &camera, SIZE, &Settings::default(), "after that");
}

#[test]
fn a_device_that_is_lost_says_so() {
    if crate::gpu().is_none() {
        return;
    }
    let (cloud, camera) = scene("figure", 20_000);
    let (device, queue) = own_device(128 << 20).expect("a device");
    let mut lost = Renderer::with_device(device.clone(), queue).expect("a renderer");
    lost.render(&cloud, &camera, SIZE, &Settings::default()).expect("a picture");
    device.destroy();
    for other in [false, true] {
        let cloud = if other { scene("statue", 20_000).0 } else { cloud.clone() };
        match lost.render(&cloud, &camera, SIZE, &Settings::default()) {
            Err(Error::DeviceLost(_) | Error::Device(_)) => {}
            outcome => panic!("{:?}", outcome.map(|frame| frame.counts)),
        }
    }
    let mut new = Renderer::with_backend(Backend::Gpu).expect("another device");
    compare(&mut new, &cloud, &camera, SIZE, &Settings::default(), "on a new renderer");
}
