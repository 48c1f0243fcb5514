//! WGSL files made ready for a device: linked, parsed, with their bindings.

use std::borrow::Cow;

use wgpu::naga;

use super::{Gpu, Library, link};
use crate::Error;

/// The source of a pass.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PassSource {
    /// Folder and file name without ending: `project/compact`. The entry point has the file's name. A raster pass has
    /// two, with the stage appended: `gather_vertex`, `gather_fragment`.
    pub(crate) path: &'static str,
    pub(crate) source: &'static str,
    /// Features of the shader beyond WebGPU's core.
    pub(crate) needs: wgpu::Features,
    /// Its imports and constants.
    pub(crate) library: &'static Library,
}

/// The passes of a stage: its folder, its [`Library`], and for each pass the file and the features that it needs.
/// Defines a [`PassSource`] for each, and `PASSES` for tests.
macro_rules! passes {
    (
        $folder:literal, $library:ident;
        $($vis:vis $name:ident = $file:literal $(needs $needs:expr)?),* $(,)?
    ) => {
        $($vis const $name: $crate::gpu::PassSource = $crate::gpu::PassSource {
            path: concat!($folder, "/", $file),
            source: include_str!(concat!($file, ".wgsl")),
            needs: wgpu::Features::empty()$(.union($needs))?,
            library: &$library,
        };)*
        #[cfg(test)]
        pub(crate) const PASSES: &[$crate::gpu::PassSource] = &[$($name),*];
    };
}
pub(crate) use passes;

impl PassSource {
    pub(crate) fn entry_point(&self) -> &'static str {
        self.path.rsplit('/').next().unwrap_or(self.path)
    }

    /// The linked source, parsed.
    ///
    /// # Panics
    /// If the source is not valid WGSL. All sources are our own.
    pub(crate) fn module(&self) -> naga::Module {
        let source = link(self.source, self.library);
        naga::front::wgsl::parse_str(&source)
            .unwrap_or_else(|error| panic!("{}: {}", self.path, error.emit_to_string(&source)))
    }
}

/// The source of a pass, ready for the device.
pub(super) struct LinkedSource {
    pub(super) label: String,
    pub(super) module: naga::Module,
    pub(super) entries: Vec<wgpu::BindGroupLayoutEntry>,
}

impl LinkedSource {
    /// # Errors
    /// [`Error::Device`] if the device lacks a feature.
    pub(super) fn new(gpu: &Gpu, source: &PassSource, stages: wgpu::ShaderStages) -> Result<Self, Error> {
        let missing = source.needs - gpu.device.features();
        if !missing.is_empty() {
            return Err(Error::Device(format!("{} needs {missing:?}, which the device was made without", source.path)));
        }
        let label = format!("autosplats.{}", source.path.replace('/', "."));
        let module = source.module();
        let entries = layout_entries(&module, stages);
        Ok(Self { label, module, entries })
    }
}

/// The common parts of compute and render pipelines.
pub(super) struct PipelineParts {
    pub(super) layout: wgpu::BindGroupLayout,
    pub(super) shader: wgpu::ShaderModule,
    pub(super) pipeline_layout: wgpu::PipelineLayout,
}

impl PipelineParts {
    pub(super) fn new(gpu: &Gpu, label: &str, module: naga::Module, entries: &[wgpu::BindGroupLayoutEntry]) -> Self {
        let device = &gpu.device;
        let label = Some(label);
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries });
        let shader = shader_module(
            device,
            wgpu::ShaderModuleDescriptor { label, source: wgpu::ShaderSource::Naga(Cow::Owned(module)) },
        );
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        Self { layout, shader, pipeline_layout }
    }
}

/// A shader module without the counter that wgpu gives each loop to end it after 2⁶⁴ rounds: several instructions a
/// round, which also keep drivers from unrolling loops of a known length. Accesses out of bounds stay harmless.
#[allow(unsafe_code, reason = "all sources are our own, and all of their loops end, whatever they read")]
fn shader_module(device: &wgpu::Device, descriptor: wgpu::ShaderModuleDescriptor<'_>) -> wgpu::ShaderModule {
    let checks = wgpu::ShaderRuntimeChecks { force_loop_bounding: false, ..wgpu::ShaderRuntimeChecks::checked() };
    // SAFETY: the one check that is left out is of loops that do not end, and there are none.
    unsafe { device.create_shader_module_trusted(descriptor, checks) }
}

/// Zeroing is off, as passes write workgroup memory before they read it.
pub(super) fn compilation_options<'a>(constants: &'a [(&'a str, f64)]) -> wgpu::PipelineCompilationOptions<'a> {
    wgpu::PipelineCompilationOptions { constants, zero_initialize_workgroup_memory: false }
}

/// Binds resources in the order of their binding numbers.
pub(super) fn bind(
    gpu: &Gpu,
    label: &str,
    layout: &wgpu::BindGroupLayout,
    resources: &[wgpu::BindingResource<'_>],
) -> wgpu::BindGroup {
    let entries: Vec<_> = (0..)
        .zip(resources)
        .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource: resource.clone() })
        .collect();
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries: &entries })
}

/// The layout of all bindings that a module declares, used or not.
fn layout_entries(module: &naga::Module, visibility: wgpu::ShaderStages) -> Vec<wgpu::BindGroupLayoutEntry> {
    let mut entries: Vec<_> = module
        .global_variables
        .iter()
        .filter_map(|(_, variable)| {
            let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
            let ty = match variable.space {
                naga::AddressSpace::Uniform => buffer(wgpu::BufferBindingType::Uniform),
                naga::AddressSpace::Storage { access } => {
                    let read_only = !access.contains(naga::StorageAccess::STORE);
                    buffer(wgpu::BufferBindingType::Storage { read_only })
                }
                // Textures hold numbers, which passes load without filtering.
                naga::AddressSpace::Handle => wgpu::BindingType::Texture {
                    sample_type: wgpu::TextureSampleType::Float { filterable: false },
                    view_dimension: wgpu::TextureViewDimension::D2,
                    multisampled: false,
                },
                _ => return None,
            };
            let binding = variable.binding?.binding;
            Some(wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None })
        })
        .collect();
    entries.sort_by_key(|entry| entry.binding);
    entries
}
