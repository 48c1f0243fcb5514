//! Temporal coherence: the k-radii of one frame are the starting radii of the next frame's search.
//!
//! A frame stores the k-radius of each pixel's points. A point of the next frame is reprojected to the pixel that
//! showed it, where most of the time a point with the same neighbours was seen. The search starts from that radius,
//! instead of a radius from the local density. The starting radius does not change the result: an engine counts
//! neighbours in any case, and a wrong start only takes longer. See docs/decisions/0014-frame-to-frame.md.

#[cfg(test)]
pub(crate) mod tests;

use std::sync::atomic::{AtomicU32, Ordering};

use rayon::prelude::*;

use super::{LANES, Neighborhoods};
use crate::camera::{PlacedView, Reprojection};
use crate::project::{Blocks, ScreenPoints};
use crate::room::fit_atomic;

/// Factor on a k-radius of the last frame to start a search from: neighbours change, and pixels hold other points.
pub(crate) const PAST_RADIUS_SLACK: f32 = 1.05;
/// Range of starting radii in first search radii. A radius outside belongs to another surface.
pub(crate) const PAST_FIRST_RADII_RANGE: [f32; 2] = [0.1, 4.0];
/// Largest mean shortfall of the last frame's radii, over recent blocks, with which the CPU still uses them. Beyond,
/// the radii of the previous block are as good.
const MAX_TRUSTED_SHORTFALL: f32 = 1.2;
/// While the last frame's radii are not trusted, one block in this many still reads them, to notice a change.
const UNTRUSTED_CHECK_BLOCKS: u32 = 8;

/// Trust in the last frame's radii, learnt from block to block. The radii are right where nothing moved, and no better
/// than any guess where points are new.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Trust {
    /// Running mean of the factor by which the radii fell short.
    missed: f32,
    skipped: u32,
}

impl Default for Trust {
    fn default() -> Self {
        Self { missed: PAST_RADIUS_SLACK, skipped: 0 }
    }
}

impl Trust {
    /// Whether the next block should read the last frame's radii.
    #[inline(always)]
    pub(crate) fn looks_back(&mut self) -> bool {
        self.skipped = if self.slack().is_some() { 0 } else { (self.skipped + 1) % UNTRUSTED_CHECK_BLOCKS };
        self.skipped == 0
    }

    /// Factor on the last frame's radii to start from; `None` if the radii are not trusted.
    #[inline(always)]
    pub(crate) fn slack(&self) -> Option<f32> {
        (self.missed <= MAX_TRUSTED_SHORTFALL).then_some(self.missed.max(1.01))
    }

    /// Takes in the factor by which a block's radii fell short.
    #[inline(always)]
    pub(crate) fn learn(&mut self, missed: f32) {
        self.missed += 0.25 * (missed.clamp(1.0, 2.0) - self.missed);
    }
}

/// The k-radii of the last frame and of the present frame.
#[derive(Debug, Default)]
pub(crate) struct Past {
    last: PastRadii,
    next: PastRadii,
    reprojection: Option<Reprojection>,
}

/// The k-radii of one frame.
#[derive(Debug, Default)]
struct PastRadii {
    /// The view of the frame, and its k.
    seen: Option<(PlacedView, u32)>,
    /// Bits of the greatest k-radius per pixel; 0 where no point has k neighbours.
    pixels: Vec<AtomicU32>,
    /// The blocks of pixels that may have radii.
    blocks: Blocks,
}

impl Past {
    /// Starts a frame. Clears radii left by an aborted frame.
    pub(crate) fn begin(&mut self, now: PlacedView, k: u32) {
        let past = self.last.seen.filter(|&(_, known)| known == k);
        self.reprojection = past.and_then(|(past, _)| Reprojection::new(&now, &past));
        let PastRadii { seen, pixels, blocks } = &mut self.next;
        *seen = Some((now, k));
        // A frame that is given up before it keeps radii has none.
        std::mem::take(blocks).change(pixels, |pixels| pixels.iter_mut().for_each(|radius| *radius.get_mut() = 0));
        fit_atomic(pixels, now.view.width as usize * now.view.height as usize);
    }

    /// Ends a frame, whose radii become the past of the next.
    pub(crate) fn end(&mut self) {
        std::mem::swap(&mut self.last, &mut self.next);
    }

    /// Discards all radii.
    pub(crate) fn forget(&mut self) {
        *self = Self::default();
    }

    /// Radius from which to search for the k nearest of the point at `position_view`, whose first search radius is
    /// `initial_radius`. `None` if the last frame has no usable radius.
    #[inline(always)]
    pub(crate) fn radius(&self, position_view: [f32; 3], initial_radius: f32) -> Option<f32> {
        let pixel = self.reprojection.as_ref()?.pixel(position_view)?;
        let radius = f32::from_bits(self.last.pixels[pixel].load(Ordering::Relaxed));
        let [least, most] = PAST_FIRST_RADII_RANGE;
        ((radius >= least * initial_radius) & (radius <= most * initial_radius)).then_some(radius)
    }

    /// Stores the k-radii of `queries` that found k neighbours.
    pub(crate) fn keep(&mut self, screen: &ScreenPoints, queries: &[u32], neighborhoods: &Neighborhoods) {
        let PastRadii { seen: Some((PlacedView { view, .. }, k)), pixels, blocks } = &mut self.next else { return };
        blocks.clone_from(screen.sixteenths.blocks());
        let pixels = &*pixels;
        queries.par_chunks(LANES).zip(&neighborhoods.blocks).with_min_len(64).for_each(|(queries, block)| {
            for (lane, &query) in queries.iter().enumerate() {
                let point = &screen.points[query as usize];
                if block.count.0[lane] >= *k as f32 && !point.is_near() {
                    let [x, y] = point.pixel_xy();
                    // The maximum picks the same one of a pixel's two points in every run.
                    let pixel = &pixels[y * view.width as usize + x];
                    pixel.fetch_max(block.k_radius.0[lane].to_bits(), Ordering::Relaxed);
                }
            }
        });
    }
}
