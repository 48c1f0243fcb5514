//! A camera that shows a whole cloud, for those who name none.

use autosplats_cloud::{Axes, PointCloud, Scan};
use glam::{DVec2, DVec3};

use super::{Camera, Projection};
use crate::Error;

/// Points looked at: enough for percentiles, few enough to cost nothing.
const SAMPLES: usize = 100_000;
/// Share of the points at either end of each axis that may be outliers.
const TRIM: f64 = 0.005;
/// Trimmed ends come back if they reach no further than this part of the extent of the rest.
const KEEP: f64 = 0.2;
/// Share of the picture left free at each side.
const BORDER: f64 = 0.04;

/// Free space around the points in mean distances between them, so that the discs at the rim of a sparse cloud end within
/// the picture. One that is cut by the picture's edge cannot be told from a surface that goes on.
const RIM: f64 = 2.5;

/// A sensor stands among its points if they reach so many times as far from it, on the ground, as half of them do: seen from
/// where all of them are in the picture, what is told best would be small.
const FAR_REACH: f64 = 4.0;
/// How far behind such a sensor to stand and how far above it, and how far ahead of it to look, as parts of the mean of how far
/// half of its points are and nine of ten.
const BEHIND: f64 = 1.15;
const ABOVE: f64 = 0.75;
const AHEAD: f64 = 0.45;
/// Turned about the sensor by so much, in degrees: more is seen of what stands along the way.
const ASIDE_DEG: f64 = 20.0;
/// What is as close to the way to the eye as this part of the distance is in the way.
const IN_THE_WAY: f64 = 0.15;

/// Where to stand in relation to the cloud.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum ViewDirection {
    /// The sensor's own view for points in a camera's frame; from behind and above the sensor for a scan that is far denser near
    /// it, as of a lidar on a car, where its position is known, or else the origin; otherwise [`Iso`](Self::Iso).
    #[default]
    Auto,
    /// From the front, half right and above.
    Iso,
    /// From the front: -Y where Z is up, +Z where Y is up.
    Front,
    /// From behind.
    Back,
    /// From the left hand of somebody at the front.
    Left,
    /// From the right hand of somebody at the front.
    Right,
    /// From above, the front at the lower edge.
    Top,
    /// From below, the front at the upper edge.
    Bottom,
}

/// Right, front (towards the viewer) and up of a convention.
fn frame(axes: Axes) -> [DVec3; 3] {
    match axes {
        Axes::ZUp => [DVec3::X, DVec3::NEG_Y, DVec3::Z],
        Axes::YUp => [DVec3::X, DVec3::Z, DVec3::Y],
        Axes::Camera => [DVec3::X, DVec3::NEG_Z, DVec3::NEG_Y],
    }
}

/// Up in world coordinates.
pub(crate) fn up(axes: Axes) -> DVec3 {
    frame(axes)[2]
}

/// The axes a cloud states, or a guess from its extents: survey coordinates and flat scenes have Z up, models Y.
pub fn guess_axes(cloud: &PointCloud) -> Axes {
    cloud.axes().unwrap_or_else(|| {
        let samples = samples(cloud, [DVec3::X, DVec3::Y, DVec3::Z]);
        let [x, y, z] = [0, 1, 2].map(|axis| {
            let [low, high] = robust_range(&samples, axis);
            high - low
        });
        let flat = z < 0.35 * x.max(y) && z < x.min(y);
        if flat || cloud.origin() != DVec3::ZERO { Axes::ZUp } else { Axes::YUp }
    })
}

impl Camera {
    /// A camera that sees all of `cloud` from `direction`, but for a few points far from the others, and but for where it stands
    /// among them ([`ViewDirection::Auto`]).
    ///
    /// `aspect` is width over height. With an orthographic `projection` its height is replaced by the one that fits; with
    /// a perspective one the field of view is kept, but for the sensor's own view, which takes the one that fits.
    ///
    /// # Errors
    /// [`Error::NothingVisible`] if the cloud has no finite point, [`Error::Camera`] if the projection is invalid.
    pub fn fit(
        cloud: &PointCloud,
        axes: Axes,
        direction: ViewDirection,
        aspect: f64,
        projection: Projection,
    ) -> Result<Self, Error> {
        let [right, front, up] = frame(axes);
        let (to_viewer, picture_up) = match direction {
            ViewDirection::Auto if axes == Axes::Camera => (front, up),
            ViewDirection::Auto | ViewDirection::Iso => (front + 0.62 * right + 0.55 * up, up),
            ViewDirection::Front => (front, up),
            ViewDirection::Back => (-front, up),
            ViewDirection::Left => (-right, up),
            ViewDirection::Right => (right, up),
            ViewDirection::Top => (up, -front),
            ViewDirection::Bottom => (-up, front),
        };
        if direction == ViewDirection::Auto
            && axes == Axes::ZUp
            && matches!(projection, Projection::PerspectiveFovDeg(_))
            && let Some([eye, look_at]) = behind_sensor(cloud)
        {
            let camera = Self { eye, look_at, up: picture_up, projection };
            return camera.axes().map(|_| camera);
        }
        let camera = Self { eye: to_viewer, look_at: DVec3::ZERO, up: picture_up, projection };
        camera.place(cloud, aspect, axes == Axes::Camera && direction == ViewDirection::Auto)
    }

    /// This camera, moved without being turned to where it sees all of `cloud`, but for a few points far from the others.
    /// `aspect` is width over height; a perspective camera keeps its field of view, an orthographic one takes the height
    /// that fits.
    ///
    /// # Errors
    /// Those of [`fit`](Self::fit).
    pub fn showing(self, cloud: &PointCloud, aspect: f64) -> Result<Self, Error> {
        self.place(cloud, aspect, false)
    }

    /// Moves the camera to where it sees all of `cloud`; `from_sensor` to where the sensor stood, if that was the origin.
    fn place(mut self, cloud: &PointCloud, aspect: f64, from_sensor: bool) -> Result<Self, Error> {
        let camera = &mut self;
        let axes = camera.axes()?;
        let forward = axes[2];
        let samples = samples(cloud, axes);
        let ranges = [0, 1, 2].map(|axis| robust_range(&samples, axis));
        let kept: Vec<DVec3> =
            samples.into_iter().filter(|p| (0..3).all(|i| (ranges[i][0]..=ranges[i][1]).contains(&p[i]))).collect();
        if kept.is_empty() {
            return Err(Error::NothingVisible("the cloud has no point with finite coordinates".into()));
        }
        let middle = ranges.map(|[low, high]| 0.5 * (low + high));
        let extent = ranges.map(|[low, high]| high - low);
        // All points in one place still need a picture of some size.
        let least = (1e-6 * cloud.origin().abs().max_element()).max(1e-3);
        let extent = extent.map(|e| e.max(if extent == [0.0; 3] { least } else { 0.0 }));
        let rim = RIM * (extent[0] * extent[1] / cloud.len() as f64).sqrt();
        let to_world = |p: [f64; 3]| cloud.origin() + axes[0] * p[0] + axes[1] * p[1] + axes[2] * p[2];
        let half_room = 0.5 - BORDER;
        camera.look_at = to_world(middle);

        if from_sensor && let Some(camera) = from_origin(&kept, axes, cloud.origin(), camera.up, aspect)? {
            return Ok(camera);
        }
        let distance = match &mut camera.projection {
            Projection::OrthographicHeight(height) => {
                let [width, upright] = [0, 1].map(|i| (extent[i] + 2.0 * rim) / (2.0 * half_room));
                *height = upright.max(width / aspect).max(1e-12);
                // In front of everything, trimmed points included as far as they are near.
                2.0 * extent[2] + *height
            }
            Projection::PerspectiveFovDeg(fov) => {
                let slope = 2.0 * half_room * (0.5 * *fov).to_radians().tan();
                let distance = kept.iter().fold(0.0f64, |distance, p| {
                    let [x, y, z] = [0, 1, 2].map(|i| p[i] - middle[i]);
                    distance.max((y.abs() + rim) / slope - z).max((x.abs() + rim) / (slope * aspect) - z)
                });
                distance.max(0.5 * extent[2] + extent.iter().fold(0.0, |a: f64, &b| a.max(b)) * 0.05)
            }
        };
        camera.eye = camera.look_at - forward * distance;
        Ok(self)
    }
}

/// The camera that sees all of `points` (along `axes`, about `origin`) from the world's origin, where the sensor was if
/// points are in its frame; `None` if they are not spread about the line ahead, so that it was somewhere else.
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
    // Points next to the sensor would spread over half the sky.
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
    let fov = 2.0 * (slope / (1.0 - 2.0 * BORDER)).atan().to_degrees();
    camera.projection = Projection::PerspectiveFovDeg(fov.max(1.0));
    Ok((fov < 120.0).then_some(camera))
}

/// The eye behind and above the sensor of a cloud with Z up, in the middle of several, or at the origin if none is known, and the
/// point ahead of it to look at; `None` if it does not stand among the points.
fn behind_sensor(cloud: &PointCloud) -> Option<[DVec3; 2]> {
    let scans = cloud.scans();
    let sensor = scans.iter().map(Scan::position).sum::<DVec3>() / scans.len().max(1) as f64;
    let samples = samples(cloud, [DVec3::X, DVec3::Y, DVec3::Z]);
    let points: Vec<DVec3> = samples.into_iter().map(|p| p + (cloud.origin() - sensor)).collect();
    let mut ranges: Vec<f64> = points.iter().map(|p| p.truncate().length()).collect();
    ranges.sort_unstable_by(f64::total_cmp);
    let range = |share: f64| ranges.get((share * ranges.len() as f64) as usize).copied();
    let [half, most, all] = [range(0.5)?, range(0.9)?, range(1.0 - 2.0 * TRIM)?];
    if !(half > 0.0 && all > FAR_REACH * half) {
        return None;
    }
    let distance = (half * most).sqrt();
    let (count, sum) = points
        .iter()
        .filter(|p| p.truncate().length() <= most)
        .fold((0.0, DVec3::ZERO), |(count, sum), p| (count + 1.0, sum + p));
    let middle = sum / count;
    // Along the way on which points reach furthest, which angles doubled tell for either end of it.
    let doubled = |p: &DVec3| DVec2::new(p.x * p.x - p.y * p.y, 2.0 * p.x * p.y) / p.truncate().length().max(distance);
    let way = DVec2::from_angle(0.5 * points.iter().map(doubled).sum::<DVec2>().to_angle());
    // From either end, on either side, whichever has the least in the way; from behind what is ahead of the sensor, if it sees
    // but one side, and else along X and Y, the one of which is forward in most conventions.
    let is_ahead = if middle.truncate().length() > 0.3 * distance { middle.truncate() } else { DVec2::new(1.0, 0.9) };
    let forward = way * way.dot(is_ahead).signum();
    let eyes = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)].map(|(end, side): (f64, f64)| {
        let forward = forward * end;
        let back = -DVec2::from_angle(side * ASIDE_DEG.to_radians()).rotate(forward);
        let eye = 0.5 * middle + (back * BEHIND).extend(ABOVE) * distance;
        [eye, middle + (forward * AHEAD).extend(0.0) * distance]
    });
    let in_the_way = |[eye, _]: &[DVec3; 2]| {
        let close = |p: &&DVec3| {
            let along = (p.dot(*eye) / eye.length_squared()).clamp(0.4, 1.0);
            p.distance(*eye * along) < IN_THE_WAY * distance
        };
        points.iter().filter(close).count()
    };
    let best = eyes.iter().min_by_key(|eye| in_the_way(eye))?;
    Some(best.map(|place| sensor + place))
}

/// Finite positions about the cloud's origin along `axes`, evenly picked.
fn samples(cloud: &PointCloud, axes: [DVec3; 3]) -> Vec<DVec3> {
    let positions = cloud.positions();
    let step = positions.len().div_ceil(SAMPLES).max(1);
    let finite = positions.iter().step_by(step).map(|&p| DVec3::from(p.map(f64::from))).filter(|p| p.is_finite());
    finite.map(|p| DVec3::from(axes.map(|axis| axis.dot(p)))).collect()
}

/// The range along `axis` without outliers; (0, 0) for no points.
fn robust_range(samples: &[DVec3], axis: usize) -> [f64; 2] {
    let mut values: Vec<f64> = samples.iter().map(|p| p[axis]).collect();
    values.sort_unstable_by(f64::total_cmp);
    let (Some(&first), Some(&last)) = (values.first(), values.last()) else { return [0.0; 2] };
    let trim = (values.len() as f64 * TRIM) as usize;
    let [low, high] = [values[trim], values[values.len() - 1 - trim]];
    let margin = KEEP * (high - low);
    let nearest = |bound: f64| {
        let inside = values.partition_point(|&v| v < bound);
        values[inside.min(values.len() - 1)]
    };
    let furthest = |bound: f64| values[values.partition_point(|&v| v <= bound).max(1) - 1];
    [
        if first < low - margin { nearest(low - margin) } else { first },
        if last > high + margin { furthest(high + margin) } else { last },
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat4;

    fn ball(extra: &[[f32; 3]]) -> PointCloud {
        let golden = 2.399963f32;
        let mut positions: Vec<[f32; 3]> = (0..2000)
            .map(|i| {
                let z = 1.0 - (i as f32 + 0.5) / 1000.0;
                let (sin, cos) = (i as f32 * golden).sin_cos();
                let r = (1.0 - z * z).sqrt();
                [r * cos, r * sin, z]
            })
            .collect();
        positions.extend_from_slice(extra);
        PointCloud::new(DVec3::ZERO, positions)
    }

    #[test]
    fn far_outliers_do_not_shrink_the_object() {
        let projection = Projection::PerspectiveFovDeg(40.0);
        let distance = |cloud: &PointCloud| {
            let camera = Camera::fit(cloud, Axes::ZUp, ViewDirection::Front, 1.5, projection).expect("a fit");
            (camera.eye - camera.look_at).length()
        };
        let clean = distance(&ball(&[]));
        let littered = distance(&ball(&[[1e6, 0.0, 0.0], [0.0, -3e5, 7.0], [f32::NAN, 0.0, 0.0]]));
        assert!((littered / clean - 1.0).abs() < 0.01, "{littered} is not about {clean}");
    }

    #[test]
    fn all_points_lie_in_the_picture() {
        let cloud = ball(&[]);
        for direction in [ViewDirection::Iso, ViewDirection::Top, ViewDirection::Left, ViewDirection::Bottom] {
            for projection in [Projection::PerspectiveFovDeg(60.0), Projection::OrthographicHeight(1.0)] {
                let camera = Camera::fit(&cloud, Axes::YUp, direction, 0.5, projection).expect("a fit");
                let view = camera.view(DVec3::ZERO, [100, 200]).expect("a view");
                for &position in cloud.positions() {
                    let [x, y] = view.to_pixel(view.to_view(position));
                    assert!((0.0..100.0).contains(&x) && (0.0..200.0).contains(&y), "{direction:?}: {x}, {y}");
                }
            }
        }
    }

    /// Ground that a lidar at `sensor` sees 2 to 80 m away, denser near it, and a post at `post` from it, 4 m high.
    fn swept(sensor: DVec3, post: DVec2) -> PointCloud {
        let golden = 2.399963f64;
        let ground = (0..4000).map(|i| {
            let range = 2.0 * 40f64.powf(f64::from(i) / 4000.0);
            (DVec2::from_angle(f64::from(i) * golden) * range).extend(-1.7)
        });
        let post = (0..200).map(|i| post.extend(-1.7 + 0.08 * f64::from(i)));
        let positions: Vec<_> = ground.chain(post).map(|p| p.as_vec3().to_array()).collect();
        let scan = Scan { name: None, world_from_sensor: DMat4::from_translation(sensor), points: 0..positions.len() };
        PointCloud::new(sensor, positions).with_scans(vec![scan])
    }

    fn auto(cloud: &PointCloud) -> Camera {
        Camera::fit(cloud, Axes::ZUp, ViewDirection::Auto, 1.5, Projection::PerspectiveFovDeg(40.0)).expect("a fit")
    }

    #[test]
    fn a_scan_around_its_sensor_is_seen_from_behind_it() {
        let nowhere = DVec2::new(300.0, 0.0);
        let sensor = DVec3::new(5e5, -4e6, 80.0);
        let camera = auto(&swept(sensor, nowhere));
        let [eye, look_at] = [camera.eye, camera.look_at].map(|place| place - sensor);
        assert!((10.0..50.0).contains(&eye.length()) && eye.z > 5.0, "near and above the sensor: {eye}");
        assert!(eye.truncate().dot(look_at.truncate()) < 0.0, "the sensor is between {eye} and {look_at}");
        let unknown = auto(&swept(DVec3::ZERO, nowhere).with_scans(Vec::new()));
        assert!(unknown.eye.abs_diff_eq(eye, 1e-6), "without a sensor the origin is one: {}, {eye}", unknown.eye);
        let blocked = auto(&swept(DVec3::ZERO, eye.truncate() * 0.8));
        assert!(blocked.eye.distance(eye) > 5.0, "a post is in the way: {}", blocked.eye);
        let elsewhere = swept(sensor, nowhere).with_scans(Vec::new());
        assert!(auto(&elsewhere).eye.distance(sensor) > 100.0, "nobody knows that it stands among the points");
    }

    #[test]
    fn a_moved_camera_looks_the_same_way_and_sees_everything() {
        let cloud = ball(&[]);
        let before = Camera {
            eye: DVec3::new(30.0, 40.0, 5.0),
            look_at: DVec3::new(29.0, 38.0, 5.5),
            up: DVec3::new(0.2, 0.0, 1.0),
            projection: Projection::PerspectiveFovDeg(30.0),
        };
        let after = before.showing(&cloud, 1.0).expect("a place");
        let turned = |camera: &Camera| camera.axes().expect("a camera that sees");
        for (a, b) in turned(&before).into_iter().zip(turned(&after)) {
            assert!(a.abs_diff_eq(b, 1e-9), "{a} became {b}");
        }
        let view = after.view(DVec3::ZERO, [100, 100]).expect("a view");
        let inside = |&p: &[f32; 3]| view.to_pixel(view.to_view(p)).into_iter().all(|c| (0.0..100.0).contains(&c));
        assert!(cloud.positions().iter().all(inside), "all points are seen");
    }
}
