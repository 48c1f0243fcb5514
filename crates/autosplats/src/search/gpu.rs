//! The search engines on the GPU, behind one interface.

use std::fmt::Debug;

use super::kd_tree::gpu::KdTreePasses;
use super::screen_grid::gpu::SearchPasses;
use super::splat_communication::gpu::CommunicationPasses;
use super::{SearchEngine, splat_communication};
use crate::Error;
use crate::gpu::{File, Gpu, Step, files};
use crate::project::DeviceCloud;
use crate::project::gpu::{Round, ScreenBuffers};

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
    /// Bits of a k-radius for each pixel of the last frame, 0 for none. Valid only if `frame` describes that frame.
    pub(crate) past: &'a wgpu::Buffer,
}

/// The compiled passes of an engine, for one k.
pub(crate) trait EnginePasses: Debug + Send {
    /// Allocates the engine's own buffers and returns the steps of each [`Round`].
    ///
    /// # Errors
    /// [`Error::DeviceLimit`] or [`Error::DeviceMemory`] if the device has too little.
    fn steps(&self, gpu: &Gpu, buffers: SearchBuffers<'_>) -> Result<EngineSteps, Error>;
}

/// The work of an engine in a frame.
#[derive(Debug)]
pub(crate) struct EngineSteps {
    /// The steps of each [`Round`].
    pub(crate) rounds: [Vec<Step>; 2],
    /// For an engine that iterates: per round, the unconverged points before the first iteration and after each.
    pub(crate) convergence: Option<wgpu::Buffer>,
}

/// Sums the unconverged points of both rounds, before the first iteration and after each, without the constant end.
pub(crate) fn convergence(runs: &[u32]) -> Vec<u32> {
    let (active, recovered) = runs.split_at(runs.len() / 2);
    let mut curve: Vec<u32> = active.iter().zip(recovered).map(|(a, b)| a + b).collect();
    // After the last iteration the numbers stay the same.
    while let [.., before, last] = curve[..]
        && before == last
    {
        curve.pop();
    }
    curve
}

/// Checks whether the device can run an engine, before anything is compiled.
///
/// # Errors
/// [`Error::Device`] if the device cannot run it.
pub(crate) fn check_engine(gpu: &Gpu, engine: SearchEngine) -> Result<(), Error> {
    match engine {
        SearchEngine::SplatCommunication => splat_communication::gpu::check(gpu),
        SearchEngine::ScreenGrid | SearchEngine::KdTree { .. } => Ok(()),
    }
}

/// Compiles the passes of an engine.
///
/// # Errors
/// [`Error::Device`] if the device cannot run it.
pub(crate) fn compile(gpu: &Gpu, engine: SearchEngine, k: u32) -> Result<Box<dyn EnginePasses>, Error> {
    match engine {
        SearchEngine::ScreenGrid => Ok(Box::new(SearchPasses::new(gpu, k)?)),
        SearchEngine::SplatCommunication => Ok(Box::new(CommunicationPasses::new(gpu)?)),
        SearchEngine::KdTree { .. } => Ok(Box::new(KdTreePasses::new(gpu)?)),
    }
}

impl EnginePasses for SearchPasses {
    fn steps(&self, gpu: &Gpu, buffers: SearchBuffers<'_>) -> Result<EngineSteps, Error> {
        let SearchBuffers { frame, screen, neighborhoods, past, .. } = buffers;
        let round = |round| self.steps(gpu, frame, screen, neighborhoods, past, round);
        Ok(EngineSteps { rounds: [Round::Active, Round::Recovered].map(round), convergence: None })
    }
}
