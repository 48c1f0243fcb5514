//! The engines on the GPU, behind one interface.

use std::fmt::Debug;

use super::kd_tree::gpu::KdTreePasses;
use super::screen_grid::gpu::SearchPasses;
use super::splat_communication::gpu::CommunicationPasses;
use super::{SearchEngine, splat_communication};
use crate::Error;
use crate::gpu::{Gpu, Step};
use crate::project::DeviceCloud;
use crate::project::gpu::{Round, ScreenBuffers};

/// What an engine may read, and where it leaves what it finds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SearchBuffers<'a> {
    /// [`FrameUniform`](crate::gpu::FrameUniform).
    pub(crate) frame: &'a wgpu::Buffer,
    pub(crate) cloud: &'a DeviceCloud,
    pub(crate) screen: &'a ScreenBuffers,
    /// `Neighborhood` of `shared/surfel.wgsl` for each query, in the order of the queries.
    pub(crate) neighborhoods: &'a wgpu::Buffer,
    /// Of each pixel of the last frame the bits of a k-radius, 0 for none; of no use unless `frame` tells of that frame.
    pub(crate) past: &'a wgpu::Buffer,
}

/// An engine's compiled passes, good for one k.
pub(crate) trait EnginePasses: Debug {
    /// Makes the buffers that the engine needs of its own, and the steps of each [`Round`].
    ///
    /// # Errors
    /// [`Error::DeviceLimit`], [`Error::DeviceMemory`] if the device has too little.
    fn steps(&self, gpu: &Gpu, buffers: SearchBuffers<'_>) -> Result<EngineSteps, Error>;
}

/// What an engine does in a frame.
#[derive(Debug)]
pub(crate) struct EngineSteps {
    /// The steps of each [`Round`].
    pub(crate) rounds: [Vec<Step>; 2],
    /// Of an engine that iterates: for each round a run of `u32`, the points that had not converged before the first
    /// iteration and after each.
    pub(crate) convergence: Option<wgpu::Buffer>,
}

/// The points of both rounds that had not converged before the first iteration and after each, as far as there were any.
pub(crate) fn convergence(runs: &[u32]) -> Vec<u32> {
    let (active, recovered) = runs.split_at(runs.len() / 2);
    let mut curve: Vec<u32> = active.iter().zip(recovered).map(|(a, b)| a + b).collect();
    // After the last iteration the numbers stay.
    while let [.., before, last] = curve[..]
        && before == last
    {
        curve.pop();
    }
    curve
}

/// Checks whether an engine runs here, before anything is compiled.
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
