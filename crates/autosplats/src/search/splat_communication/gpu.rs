//! What the two forms of splat communication share on the GPU: limits, amounts of work, and passes that set them.

use bytemuck::{Pod, Zeroable};

use crate::Error;
use crate::gpu::{Constant, File, Gpu, Groups, Library, Pass, Step, constants, files, passes};
use crate::project::gpu::Counter;
use crate::search::MARGIN_PX;
use crate::search::engine::SearchBuffers;

/// Files that passes of both forms import.
pub(super) const IMPORTS: &[File] =
    files!["communication", "counting", "depth_mask", "ending", "first_radius", "radius_search"];
pub(super) const CONSTANTS: &[Constant] = constants![MARGIN_PX, UNCONVERGED = UNCONVERGED as f32];
const LIBRARY: Library = Library { files: &[IMPORTS], constants: &[Counter::CONSTANTS, CONSTANTS] };

passes! {
    "search/splat_communication", LIBRARY;
    BEGIN = "begin",
    DECIDE = "decide",
}

/// Most iterations. A bracket between equal distances takes about fourteen to shrink to the precision of floats.
pub(crate) const ITERATIONS: usize = 16;
/// Fraction of the points that need not converge: 1 - t_conv [Paper, §5.2].
pub(crate) const UNCONVERGED: f64 = 0.001;

/// Arguments of an indirect draw.
type DrawArguments = [u32; 4];

/// Arguments of all draws and dispatches, laid out as in `imports/communication.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Arguments {
    pub(crate) points: DrawArguments,
    pub(crate) queries: DrawArguments,
    pub(crate) clear: DrawArguments,
    pub(crate) boxes: DrawArguments,
    pub(crate) last_clear: DrawArguments,
    pub(crate) last_boxes: DrawArguments,
    pub(crate) queries_groups: [u32; 3],
    pub(crate) iterations: u32,
    pub(crate) points_groups: [u32; 3],
    pub(crate) padding: u32,
}

/// Byte offset of the arguments of a draw or dispatch.
macro_rules! at {
    ($field:ident) => {
        std::mem::offset_of!($crate::search::splat_communication::gpu::Arguments, $field) as u64
    };
}
pub(super) use at;

/// How far the iterations are.
#[derive(Debug)]
pub(super) struct Progress {
    /// [`Arguments`].
    pub(super) arguments: wgpu::Buffer,
    /// Unconverged queries of each round, before the first iteration and after each.
    pub(super) convergence: wgpu::Buffer,
}

impl Progress {
    /// # Errors
    /// [`Error::DeviceMemory`].
    pub(super) fn new(gpu: &Gpu) -> Result<Self, Error> {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::INDIRECT;
        Ok(Self {
            arguments: gpu.buffer("arguments of splats", size_of::<Arguments>() as u64, usage)?,
            convergence: gpu.storage::<u32>("convergence", 2 * (ITERATIONS + 1))?,
        })
    }

    /// Workgroups that take the queries of a round, until the iterations end.
    pub(super) fn queries_groups(&self) -> Groups {
        Groups::Counted(self.arguments.clone(), at!(queries_groups))
    }

    /// Workgroups that take all screen points, until the iterations end.
    pub(super) fn points_groups(&self) -> Groups {
        Groups::Counted(self.arguments.clone(), at!(points_groups))
    }
}

/// The passes that begin and end iterations.
#[derive(Debug)]
pub(super) struct ProgressPasses {
    begin: Pass,
    decide: Pass,
}

impl ProgressPasses {
    /// # Errors
    /// [`Error::Device`].
    pub(super) fn new(gpu: &Gpu) -> Result<Self, Error> {
        let pass = |source| Pass::new(gpu, source, &[]);
        Ok(Self { begin: pass(&BEGIN)?, decide: pass(&DECIDE)? })
    }

    /// The step before the first iteration.
    pub(super) fn begin(&self, gpu: &Gpu, buffers: SearchBuffers<'_>, progress: &Progress) -> Step {
        self.begin.step(gpu, &bound(buffers, progress), 1)
    }

    /// The step after each iteration.
    pub(super) fn decide(&self, gpu: &Gpu, buffers: SearchBuffers<'_>, progress: &Progress) -> Step {
        self.decide.step(gpu, &bound(buffers, progress), 1)
    }
}

fn bound<'a>(buffers: SearchBuffers<'a>, progress: &'a Progress) -> [&'a wgpu::Buffer; 4] {
    [buffers.frame, &buffers.screen.counters, &progress.arguments, &progress.convergence]
}
