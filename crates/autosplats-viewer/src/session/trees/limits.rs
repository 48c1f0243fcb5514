//! How many points fit into the memory.

use autosplats::{BYTES_PER_PIXEL, still_supersample};

/// Memory of nodes on their way from the file, in bytes.
const QUEUES: u64 = 64 << 20;
/// Least memory for points, in bytes.
const LEAST_POINTS: u64 = 64 << 20;
/// Size of the window's picture at the start, pixels.
pub(crate) const START_SIZE: [u32; 2] = [1280, 800];

/// Limits of octrees (COPC, EPT).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TreeOptions {
    /// Largest distance between neighbouring points on the screen, in pixels. 0 reads all points, and so does `None`
    /// for files of less than 20 million points; for others, it is one pixel.
    pub detail: Option<f64>,
    /// Most points of a picture.
    pub max_points: usize,
    /// Memory for points and pictures, in bytes; `None` is a quarter of what is free, at most 2 GiB. Beyond it, a
    /// window that is larger than at the start takes what its pictures need.
    pub memory: Option<u64>,
}

impl Default for TreeOptions {
    fn default() -> Self {
        Self { detail: None, max_points: 10_000_000, memory: None }
    }
}

impl TreeOptions {
    /// Least [memory](Self::memory), in bytes.
    #[must_use]
    pub fn least_memory() -> u64 {
        of_picture(START_SIZE, 2) + LEAST_POINTS
    }
}

/// Limits of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Limits {
    /// Most points that it is made of.
    pub(super) max_points: usize,
    /// Most bytes of decoded nodes that are kept.
    pub(super) stored_bytes: usize,
}

impl Limits {
    /// The limits of a picture of `size` pixels, in `memory` bytes, whose points have `point_bytes`. `is_copied` says
    /// that the layers' clouds are copied to be shown.
    pub(super) fn new(memory: u64, size: [u32; 2], max_points: usize, point_bytes: usize, is_copied: bool) -> Self {
        let points = memory.saturating_sub(of_picture(size, still_supersample(size))).max(LEAST_POINTS);
        // Nodes have one half. In the other are the cloud that is shown, and the one that is to follow.
        let clouds = if is_copied { 4 } else { 2 };
        let fits = points / 2 / clouds / point_bytes.max(1) as u64;
        Self { max_points: max_points.min(fits as usize).max(1), stored_bytes: (points / 2) as usize }
    }
}

/// Bytes of all but points.
fn of_picture([width, height]: [u32; 2], supersample: u32) -> u64 {
    u64::from(width) * u64::from(height) * u64::from(supersample).pow(2) * BYTES_PER_PIXEL + QUEUES
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_share_what_pictures_leave() {
        let limits = |memory: u64, is_copied| Limits::new(memory, [100, 100], 10_000_000, 16, is_copied);
        assert_eq!(limits(2 << 30, false).max_points, 10_000_000, "there is room for all");
        let [plain, copied] = [false, true].map(|is_copied| limits(400 << 20, is_copied));
        assert!(plain.max_points < 10_000_000 && copied.max_points * 2 <= plain.max_points, "{plain:?} {copied:?}");
        let all = plain.stored_bytes + 2 * 16 * plain.max_points;
        assert!(all < (400 << 20) - (64 << 20), "{all} bytes are too many");
        assert_eq!(limits(0, false).stored_bytes, 32 << 20, "something has to be shown");
    }
}
