//! Temporal smoothing of pictures on the GPU: a pass that looks back and one that keeps the picture, an invocation per
//! pixel.

use super::{MAX_SAME_DEPTH_PX, MIN_SEEN_WEIGHT, PAST_SHARE};
use crate::Error;
use crate::gpu::{Gpu, LARGE_GROUP, Library, Pass, Step, constants, passes};
use crate::shade::encode::ENCODE_STEPS;
use crate::shade::gpu::{self, ROW_PIXELS, ShadeBuffers};
use crate::splat::LayerBuffers;

/// Imports and constants of the passes.
const LIBRARY: Library = Library {
    files: gpu::LIBRARY.files,
    constants: &[constants![ENCODE_STEPS, MAX_SAME_DEPTH_PX, MIN_SEEN_WEIGHT, PAST_SHARE, ROW_PIXELS]],
};

passes! {
    "shade/over_time", LIBRARY;
    OVER_TIME = "over_time",
    KEEP_PICTURE = "keep_picture",
}

/// State that the last picture leaves for the next one.
#[derive(Debug)]
pub(crate) struct LastPictureBuffers {
    /// Depths row by row; infinite where no surface is.
    depths: wgpu::Buffer,
    /// RGBA per pixel, 8 bits a channel, rows without gaps.
    image: wgpu::Buffer,
}

impl LastPictureBuffers {
    /// Buffers for a picture of `size`.
    ///
    /// # Errors
    /// [`Error::DeviceLimit`], [`Error::DeviceMemory`] if the device has too little.
    pub(crate) fn new(gpu: &Gpu, size: [u32; 2]) -> Result<Self, Error> {
        let pixels = size[0] as usize * size[1] as usize;
        Ok(Self {
            depths: gpu.storage::<f32>("depths of the last picture", pixels)?,
            image: gpu.storage::<u32>("last picture", pixels)?,
        })
    }
}

/// The passes of temporal smoothing of pictures.
#[derive(Debug)]
pub(crate) struct PictureOverTimePasses {
    average: Pass,
    keep: Pass,
}

impl PictureOverTimePasses {
    /// Compiles the passes.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Error> {
        let pass = |source| Pass::new(gpu, source, &[]);
        Ok(Self { average: pass(&OVER_TIME)?, keep: pass(&KEEP_PICTURE)? })
    }

    /// Averages a shaded picture with the last one, and keeps the result.
    pub(crate) fn steps(
        &self,
        gpu: &Gpu,
        frame: &wgpu::Buffer,
        layers: &LayerBuffers,
        picture: &ShadeBuffers,
        last: &LastPictureBuffers,
    ) -> [Step; 2] {
        let groups = (picture.size[0] * picture.size[1]).div_ceil(LARGE_GROUP);
        let LastPictureBuffers { depths, image } = last;
        [
            self.average.step(gpu, &[frame, &layers.surface, depths, image, &picture.tables, &picture.image], groups),
            self.keep.step(gpu, &[frame, &layers.surface, &picture.image, depths, image], groups),
        ]
    }
}
