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

/// What a stage of a frame asks of the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct StageWork {
    /// The stage, such as `project`.
    pub stage: &'static str,
    /// Number of dispatches.
    pub dispatches: usize,
    /// Bytes of all buffers that the dispatches bind, twice where they may write them. A dispatch that reads nothing
    /// twice, past the caches, moves as much at most. Buffers have room for the worst case, so it mostly moves less.
    pub bound_bytes: u64,
}

impl StageWork {
    /// The work of each stage that has steps which compute, in the order of the stages' first steps.
    pub(crate) fn of(steps: &[Step]) -> Vec<Self> {
        let mut all: Vec<Self> = Vec::new();
        for step in steps.iter().filter(|step| step.groups().is_some()) {
            let stage = step.stage();
            let at = all.iter().position(|work| work.stage == stage).unwrap_or_else(|| {
                all.push(Self { stage, dispatches: 0, bound_bytes: 0 });
                all.len() - 1
            });
            let bytes = |(buffer, writes): &(wgpu::Buffer, bool)| buffer.size() * if *writes { 2 } else { 1 };
            all[at].dispatches += 1;
            all[at].bound_bytes += step.uses.iter().map(bytes).sum::<u64>();
        }
        all
    }
}

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
            uses: Vec::new(),
        }
    }
}
