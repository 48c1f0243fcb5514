//! The engines on the GPU, behind one interface.

use std::fmt::Debug;

use super::SearchEngine;
use super::kd_tree::gpu::KdTreePasses;
use super::screen_grid::gpu::SearchPasses;
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
}

/// An engine's compiled passes, good for one k.
pub(crate) trait EnginePasses: Debug {
    /// Makes the buffers that the engine needs of its own, and the steps of each [`Round`].
    ///
    /// # Errors
    /// [`Error::DeviceLimit`], [`Error::DeviceMemory`] if the device has too little.
    fn steps(&self, gpu: &Gpu, buffers: SearchBuffers<'_>) -> Result<[Vec<Step>; 2], Error>;
}

/// Compiles the passes of an engine.
///
/// # Errors
/// [`Error::Device`] if the device cannot run it.
pub(crate) fn compile(gpu: &Gpu, engine: SearchEngine, k: u32) -> Result<Box<dyn EnginePasses>, Error> {
    match engine {
        SearchEngine::ScreenGrid => Ok(Box::new(SearchPasses::new(gpu, k)?)),
        SearchEngine::KdTree { .. } => Ok(Box::new(KdTreePasses::new(gpu)?)),
    }
}

impl EnginePasses for SearchPasses {
    fn steps(&self, gpu: &Gpu, buffers: SearchBuffers<'_>) -> Result<[Vec<Step>; 2], Error> {
        let SearchBuffers { frame, screen, neighborhoods, .. } = buffers;
        Ok([Round::Active, Round::Recovered].map(|round| self.steps(gpu, frame, screen, neighborhoods, round)))
    }
}
