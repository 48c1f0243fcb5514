//! The interface of the search engines on the GPU, and what several of them share.

use std::fmt::Debug;

use crate::Error;
use crate::gpu::{File, Gpu, Step, files};
use crate::project::DeviceCloud;
use crate::project::gpu::ScreenBuffers;

/// Files that the passes of several engines import.
pub(crate) const IMPORTS: &[File] = files!["gaps", "window"];

/// The buffers that an engine reads and writes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SearchBuffers<'a> {
    /// [`FrameUniform`](crate::gpu::FrameUniform).
    pub(crate) frame: &'a wgpu::Buffer,
    pub(crate) cloud: &'a DeviceCloud,
    pub(crate) screen: &'a ScreenBuffers,
    /// `Neighborhood` of `shared/neighborhood.wgsl` for each query, in query order.
    pub(crate) neighborhoods: &'a wgpu::Buffer,
}

/// The compiled passes of an engine, for one k.
pub(crate) trait EnginePasses: Debug + Send {
    /// Allocates the engine's own buffers and returns the steps of each [`Round`](crate::project::gpu::Round).
    ///
    /// # Errors
    /// [`Error::DeviceLimit`] or [`Error::DeviceMemory`] if the device has too little.
    fn steps(&self, gpu: &Gpu, buffers: SearchBuffers<'_>) -> Result<EngineSteps, Error>;
}

/// The work of an engine in a frame.
#[derive(Debug)]
pub(crate) struct EngineSteps {
    /// The steps of each [`Round`](crate::project::gpu::Round).
    pub(crate) rounds: [Vec<Step>; 2],
    /// For an engine that iterates: per round, the unconverged points before the first iteration and after each.
    pub(crate) convergence: Option<wgpu::Buffer>,
}
