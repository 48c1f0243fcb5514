//! The same on the GPU: an invocation per surfel, which looks back, and one that keeps it.

use super::points::{ALIKE, Fitted};
use super::surfaces::NEAR;
use crate::Error;
use crate::gpu::{Gpu, Pass, PassSource, Step};
use crate::project::gpu::{Round, ScreenBuffers, Work};
use crate::splat::LayerBuffers;
use crate::splat::gpu::CLEAR_WORDS;

#[cfg(test)]
pub(crate) const PASSES: &[PassSource] = &[OVER_TIME, KEEP_FITTED];
const OVER_TIME: PassSource = PassSource::new("splat/over_time/over_time", include_str!("over_time.wgsl"));
const KEEP_FITTED: PassSource = PassSource::new("splat/over_time/keep_fitted", include_str!("keep_fitted.wgsl"));

/// What the last frame leaves for the next one.
#[derive(Debug)]
pub(crate) struct OverTimeBuffers {
    /// Of each half of a pixel, the place of what was fitted to its point, from 1 on; 0 if it has none.
    halves: wgpu::Buffer,
    /// [`Fitted`] per surfel of the last frame.
    fitted: wgpu::Buffer,
    /// Over how many frames each surfel of this one is averaged.
    frames: wgpu::Buffer,
}

impl OverTimeBuffers {
    /// Room for `screen_capacity` surfels in a picture of `size`.
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
    /// For each [`Round`].
    smooth: [Pass; 2],
    clear: Pass,
    keep: Pass,
}

impl OverTimePasses {
    /// Compiles them.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Error> {
        let smooth = |round: Round| {
            let constants = [("ROUND", f64::from(round as u32)), ("NEAR", NEAR.into()), ("ALIKE", ALIKE.into())];
            Pass::new(gpu, &OVER_TIME, &constants)
        };
        Ok(Self {
            smooth: [smooth(Round::Active)?, smooth(Round::Recovered)?],
            clear: Pass::new(gpu, &CLEAR_WORDS, &[])?,
            keep: Pass::new(gpu, &KEEP_FITTED, &[])?,
        })
    }

    /// Averages the surfels of a round with what the last frame found, whose surface `layers` still hold.
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
        self.smooth[round as usize].step(gpu, &bound, screen.groups(round.work_64()))
    }

    /// Keeps the surfels of both rounds; to be run after the last one was averaged.
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
            self.clear.step(gpu, &[frame, halves], (2 * width * height).div_ceil(256)),
            self.keep.step(
                gpu,
                &[frame, counters, points, surfels, frames, fitted, halves],
                screen.groups(Work::Queries256),
            ),
        ]
    }
}
