//! A pass that computes: one WGSL file made into a compute pipeline. Passes that draw are in `raster.rs`.

use std::sync::PoisonError;

use rayon::prelude::*;

use super::Gpu;
use super::compiled::{Pass, PassKey};
use super::source::{LinkedSource, PassSource, PipelineParts, bind, compilation_options};
use super::step::{Groups, Step, StepWork, Use};
use crate::Error;

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

    /// Compiles passes side by side.
    ///
    /// # Errors
    /// [`Error::Device`], as [`new`](Self::new).
    pub(crate) fn all<const N: usize>(
        gpu: &Gpu,
        passes: [(&PassSource, &[(&str, f64)]); N],
    ) -> Result<[Self; N], Error> {
        let made = passes.into_par_iter().with_max_len(1).map(|(source, constants)| Self::new(gpu, source, constants));
        Ok(made.collect::<Result<Vec<_>, _>>()?.try_into().expect("a pass of each"))
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
                cache: gpu.pipelines.as_ref().map(|pipelines| pipelines.cache()),
            });
            Self {
                path: source.path,
                label: label.clone(),
                pipeline,
                layout: made.layout,
                writes: entries.iter().map(is_written).collect(),
            }
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
        Step {
            path: self.path,
            label: self.label.clone(),
            work,
            uses: resources.iter().zip(&self.writes).filter_map(use_of).collect(),
        }
    }
}

/// Whether a pass may write a binding.
fn is_written(entry: &wgpu::BindGroupLayoutEntry) -> bool {
    let wgpu::BindingType::Buffer { ty, .. } = entry.ty else { return false };
    ty == wgpu::BufferBindingType::Storage { read_only: false }
}

/// The use of a buffer that is bound; textures are none.
fn use_of((resource, &writes): (&wgpu::BindingResource<'_>, &bool)) -> Option<Use> {
    let wgpu::BindingResource::Buffer(bound) = resource else { return None };
    let bytes = bound.size.map_or_else(|| bound.buffer.size() - bound.offset, u64::from);
    Some(Use { buffer: bound.buffer.clone(), bytes, writes })
}

#[cfg(test)]
mod tests {
    use super::super::{Library, test_gpu};
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
