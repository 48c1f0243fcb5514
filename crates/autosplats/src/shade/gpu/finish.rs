//! The host's last steps for a picture in memory.

use rayon::prelude::*;

use super::super::color_map::Scale;
use super::super::cpu::Scene;
use super::super::encode::{encode, encode_table};
use super::super::{Image, Shading, legend};
use super::pitch;

/// A picture as read back.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReadPicture<'a> {
    pub(crate) size: [u32; 2],
    /// Bytes of [`ShadeBuffers::image`](super::ShadeBuffers::image); empty if the picture stays on the device.
    pub(crate) image: &'a [u8],
    /// Bytes of [`ShadeBuffers::linear`](super::ShadeBuffers::linear); empty if not requested.
    pub(crate) linear: &'a [u8],
    /// The counters `RangeLow` and `RangeHigh`; used only if the range is not given.
    pub(crate) range: [u32; 2],
}

/// Converts a picture to the host's form and draws its legend. Returns the range of the colour map in world values, if
/// the colour mode has one.
pub(crate) fn finish(
    read: &ReadPicture<'_>,
    scene: &Scene<'_>,
    shading: &Shading,
    image: &mut Image,
) -> Option<[f64; 2]> {
    if read.image.is_empty() {
        *image = Image::default();
    } else {
        let [width, height] = read.size;
        image.width = width;
        image.height = height;
        image.pixels.resize(width as usize * height as usize, [0; 4]);
        let rows = read.image.par_chunks(4 * pitch(width) as usize);
        image.pixels.par_chunks_mut(width as usize).zip(rows).for_each(|(pixels, row)| {
            bytemuck::cast_slice_mut(pixels).copy_from_slice(&row[..4 * width as usize]);
        });
    }
    let linear = read.linear.par_chunks_exact(size_of::<[f32; 4]>());
    linear
        .map(|bytes| bytemuck::pod_read_unaligned(&bytes[..size_of::<[f32; 3]>()]))
        .collect_into_vec(&mut image.linear);
    let map = shading.color.usual_map()?;
    let range = scene
        .given_range(shading)
        .unwrap_or_else(|| scene.range_above_noise(&shading.color, read.range.map(f32::from_bits)));
    if shading.legend && !read.image.is_empty() {
        let scale = Scale::new(shading.color_map.unwrap_or(map), range);
        let table = encode_table();
        let world = |range| scene.world_range(&shading.color, range);
        legend::draw(image, shading, &scale, world, |channel| encode(table, channel));
    }
    Some(scene.world_range(&shading.color, range))
}
