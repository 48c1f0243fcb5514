//! Temporal coherence: the k-radii of the last frame, from which the search of the next one starts.
//!
//! A frame leaves the k-radius of each pixel's points behind. A point of the next frame looks back: where it lies now it would
//! have been seen in some pixel then, and most of the time a point with the same neighbours was. Its search starts from that
//! radius, which is as good as known, instead of from one by the density of points around. What is found does not depend on
//! it: an engine counts neighbours whatever it starts from, and a wrong start only takes longer.

pub(crate) mod gpu;
#[cfg(test)]
pub(crate) mod tests;

use std::sync::atomic::{AtomicU32, Ordering};

use rayon::prelude::*;

use super::{LANES, Neighborhoods};
use crate::camera::{Reprojection, Seen};
use crate::project::ScreenPoints;

/// A search starts from a k-radius of the last frame times this: neighbours come and go, and pixels hold other points.
pub(crate) const SLACK: f32 = 1.05;
/// Least and most radius to start from, in first search radii: what is beyond belongs to another surface.
pub(crate) const LIKELY: [f32; 2] = [0.1, 4.0];
/// The CPU looks back as long as the radii of the last frame, times this, are large enough for all of sixteen points: what is
/// known of the points around is as good otherwise.
const TRUSTED: f32 = 1.2;
/// When it does not, it does so for one of so many blocks all the same, to see whether that has changed.
const SKIPPED: u32 = 8;
/// Values that a task clears.
const CHUNK: usize = 1 << 16;

/// How much is made of the last frame's radii, learnt from block to block: they are right where nothing moved, and as good as any
/// where points are new.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Trust {
    /// By what factor they would have had to be larger, of late.
    missed: f32,
    skipped: u32,
}

impl Default for Trust {
    fn default() -> Self {
        Self { missed: SLACK, skipped: 0 }
    }
}

impl Trust {
    /// Whether the next block is to look back.
    #[inline(always)]
    pub(crate) fn looks_back(&mut self) -> bool {
        self.skipped = if self.slack().is_some() { 0 } else { (self.skipped + 1) % SKIPPED };
        self.skipped == 0
    }

    /// The factor on the last frame's radii to start with; `None` if they are not to be used.
    #[inline(always)]
    pub(crate) fn slack(&self) -> Option<f32> {
        (self.missed <= TRUSTED).then_some(self.missed.max(1.01))
    }

    /// Takes in the factor that a block's radii were too small by.
    #[inline(always)]
    pub(crate) fn learn(&mut self, missed: f32) {
        self.missed += 0.25 * (missed.clamp(1.0, 2.0) - self.missed);
    }
}

/// The k-radii of the last frame and of this one.
#[derive(Debug, Default)]
pub(crate) struct Past {
    last: Radii,
    next: Radii,
    reprojection: Option<Reprojection>,
}

/// What one frame leaves behind.
#[derive(Debug, Default)]
struct Radii {
    /// How it was seen, and with which k.
    seen: Option<(Seen, u32)>,
    /// Bits of the greatest k-radius per pixel; 0 where no point has one with k neighbours within.
    pixels: Vec<AtomicU32>,
}

impl Past {
    /// A frame begins. What one that was given up left is forgotten.
    pub(crate) fn begin(&mut self, now: Seen, k: u32) {
        let past = self.last.seen.filter(|&(_, known)| known == k);
        self.reprojection = past.and_then(|(past, _)| Reprojection::new(&now, &past));
        let Radii { seen, pixels } = &mut self.next;
        *seen = Some((now, k));
        pixels.resize_with(now.view.width as usize * now.view.height as usize, AtomicU32::default);
        pixels.par_chunks_mut(CHUNK).for_each(|chunk| chunk.iter_mut().for_each(|radius| *radius.get_mut() = 0));
    }

    /// The frame is done.
    pub(crate) fn end(&mut self) {
        std::mem::swap(&mut self.last, &mut self.next);
    }

    /// Nothing is known of frames before the next.
    pub(crate) fn forget(&mut self) {
        *self = Self::default();
    }

    /// The radius from which to search for the k nearest of the point at `position_view`, whose first search radius is
    /// `initial_radius`; `None` if the last frame does not tell.
    #[inline(always)]
    pub(crate) fn radius(&self, position_view: [f32; 3], initial_radius: f32) -> Option<f32> {
        let pixel = self.reprojection.as_ref()?.pixel(position_view)?;
        let radius = f32::from_bits(self.last.pixels[pixel].load(Ordering::Relaxed));
        let [least, most] = LIKELY;
        ((radius >= least * initial_radius) & (radius <= most * initial_radius)).then_some(radius)
    }

    /// Keeps what was found for `queries`.
    pub(crate) fn keep(&self, screen: &ScreenPoints, queries: &[u32], neighborhoods: &Neighborhoods) {
        let Some((Seen { view, .. }, k)) = self.next.seen else { return };
        queries.par_chunks(LANES).zip(&neighborhoods.blocks).with_min_len(64).for_each(|(queries, block)| {
            for (lane, &query) in queries.iter().enumerate() {
                if block.count.0[lane] >= k as f32 {
                    let [x, y] = screen.points[query as usize].pixel_xy();
                    // Of the two points of a pixel always the same one.
                    let pixel = &self.next.pixels[y * view.width as usize + x];
                    pixel.fetch_max(block.k_radius.0[lane].to_bits(), Ordering::Relaxed);
                }
            }
        });
    }
}
