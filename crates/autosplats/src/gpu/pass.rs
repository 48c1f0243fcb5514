//! A pass: one WGSL file made into a pipeline.

use std::borrow::Cow;

use wgpu::naga;

use super::{Gpu, link::link};
use crate::Error;

/// Where the code of a pass is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PassSource {
    /// Folder and file name without its ending: `project/compact`. The entry point has the file's name.
    pub(crate) path: &'static str,
    pub(crate) source: &'static str,
    /// What the shader uses beyond WebGPU's core.
    pub(crate) needs: wgpu::Features,
}

impl PassSource {
    /// A pass that runs on every WebGPU device.
    pub(crate) const fn new(path: &'static str, source: &'static str) -> Self {
        Self { path, source, needs: wgpu::Features::empty() }
    }

    pub(crate) fn entry_point(&self) -> &'static str {
        self.path.rsplit('/').next().unwrap_or(self.path)
    }

    /// The linked source, parsed.
    ///
    /// # Panics
    /// If it is not WGSL: sources are our own.
    pub(crate) fn module(&self) -> naga::Module {
        let source = link(self.source);
        naga::front::wgsl::parse_str(&source)
            .unwrap_or_else(|error| panic!("{}: {}", self.path, error.emit_to_string(&source)))
    }
}

/// A compute pipeline with the layout of what it is bound to.
#[derive(Debug)]
pub(crate) struct Pass {
    path: &'static str,
    label: String,
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
}

impl Pass {
    /// Compiles a pass; `constants` are its overrides.
    ///
    /// # Errors
    /// [`Error::Device`] if the device lacks a feature or refuses the shader.
    pub(crate) fn new(gpu: &Gpu, source: &PassSource, constants: &[(&str, f64)]) -> Result<Self, Error> {
        let missing = source.needs - gpu.device.features();
        if !missing.is_empty() {
            return Err(Error::Device(format!("{} needs {missing:?}, which the device was made without", source.path)));
        }
        let label = format!("autosplats.{}", source.path.replace('/', "."));
        let module = source.module();
        let entries = layout_entries(&module);
        gpu.checked(|| {
            let device = &gpu.device;
            let layout = device
                .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(&label), entries: &entries });
            let shader = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(&label),
                source: wgpu::ShaderSource::Naga(Cow::Owned(module)),
            });
            let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(&label),
                bind_group_layouts: &[Some(&layout)],
                immediate_size: 0,
            });
            let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(&label),
                layout: Some(&pipeline_layout),
                module: &shader,
                entry_point: Some(source.entry_point()),
                // Buffers are ours and sized by us; workgroup memory is written before it is read.
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants,
                    zero_initialize_workgroup_memory: false,
                },
                cache: None,
            });
            Self { path: source.path, label: label.clone(), pipeline, layout }
        })
    }

    /// The pass bound to buffers, in the order of their binding numbers, to run in `groups` workgroups.
    pub(crate) fn step(&self, gpu: &Gpu, buffers: &[&wgpu::Buffer], groups: impl Into<Groups>) -> Step {
        let entries: Vec<_> = (0..)
            .zip(buffers)
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let bindings = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(&self.label),
            layout: &self.layout,
            entries: &entries,
        });
        Step {
            path: self.path,
            label: self.label.clone(),
            pipeline: self.pipeline.clone(),
            bindings,
            groups: groups.into(),
        }
    }
}

/// How many workgroups a step has.
#[derive(Clone, Debug)]
pub(crate) enum Groups {
    /// So many.
    Number(u32),
    /// As many as the device wrote into a buffer, in rows as a dispatch has them, at this byte.
    Counted(wgpu::Buffer, u64),
}

impl From<u32> for Groups {
    fn from(number: u32) -> Self {
        Self::Number(number)
    }
}

/// A pass ready to run.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    pub(super) path: &'static str,
    pub(super) label: String,
    pub(super) pipeline: wgpu::ComputePipeline,
    pub(super) bindings: wgpu::BindGroup,
    pub(super) groups: Groups,
}

/// The layout that a module declares, whether or not it uses all of it.
fn layout_entries(module: &naga::Module) -> Vec<wgpu::BindGroupLayoutEntry> {
    let mut entries: Vec<_> = module
        .global_variables
        .iter()
        .filter_map(|(_, variable)| {
            let binding = variable.binding?;
            let ty = match variable.space {
                naga::AddressSpace::Uniform => wgpu::BufferBindingType::Uniform,
                naga::AddressSpace::Storage { access } => {
                    wgpu::BufferBindingType::Storage { read_only: !access.contains(naga::StorageAccess::STORE) }
                }
                _ => return None,
            };
            Some(wgpu::BindGroupLayoutEntry {
                binding: binding.binding,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
                count: None,
            })
        })
        .collect();
    entries.sort_by_key(|entry| entry.binding);
    entries
}
