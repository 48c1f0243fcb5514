//! Steps: passes bound to what they read and write.

use super::raster::{Draw, Raster, Targets};

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
    /// The buffers that a pass which computes binds.
    pub(super) uses: Vec<Use>,
}

/// A buffer that a step binds.
#[derive(Clone, Debug)]
pub(super) struct Use {
    pub(super) buffer: wgpu::Buffer,
    /// Bytes of it that are bound.
    pub(super) bytes: u64,
    /// Whether the pass may write it. It may read it in any case.
    pub(super) writes: bool,
}

/// The work of a step.
#[derive(Clone, Debug)]
pub(super) enum StepWork {
    Compute { pipeline: wgpu::ComputePipeline, bindings: wgpu::BindGroup, groups: Groups },
    Raster(Raster),
}

impl Step {
    /// The stage of the pass: the first folder of its path.
    pub(super) fn stage(&self) -> &'static str {
        self.path.split('/').next().unwrap_or(self.path)
    }

    /// Number of workgroups of a step that computes.
    pub(crate) fn groups(&self) -> Option<&Groups> {
        match &self.work {
            StepWork::Compute { groups, .. } => Some(groups),
            StepWork::Raster(_) => None,
        }
    }

    /// Draws in this order, as one step with the name of the last draw.
    ///
    /// # Panics
    /// If there is nothing to draw.
    pub(crate) fn draw(targets: Targets, draws: Vec<Draw>) -> Self {
        let [.., last] = &draws[..] else { panic!("a step that draws nothing") };
        Self {
            path: last.path,
            label: last.label.clone(),
            work: StepWork::Raster(Raster { targets, draws }),
            uses: Vec::new(),
        }
    }
}
