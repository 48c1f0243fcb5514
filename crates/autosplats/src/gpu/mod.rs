//! The plumbing of wgpu: devices, shader linking, passes, buffers and readback. This module knows nothing of points.
//!
//! # How it works
//! A stage compiles its [`Pass`]es once. Whenever a frame's buffers change, the stage binds passes to them, which gives
//! [`Step`]s. A frame is the list of all stages' steps, which a [`Recorder`] replays without allocations.

mod buffers;
mod compiled;
mod device;
mod frame;
mod link;
mod pass;
mod pipeline_file;
mod raster;
mod recorder;
mod source;
mod step;
mod work;

pub(crate) use buffers::Readback;
#[cfg(test)]
pub(crate) use buffers::read_back;
pub(crate) use compiled::Pass;
#[cfg(test)]
pub(crate) use device::test_gpu;
pub use device::{AdapterSummary, adapters, device_descriptor};
pub(crate) use device::{Gpu, INT64_ATOMICS, INT64_IN_LANES};
pub(crate) use frame::FrameUniform;
pub(crate) use link::{Constant, File, InWgsl, LARGE_GROUP, Library, SMALL_GROUP, constants, files, indices, link};
pub(crate) use raster::{DepthMask, Draw, Load, RasterPass, Target, Targets};
pub use recorder::PassTime;
pub(crate) use recorder::{Clock, DISPATCH_BYTES, Recorder, stage_ms};
pub(crate) use source::{PassSource, passes};
pub(crate) use step::{Groups, Step};
pub use work::StageWork;
pub(crate) use work::stage_work;
