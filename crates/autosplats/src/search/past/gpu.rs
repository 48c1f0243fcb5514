//! The k-radii of the last frame on the GPU.

use crate::Error;
use crate::gpu::{Gpu, LARGE_GROUP, Library, Pass, Step, passes};
use crate::project::gpu::{Counter, ScreenBuffers, Work};

/// Imports and constants of the passes.
const LIBRARY: Library = Library { files: &[], constants: &[Counter::CONSTANTS] };

passes! {
    "search/past", LIBRARY;
    CLEAR_PAST = "clear_past",
    KEEP_PAST = "keep_past",
}

/// Allocates a buffer for the k-radii of pictures of `size`, empty if `None`.
///
/// # Errors
/// [`Error::DeviceLimit`] or [`Error::DeviceMemory`] if the device has too little.
pub(crate) fn past_buffer(gpu: &Gpu, size: Option<[u32; 2]>) -> Result<wgpu::Buffer, Error> {
    gpu.storage::<u32>("k-radii of the last frame", size.map_or(0, |[width, height]| width as usize * height as usize))
}

/// The passes that store the k-radii of a frame.
#[derive(Debug)]
pub(crate) struct PastPasses {
    clear: Pass,
    keep: Pass,
}

impl PastPasses {
    /// Compiles the passes.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Error> {
        Ok(Self { clear: Pass::new(gpu, &CLEAR_PAST, &[])?, keep: Pass::new(gpu, &KEEP_PAST, &[])? })
    }

    /// Stores the k-radii of both rounds in `past`; to be run after the last search of a frame.
    pub(crate) fn steps(
        &self,
        gpu: &Gpu,
        frame: &wgpu::Buffer,
        screen: &ScreenBuffers,
        neighborhoods: &wgpu::Buffer,
        past: &wgpu::Buffer,
    ) -> [Step; 2] {
        let ScreenBuffers { size: [width, height], counters, points, queries, .. } = screen;
        let keep = [frame, counters, points, queries, neighborhoods, past];
        [
            self.clear.step(gpu, &[frame, past], (width * height).div_ceil(LARGE_GROUP)),
            self.keep.step(gpu, &keep, screen.groups(Work::Queries256)),
        ]
    }
}
