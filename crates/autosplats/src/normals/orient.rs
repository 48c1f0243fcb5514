//! The side that each normal points to.

use autosplats_cloud::glam::{DVec3, Vec3};
use autosplats_cloud::{Axes, PointCloud, Scan};

use super::{MAX_COORDINATE, Orientation, Viewpoint};
use crate::Error;

/// Height over the shorter side below which a cloud is terrain.
const TERRAIN_HEIGHT: f32 = 0.5;

impl Orientation {
    /// The side for a cloud about which nothing else is known: [towards its sensors](Self::towards_sensors), else up
    /// along z for terrain, much wider than high, else outward.
    ///
    /// # Examples
    ///
    /// ```
    /// use autosplats::{Orientation, cloud::{PointCloud, glam::DVec3}};
    ///
    /// let floor = (0..100).map(|i| [(i % 10) as f32, (i / 10) as f32, 0.0]).collect();
    /// let cloud = PointCloud::new(DVec3::ZERO, floor);
    /// assert_eq!(Orientation::usual(&cloud), Orientation::Direction(DVec3::Z));
    /// ```
    #[must_use]
    pub fn usual(cloud: &PointCloud) -> Self {
        Self::towards_sensors(cloud)
            .unwrap_or_else(|| if is_terrain(cloud) { Self::Direction(DVec3::Z) } else { Self::Outward })
    }

    /// Towards the sensors of the cloud's scans, or the origin for points in a camera's frame. `None` if the cloud
    /// states no sensor.
    #[must_use]
    pub fn towards_sensors(cloud: &PointCloud) -> Option<Self> {
        if cloud.scans().is_empty() {
            return (cloud.axes() == Some(Axes::Camera)).then(|| Self::towards(DVec3::ZERO, cloud));
        }
        let viewpoint = |scan: &Scan| Viewpoint { position: scan.position(), points: scan.points.clone() };
        Some(Self::Viewpoints(cloud.scans().iter().map(viewpoint).collect()))
    }

    /// Towards one position in world coordinates, that of the sensor which saw all points of the cloud.
    #[must_use]
    pub fn towards(position: DVec3, cloud: &PointCloud) -> Self {
        Self::Viewpoints(vec![Viewpoint { position, points: 0..cloud.len() }])
    }
}

/// Whether the points are terrain seen from above: much wider than high.
fn is_terrain(cloud: &PointCloud) -> bool {
    let finite = cloud.positions().iter().filter(|point| point.iter().all(|value| value.is_finite()));
    let (min, max) = finite.fold(([f32::MAX; 3], [f32::MIN; 3]), |(min, max), point| {
        (std::array::from_fn(|axis| min[axis].min(point[axis])), std::array::from_fn(|axis| max[axis].max(point[axis])))
    });
    let [x, y, z]: [f32; 3] = std::array::from_fn(|axis| max[axis] - min[axis]);
    matches!(cloud.axes(), None | Some(Axes::ZUp | Axes::Camera)) && z < TERRAIN_HEIGHT * x.min(y)
}

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
