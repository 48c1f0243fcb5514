//! Temporal smoothing of pictures: each pixel is the mean of its surface now and in the last picture.
//!
//! A far surface has more points than pixels, and each picture shows others of them. So detail finer than pixels
//! flickers, as in a picture of one ray a pixel. Successive pictures together contain more detail than each alone. The
//! last picture must have shown the pixel's surface at the same depth within [`MAX_SAME_DEPTH_PX`] pixels. Then the
//! pixel becomes the mean of both, in linear light. The last picture is such a mean itself, so the weight of older
//! pictures halves with each one. A larger share of the past would be steadier than the truth, in which light moves
//! with the camera, and would blur. See docs/decisions/0014-frame-to-frame.md.
//!
//! Only pictures of the same points and settings are averaged, and only where requested
//! ([`Reconstruction::steady`](crate::Reconstruction::steady)). Layers, and the image in linear light, are not
//! averaged.

pub(crate) mod gpu;
#[cfg(test)]
mod tests;

use rayon::prelude::*;

use super::{Image, linear_steps};
use crate::camera::{PlacedView, Reprojection, View};
use crate::cancel::Cancel;
use crate::shade::encode::{encode, encode_table};
use crate::splat::GBuffer;

/// Share of the last picture in a pixel, 0 to 1.
pub(super) const PAST_SHARE: f32 = 0.5;
/// Largest difference in depth of the same surface, in pixels.
pub(super) const MAX_SAME_DEPTH_PX: f32 = 3.0;
/// Least share, in the bilinear weights of the last picture's four pixels, of pixels that showed the same surface.
pub(super) const MIN_SEEN_WEIGHT: f32 = 0.1;

/// State that the last picture, made with settings `M`, leaves for the next one. Keeps its buffers.
#[derive(Debug)]
pub(crate) struct LastPicture<M> {
    /// View and origin of the last picture, identity of its points, and its settings; `None` without a last picture.
    made: Option<(PlacedView, u64, M)>,
    /// View of this picture into the last one; `None` if the two are not averaged.
    past: Option<Reprojection>,
    kept: KeptPicture,
}

/// Depths and colours of a picture, kept for the next one.
#[derive(Debug, Default)]
struct KeptPicture {
    /// Depths row by row; infinite where no surface is.
    depths: Vec<f32>,
    pixels: Vec<[u8; 4]>,
}

/// A picture in progress, with its view into the last one.
#[derive(Debug)]
pub(crate) struct PictureInProgress<'a> {
    last: &'a mut KeptPicture,
    view: View,
    /// Reprojection into the last picture, if the two are to be averaged.
    past: Option<Reprojection>,
}

impl<M> Default for LastPicture<M> {
    fn default() -> Self {
        Self { made: None, past: None, kept: KeptPicture::default() }
    }
}

impl<M: PartialEq> LastPicture<M> {
    /// Begins a picture with this view, without a margin, and these settings. The state of a picture that was given up
    /// is dropped.
    pub(crate) fn begin(&mut self, now: PlacedView, identity: u64, made: &M) {
        let last = self.made.take().filter(|(_, points, before)| *points == identity && before == made);
        self.past = last.and_then(|(then, ..)| Reprojection::new(&now, &then));
    }

    /// The picture that began, with its view.
    pub(crate) fn following(&mut self, view: View) -> PictureInProgress<'_> {
        PictureInProgress { last: &mut self.kept, view, past: self.past }
    }

    /// Completes the picture that began.
    pub(crate) fn end(&mut self, now: PlacedView, identity: u64, made: M) {
        self.made = Some((now, identity, made));
    }

    /// Forgets all earlier pictures.
    pub(crate) fn forget(&mut self) {
        *self = Self::default();
    }
}

impl PictureInProgress<'_> {
    /// Averages a picture with the last one, and keeps it for the next.
    pub(crate) fn average(&mut self, layers: &GBuffer, image: &mut Image, cancel: &Cancel<'_>) {
        let Self { last, view, past } = self;
        if let Some(past) = past {
            last.mix_into(image, layers, view, past, cancel);
        }
        last.keep(layers, image, cancel);
    }
}

impl KeptPicture {
    fn mix_into(&self, image: &mut Image, layers: &GBuffer, view: &View, past: &Reprojection, cancel: &Cancel<'_>) {
        let (steps, table) = (linear_steps(), encode_table());
        let width = image.width as usize;
        let rows = image.pixels.par_chunks_mut(width).enumerate();
        rows.filter(|_| !cancel.is_given_up()).for_each(|(y, row)| {
            for (x, pixel) in row.iter_mut().enumerate() {
                let index = layers.index(x, y);
                if !(layers.weight[index] > 0.0) {
                    continue;
                }
                let position =
                    past.position(view.unproject([x as f32 + 0.5, y as f32 + 0.5], layers.depth[index]).into());
                let Some(then) = self.shown_at(position.z, past.view.to_pixel(position), &past.view, &steps) else {
                    continue;
                };
                for (channel, then) in pixel.iter_mut().zip(then) {
                    let now = steps[usize::from(*channel)];
                    *channel = encode(table, now + PAST_SHARE * (then - now));
                }
            }
        });
    }

    /// Bilinear colour in linear light of the surface at a depth and a place in the last picture, from the pixels that
    /// showed it.
    #[inline(always)]
    fn shown_at(&self, depth: f32, [x, y]: [f32; 2], view: &View, steps: &[f32; 256]) -> Option<[f32; 3]> {
        let [width, height] = [view.width as usize, view.height as usize];
        let [x, y] = [x - 0.5, y - 0.5];
        // NaN is in no picture.
        let inside = (x >= 0.0) & (y >= 0.0) & (x < width as f32 - 1.0) & (y < height as f32 - 1.0);
        if !(inside & (depth > view.near)) {
            return None;
        }
        let first = y as usize * width + x as usize;
        let [right, below] = [x.fract(), y.fract()];
        let tolerance = MAX_SAME_DEPTH_PX * view.pixel_size(depth);
        let (mut sum, mut all) = ([0.0; 3], 0.0);
        let weights = [(1.0 - right) * (1.0 - below), right * (1.0 - below), (1.0 - right) * below, right * below];
        for (at, weight) in [first, first + 1, first + width, first + width + 1].into_iter().zip(weights) {
            if (self.depths[at] - depth).abs() < tolerance {
                let color = self.pixels[at];
                sum = [0, 1, 2].map(|i| sum[i] + weight * steps[usize::from(color[i])]);
                all += weight;
            }
        }
        (all >= MIN_SEEN_WEIGHT).then(|| sum.map(|channel| channel / all))
    }

    fn keep(&mut self, layers: &GBuffer, image: &Image, cancel: &Cancel<'_>) {
        let width = image.width as usize;
        self.pixels.clone_from(&image.pixels);
        self.depths.resize(image.pixels.len(), 0.0);
        let rows = self.depths.par_chunks_mut(width).enumerate();
        rows.filter(|_| !cancel.is_given_up()).for_each(|(y, row)| {
            let mut x = 0;
            while x < width {
                let run = layers.run(x).min(width - x);
                row[x..x + run].copy_from_slice(&layers.depth[layers.index(x, y)..][..run]);
                x += run;
            }
        });
    }
}
