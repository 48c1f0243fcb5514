//! The fit on the GPU: one invocation per point.

use super::Surfel;
use super::alone::{
    FEW_NEIGHBORS, FEW_NEIGHBORS_FIRST_RADII, MAX_MEAN_OFFSET_K_RADII, MAX_PLANE_OFFSET_K_RADII,
    MAX_SPARSE_MEAN_OFFSET_K_RADII, MIN_COMPARED_NEIGHBORS, MIN_FLAT_OFFSET_RATIO, MIN_SURFACE_POINTS,
    SPARSE_FIRST_RADII,
};
use super::cpu::{
    DOT_CURVATURE, ISOLATED_DOT_RADIUS_PX, MAX_CULLED_FIRST_RADII, MAX_LINE_EIGENVALUE_RATIO, MIN_LINE_SINE,
    MIN_SCAN_LINE_NEIGHBORS,
};
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
                ("MAX_LINE_EIGENVALUE_RATIO", MAX_LINE_EIGENVALUE_RATIO.into()),
                ("MIN_LINE_SINE", MIN_LINE_SINE.into()),
                ("MIN_SCAN_LINE_NEIGHBORS", MIN_SCAN_LINE_NEIGHBORS.into()),
                ("ISOLATED_DOT_RADIUS_PX", ISOLATED_DOT_RADIUS_PX.into()),
                ("DOT_CURVATURE", DOT_CURVATURE.into()),
                ("MAX_CULLED_FIRST_RADII", MAX_CULLED_FIRST_RADII.into()),
                ("MAX_MEAN_OFFSET_K_RADII", MAX_MEAN_OFFSET_K_RADII.into()),
                ("MAX_SPARSE_MEAN_OFFSET_K_RADII", MAX_SPARSE_MEAN_OFFSET_K_RADII.into()),
                ("SPARSE_FIRST_RADII", SPARSE_FIRST_RADII.into()),
                ("MIN_COMPARED_NEIGHBORS", MIN_COMPARED_NEIGHBORS.into()),
                ("MAX_PLANE_OFFSET_K_RADII", MAX_PLANE_OFFSET_K_RADII.into()),
                ("MIN_FLAT_OFFSET_RATIO", MIN_FLAT_OFFSET_RATIO.into()),
                ("FEW_NEIGHBORS", FEW_NEIGHBORS.into()),
                ("FEW_NEIGHBORS_FIRST_RADII", FEW_NEIGHBORS_FIRST_RADII.into()),
                ("MIN_SURFACE_POINTS", MIN_SURFACE_POINTS as f64),
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
