//! The fit on the GPU: an invocation per point.

use super::Surfel;
use super::cpu::{LEAST_ACROSS, LINE, LONE_RADIUS_PX, LONGEST, LOPSIDED, LOPSIDED_COUNT, WIDEST_BEHIND};
use super::eigen::SWEEPS;
use crate::Error;
use crate::gpu::{Gpu, Pass, PassSource, Step};
use crate::project::gpu::{ScreenBuffers, Work};

#[cfg(test)]
pub(crate) const PASSES: &[PassSource] = &[FIT];
const FIT: PassSource = PassSource::new("fit/fit", include_str!("fit.wgsl"));

/// Workgroups of 64 invocations for each round.
const ROUND_WORK: [Work; 2] = [Work::Active64, Work::Recovered64];

/// Room for the surfels of `capacity` queries.
///
/// # Errors
/// [`Error::DeviceLimit`], [`Error::DeviceMemory`] if the device has too little.
pub(crate) fn surfel_buffer(gpu: &Gpu, capacity: u32) -> Result<wgpu::Buffer, Error> {
    gpu.storage::<Surfel>("surfels", capacity as usize)
}

/// The passes of the fit: one per round.
#[derive(Debug)]
pub(crate) struct FitPasses {
    rounds: [Pass; 2],
}

impl FitPasses {
    /// Compiles them.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Error> {
        let round = |round: u32| {
            let constants = [
                ("ROUND", f64::from(round)),
                ("SWEEPS", SWEEPS as f64),
                ("LINE", LINE.into()),
                ("LEAST_ACROSS", LEAST_ACROSS.into()),
                ("LONGEST", LONGEST.into()),
                ("LONE_RADIUS_PX", LONE_RADIUS_PX.into()),
                ("WIDEST_BEHIND", WIDEST_BEHIND.into()),
                ("LOPSIDED", LOPSIDED.into()),
                ("LOPSIDED_COUNT", LOPSIDED_COUNT.into()),
            ];
            Pass::new(gpu, &FIT, &constants)
        };
        Ok(Self { rounds: [round(0)?, round(1)?] })
    }

    /// Fits surfels to the neighbourhoods of the queries of `round`, 0 for active points, 1 for recovered ones.
    pub(crate) fn steps(
        &self,
        gpu: &Gpu,
        frame: &wgpu::Buffer,
        screen: &ScreenBuffers,
        neighborhoods: &wgpu::Buffer,
        surfels: &wgpu::Buffer,
        round: usize,
    ) -> Vec<Step> {
        let ScreenBuffers { counters, density, points, source, queries, .. } = screen;
        let buffers = [frame, counters, density, points, source, queries, neighborhoods, surfels];
        vec![self.rounds[round].step(gpu, &buffers, screen.groups(ROUND_WORK[round]))]
    }
}

#[cfg(test)]
mod tests;
