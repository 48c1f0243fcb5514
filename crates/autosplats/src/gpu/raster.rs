//! Passes that draw: one WGSL file made into a render pipeline.

use super::Gpu;
use super::source::{LinkedSource, PassSource, PipelineParts, bind, compilation_options};
use crate::Error;

/// Format of all colour targets: four numbers per pixel.
const COLOR_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;
const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// How drawn values combine with stored ones, in colour and alpha.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Target {
    Replace,
    /// Sums in all channels.
    Add,
    /// Sums in colour, maximum in alpha.
    AddAndMax,
}

impl Target {
    fn blend(self) -> Option<wgpu::BlendState> {
        let blend = |operation| wgpu::BlendComponent {
            src_factor: wgpu::BlendFactor::One,
            dst_factor: wgpu::BlendFactor::One,
            operation,
        };
        let [add, max] = [wgpu::BlendOperation::Add, wgpu::BlendOperation::Max].map(blend);
        match self {
            Self::Replace => None,
            Self::Add => Some(wgpu::BlendState { color: add, alpha: add }),
            Self::AddAndMax => Some(wgpu::BlendState { color: add, alpha: max }),
        }
    }
}

/// How a pass uses the depth buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DepthMask {
    /// Writes the drawn depth.
    Write,
    /// Draws where the fragment is further away than the stored depth, and keeps that depth.
    Greater,
}

/// Content of a texture when drawing begins.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Load {
    /// The former content.
    Kept,
    /// One value everywhere.
    Cleared([f64; 4]),
}

/// A render pipeline with the layout of its bindings.
#[derive(Debug)]
pub(crate) struct RasterPass {
    path: &'static str,
    label: String,
    pipeline: wgpu::RenderPipeline,
    layout: wgpu::BindGroupLayout,
}

/// A pass bound to its resources. A buffer holds the number of vertices.
#[derive(Clone, Debug)]
pub(crate) struct Draw {
    pub(super) path: &'static str,
    pub(super) label: String,
    pipeline: wgpu::RenderPipeline,
    bindings: wgpu::BindGroup,
    arguments: wgpu::Buffer,
    at: u64,
}

/// The targets of a step.
#[derive(Clone, Debug)]
pub(crate) struct Targets {
    pub(crate) colors: Vec<(wgpu::TextureView, Load)>,
    pub(crate) depth: wgpu::TextureView,
    /// Depth everywhere before drawing; `None` if depths are only read.
    pub(crate) clear_depth: Option<f32>,
}

/// A step that draws.
#[derive(Clone, Debug)]
pub(super) struct Raster {
    pub(super) targets: Targets,
    pub(super) draws: Vec<Draw>,
}

impl RasterPass {
    /// Compiles a pass that draws triangles into `targets`; `constants` are values of its overrides.
    ///
    /// # Errors
    /// [`Error::Device`] if the device lacks a feature or refuses the shader.
    pub(crate) fn new(
        gpu: &Gpu,
        source: &PassSource,
        constants: &[(&str, f64)],
        targets: &[Target],
        depth: DepthMask,
    ) -> Result<Self, Error> {
        let LinkedSource { label, module, entries } =
            LinkedSource::new(gpu, source, wgpu::ShaderStages::VERTEX_FRAGMENT)?;
        let targets: Vec<_> = targets
            .iter()
            .map(|target| {
                let write_mask = wgpu::ColorWrites::ALL;
                Some(wgpu::ColorTargetState { format: COLOR_FORMAT, blend: target.blend(), write_mask })
            })
            .collect();
        let [vertex, fragment] = ["vertex", "fragment"].map(|stage| format!("{}_{stage}", source.entry_point()));
        gpu.checked(|| {
            let made = PipelineParts::new(gpu, &label, module, &entries);
            let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(&label),
                layout: Some(&made.pipeline_layout),
                vertex: wgpu::VertexState {
                    module: &made.shader,
                    entry_point: Some(&vertex),
                    compilation_options: compilation_options(constants),
                    buffers: &[],
                },
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil: Some(wgpu::DepthStencilState {
                    format: DEPTH_FORMAT,
                    depth_write_enabled: Some(depth == DepthMask::Write),
                    depth_compare: Some(match depth {
                        DepthMask::Write => wgpu::CompareFunction::Always,
                        DepthMask::Greater => wgpu::CompareFunction::Greater,
                    }),
                    stencil: wgpu::StencilState::default(),
                    bias: wgpu::DepthBiasState::default(),
                }),
                multisample: wgpu::MultisampleState::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &made.shader,
                    entry_point: Some(&fragment),
                    compilation_options: compilation_options(constants),
                    targets: &targets,
                }),
                multiview_mask: None,
                cache: gpu.pipelines.as_ref().map(|pipelines| pipelines.cache()),
            });
            Self { path: source.path, label: label.clone(), pipeline, layout: made.layout }
        })
    }

    /// Binds the pass to resources, in the order of binding numbers. `arguments` has the draw's arguments at byte `at`.
    pub(crate) fn draw(
        &self,
        gpu: &Gpu,
        resources: &[wgpu::BindingResource<'_>],
        arguments: &wgpu::Buffer,
        at: u64,
    ) -> Draw {
        Draw {
            path: self.path,
            label: self.label.clone(),
            pipeline: self.pipeline.clone(),
            bindings: bind(gpu, &self.label, &self.layout, resources),
            arguments: arguments.clone(),
            at,
        }
    }
}

impl Raster {
    pub(super) fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        label: Option<&str>,
        timestamp_writes: Option<wgpu::RenderPassTimestampWrites<'_>>,
    ) {
        let Targets { colors, depth, clear_depth } = &self.targets;
        let colors: Vec<_> = colors
            .iter()
            .map(|(view, load)| {
                let load = match *load {
                    Load::Kept => wgpu::LoadOp::Load,
                    Load::Cleared([r, g, b, a]) => wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a }),
                };
                let ops = wgpu::Operations { load, store: wgpu::StoreOp::Store };
                Some(wgpu::RenderPassColorAttachment { view, depth_slice: None, resolve_target: None, ops })
            })
            .collect();
        let depth_ops =
            clear_depth.map(|depth| wgpu::Operations { load: wgpu::LoadOp::Clear(depth), store: wgpu::StoreOp::Store });
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label,
            color_attachments: &colors,
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: depth,
                depth_ops,
                stencil_ops: None,
            }),
            timestamp_writes,
            occlusion_query_set: None,
            multiview_mask: None,
        });
        for draw in &self.draws {
            pass.set_pipeline(&draw.pipeline);
            pass.set_bind_group(0, &draw.bindings, &[]);
            pass.draw_indirect(&draw.arguments, draw.at);
        }
    }
}
