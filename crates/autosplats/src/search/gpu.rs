//! The choice of a search engine on the GPU.

use super::SearchEngine;
use super::engine::{EnginePasses, EngineSteps, SearchBuffers};
use super::kd_tree::gpu::KdTreePasses;
use super::screen_grid::gpu::SearchPasses;
use super::splat_communication::{compute, raster};
use crate::Error;
use crate::gpu::Gpu;
use crate::project::gpu::Round;

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
        SearchEngine::SplatCommunicationRaster => raster::check(gpu),
        SearchEngine::ScreenGrid | SearchEngine::SplatCommunication | SearchEngine::KdTree { .. } => Ok(()),
    }
}

/// Compiles the passes of an engine.
///
/// # Errors
/// [`Error::Device`] if the device cannot run it.
pub(crate) fn compile(gpu: &Gpu, engine: SearchEngine, k: u32) -> Result<Box<dyn EnginePasses>, Error> {
    match engine {
        SearchEngine::ScreenGrid => Ok(Box::new(SearchPasses::new(gpu, k)?)),
        SearchEngine::SplatCommunication => Ok(Box::new(compute::CommunicationPasses::new(gpu)?)),
        SearchEngine::SplatCommunicationRaster => Ok(Box::new(raster::CommunicationPasses::new(gpu)?)),
        SearchEngine::KdTree { .. } => Ok(Box::new(KdTreePasses::new(gpu)?)),
    }
}

impl EnginePasses for SearchPasses {
    fn steps(&self, gpu: &Gpu, buffers: SearchBuffers<'_>) -> Result<EngineSteps, Error> {
        let SearchBuffers { frame, screen, neighborhoods, .. } = buffers;
        let round = |round| self.steps(gpu, frame, screen, neighborhoods, round);
        Ok(EngineSteps { rounds: [Round::Active, Round::Recovered].map(round), convergence: None })
    }
}
