//! Exact surfaces.

use std::sync::Arc;

use autosplats::cloud::glam::DVec3;
use autosplats_scenes::Scene;

use crate::mesh::{Hit, Mesh};

/// An exact surface.
#[derive(Clone, Debug)]
pub enum Surface {
    /// A built-in scene.
    Scene(Scene),
    /// A mesh with interpolated normals.
    Mesh(Arc<Mesh>),
}

impl Surface {
    /// The first intersection of a ray with the surface. `direction` has length 1.
    pub fn trace(&self, origin: DVec3, direction: DVec3) -> Option<Hit> {
        match self {
            Self::Scene(scene) => {
                scene.trace(origin, direction).map(|hit| Hit { distance: hit.distance, normal: hit.normal })
            }
            Self::Mesh(mesh) => mesh.trace(origin, direction),
        }
    }
}
