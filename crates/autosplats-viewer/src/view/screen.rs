//! Draws the picture into the window by a pass of its own, which reads one texture once per pixel. egui's own image
//! drawing takes several times as long, which counts where the CPU draws the window.

use std::sync::Arc;

use autosplats::Image;
use eframe::egui_wgpu::{CallbackResources, CallbackTrait, ScreenDescriptor};
use eframe::{egui, wgpu};

/// A picture to draw.
pub(crate) struct OnScreen {
    pub(crate) image: Arc<Image>,
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
    image: Arc<Image>,
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
        let size = |image: &Image| [image.width, image.height];
        let screen = match resources.remove::<Screen>() {
            Some(screen) if Arc::ptr_eq(&screen.image, &self.image) => screen,
            Some(mut screen) if size(&screen.image) == size(&self.image) && screen.sharp == self.sharp => {
                screen.image = Arc::clone(&self.image);
                screen.upload(queue);
                screen
            }
            screen => {
                let pipeline = screen.map_or_else(|| pipeline(device, self.format), |screen| screen.pipeline);
                let screen = self.new_screen(device, pipeline);
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
    fn new_screen(&self, device: &wgpu::Device, pipeline: wgpu::RenderPipeline) -> Screen {
        let Image { width, height, .. } = *self.image;
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("picture"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            // An sRGB window converts linear values on output, so the texture converts on input.
            format: if self.format.is_srgb() {
                wgpu::TextureFormat::Rgba8UnormSrgb
            } else {
                wgpu::TextureFormat::Rgba8Unorm
            },
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let filter = if self.sharp { wgpu::FilterMode::Nearest } else { wgpu::FilterMode::Linear };
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("picture"),
            mag_filter: filter,
            min_filter: filter,
            ..Default::default()
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("picture"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&view) },
                wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::Sampler(&sampler) },
            ],
        });
        Screen { pipeline, texture, bindings, image: Arc::clone(&self.image), sharp: self.sharp }
    }
}

impl Screen {
    fn upload(&self, queue: &wgpu::Queue) {
        let layout =
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * self.image.width), rows_per_image: None };
        queue.write_texture(
            self.texture.as_image_copy(),
            self.image.pixels.as_flattened(),
            layout,
            self.texture.size(),
        );
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
