//! The screen-grid search on the GPU: an invocation per point.

use super::cpu::{FIRST_REACH, LEAST_GROWTH};
use crate::Error;
use crate::gpu::{Gpu, Pass, PassSource, Step};
use crate::project::gpu::{Round, ScreenBuffers};
use crate::search::{BOUND_STEP, CROWDED, MARGIN_PX, MAX_CANDIDATES};

#[cfg(test)]
pub(crate) const PASSES: &[PassSource] = &[SEARCH];
const SEARCH: PassSource = PassSource::new("search/screen_grid/search", include_str!("search.wgsl"));

/// `Neighborhood` of `shared/surfel.wgsl`.
type Neighborhood = [f32; 12];

/// Room for the neighbourhoods of `capacity` queries.
///
/// # Errors
/// [`Error::DeviceLimit`], [`Error::DeviceMemory`] if the device has too little.
pub(crate) fn neighborhood_buffer(gpu: &Gpu, capacity: u32) -> Result<wgpu::Buffer, Error> {
    gpu.storage::<Neighborhood>("neighbourhoods", capacity as usize)
}

/// The passes of the search: one per round.
#[derive(Debug)]
pub(crate) struct SearchPasses {
    rounds: [Pass; 2],
}

impl SearchPasses {
    /// Compiles them for frames with this k, which is the length of the list that each invocation keeps in registers.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(crate) fn new(gpu: &Gpu, k: u32) -> Result<Self, Error> {
        let round = |round: Round| {
            let constants = [
                ("ROUND", f64::from(round as u32)),
                ("K", k.into()),
                ("QUADS", k.div_ceil(4).into()),
                ("FIRST_REACH", FIRST_REACH.into()),
                ("LEAST_GROWTH", LEAST_GROWTH.into()),
                ("MARGIN_PX", MARGIN_PX.into()),
                ("MAX_CANDIDATES", MAX_CANDIDATES as f64),
                ("CROWDED", CROWDED as f64),
                ("BOUND_STEP", BOUND_STEP.into()),
            ];
            Pass::new(gpu, &SEARCH, &constants)
        };
        Ok(Self { rounds: [round(Round::Active)?, round(Round::Recovered)?] })
    }

    /// Finds the neighbourhoods of the queries of `round`.
    pub(crate) fn steps(
        &self,
        gpu: &Gpu,
        frame: &wgpu::Buffer,
        screen: &ScreenBuffers,
        neighborhoods: &wgpu::Buffer,
        round: Round,
    ) -> Vec<Step> {
        let ScreenBuffers { counters, density, cell_start, points, queries, .. } = screen;
        let buffers = [frame, counters, density, cell_start, points, queries, neighborhoods];
        vec![self.rounds[round as usize].step(gpu, &buffers, screen.groups(round.work_64()))]
    }
}

#[cfg(test)]
pub(crate) mod tests;
