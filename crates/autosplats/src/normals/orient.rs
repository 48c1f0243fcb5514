//! The side that each normal points to.

use autosplats_cloud::PointCloud;
use autosplats_cloud::glam::{DVec3, Vec3};

use super::{MAX_COORDINATE, Orientation, Viewpoint};
use crate::Error;

/// Resolved orientation of normals.
pub(super) enum Sides {
    Direction(Vec3),
    /// Away from the middle, except where a viewpoint is known.
    Outward {
        /// Sorted by the first index of their points; positions are relative to the cloud's origin.
        viewpoints: Vec<Viewpoint>,
        /// Relative to the cloud's origin.
        middle: Vec3,
    },
}

impl Sides {
    pub(super) fn new(cloud: &PointCloud, orientation: &Orientation) -> Result<Self, Error> {
        let bad = |value: String, range| Err(Error::Setting { name: "orientation", value, range });
        match orientation {
            Orientation::Direction(direction) => match direction.try_normalize() {
                Some(direction) => Ok(Self::Direction(direction.as_vec3())),
                None => bad(direction.to_string(), "a finite direction longer than 0"),
            },
            Orientation::Outward => Ok(Self::Outward { viewpoints: Vec::new(), middle: Vec3::ZERO }),
            Orientation::Viewpoints(given) => {
                let mut viewpoints: Vec<Viewpoint> =
                    given.iter().filter(|viewpoint| !viewpoint.points.is_empty()).cloned().collect();
                for Viewpoint { position, points } in &mut viewpoints {
                    *position -= cloud.origin();
                    if !(position.abs().max_element() <= f64::from(MAX_COORDINATE)) {
                        return bad(position.to_string(), "viewpoints within 1e18 of the cloud's origin");
                    }
                    if points.end > cloud.len() {
                        return bad(format!("{points:?}"), "ranges of points that the cloud has");
                    }
                }
                viewpoints.sort_by_key(|viewpoint| viewpoint.points.start);
                if let Some(pair) = viewpoints.windows(2).find(|pair| pair[0].points.end > pair[1].points.start) {
                    return bad(format!("{:?} and {:?}", pair[0].points, pair[1].points), "ranges that do not overlap");
                }
                Ok(Self::Outward { viewpoints, middle: Vec3::ZERO })
            }
        }
    }

    /// Sets the middle of the cloud.
    pub(super) fn about(self, middle: [f32; 3]) -> Self {
        match self {
            Self::Direction(_) => self,
            Self::Outward { viewpoints, .. } => Self::Outward { viewpoints, middle: middle.into() },
        }
    }

    /// The direction that the normal of a point should face, of any length.
    #[inline(always)]
    pub(super) fn toward(&self, position: [f32; 3], index: u32) -> [f32; 3] {
        match self {
            Self::Direction(direction) => direction.to_array(),
            Self::Outward { viewpoints, middle } => {
                let index = index as usize;
                // Only the last range that begins at or before the index can contain it.
                let begun = viewpoints.partition_point(|viewpoint| viewpoint.points.start <= index);
                match begun.checked_sub(1).map(|last| &viewpoints[last]) {
                    Some(seen) if index < seen.points.end => {
                        (seen.position - DVec3::from(position.map(f64::from))).as_vec3().to_array()
                    }
                    _ => (Vec3::from(position) - *middle).to_array(),
                }
            }
        }
    }
}
