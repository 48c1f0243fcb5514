//! The fit on the GPU: one invocation per point.

use super::Surfel;
use super::alone::{BESIDE, FAR_SPARSER, FEW, FLAT, HANDFUL, LOPSIDED, LOPSIDED_COUNT, LOPSIDED_SPARSE, SPARSER};
use super::cpu::{DOT_CURVATURE, LEAST_ACROSS, LINE, LONE_RADIUS_PX, ROW_COUNT, WIDEST_BEHIND};
use super::eigen::SWEEPS;
use crate::Error;
use crate::gpu::{Gpu, Pass, PassSource, Step};
use crate::project::gpu::{Round, ScreenBuffers};

#[cfg(test)]
pub(crate) const PASSES: &[PassSource] = &[FIT];
const FIT: PassSource = PassSource::new("fit/fit", include_str!("fit.wgsl"));

/// Allocates the surfels of `capacity` queries.
///
/// # Errors
/// [`Error::DeviceLimit`] or [`Error::DeviceMemory`] if the device has too little.
pub(crate) fn surfel_buffer(gpu: &Gpu, capacity: u32) -> Result<wgpu::Buffer, Error> {
    gpu.storage::<Surfel>("surfels", capacity as usize)
}

/// The passes of the fit, one per round.
#[derive(Debug)]
pub(crate) struct FitPasses {
    rounds: [Pass; 2],
}

impl FitPasses {
    /// Compiles the passes.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Error> {
        let round = |round: Round| {
            let constants = [
                ("ROUND", f64::from(round as u32)),
                ("SWEEPS", SWEEPS as f64),
                ("LINE", LINE.into()),
                ("LEAST_ACROSS", LEAST_ACROSS.into()),
                ("ROW_COUNT", ROW_COUNT.into()),
                ("LONE_RADIUS_PX", LONE_RADIUS_PX.into()),
                ("DOT_CURVATURE", DOT_CURVATURE.into()),
                ("WIDEST_BEHIND", WIDEST_BEHIND.into()),
                ("LOPSIDED", LOPSIDED.into()),
                ("LOPSIDED_SPARSE", LOPSIDED_SPARSE.into()),
                ("FAR_SPARSER", FAR_SPARSER.into()),
                ("LOPSIDED_COUNT", LOPSIDED_COUNT.into()),
                ("BESIDE", BESIDE.into()),
                ("FLAT", FLAT.into()),
                ("FEW", FEW.into()),
                ("SPARSER", SPARSER.into()),
                ("HANDFUL", HANDFUL as f64),
            ];
            Pass::new(gpu, &FIT, &constants)
        };
        Ok(Self { rounds: [round(Round::Active)?, round(Round::Recovered)?] })
    }

    /// Fits surfels to the neighbourhoods of the queries of `round`.
    pub(crate) fn steps(
        &self,
        gpu: &Gpu,
        frame: &wgpu::Buffer,
        screen: &ScreenBuffers,
        neighborhoods: &wgpu::Buffer,
        surfels: &wgpu::Buffer,
        round: Round,
    ) -> Vec<Step> {
        let ScreenBuffers { counters, density, points, source, queries, .. } = screen;
        let buffers = [frame, counters, density, points, source, queries, neighborhoods, surfels];
        vec![self.rounds[round as usize].step(gpu, &buffers, screen.groups(round.work_64()))]
    }
}

#[cfg(test)]
mod tests;
