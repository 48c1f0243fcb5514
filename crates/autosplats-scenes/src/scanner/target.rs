//! The surfaces that rays of scanners hit.

use std::sync::Arc;

use autosplats_cloud::{Axes, Contents, Crs, Error};
use glam::DVec3;

use super::{
    rays::{Rays, Window},
    triangles::{Nearest, Triangles},
};
use crate::{Scene, Surface};

/// A part of a scene whose window has at most this many rays is not subdivided.
const MAX_UNCUT_RAYS: u64 = 25;

/// Relative margin on the span of a ray that is searched.
const RELATIVE_RANGE_MARGIN: f32 = 1e-6;

/// A surface that rays can hit.
pub(super) enum Target {
    Scene(Scene),
    Mesh(Arc<Contents>, Triangles),
}

/// The end of a ray.
pub(super) struct Hit {
    pub(super) distance: f64,
    pub(super) color: Option<[u8; 3]>,
}

/// A target prepared for all rays of a scanner.
pub(super) enum PreparedTarget<'a> {
    /// Nearest and farthest distance at which each ray may hit something, if known. Far is below near if none.
    Scene(&'a Scene, Option<Vec<[f32; 2]>>),
    Mesh(&'a Contents, &'a Triangles, Vec<Nearest>),
}

impl Target {
    pub(super) fn new(surface: Surface) -> Result<Self, Error> {
        Ok(match surface {
            Surface::Scene(scene) => {
                scene.prepare();
                Self::Scene(scene)
            }
            Surface::Mesh(mesh) => {
                let triangles = Triangles::new(&mesh)?;
                Self::Mesh(mesh, triangles)
            }
        })
    }

    /// Origin of the stored positions.
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

    /// Prepares the target for all rays of a scanner.
    pub(super) fn prepared_for(&self, rays: &Rays) -> PreparedTarget<'_> {
        match self {
            Self::Scene(scene) => PreparedTarget::Scene(scene, spans(scene, rays)),
            Self::Mesh(mesh, triangles) => {
                PreparedTarget::Mesh(mesh, triangles, triangles.nearest(rays, mesh.cloud.origin()))
            }
        }
    }
}

/// For each ray the range of distances at which it may hit the scene. Empty for most rays.
fn spans(scene: &Scene, rays: &Rays) -> Option<Vec<[f32; 2]>> {
    let cube_radius = rays.cube_radius();
    let mut parts: Vec<(Window, [f32; 2])> = Vec::new();
    let known = scene.cubes(&mut |middle, half, whole| {
        let Some(window) = rays.window(rays.in_sensor(middle - rays.eye), half * cube_radius) else { return false };
        if !whole && window.len() > MAX_UNCUT_RAYS {
            return true;
        }
        let (distance, radius) = (middle.distance(rays.eye), half * 3.0_f64.sqrt());
        let (near, far) = ((distance - radius) as f32, (distance + radius) as f32);
        parts.push((window, [near - RELATIVE_RANGE_MARGIN * far, far + RELATIVE_RANGE_MARGIN * far]));
        false
    });
    known.then(|| {
        rays.put_all(&parts, [f32::INFINITY, f32::NEG_INFINITY], |[near, far], part, _, _| {
            (*near, *far) = (near.min(part[0]), far.max(part[1]));
        })
    })
}

impl PreparedTarget<'_> {
    /// Whether a ray, numbered row by row, may hit anything.
    pub(super) fn may_meet(&self, ray: usize) -> bool {
        match self {
            Self::Scene(_, spans) => spans.as_ref().is_none_or(|spans| spans[ray][0] <= spans[ray][1]),
            Self::Mesh(_, _, nearest) => nearest[ray].distance < f64::INFINITY,
        }
    }

    /// The hit of a ray for which [`may_meet`](Self::may_meet) holds. `direction` is in the scanner's frame.
    pub(super) fn hit(&self, rays: &Rays, ray: usize, direction: DVec3) -> Option<Hit> {
        match self {
            Self::Scene(scene, spans) => {
                let [near, far] = spans.as_ref().map_or([0.0, f32::INFINITY], |spans| spans[ray]);
                let within = f64::from(near)..f64::from(far);
                let (distance, rgb) = scene.trace_within(rays.eye, rays.in_world(direction), within)?;
                let color = rgb.map(|channel| (channel * 255.0 + 0.5).clamp(0.0, 255.0) as u8);
                Some(Hit { distance, color: Some(color) })
            }
            Self::Mesh(mesh, triangles, nearest) => {
                let nearest = nearest[ray];
                let mixed = |colors: &[[u8; 3]]| {
                    let eye = rays.eye - mesh.cloud.origin();
                    let (corners, [second, third]) = triangles.place(nearest, eye, rays.in_world(direction));
                    let [a, b, c] = corners.map(|corner| colors[corner as usize].map(f64::from));
                    let mix = |i: usize| a[i] * (1.0 - second - third) + b[i] * second + c[i] * third;
                    [0, 1, 2].map(|i| (mix(i) + 0.5).clamp(0.0, 255.0) as u8)
                };
                Some(Hit { distance: nearest.distance, color: mesh.cloud.colors().map(mixed) })
            }
        }
    }
}
