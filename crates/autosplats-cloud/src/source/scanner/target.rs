//! What rays of scanners end at.

use std::sync::Arc;

use glam::DVec3;

use super::tree::{Tree, Waiting};
use crate::{Axes, Contents, Crs, Error, Scene, source::animation::Surface};

/// A surface that can be hit.
pub(super) enum Target {
    Scene(Scene),
    Mesh(Arc<Contents>, Tree),
}

/// Where a ray ends.
pub(super) struct Hit {
    pub(super) distance: f64,
    pub(super) color: Option<[u8; 3]>,
}

impl Target {
    pub(super) fn new(surface: Surface) -> Result<Self, Error> {
        Ok(match surface {
            Surface::Scene(scene) => Self::Scene(scene),
            Surface::Mesh(mesh) => {
                let tree = Tree::new(&mesh)?;
                Self::Mesh(mesh, tree)
            }
        })
    }

    /// What positions are stored about.
    pub(super) fn origin(&self) -> DVec3 {
        match self {
            Self::Scene(_) => DVec3::ZERO,
            Self::Mesh(mesh, _) => mesh.cloud.origin(),
        }
    }

    pub(super) fn axes(&self) -> Option<Axes> {
        match self {
            Self::Scene(_) => Some(Axes::ZUp),
            Self::Mesh(mesh, _) => mesh.cloud.axes(),
        }
    }

    pub(super) fn crs(&self) -> Crs {
        match self {
            Self::Scene(_) => Crs::default(),
            Self::Mesh(mesh, _) => mesh.cloud.crs().clone(),
        }
    }

    pub(super) fn is_colored(&self) -> bool {
        match self {
            Self::Scene(_) => true,
            Self::Mesh(mesh, _) => mesh.cloud.colors().is_some(),
        }
    }

    /// First place where a ray of length one from a place in world coordinates meets the surface.
    pub(super) fn trace(&self, eye: DVec3, direction: DVec3, waiting: &mut Waiting) -> Option<Hit> {
        match self {
            Self::Scene(scene) => {
                let hit = scene.trace(eye, direction)?;
                let color = hit.rgb.map(|channel| (channel * 255.0 + 0.5).clamp(0.0, 255.0) as u8);
                Some(Hit { distance: hit.distance, color: Some(color) })
            }
            Self::Mesh(mesh, tree) => {
                let crossing = tree.trace(eye - mesh.cloud.origin(), direction, waiting)?;
                let [second, third] = crossing.weights;
                let mixed = |colors: &[[u8; 3]]| {
                    let [a, b, c] = crossing.corners.map(|corner| colors[corner as usize].map(f64::from));
                    let mix = |i: usize| a[i] * (1.0 - second - third) + b[i] * second + c[i] * third;
                    [0, 1, 2].map(|i| (mix(i) + 0.5).clamp(0.0, 255.0) as u8)
                };
                Some(Hit { distance: crossing.distance, color: mesh.cloud.colors().map(mixed) })
            }
        }
    }
}
