//! Surfaces that are known exactly.

use std::sync::Arc;

use autosplats::cloud::Scene;
use autosplats::cloud::glam::DVec3;

use crate::mesh::Mesh;

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// From the ray's origin.
    pub distance: f64,
    /// Unit normal, on either side.
    pub normal: DVec3,
}

/// A surface that is known exactly.
#[derive(Clone, Debug)]
pub enum Surface {
    /// A built-in scene.
    Scene(Scene),
    /// A smooth mesh.
    Mesh(Arc<Mesh>),
}

impl Surface {
    /// First place where a ray meets the surface; `direction` has length one.
    pub fn trace(&self, origin: DVec3, direction: DVec3) -> Option<Hit> {
        match self {
            Self::Scene(scene) => {
                scene.trace(origin, direction).map(|hit| Hit { distance: hit.distance, normal: hit.normal })
            }
            Self::Mesh(mesh) => mesh.trace(origin, direction),
        }
    }
}
