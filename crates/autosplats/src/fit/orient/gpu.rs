//! The same on the GPU: an invocation per surfel, for clouds that know of sensors.

use super::{SEEN, SURE, Sensor, Sensors};
use crate::Error;
use crate::gpu::{Gpu, Pass, PassSource, Step};
use crate::project::gpu::{Round, ScreenBuffers};

#[cfg(test)]
pub(crate) const PASSES: &[PassSource] = &[ORIENT];
const ORIENT: PassSource = PassSource::new("fit/orient/orient", include_str!("orient.wgsl"));

/// The sensors of a cloud on the device.
///
/// # Errors
/// [`Error::DeviceLimit`], [`Error::DeviceMemory`] if the device has too little.
pub(crate) fn sensor_buffer(gpu: &Gpu, sensors: usize) -> Result<wgpu::Buffer, Error> {
    gpu.storage::<Sensor>("sensors", sensors)
}

/// Tells the device where sensors stood; the buffer has room for just these.
pub(crate) fn write_sensors(gpu: &Gpu, sensors: &Sensors, to: &wgpu::Buffer) {
    gpu.queue.write_buffer(to, 0, bytemuck::cast_slice(&sensors.runs));
}

/// The pass, one per round.
#[derive(Debug)]
pub(crate) struct OrientPasses {
    rounds: [Pass; 2],
}

impl OrientPasses {
    /// Compiles them.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Error> {
        let round = |round: Round| {
            let constants = [("ROUND", f64::from(round as u32)), ("SURE", SURE.into()), ("SEEN", SEEN.into())];
            Pass::new(gpu, &ORIENT, &constants)
        };
        Ok(Self { rounds: [round(Round::Active)?, round(Round::Recovered)?] })
    }

    /// Marks those of the surfels just fitted that show their back.
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
