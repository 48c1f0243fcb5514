//! Orientation by sensors on the GPU: one invocation per surfel, for clouds with known sensors.

use super::{MIN_EYE_COSINE, MIN_SENSOR_COSINE, Sensor, Sensors};
use crate::Error;
use crate::gpu::{Gpu, Pass, PassSource, Step};
use crate::project::gpu::{Round, ScreenBuffers};

#[cfg(test)]
pub(crate) const PASSES: &[PassSource] = &[ORIENT];
const ORIENT: PassSource = PassSource::new("fit/orient/orient", include_str!("orient.wgsl"));

/// Allocates the sensors of a cloud.
///
/// # Errors
/// [`Error::DeviceLimit`] or [`Error::DeviceMemory`] if the device has too little.
pub(crate) fn sensor_buffer(gpu: &Gpu, sensors: usize) -> Result<wgpu::Buffer, Error> {
    gpu.storage::<Sensor>("sensors", sensors)
}

/// Writes the positions of the sensors to a buffer of just their size.
pub(crate) fn write_sensors(gpu: &Gpu, sensors: &Sensors, to: &wgpu::Buffer) {
    gpu.queue.write_buffer(to, 0, bytemuck::cast_slice(&sensors.runs));
}

/// The pass, for each round.
#[derive(Debug)]
pub(crate) struct OrientPasses {
    rounds: [Pass; 2],
}

impl OrientPasses {
    /// Compiles the passes.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Error> {
        let round = |round: Round| {
            let constants = [
                ("ROUND", f64::from(round as u32)),
                ("MIN_SENSOR_COSINE", MIN_SENSOR_COSINE.into()),
                ("MIN_EYE_COSINE", MIN_EYE_COSINE.into()),
            ];
            Pass::new(gpu, &ORIENT, &constants)
        };
        Ok(Self { rounds: [round(Round::Active)?, round(Round::Recovered)?] })
    }

    /// Marks the surfels of a round that show their back.
    pub(crate) fn step(
        &self,
        gpu: &Gpu,
        frame: &wgpu::Buffer,
        screen: &ScreenBuffers,
        sensors: &wgpu::Buffer,
        surfels: &wgpu::Buffer,
        round: Round,
    ) -> Step {
        let buffers = [frame, &screen.counters, sensors, surfels];
        self.rounds[round as usize].step(gpu, &buffers, screen.groups(round.work_64()))
    }
}
