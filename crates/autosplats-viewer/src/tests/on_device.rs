//! Pictures that stay on the device of the window.

use std::sync::Arc;

use autosplats::{AdapterSummary, Image, Renderer, adapters, device_descriptor, usual_exposure};
use eframe::egui_wgpu::{CallbackResources, CallbackTrait as _, ScreenDescriptor};
use eframe::wgpu;

use super::rest::at_rest;
use super::*;
use crate::view::{OnScreen, Pixels, WindowDevice};

/// The device that renderers choose, as that of a window; `None` if there is none.
fn window_device(format: wgpu::TextureFormat) -> Option<WindowDevice> {
    let Some(AdapterSummary { name, .. }) = adapters().into_iter().next() else {
        assert!(std::env::var_os("CI").is_none(), "there is no device");
        eprintln!("nothing checked: there is no device");
        return None;
    };
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let all = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
    let adapter = all.into_iter().find(|adapter| adapter.get_info().name == name).expect("it was there");
    let opened = pollster::block_on(adapter.request_device(&device_descriptor(&adapter)));
    let (device, queue) = opened.expect("it starts");
    Some(WindowDevice { device, queue, format })
}

/// What a texture holds.
pub(super) fn read(WindowDevice { device, queue, .. }: &WindowDevice, texture: &wgpu::Texture) -> Image {
    let [width, height] = [texture.width(), texture.height()];
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
    device.poll(wgpu::PollType::wait_indefinitely()).expect("it answers");
    let bytes = buffer.get_mapped_range(..).expect("it is mapped");
    let rows = bytes.chunks(pitch as usize).map(|row| &row[..4 * width as usize]);
    let pixels = rows.flat_map(|row| row.as_chunks().0.iter().copied()).collect();
    Image { width, height, pixels, linear: Vec::new() }
}

/// What the window shows of a picture, at this size.
fn drawn(window: &WindowDevice, pixels: Pixels, [width, height]: [u32; 2]) -> Image {
    let WindowDevice { device, queue, format } = window;
    let target = device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: *format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let on_screen = OnScreen { pixels, sharp: false, format: *format };
    let mut resources = CallbackResources::default();
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let screen = ScreenDescriptor { size_in_pixels: [width, height], pixels_per_point: 1.0 };
    on_screen.prepare(device, queue, &screen, &mut encoder, &mut resources);
    let view = target.create_view(&wgpu::TextureViewDescriptor::default());
    let attachment = wgpu::RenderPassColorAttachment {
        view: &view,
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::RED), store: wgpu::StoreOp::Store },
    };
    let descriptor =
        wgpu::RenderPassDescriptor { color_attachments: &[Some(attachment)], ..wgpu::RenderPassDescriptor::default() };
    let mut pass = encoder.begin_render_pass(&descriptor).forget_lifetime();
    let viewport = Rect::from_min_size(Pos2::ZERO, egui::vec2(width as f32, height as f32));
    let info = egui::PaintCallbackInfo {
        viewport,
        clip_rect: viewport,
        pixels_per_point: 1.0,
        screen_size_px: [width, height],
    };
    on_screen.paint(info, &mut pass, &resources);
    drop(pass);
    queue.submit([encoder.finish()]);
    read(window, &target)
}

/// A picture with borders, transparent parts and every brightness.
fn checkered(size: [u32; 2]) -> Image {
    let mut image = Image { width: size[0], height: size[1], ..Image::default() };
    image.pixels = (0..size[0] * size[1])
        .map(|at| {
            let random = at.wrapping_add(1).wrapping_mul(0x9E37_79B9).rotate_left(at % 32).to_le_bytes();
            [random[0], random[1], random[2], if random[3] < 64 { 0 } else { random[3] | 0x80 }]
        })
        .collect();
    image
}

#[test]
fn a_supersampled_texture_is_averaged_as_in_memory() {
    let formats = [wgpu::TextureFormat::Rgba8Unorm, wgpu::TextureFormat::Rgba8UnormSrgb];
    for window in formats.into_iter().filter_map(window_device) {
        let size = [74, 46];
        for supersample in [1, 2, 3] {
            let image = checkered(size.map(|side| supersample * side));
            let texture = OnScreen::new_texture(&window.device, window.format, &image);
            let layout =
                wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * image.width), rows_per_image: None };
            let bytes = image.pixels.as_flattened();
            window.queue.write_texture(texture.as_image_copy(), bytes, layout, texture.size());
            let there = Pixels::Texture { texture: Arc::new(texture), supersample };
            let here = Pixels::Image(Arc::new(image.averaged(supersample)));
            let [there, here] = [there, here].map(|pixels| drawn(&window, pixels, size));
            let apart = there.pixels.as_flattened().iter().zip(here.pixels.as_flattened());
            let most = apart.map(|(one, other)| one.abs_diff(*other)).max();
            assert!(most <= Some(1), "{most:?} steps apart, {supersample} times, {:?}", window.format);
            let colors: std::collections::HashSet<_> = here.pixels.iter().collect();
            assert!(colors.len() > 1000, "the picture is there: {} colours", colors.len());
        }
    }
}

#[test]
fn pictures_stay_on_the_device_of_the_window() {
    let Some(device) = window_device(wgpu::TextureFormat::Rgba8Unorm) else { return };
    let mut window = Window::sharing(device.clone(), &[STATUE]);
    let shown = at_rest(&mut window);
    let shot = window.app().view.shot.as_ref().expect("there is a picture");
    assert!(matches!(shot.pixels, Pixels::Texture { supersample: 2, .. }), "{:?}", shot.pixels);
    assert!(shot.timings.frame > 0.0 && shot.counts.covered > 1000, "times and counts come all the same");
    let mut settings = window.app().view.look.settings.clone();
    settings.shading.legend = false;
    settings.shading.exposure.get_or_insert(usual_exposure(&shot.shown.cloud));
    let mut renderer = Renderer::with_device(device.device, device.queue).expect("a renderer");
    let size = shot.size.map(|side| 2 * side);
    let frame = renderer.render(&shot.shown.cloud, &shot.camera, size, &settings).expect("a picture");
    assert!(shown.pixels == frame.image.averaged(2).pixels, "it is the one that was rendered larger");

    window.key(CTRL, Key::A);
    let tinted = at_rest(&mut window);
    let shot = window.app().view.shot.as_ref().expect("there is a picture");
    assert!(matches!(shot.pixels, Pixels::Image(_)), "what is selected is tinted in memory");
    assert!(tinted.pixels != shown.pixels, "and it is");
}

#[test]
fn moving_pictures_stay_there_too() {
    let Some(device) = window_device(wgpu::TextureFormat::Rgba8Unorm) else { return };
    let mut window = Window::sharing(device, &[STATUE]);
    window.settle();
    let place = window.place(0.5, 0.42);
    window.event(Event::PointerMoved(place));
    for _ in 0..8 {
        let before = window.app().view.shot.as_ref().expect("there is a picture").camera;
        window.wheel(1, 2.0);
        window.until("a picture of the moving view", |window| {
            let shot = window.app().view.shot.as_ref().filter(|shot| shot.camera != before);
            shot.is_some_and(|shot| matches!(shot.pixels, Pixels::Texture { .. }))
        });
    }
    at_rest(&mut window);
}
