//! Which nodes of trees a picture needs, and loading them.
//!
//! # How it works
//!
//! A node is chosen if the points of its parent would be further apart on the screen than [`Detail`] allows. What is
//! chosen depends on the trees, the camera and the size of the picture alone, never on what happens to be loaded, so
//! that pictures are the same however their points came. A limit on points cuts the finest levels everywhere alike.
//! Nodes are [loaded](load_nodes) in parallel and handed over in the order of their keys.

mod choose;
mod load;
mod scene;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use autosplats_cloud::{SLOT_POINTS, Tree};
use glam::DMat4;

pub use choose::{Choice, choose, choose_loading};
pub use load::{NodePoints, load_nodes};
pub use scene::{Coarsest, Shown, TreeScene};

/// How fine points on the screen shall be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detail {
    /// Largest distance between neighbouring points on the screen, in pixels, above 0. Finer nodes are left out.
    pub spacing_px: f64,
    /// Most points of a picture. If more are needed, the spacing grows everywhere alike.
    pub max_points: usize,
    /// Most slots of a [pool](autosplats_cloud::PointPool) that the points of a picture may take.
    pub max_slots: usize,
}

impl Default for Detail {
    /// One pixel and ten million points. A finer spacing adds nothing that can be seen.
    fn default() -> Self {
        Self { spacing_px: 1.0, max_points: 10_000_000, max_slots: usize::MAX }
    }
}

/// Slots beyond those that full ones of a picture take.
const SPARE_SLOTS: usize = 8;

impl Detail {
    /// The detail whose pictures have at most `max_points`, in slots of which nodes may leave a fifth empty.
    pub fn of_points(spacing_px: f64, max_points: usize) -> Self {
        Self { spacing_px, max_points, max_slots: max_points.div_ceil(SLOT_POINTS).saturating_mul(5) / 4 + SPARE_SLOTS }
    }
}

/// A tree and its place in the world.
#[derive(Clone, Debug)]
pub struct PlacedTree {
    /// The tree.
    pub tree: Arc<dyn Tree>,
    /// Maps the tree's coordinates to the world: a rotation, a uniform scale and a translation.
    pub world_from_tree: DMat4,
}
