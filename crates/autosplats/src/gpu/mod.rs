//! The plumbing of wgpu: devices, shader linking, passes, buffers and readback. Nothing here knows of points.
//!
//! # How it works
//! A stage compiles its [`Pass`]es once, and makes them [`Step`]s, passes bound to the buffers of a frame, when these
//! change. A frame is the list of all stages' steps, replayed by a [`Recorder`]: nothing is allocated then.

mod buffers;
mod device;
mod frame;
mod link;
mod pass;
mod raster;
mod recorder;

pub(crate) use buffers::Readback;
#[cfg(test)]
pub(crate) use buffers::read_back;
#[cfg(test)]
pub(crate) use device::test_gpu;
pub use device::{AdapterSummary, adapters};
pub(crate) use device::{Gpu, INT64_ATOMICS};
pub(crate) use frame::FrameUniform;
#[cfg(test)]
pub(crate) use link::link;
pub(crate) use pass::{Groups, Pass, PassSource, Step};
pub(crate) use raster::{DepthMask, Draw, Load, RasterPass, Target, Targets};
#[cfg(test)]
pub(crate) use recorder::GROUPS_PER_ROW;
pub use recorder::PassTime;
pub(crate) use recorder::{Clock, Recorder, stage_ms};
