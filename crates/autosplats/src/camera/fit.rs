//! Cameras that show a whole cloud, for callers without a camera of their own.

use autosplats_cloud::{Axes, Crs, PointCloud, Scan};
use glam::{DQuat, DVec2, DVec3};

use super::body::{OUTLIER_SHARE, main_body, robust_range, samples};
use super::{Camera, Projection};
use crate::Error;

/// Points in the sample: enough for quantiles, few enough to cost nothing.
const FIT_SAMPLES: usize = 100_000;
/// Radii of the core of the points within which all points are shown; see [`main_body`].
const BODY_REACH: f64 = 1.3;
/// Fraction of the picture left free at each side.
const FREE_PICTURE_SHARE: f64 = 0.04;

/// Free space around the points, in mean distances between points. Discs at the rim of a sparse cloud then end within
/// the picture; a disc cut by the edge looks like a surface that continues.
const RIM_POINT_DISTANCES: f64 = 2.5;

/// Least distance from the eye to the points, as a fraction of their extent. Nearer points would hide how large the
/// rest is.
const MIN_EYE_DISTANCE_EXTENTS: f64 = 0.2;
/// Iterations to find the middle of the picture, because the outermost points change with the middle.
const MIDDLE_STEPS: usize = 8;

/// A sensor stands among its points if the furthest are at least this many times as far, horizontally, as the median. A
/// view of all points would make the densest part small.
const MIN_RANGE_RATIO: f64 = 4.0;
/// Position of an eye behind a sensor and above it, and of its target ahead. Unit: geometric mean of the median and the
/// 0.9 quantile of the horizontal ranges.
const EYE_BEHIND_RANGES: f64 = 1.15;
const EYE_ABOVE_RANGES: f64 = 0.75;
const TARGET_AHEAD_RANGES: f64 = 0.45;
/// Rotation of the eye about the sensor, in degrees. Objects along the way hide each other less.
const EYE_TURN_DEG: f64 = 20.0;
/// Height of the picture over its distance from the eye at 40°. `EYE_BEHIND_RANGES`, `EYE_ABOVE_RANGES` and
/// `TARGET_AHEAD_RANGES` are meant for this field of view.
const REFERENCE_HEIGHT_RATIO: f64 = 0.728;
/// Least fraction of the way from the target to the eye that remains for wide fields of view. A nearer eye would pass
/// the sensor.
const MIN_EYE_WAY_SHARE: f64 = 0.4;
/// Distance from the line of sight within which points are in the way, as a fraction of the unit of
/// `EYE_BEHIND_RANGES`.
const MAX_OBSTACLE_RANGES: f64 = 0.15;
/// Fewer than one point in this many do not count as being in the way.
const POINTS_PER_OBSTACLE: usize = 500;
/// Horizontal distance of a sensor from the middle of its points above which it sees one side, in the unit of
/// `EYE_BEHIND_RANGES`.
const MIN_ONE_SIDED_RANGES: f64 = 0.3;
/// Points are seen from one side if the mean of the horizontal unit vectors towards their sensors is longer than this.
const MIN_MEAN_DIRECTION: f64 = 0.6;
/// Least ratio of the nearest points' horizontal range to the median for a side to exist. Points above or below a
/// sensor have no side.
const MIN_NEAREST_RANGE_RATIO: f64 = 0.3;
/// Quantile of the horizontal ranges that counts as nearest.
const NEAREST_QUANTILE: f64 = 0.05;
/// Height of an eye on the seen side over its horizontal distance.
const EYE_HEIGHT_RATIO: f64 = 0.47;

/// Position of the camera relative to the cloud.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum ViewDirection {
    /// Chosen from the data. Points in a camera's frame, in perspective, are seen from the camera. A scan that is far
    /// denser near its sensor, as of a lidar on a car, is seen from behind and above the sensor. This needs
    /// perspective. Several sensors count as one in their middle. An unknown sensor is assumed at the origin if the
    /// cloud has no coordinate system. Points that sensors saw from one side are seen from half right of and above that
    /// side. All else as [`Iso`](Self::Iso).
    #[default]
    Auto,
    /// From the front, half right and above.
    Iso,
    /// From the front: -Y if Z is up, +Z if Y is up.
    Front,
    /// From behind.
    Back,
    /// From the left-hand side of a viewer at the front.
    Left,
    /// From the right-hand side of a viewer at the front.
    Right,
    /// From above, with the front at the lower edge.
    Top,
    /// From below, with the front at the upper edge.
    Bottom,
}

impl Camera {
    /// Creates a camera that sees all of `cloud` from `direction`, except a few distant outliers. With
    /// [`ViewDirection::Auto`] the camera may stand among the points and see a part of them.
    ///
    /// `aspect` is width over height. The height of an orthographic `projection` is replaced by one that fits. The
    /// field of view of a perspective one is kept, except for a sensor's own view.
    ///
    /// # Errors
    /// [`Error::NothingVisible`] if the cloud has no finite point, [`Error::Camera`] if the projection is invalid.
    ///
    /// # Examples
    ///
    /// ```
    /// use autosplats::{Camera, Projection, ViewDirection, guess_axes};
    /// use autosplats_scenes::Scene;
    ///
    /// let (scene, count) = Scene::parse("figure:2K")?;
    /// let cloud = scene.sample(count, &())?;
    /// let projection = Projection::PerspectiveFovDeg(40.0);
    /// let axes = guess_axes(&cloud);
    /// let camera = Camera::fit(&cloud, axes, ViewDirection::Front, 4.0 / 3.0, projection)?;
    /// let lens = camera.lens([64, 48])?;
    /// let (pixel, _) = lens.to_pixel(cloud.world_position(0)).ok_or("it is behind the eye")?;
    /// assert!((0.0..64.0).contains(&pixel.x) && (0.0..48.0).contains(&pixel.y));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn fit(
        cloud: &PointCloud,
        axes: Axes,
        direction: ViewDirection,
        aspect: f64,
        projection: Projection,
    ) -> Result<Self, Error> {
        let [right, front, up] = axes.frame();
        let iso = front + 0.62 * right + 0.55 * up;
        let (to_viewer, picture_up) = match direction {
            ViewDirection::Auto if axes == Axes::Camera => (front, up),
            ViewDirection::Auto => (direction_to_seen_side(cloud, up).unwrap_or(iso), up),
            ViewDirection::Iso => (iso, up),
            ViewDirection::Front => (front, up),
            ViewDirection::Back => (-front, up),
            ViewDirection::Left => (-right, up),
            ViewDirection::Right => (right, up),
            ViewDirection::Top => (up, -front),
            ViewDirection::Bottom => (-up, front),
        };
        if let Projection::Pinhole { .. } = projection {
            return Err(Error::Camera("a calibrated camera has a pose and is not fitted".into()));
        }
        let own = match projection {
            Projection::PerspectiveFovDeg(fov) if direction == ViewDirection::Auto => Some((axes, fov)),
            _ => None,
        };
        if let Some((axes, fov)) = own.filter(|&(axes, _)| axes != Axes::Camera)
            && let Some([eye, look_at]) = behind_sensor(cloud, axes, fov, aspect)
        {
            let camera = Self { eye, look_at, up: picture_up, projection };
            return camera.axes().map(|_| camera);
        }
        let camera = Self { eye: to_viewer, look_at: DVec3::ZERO, up: picture_up, projection };
        camera.place(cloud, aspect, matches!(own, Some((Axes::Camera, _))))
    }

    /// Moves this camera, without turning it, to where it sees all of `cloud`, except a few distant outliers. `aspect`
    /// is width over height. A perspective camera keeps its field of view; the height of an orthographic one is
    /// replaced.
    ///
    /// # Errors
    /// Those of [`fit`](Self::fit).
    pub fn showing(self, cloud: &PointCloud, aspect: f64) -> Result<Self, Error> {
        self.place(cloud, aspect, false)
    }

    /// Moves the camera to where it sees all of `cloud`. With `from_sensor`, moves it to the world's origin if the
    /// sensor seems to be there.
    fn place(mut self, cloud: &PointCloud, aspect: f64, from_sensor: bool) -> Result<Self, Error> {
        let camera = &mut self;
        let axes = camera.axes()?;
        let forward = axes[2];
        let (kept, ranges) = main_body(samples(cloud, axes, FIT_SAMPLES), BODY_REACH);
        if kept.is_empty() {
            return Err(Error::NothingVisible("the cloud has no point with finite coordinates".into()));
        }
        let middle = ranges.map(|[low, high]| 0.5 * (low + high));
        let extent = ranges.map(|[low, high]| high - low);
        // Points in a single place still need a picture of some size.
        let least = (1e-6 * cloud.origin().abs().max_element()).max(1e-3);
        let extent = extent.map(|e| e.max(if extent == [0.0; 3] { least } else { 0.0 }));
        let rim = RIM_POINT_DISTANCES * (extent[0] * extent[1] / cloud.len() as f64).sqrt();
        let to_world = |p: [f64; 3]| cloud.origin() + axes[0] * p[0] + axes[1] * p[1] + axes[2] * p[2];
        let half_room = 0.5 - FREE_PICTURE_SHARE;
        camera.look_at = to_world(middle);

        if from_sensor && let Some(camera) = from_origin(&kept, axes, cloud.origin(), camera.up, aspect)? {
            return Ok(camera);
        }
        let distance = match &mut camera.projection {
            Projection::OrthographicHeight(height) => {
                let [width, upright] = [0, 1].map(|i| (extent[i] + 2.0 * rim) / (2.0 * half_room));
                *height = upright.max(width / aspect).max(f64::MIN_POSITIVE);
                // In front of all points, including trimmed ones that are near.
                2.0 * extent[2] + *height
            }
            projection => {
                let fov = projection.fov_deg().unwrap_or(Projection::USUAL_FOV_DEG);
                let slope = 2.0 * half_room * (0.5 * fov).to_radians().tan();
                let eye = eye_before(&kept, 0, slope * aspect, rim).min(eye_before(&kept, 1, slope, rim));
                let least = 0.5 * extent[2] + extent.iter().fold(0.0, |a: f64, &b| a.max(b)) * MIN_EYE_DISTANCE_EXTENTS;
                let distance = (middle[2] - eye).max(least);
                // Near points look wider than far points, so that the middle of the picture differs from the middle of
                // the points.
                let [x, y] = [0, 1].map(|axis| middle_seen(&kept, axis, middle[2] - distance, rim, middle[axis]));
                camera.look_at = to_world([x, y, middle[2]]);
                distance
            }
        };
        camera.eye = camera.look_at - forward * distance;
        Ok(self)
    }
}

/// Position along the line of sight, the third axis, of an eye whose picture's two opposite sides touch the `points`.
/// Each point is a disc of radius `rim`. The sides are apart along `axis`; `slope` is the tangent of their angle to the
/// line of sight.
fn eye_before(points: &[DVec3], axis: usize, slope: f64, rim: f64) -> f64 {
    // Offset of each side from the line of sight at position 0.
    let [right, left] = points.iter().fold([f64::NEG_INFINITY; 2], |[right, left], p| {
        let narrower = rim - slope * p.z;
        [right.max(p[axis] + narrower), left.max(narrower - p[axis])]
    });
    -0.5 * (right + left) / slope
}

/// Position along `axis` of an eye that sees `points` in the middle of the picture. Each point is a disc of radius
/// `rim`; `eye` is the position along the line of sight. The search starts at `middle`.
fn middle_seen(points: &[DVec3], axis: usize, eye: f64, rim: f64, middle: f64) -> f64 {
    (0..MIDDLE_STEPS).fold(middle, |middle, _| {
        // The outermost point of the picture on each side: its tangent, position and distance along the line of sight.
        let none = [(f64::NEG_INFINITY, 0.0, 1.0); 2];
        let [(_, right, right_z), (_, left, left_z)] = points.iter().fold(none, |[right, left], p| {
            let z = p.z - eye;
            let further = |end: (f64, f64, f64), place: f64, away: f64| {
                if away / z > end.0 { (away / z, place, z) } else { end }
            };
            let [high, low] = [p[axis] + rim, p[axis] - rim];
            [further(right, high, high - middle), further(left, low, middle - low)]
        });
        // Both have the same tangent from here.
        (right * left_z + left * right_z) / (left_z + right_z)
    })
}

/// The camera that sees all `points` (along `axes`, relative to `origin`) from the world's origin, which is the
/// sensor's position for points in its frame. `None` if the points do not lie ahead, so that the sensor is elsewhere.
fn from_origin(
    points: &[DVec3],
    axes: [DVec3; 3],
    origin: DVec3,
    up: DVec3,
    aspect: f64,
) -> Result<Option<Camera>, Error> {
    let world = |p: DVec3| axes[0] * p.x + axes[1] * p.y + axes[2] * p.z;
    let offset = DVec3::from(axes.map(|axis| axis.dot(origin)));
    let points: Vec<DVec3> = points.iter().map(|&p| p + offset).filter(|p| p.z > 0.0).collect();
    let depth = points.iter().map(|p| p.z).sum::<f64>() / points.len().max(1) as f64;
    // Points next to the sensor would cover half the sky.
    let slopes = points.iter().filter(|p| p.z > 0.1 * depth).map(|&p| DVec3::new(p.x / p.z, p.y / p.z, 1.0));
    let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    let [low, high] = slopes.clone().fold(none, |[low, high], slope| [low.min(slope), high.max(slope)]);
    let ahead = 0.5 * (low + high);
    if !(ahead.truncate().length() < 0.3) {
        return Ok(None);
    }
    let projection = Projection::PerspectiveFovDeg(1.0);
    let mut camera = Camera { eye: DVec3::ZERO, look_at: world(ahead) * depth, up, projection };
    let [right, down, forward] = camera.axes()?;
    let slope = slopes.fold(0.0f64, |most, slope| {
        let p = world(slope);
        most.max((p.dot(down) / p.dot(forward)).abs()).max((p.dot(right) / p.dot(forward)).abs() / aspect)
    });
    let fov = 2.0 * (slope / (1.0 - 2.0 * FREE_PICTURE_SHARE)).atan().to_degrees();
    camera.projection = Projection::PerspectiveFovDeg(fov.max(1.0));
    Ok((fov < 120.0).then_some(camera))
}

/// Direction towards an eye on the side of a cloud that its sensors saw; from the other side it would see backs. `None`
/// if no sensor is known, or if the sensors saw all sides or stood among the points.
fn direction_to_seen_side(cloud: &PointCloud, up: DVec3) -> Option<DVec3> {
    let sensor = middle_of(cloud.scans())? - cloud.origin();
    let samples = samples(cloud, DVec3::AXES, FIT_SAMPLES);
    let ways: Vec<DVec3> = samples.iter().map(|&p| (sensor - p).reject_from(up)).collect();
    let mean = ways.iter().map(|way| way.normalize_or_zero()).sum::<DVec3>() / ways.len().max(1) as f64;
    let mut ranges: Vec<f64> = ways.iter().map(|way| way.length()).collect();
    ranges.sort_unstable_by(f64::total_cmp);
    let range = |share: f64| ranges.get((share * ranges.len() as f64) as usize).copied();
    let is_apart = range(NEAREST_QUANTILE)? >= MIN_NEAREST_RANGE_RATIO * range(0.5)?;
    let aside = DQuat::from_axis_angle(up, EYE_TURN_DEG.to_radians());
    (is_apart && mean.length() > MIN_MEAN_DIRECTION).then(|| aside * mean.normalize() + EYE_HEIGHT_RATIO * up)
}

/// Mean sensor position of some scans in world coordinates; `None` without scans.
fn middle_of(scans: &[Scan]) -> Option<DVec3> {
    (!scans.is_empty()).then(|| scans.iter().map(Scan::position).sum::<DVec3>() / scans.len() as f64)
}

/// Eye behind and above the sensor of a cloud, and its target ahead. Several sensors count as one in their middle;
/// without scans and coordinate system the sensor is at the origin. `None` if the sensor does not stand among the
/// points. `fov` is the vertical field of view in degrees.
fn behind_sensor(cloud: &PointCloud, axes: Axes, fov: f64, aspect: f64) -> Option<[DVec3; 2]> {
    let sensor = match middle_of(cloud.scans()) {
        None if *cloud.crs() != Crs::default() => return None,
        sensor => sensor.unwrap_or_default(),
    };
    // As if Z were up: the first axis to the right, the second away from the viewer.
    let [right, front, up] = axes.frame();
    let frame = [right, -front, up];
    let offset = DVec3::from(frame.map(|axis| axis.dot(cloud.origin() - sensor)));
    let points: Vec<DVec3> = samples(cloud, frame, FIT_SAMPLES).into_iter().map(|p| p + offset).collect();
    let mut ranges: Vec<f64> = points.iter().map(|p| p.truncate().length()).collect();
    ranges.sort_unstable_by(f64::total_cmp);
    let range = |share: f64| ranges.get((share * ranges.len() as f64) as usize).copied();
    let [half, most, all] = [range(0.5)?, range(0.9)?, range(1.0 - 2.0 * OUTLIER_SHARE)?];
    let distance = (half * most).sqrt();
    let [low, high] = robust_range(&points, 2);
    // Tall thin things would mostly be above the picture.
    if !(half > 0.0 && all > MIN_RANGE_RATIO * half && high - low < all.min(MIN_RANGE_RATIO * distance)) {
        return None;
    }
    let near = || points.iter().filter(|p| p.truncate().length() <= most);
    let middle = near().sum::<DVec3>() / near().count() as f64;
    // A sensor that sees one side is seen from behind. Other sensors are seen along the direction in which points reach
    // furthest. The mean of doubled angles gives this direction without a sign; the sign favours +X and +Y, which are
    // ahead in most conventions.
    let sees_one_side = middle.truncate().length() > MIN_ONE_SIDED_RANGES * distance;
    let doubled = |p: &DVec3| DVec2::new(p.x * p.x - p.y * p.y, 2.0 * p.x * p.y) / p.truncate().length().max(distance);
    let forward = if sees_one_side {
        middle.truncate().normalize()
    } else {
        let way = DVec2::from_angle(0.5 * points.iter().map(doubled).sum::<DVec2>().to_angle());
        way * way.dot(DVec2::new(1.0, 0.9)).signum()
    };
    let upright_at_1 = 2.0 * (0.5 * fov).to_radians().tan() * aspect.min(1.0);
    let place = |(end, side): (f64, f64)| {
        let forward = forward * end;
        let back = -DVec2::from_angle(side * EYE_TURN_DEG.to_radians()).rotate(forward);
        let eye = 0.5 * middle + (back * EYE_BEHIND_RANGES).extend(EYE_ABOVE_RANGES) * distance;
        let look_at = middle + (forward * TARGET_AHEAD_RANGES).extend(0.0) * distance;
        [look_at + (eye - look_at) * (REFERENCE_HEIGHT_RATIO / upright_at_1).max(MIN_EYE_WAY_SHARE), look_at]
    };
    // From either side and either end, the position with fewer points in the way; a few points are ignored.
    let places = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)].map(place);
    let in_the_way = |[eye, _]: &[DVec3; 2]| {
        let close = |p: &&DVec3| {
            // Without the points around the sensor.
            let along = (p.dot(*eye) / eye.length_squared()).clamp(0.4, 1.0);
            p.distance(*eye * along) < MAX_OBSTACLE_RANGES * distance
        };
        points.iter().filter(close).count() * POINTS_PER_OBSTACLE / points.len()
    };
    let places = if sees_one_side { &places[..2] } else { &places };
    let best = places.iter().min_by_key(|place| in_the_way(place))?;
    Some(best.map(|p| sensor + frame[0] * p.x + frame[1] * p.y + frame[2] * p.z))
}

#[cfg(test)]
mod tests;
