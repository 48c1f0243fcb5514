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
    /// Bound buffers, each with whether the pass may write it.
    #[cfg(test)]
    pub(crate) uses: Vec<(wgpu::Buffer, bool)>,
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
}

#[cfg(test)]
impl Step {
    /// Number of workgroups of a step that computes.
    pub(crate) fn groups(&self) -> Option<&Groups> {
        match &self.work {
            StepWork::Compute { groups, .. } => Some(groups),
            StepWork::Raster(_) => None,
        }
    }
}

impl Step {
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
            #[cfg(test)]
            uses: Vec::new(),
        }
    }
}
