//! The sensor and the axes of a PCD.

use autosplats_cloud::{Axes, PointCloud, Scan};
use glam::{DMat4, DVec3};
use rayon::prelude::*;

use super::header::{Header, Viewpoint};

/// Pairs of neighbours sampled to find out from where an image of points was taken.
const MAX_SAMPLED_PAIRS: usize = 1 << 14;

/// Largest range of depth cameras, in metres, with a margin.
const DEPTH_CAMERA_RANGE: f32 = 20.0;

/// Points looked at as one piece of parallel work.
const BLOCK: usize = 1 << 14;

/// What the header and all points tell of the sensor.
pub(super) struct Frame {
    pub(super) world_from_sensor: Option<DMat4>,
    axes: Option<Axes>,
}

impl Frame {
    /// `from_origin` is what [`image_from_origin`] tells; `seen` is counted if [`may_be_seen_from_origin`].
    pub(super) fn of(header: &Header, from_origin: bool, colored: bool, seen: Option<InFront>) -> Self {
        let origin = from_origin.then_some(DMat4::IDENTITY);
        let camera = || seen.is_some_and(|seen| seen.tells_camera(header, colored)).then_some(Axes::Camera);
        Self { world_from_sensor: sensor(header).or(origin), axes: header.axes.or_else(camera) }
    }

    /// Tells points of them.
    pub(super) fn set(&self, cloud: PointCloud) -> PointCloud {
        let points = 0..cloud.len();
        let scan = self.world_from_sensor.map(|world_from_sensor| Scan { name: None, world_from_sensor, points });
        let cloud = cloud.with_scans(scan.into_iter().collect());
        if let Some(axes) = self.axes { cloud.with_axes(axes) } else { cloud }
    }
}

/// The sensor's pose, if VIEWPOINT is not the default, or if a file of this project states that the default is true.
///
/// Points are not moved by the pose. The format calls VIEWPOINT the place from which the points were acquired, not a
/// transformation to apply, and other programs leave points unmoved.
fn sensor(header: &Header) -> Option<DMat4> {
    match header.viewpoint {
        Viewpoint::At(world_from_sensor) => Some(world_from_sensor),
        Viewpoint::Identity => header.knows_sensor.then_some(DMat4::IDENTITY),
        Viewpoint::Broken => None,
    }
}

/// The scans that the header states.
pub(super) fn scans(header: &Header, points: usize) -> Vec<Scan> {
    let scan = |world_from_sensor| Scan { name: None, world_from_sensor, points: 0..points };
    sensor(header).map(scan).into_iter().collect()
}

/// Points of which [`image_from_origin`] needs the rays, and those of the points after them. None if the points are no
/// image of an unknown sensor.
pub(super) fn sampled_pairs(header: &Header, points: usize) -> Vec<usize> {
    let is_image = header.viewpoint == Viewpoint::Identity && !header.knows_sensor && header.height > 1;
    let Some(width) = header.width.filter(|&width| width > 0 && is_image) else { return Vec::new() };
    let step = points.div_ceil(MAX_SAMPLED_PAIRS).max(1);
    (0..points.saturating_sub(1)).step_by(step).filter(|i| (i + 1) % width != 0).collect()
}

/// The direction to a point.
pub(super) fn ray(point: DVec3) -> Option<DVec3> {
    point.try_normalize().filter(|ray| ray.is_finite())
}

/// Whether an organised cloud was taken from the origin, although its VIEWPOINT is the default. Seen from the sensor,
/// neighbours in a row of the image have about the same angle between them, near or far. Moved points do not.
pub(super) fn image_from_origin(starts: &[usize], ray: impl Fn(usize) -> Option<DVec3>) -> bool {
    let mut angles: Vec<f64> = starts.iter().filter_map(|&i| Some(ray(i)?.cross(ray(i + 1)?).length())).collect();
    if angles.is_empty() {
        return false;
    }
    angles.sort_unstable_by(f64::total_cmp);
    let middle = angles[angles.len() / 2];
    let even = angles.iter().filter(|&&angle| (0.3 * middle..=3.0 * middle).contains(&angle)).count();
    middle > 0.0 && even * 10 >= angles.len() * 9
}

/// Whether points of this origin may be in a camera's frame.
pub(super) fn may_be_seen_from_origin(header: &Header, origin: DVec3) -> bool {
    header.axes.is_none() && header.viewpoint == Viewpoint::Identity && origin == DVec3::ZERO
}

/// How many finite points are in front of the origin, and how many behind.
#[derive(Clone, Copy, Default)]
pub(super) struct InFront {
    front: usize,
    behind: usize,
    /// Whether a point is beyond the range of depth cameras.
    far: bool,
}

impl InFront {
    /// Adds points.
    pub(super) fn with(self, positions: &[[f32; 3]]) -> Self {
        let add = |mut all: Self, points: &[[f32; 3]]| {
            for point in points {
                all.far |= point.iter().any(|value| value.abs() > DEPTH_CAMERA_RANGE);
                if point.iter().all(|value| value.is_finite()) {
                    if point[2] > 0.0 { all.front += 1 } else { all.behind += 1 }
                }
            }
            all
        };
        let join =
            |a: Self, b: Self| Self { front: a.front + b.front, behind: a.behind + b.behind, far: a.far || b.far };
        join(self, positions.par_chunks(BLOCK).fold(Self::default, add).reduce(Self::default, join))
    }

    /// Whether an image of points, or coloured points in a depth camera's range, are in the camera's frame: 99 % in
    /// front.
    fn tells_camera(self, header: &Header, colored: bool) -> bool {
        let may_be = header.height > 1 || colored && !self.far;
        may_be && self.front > 0 && self.behind * 100 <= self.front
    }
}
