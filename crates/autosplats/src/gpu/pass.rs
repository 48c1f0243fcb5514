//! A pass: one WGSL file made into a compute pipeline. Passes that draw are in `raster.rs`.

use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::PoisonError;

use wgpu::naga;

use super::raster::Raster;
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

/// The compute passes that a device has compiled. Constants are settings with few values, so their number is bounded.
pub(super) type CompiledPasses = HashMap<PassKey, Pass>;

/// What a pass is compiled from: its code before linking, and the values of its overrides, as bits.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct PassKey {
    path: &'static str,
    source: &'static str,
    constants: Vec<(String, u64)>,
}

/// A compute pipeline with the layout of its bindings.
#[derive(Clone, Debug)]
pub(crate) struct Pass {
    path: &'static str,
    label: String,
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
}

impl Pass {
    /// Compiles a pass; `constants` are values of its overrides.
    ///
    /// # Errors
    /// [`Error::Device`] if the device lacks a feature or refuses the shader.
    pub(crate) fn new(gpu: &Gpu, source: &PassSource, constants: &[(&str, f64)]) -> Result<Self, Error> {
        let constant = |&(name, value): &(&str, f64)| (name.to_owned(), value.to_bits());
        let key =
            PassKey { source: source.source, path: source.path, constants: constants.iter().map(constant).collect() };
        let lock = || gpu.compiled.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(pass) = lock().get(&key) {
            gpu.check_lost()?;
            return Ok(pass.clone());
        }
        let pass = Self::compile(gpu, source, constants)?;
        lock().insert(key, pass.clone());
        Ok(pass)
    }

    fn compile(gpu: &Gpu, source: &PassSource, constants: &[(&str, f64)]) -> Result<Self, Error> {
        let LinkedSource { label, module, entries } = LinkedSource::new(gpu, source, wgpu::ShaderStages::COMPUTE)?;
        gpu.checked(|| {
            let made = PipelineParts::new(gpu, &label, module, &entries);
            let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(&label),
                layout: Some(&made.pipeline_layout),
                module: &made.shader,
                entry_point: Some(source.entry_point()),
                compilation_options: compilation_options(constants),
                cache: None,
            });
            Self { path: source.path, label: label.clone(), pipeline, layout: made.layout }
        })
    }

    /// Binds the pass to buffers, in the order of their binding numbers, to run in `groups` workgroups.
    pub(crate) fn step(&self, gpu: &Gpu, buffers: &[&wgpu::Buffer], groups: impl Into<Groups>) -> Step {
        let resources: Vec<_> = buffers.iter().map(|buffer| buffer.as_entire_binding()).collect();
        self.step_with(gpu, &resources, groups)
    }

    /// Binds the pass to buffers and textures, as [`step`](Self::step) does.
    pub(crate) fn step_with(
        &self,
        gpu: &Gpu,
        resources: &[wgpu::BindingResource<'_>],
        groups: impl Into<Groups>,
    ) -> Step {
        let work = StepWork::Compute {
            pipeline: self.pipeline.clone(),
            bindings: bind(gpu, &self.label, &self.layout, resources),
            groups: groups.into(),
        };
        Step { path: self.path, label: self.label.clone(), work }
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
        let shader = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label,
            source: wgpu::ShaderSource::Naga(Cow::Owned(module)),
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        Self { layout, shader, pipeline_layout }
    }
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

/// Number of workgroups of a step.
#[derive(Clone, Debug)]
pub(crate) enum Groups {
    /// A fixed number.
    Number(u32),
    /// The arguments of an indirect dispatch, in a buffer at this byte.
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
    pub(super) work: StepWork,
}

/// The work of a step.
#[derive(Clone, Debug)]
pub(super) enum StepWork {
    Compute { pipeline: wgpu::ComputePipeline, bindings: wgpu::BindGroup, groups: Groups },
    Raster(Raster),
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

#[cfg(test)]
mod tests {
    use super::super::test_gpu;
    use super::*;

    #[test]
    fn a_pass_is_compiled_once_for_each_set_of_constants() {
        const LIBRARY: Library = Library { files: &[], constants: &[] };
        const CODE: &str = "override STEP: u32 = 1u;\n@group(0) @binding(0) var<storage, read_write> x: array<u32>;\n\
                            @compute @workgroup_size(1) fn count() { x[0] += STEP; }";
        const OTHER: &str = "@group(0) @binding(0) var<storage, read_write> x: array<u32>;\n\
                             @compute @workgroup_size(1) fn count() { x[0] += 3u; }";
        let Some(gpu) = test_gpu() else { return };
        let pass = |code, constants: &[(&str, f64)]| {
            let source = PassSource { path: "count", source: code, needs: wgpu::Features::empty(), library: &LIBRARY };
            Pass::new(&gpu, &source, constants).expect("a pass").pipeline
        };
        let first = pass(CODE, &[("STEP", 1.0)]);
        assert_eq!(first, pass(CODE, &[("STEP", 1.0)]), "the same pass");
        assert_ne!(first, pass(CODE, &[("STEP", 2.0)]), "another constant");
        assert_ne!(first, pass(OTHER, &[]), "another source of the same name");
    }
}
