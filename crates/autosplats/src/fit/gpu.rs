//! The fit on the GPU: one invocation per point.

use super::eigen::SWEEPS;
use super::{Surfel, alone, cpu};
use crate::Error;
use crate::gpu::{Gpu, Library, Pass, Step, constants, passes};
use crate::project::gpu::{Counter, Round, ScreenBuffers};

/// Imports and constants of the passes.
const LIBRARY: Library = Library {
    files: &[],
    constants: &[
        Counter::CONSTANTS,
        constants!(in alone:
            FEW_NEIGHBORS, FEW_NEIGHBORS_FIRST_RADII, MAX_MEAN_OFFSET_K_RADII, MAX_NEAR_VARIATION,
            MAX_PLANE_OFFSET_K_RADII, MAX_SPARSE_MEAN_OFFSET_K_RADII, MIN_COMPARED_NEIGHBORS, MIN_FLAT_OFFSET_RATIO,
            MIN_SURFACE_POINTS, SPARSE_FIRST_RADII
        ),
        constants!(in cpu:
            DOT_CURVATURE, ISOLATED_DOT_RADIUS_PX, MAX_CULLED_FIRST_RADII, MAX_LINE_EIGENVALUE_RATIO, MIN_LINE_SINE,
            MIN_SCAN_LINE_NEIGHBORS, NEAR_RADIUS_GROWTH
        ),
        constants!(in Surfel: BACK, LINE),
        constants![SWEEPS],
    ],
};

passes! {
    "fit", LIBRARY;
    FIT = "fit",
}

/// Allocates the surfels of `capacity` queries.
///
/// # Errors
/// [`Error::DeviceLimit`] or [`Error::DeviceMemory`] if the device has too little.
pub(crate) fn surfel_buffer(gpu: &Gpu, capacity: u32) -> Result<wgpu::Buffer, Error> {
    gpu.storage::<Surfel>("surfels", capacity as usize)
}

/// The pass of the fit.
#[derive(Debug)]
pub(crate) struct FitPass(Pass);

impl FitPass {
    /// Compiles the pass.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Error> {
        Pass::new(gpu, &FIT, &[]).map(Self)
    }

    /// Fits surfels to the neighbourhoods of the queries of `round`.
    pub(crate) fn step(
        &self,
        gpu: &Gpu,
        frame: &wgpu::Buffer,
        screen: &ScreenBuffers,
        neighborhoods: &wgpu::Buffer,
        surfels: &wgpu::Buffer,
        round: Round,
    ) -> Step {
        let ScreenBuffers { counters, density, points, source, queries, past, .. } = screen;
        let buffers = [frame, counters, density, points, source, queries, neighborhoods, surfels, past];
        self.0.step(gpu, &buffers, screen.groups(round.work_64()))
    }
}

#[cfg(test)]
mod tests;
