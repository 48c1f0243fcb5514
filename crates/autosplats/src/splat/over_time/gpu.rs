//! Temporal smoothing on the GPU: a pass that looks back, and one that keeps the frame, each with an invocation per
//! surfel.

use super::points::Fitted;
use super::surfaces::{MAX_SURFACE_DISTANCE_RADII, MIN_SURFACE_COSINE};
use crate::Error;
use crate::fit::Surfel;
use crate::gpu::{Gpu, LARGE_GROUP, Library, Pass, Step, constants, files, passes};
use crate::project::gpu::{Counter, Round, ScreenBuffers, Work};
use crate::splat::LayerBuffers;
use crate::splat::gpu::CLEAR_WORDS;

/// Imports and constants of the passes.
const LIBRARY: Library = Library {
    files: &[files!["fitted"]],
    constants: &[
        Counter::CONSTANTS,
        constants!(in Surfel: BACK, LINE),
        constants![MAX_SURFACE_DISTANCE_RADII, MIN_SURFACE_COSINE],
    ],
};

passes! {
    "splat/over_time", LIBRARY;
    OVER_TIME = "over_time",
    KEEP_FITTED = "keep_fitted",
}

/// State that the last frame leaves for the next one.
#[derive(Debug)]
pub(crate) struct OverTimeBuffers {
    /// Index plus 1 in `fitted` for the point of each half of a pixel; 0 if there is none.
    halves: wgpu::Buffer,
    /// [`Fitted`] per surfel of the last frame.
    fitted: wgpu::Buffer,
    /// Number of frames averaged in each surfel of this frame.
    frames: wgpu::Buffer,
}

impl OverTimeBuffers {
    /// Buffers for `screen_capacity` surfels and a picture of `size`.
    ///
    /// # Errors
    /// [`Error::DeviceLimit`], [`Error::DeviceMemory`] if the device has too little.
    pub(crate) fn new(gpu: &Gpu, screen_capacity: u32, size: [u32; 2]) -> Result<Self, Error> {
        let halves = 2 * size[0] as usize * size[1] as usize;
        Ok(Self {
            halves: gpu.storage::<u32>("halves of pixels", halves)?,
            fitted: gpu.storage::<Fitted>("surfels of the last frame", screen_capacity as usize)?,
            frames: gpu.storage::<f32>("frames averaged", screen_capacity as usize)?,
        })
    }
}

/// The passes of temporal smoothing.
#[derive(Debug)]
pub(crate) struct OverTimePasses {
    smooth: Pass,
    clear: Pass,
    keep: Pass,
}

impl OverTimePasses {
    /// Compiles the passes.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Error> {
        Ok(Self {
            smooth: Pass::new(gpu, &OVER_TIME, &[])?,
            clear: Pass::new(gpu, &CLEAR_WORDS, &[])?,
            keep: Pass::new(gpu, &KEEP_FITTED, &[])?,
        })
    }

    /// Averages the surfels of a round with those of the last frame, whose surface `layers` still hold.
    pub(crate) fn step(
        &self,
        gpu: &Gpu,
        frame: &wgpu::Buffer,
        screen: &ScreenBuffers,
        surfels: &wgpu::Buffer,
        (layers, buffers): (&LayerBuffers, &OverTimeBuffers),
        round: Round,
    ) -> Step {
        let ScreenBuffers { counters, points, .. } = screen;
        let OverTimeBuffers { halves, fitted, frames } = buffers;
        let bound = [frame, counters, &layers.surface, points, halves, fitted, surfels, frames];
        self.smooth.step(gpu, &bound, screen.groups(round.work_64()))
    }

    /// Keeps the surfels of both rounds. Runs after both are averaged.
    pub(crate) fn steps_keep(
        &self,
        gpu: &Gpu,
        frame: &wgpu::Buffer,
        screen: &ScreenBuffers,
        surfels: &wgpu::Buffer,
        buffers: &OverTimeBuffers,
    ) -> [Step; 2] {
        let ScreenBuffers { size: [width, height], counters, points, .. } = screen;
        let OverTimeBuffers { halves, fitted, frames } = buffers;
        [
            self.clear.step(gpu, &[frame, halves], (2 * width * height).div_ceil(LARGE_GROUP)),
            self.keep.step(
                gpu,
                &[frame, counters, points, surfels, frames, fitted, halves],
                screen.groups(Work::Queries256),
            ),
        ]
    }
}
