//! What scanners see.

use std::sync::Arc;

use autosplats_cloud::Contents;

use crate::Scene;

/// A surface at one moment.
#[derive(Clone, Debug)]
pub enum Surface {
    /// A generated scene.
    Scene(Scene),
    /// The triangles of a mesh.
    Mesh(Arc<Contents>),
}
