//! What a scene consists of.

use glam::DVec3;

use super::octree::Octree;

/// The surface, and how to take points from it.
#[derive(Debug)]
pub(super) struct Model {
    pub(super) tree: Octree,
    pub(super) points: Points,
}

/// Origin of a scene's points.
#[derive(Debug)]
pub(super) enum Points {
    /// Sampled evenly on each zone. The values are the zones' shares of the points.
    Sampled(Vec<f64>),
    /// Scanned from these positions.
    Scanned(Vec<DVec3>),
}
