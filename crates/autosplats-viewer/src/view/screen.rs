//! Draws the picture into the window by a pass of its own, which reads one texture once per pixel. egui's own image
//! drawing takes several times as long, which counts where the CPU draws the window.

use autosplats::Image;
use eframe::egui_wgpu::{CallbackResources, CallbackTrait, ScreenDescriptor};
use eframe::wgpu::util::DeviceExt as _;
use eframe::{egui, wgpu};

use super::{Pixels, WindowDevice};

/// A picture to draw.
pub(crate) struct OnScreen {
    pub(crate) pixels: Pixels,
    /// Whether to enlarge without blending.
    pub(crate) sharp: bool,
    /// Pixel format of the window.
    pub(crate) format: wgpu::TextureFormat,
}

/// What the device keeps of the last picture.
struct Screen {
    pipeline: wgpu::RenderPipeline,
    texture: wgpu::Texture,
    bindings: wgpu::BindGroup,
    pixels: Pixels,
    sharp: bool,
}

impl CallbackTrait for OnScreen {
    fn prepare(
        &self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        _screen: &ScreenDescriptor,
        _encoder: &mut wgpu::CommandEncoder,
        resources: &mut CallbackResources,
    ) -> Vec<wgpu::CommandBuffer> {
        let screen = match resources.remove::<Screen>() {
            Some(screen) if screen.pixels.are(&self.pixels) && screen.sharp == self.sharp => screen,
            screen => {
                let screen = match screen {
                    Some(screen) if screen.has_room_for(self) => Screen { pixels: self.pixels.clone(), ..screen },
                    Some(screen) => self.new_screen(device, screen.pipeline),
                    None => self.new_screen(device, pipeline(device, self.format)),
                };
                screen.upload(queue);
                screen
            }
        };
        resources.insert(screen);
        Vec::new()
    }

    fn paint(
        &self,
        _info: egui::PaintCallbackInfo,
        pass: &mut wgpu::RenderPass<'static>,
        resources: &CallbackResources,
    ) {
        let Some(screen) = resources.get::<Screen>() else { return };
        pass.set_pipeline(&screen.pipeline);
        pass.set_bind_group(0, &screen.bindings, &[]);
        pass.draw(0..3, 0..1);
    }
}

impl OnScreen {
    /// A texture for a picture in memory, in a window of this format.
    pub(crate) fn new_texture(device: &wgpu::Device, format: wgpu::TextureFormat, image: &Image) -> wgpu::Texture {
        device.create_texture(&wgpu::TextureDescriptor {
            label: Some("picture"),
            size: wgpu::Extent3d { width: image.width, height: image.height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: WindowDevice::texture_format(format),
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        })
    }

    fn new_screen(&self, device: &wgpu::Device, pipeline: wgpu::RenderPipeline) -> Screen {
        let (texture, supersample) = match &self.pixels {
            Pixels::Texture { texture, supersample } => (wgpu::Texture::clone(texture), *supersample),
            Pixels::Image(image) => (Self::new_texture(device, self.format, image), 1),
        };
        let filter = if self.sharp { wgpu::FilterMode::Nearest } else { wgpu::FilterMode::Linear };
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("picture"),
            mag_filter: filter,
            min_filter: filter,
            ..Default::default()
        });
        // `Reading` of `screen.wgsl`.
        let reading = [supersample, u32::from(!texture.format().is_srgb())].map(u32::to_ne_bytes);
        let reading = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("picture"),
            contents: reading.as_flattened(),
            usage: wgpu::BufferUsages::UNIFORM,
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("picture"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&view) },
                wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::Sampler(&sampler) },
                wgpu::BindGroupEntry { binding: 2, resource: reading.as_entire_binding() },
            ],
        });
        Screen { pipeline, texture, bindings, pixels: self.pixels.clone(), sharp: self.sharp }
    }
}

impl Screen {
    /// Whether the texture is this object's own and takes the picture.
    fn has_room_for(&self, next: &OnScreen) -> bool {
        let (Pixels::Image(old), Pixels::Image(new)) = (&self.pixels, &next.pixels) else { return false };
        [old.width, old.height] == [new.width, new.height] && self.sharp == next.sharp
    }

    /// Writes a picture in memory into the texture.
    fn upload(&self, queue: &wgpu::Queue) {
        let Pixels::Image(image) = &self.pixels else { return };
        let layout =
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * image.width), rows_per_image: None };
        queue.write_texture(self.texture.as_image_copy(), image.pixels.as_flattened(), layout, self.texture.size());
    }
}

fn pipeline(device: &wgpu::Device, format: wgpu::TextureFormat) -> wgpu::RenderPipeline {
    let module = device.create_shader_module(wgpu::include_wgsl!("screen.wgsl"));
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("picture"),
        layout: None,
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("corner"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("pixel"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(format.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}
