//! Temporal smoothing of pictures on the GPU: a pass that looks back and one that keeps the picture, an invocation per
//! pixel.

use super::{MAX_SAME_DEPTH_PX, MIN_SEEN_WEIGHT, PAST_SHARE};
use crate::Error;
use crate::gpu::{Gpu, Pass, PassSource, Step};
use crate::shade::cpu::ENCODE_STEPS;
use crate::shade::gpu::{ROW_PIXELS, ShadeBuffers};
use crate::splat::LayerBuffers;

#[cfg(test)]
pub(crate) const PASSES: &[PassSource] = &[OVER_TIME, KEEP_PICTURE];
const OVER_TIME: PassSource = PassSource::new("shade/over_time/over_time", include_str!("over_time.wgsl"));
const KEEP_PICTURE: PassSource = PassSource::new("shade/over_time/keep_picture", include_str!("keep_picture.wgsl"));

/// Invocations in a workgroup.
const GROUP: u32 = 256;

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
        let row_pixels = ("ROW_PIXELS", ROW_PIXELS.into());
        let average = [
            ("PAST_SHARE", PAST_SHARE.into()),
            ("MAX_SAME_DEPTH_PX", MAX_SAME_DEPTH_PX.into()),
            ("MIN_SEEN_WEIGHT", MIN_SEEN_WEIGHT.into()),
            ("ENCODE_STEPS", ENCODE_STEPS as f64),
            row_pixels,
        ];
        Ok(Self { average: Pass::new(gpu, &OVER_TIME, &average)?, keep: Pass::new(gpu, &KEEP_PICTURE, &[row_pixels])? })
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
        let groups = (picture.size[0] * picture.size[1]).div_ceil(GROUP);
        let LastPictureBuffers { depths, image } = last;
        [
            self.average.step(gpu, &[frame, &layers.surface, depths, image, &picture.tables, &picture.image], groups),
            self.keep.step(gpu, &[frame, &layers.surface, &picture.image, depths, image], groups),
        ]
    }
}
