//! Orientation by sensors on the GPU: one invocation per surfel, for clouds with known sensors.

use super::{MIN_EYE_COSINE, MIN_SENSOR_COSINE, Sensor, Sensors};
use crate::Error;
use crate::fit::Surfel;
use crate::gpu::{Gpu, Library, Pass, Step, constants, passes};
use crate::project::gpu::{Counter, Round, ScreenBuffers};

/// Imports and constants of the passes.
const LIBRARY: Library = Library {
    files: &[],
    constants: &[Counter::CONSTANTS, constants!(in Surfel: BACK, LINE), constants![MIN_EYE_COSINE, MIN_SENSOR_COSINE]],
};

passes! {
    "fit/orient", LIBRARY;
    ORIENT = "orient",
}

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

/// The pass.
#[derive(Debug)]
pub(crate) struct OrientPass(Pass);

impl OrientPass {
    /// Compiles the pass.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Error> {
        Pass::new(gpu, &ORIENT, &[]).map(Self)
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
        self.0.step(gpu, &buffers, screen.groups(round.work_64()))
    }
}
