//! A camera that shows a whole cloud, for those who name none.

use autosplats_cloud::{Axes, Crs, PointCloud, Scan};
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
/// the picture. Without a margin one that is cut by its edge cannot be told from a surface that goes on.
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
/// Height of the picture over its distance from the eye for which these hold: at 40°.
const UPRIGHT: f64 = 0.728;
/// No field of view brings the eye nearer than this part of the way, or it would be past the sensor.
const NEAREST: f64 = 0.4;
/// What is as close to the way to the eye as this part of the distance is in the way,
const IN_THE_WAY: f64 = 0.15;
/// if it is one point in so many.
const A_FEW: usize = 500;
/// A sensor sees one side if the middle of its points is further from it than this part of the distance.
const ONE_SIDE: f64 = 0.3;

/// Where to stand in relation to the cloud.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum ViewDirection {
    /// In perspective, the sensor's own view for points in a camera's frame, and with Z up from behind and above the sensor
    /// for a scan that is far denser near it, as of a lidar on a car: in the middle of several, or at the origin of points
    /// without a coordinate system where no sensor is known. Otherwise [`Iso`](Self::Iso).
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
        let own = match projection {
            Projection::PerspectiveFovDeg(fov) if direction == ViewDirection::Auto => Some((axes, fov)),
            _ => None,
        };
        if let Some((Axes::ZUp, fov)) = own
            && let Some([eye, look_at]) = behind_sensor(cloud, fov, aspect)
        {
            let camera = Self { eye, look_at, up: picture_up, projection };
            return camera.axes().map(|_| camera);
        }
        let camera = Self { eye: to_viewer, look_at: DVec3::ZERO, up: picture_up, projection };
        camera.place(cloud, aspect, matches!(own, Some((Axes::Camera, _))))
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
                let sides =
                    [(0, slope * aspect), (1, slope)].map(|(axis, slope)| between_sides(&kept, axis, slope, rim));
                // What is near is wider than what is far, so that the middle of the picture is not that of the points.
                camera.look_at = to_world([sides[0].middle, sides[1].middle, middle[2]]);
                let distance = middle[2] - sides[0].eye.min(sides[1].eye);
                distance.max(0.5 * extent[2] + extent.iter().fold(0.0, |a: f64, &b| a.max(b)) * 0.05)
            }
        };
        camera.eye = camera.look_at - forward * distance;
        Ok(self)
    }
}

/// Where an eye is that sees points between two opposite sides of a picture, and touching both.
struct BetweenSides {
    /// Along the axis.
    middle: f64,
    /// Along the line of sight.
    eye: f64,
}

/// The eye that sees all `points` along `axis`, each `rim` wide to either side. `slope` is that of the sides of the picture
/// against the line of sight, which is the third axis.
fn between_sides(points: &[DVec3], axis: usize, slope: f64, rim: f64) -> BetweenSides {
    let none = [f64::NEG_INFINITY; 2];
    // How far each side is from the line of sight where that begins.
    let [right, left] = points.iter().fold(none, |[right, left], p| {
        let narrower = rim - slope * p.z;
        [right.max(p[axis] + narrower), left.max(-p[axis] + narrower)]
    });
    BetweenSides { middle: 0.5 * (right - left), eye: -0.5 * (right + left) / slope }
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

/// The eye behind and above the sensor of a cloud with Z up, in the middle of several, or at the origin of one without
/// a coordinate system, and the point ahead of it to look at; `None` if it does not stand among the points. `fov` is upright, in degrees.
fn behind_sensor(cloud: &PointCloud, fov: f64, aspect: f64) -> Option<[DVec3; 2]> {
    let sensor = match cloud.scans() {
        [] if *cloud.crs() != Crs::default() => return None,
        scans => scans.iter().map(Scan::position).sum::<DVec3>() / scans.len().max(1) as f64,
    };
    let samples = samples(cloud, [DVec3::X, DVec3::Y, DVec3::Z]);
    let points: Vec<DVec3> = samples.into_iter().map(|p| p + (cloud.origin() - sensor)).collect();
    let mut ranges: Vec<f64> = points.iter().map(|p| p.truncate().length()).collect();
    ranges.sort_unstable_by(f64::total_cmp);
    let range = |share: f64| ranges.get((share * ranges.len() as f64) as usize).copied();
    let [half, most, all] = [range(0.5)?, range(0.9)?, range(1.0 - 2.0 * TRIM)?];
    let distance = (half * most).sqrt();
    let [low, high] = robust_range(&points, 2);
    // Most of what is high and thin would be above the picture.
    if !(half > 0.0 && all > FAR_REACH * half && high - low < all.min(FAR_REACH * distance)) {
        return None;
    }
    let near = || points.iter().filter(|p| p.truncate().length() <= most);
    let middle = near().sum::<DVec3>() / near().count() as f64;
    // A sensor that sees one side is seen from behind, others along the way on which points reach furthest, which angles doubled
    // tell for either end of it: towards X or Y, one of which is ahead in most conventions.
    let sees_one_side = middle.truncate().length() > ONE_SIDE * distance;
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
        let back = -DVec2::from_angle(side * ASIDE_DEG.to_radians()).rotate(forward);
        let eye = 0.5 * middle + (back * BEHIND).extend(ABOVE) * distance;
        let look_at = middle + (forward * AHEAD).extend(0.0) * distance;
        [look_at + (eye - look_at) * (UPRIGHT / upright_at_1).max(NEAREST), look_at]
    };
    // On either side, and from either end, whichever has less in the way; a few points are nothing.
    let places = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)].map(place);
    let in_the_way = |[eye, _]: &[DVec3; 2]| {
        let close = |p: &&DVec3| {
            // Not the points around the sensor.
            let along = (p.dot(*eye) / eye.length_squared()).clamp(0.4, 1.0);
            p.distance(*eye * along) < IN_THE_WAY * distance
        };
        points.iter().filter(close).count() * A_FEW / points.len()
    };
    let places = if sees_one_side { &places[..2] } else { &places };
    let best = places.iter().min_by_key(|place| in_the_way(place))?;
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
    use std::f64::consts::{PI, TAU};

    use autosplats_cloud::Unit;
    use glam::DMat4;

    use super::*;

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

    #[test]
    fn what_is_seen_fills_the_picture() {
        // Ground that goes away from the eye: its near end is wider.
        let ground = (0..900).map(|i| [(i % 30) as f32, (i / 30) as f32, 0.0]).collect();
        let cloud = PointCloud::new(DVec3::ZERO, ground);
        for aspect in [0.5, 1.5, 2.5] {
            let projection = Projection::PerspectiveFovDeg(60.0);
            let camera = Camera::fit(&cloud, Axes::ZUp, ViewDirection::Iso, aspect, projection).expect("a fit");
            let size = [(200.0 * aspect) as u32, 200];
            let view = camera.view(DVec3::ZERO, size).expect("a view");
            let pixels: Vec<_> = cloud.positions().iter().map(|&p| view.to_pixel(view.to_view(p))).collect();
            let free = [0, 1].map(|axis| {
                let ends = pixels.iter().fold([f32::MAX, f32::MIN], |[a, b], p| [a.min(p[axis]), b.max(p[axis])]);
                [ends[0] / size[axis] as f32, 1.0 - ends[1] / size[axis] as f32]
            });
            let least = free[0][0].min(free[0][1]).min(free[1][0]).min(free[1][1]);
            let most = free.iter().map(|[a, b]| a.max(*b)).fold(1.0f32, f32::min);
            assert!(least > 0.04 && most < 0.14, "{aspect}: as large as it fits, and in the middle: {free:?}");
        }
    }

    /// Ground that a lidar at `sensor` sees 2 to 80 m away, denser near it, at azimuths of so much, and other points about it.
    fn swept(sensor: DVec3, azimuths: f64, others: impl IntoIterator<Item = DVec3>) -> PointCloud {
        let ground = (0..4000).map(|i| {
            let azimuth = azimuths * ((f64::from(i) * 0.618034).fract() - 0.5);
            (DVec2::from_angle(azimuth) * 2.0 * 40f64.powf(f64::from(i) / 4000.0)).extend(-1.7)
        });
        let positions: Vec<_> = ground.chain(others).map(|p| p.as_vec3().to_array()).collect();
        let scan = Scan { name: None, world_from_sensor: DMat4::from_translation(sensor), points: 0..positions.len() };
        PointCloud::new(sensor, positions).with_scans(vec![scan])
    }

    fn auto(cloud: &PointCloud, fov: f64, aspect: f64) -> Camera {
        Camera::fit(cloud, Axes::ZUp, ViewDirection::Auto, aspect, Projection::PerspectiveFovDeg(fov)).expect("a fit")
    }

    #[test]
    fn a_scan_around_its_sensor_is_seen_from_behind_it() {
        let sensor = DVec3::new(5e5, -4e6, 80.0);
        let camera = auto(&swept(sensor, TAU, []), 40.0, 1.5);
        let [eye, look_at] = [camera.eye, camera.look_at].map(|place| place - sensor);
        assert!((10.0..50.0).contains(&eye.length()) && eye.z > 5.0, "near and above the sensor: {eye}");
        assert!(eye.truncate().dot(look_at.truncate()) < 0.0, "the sensor is between {eye} and {look_at}");
        let unknown = |sensor| swept(sensor, TAU, []).with_scans(Vec::new());
        let of_origin = auto(&unknown(DVec3::ZERO), 40.0, 1.5);
        assert!(of_origin.eye.abs_diff_eq(eye, 1e-6), "without a sensor the origin is one: {}, {eye}", of_origin.eye);
        assert!(auto(&unknown(sensor), 40.0, 1.5).eye.distance(sensor) > 100.0, "nobody knows where it stood");
        let surveyed = unknown(DVec3::ZERO).with_crs(Crs { unit: Some(Unit::Metre), ..Crs::default() });
        assert!(auto(&surveyed, 40.0, 1.5).eye.length() > 100.0, "the origin of a coordinate system is no sensor");
    }

    #[test]
    fn what_is_in_the_way_is_gone_around() {
        // A street says which way to look.
        let street = || (0..600).map(|i| DVec3::new(f64::from(i - 300) * 0.25, 3.0, -1.7));
        let free = auto(&swept(DVec3::ZERO, TAU, street()), 40.0, 1.5).eye;
        let before = |count: usize| (0..count).map(move |i| free * (0.6 + 0.2 * i as f64 / count as f64));
        let eye = |count: usize| auto(&swept(DVec3::ZERO, TAU, street().chain(before(count))), 40.0, 1.5).eye;
        assert!(eye(40).distance(free) > 5.0, "something is in the way: {}, {free}", eye(40));
        assert!(eye(3).distance(free) < 2.0, "three points are nothing: {}, {free}", eye(3));
    }

    #[test]
    fn a_sensor_that_sees_one_side_is_seen_from_behind() {
        let behind = |i: usize| DVec3::new(-10.0, 0.1 * i as f64, 4.0);
        let wall = |i: usize| DVec3::new(30.0, 0.1 * (i as f64 - 300.0), 0.0);
        for azimuths in [1.5, PI, 3.6] {
            let others = (0..60).map(behind).chain((0..600).map(wall));
            let camera = auto(&swept(DVec3::ZERO, azimuths, others), 40.0, 1.5);
            assert!(camera.eye.x < -5.0 && camera.look_at.x > 5.0, "{azimuths}, whatever is there: {camera:?}");
        }
    }

    #[test]
    fn as_much_is_seen_whatever_the_field_of_view() {
        let cloud = swept(DVec3::ZERO, TAU, []);
        for (fov, aspect) in [(20.0, 1.5), (40.0, 1.5), (70.0, 1.5), (110.0, 1.5), (40.0, 0.5)] {
            let camera = auto(&cloud, fov, aspect);
            assert!(camera.eye.truncate().dot(camera.look_at.truncate()) < 0.0, "{fov}: the sensor is in between");
            let view = camera.view(DVec3::ZERO, [(300.0 * aspect) as u32, 300]).expect("a view");
            let [x, y] = view.to_pixel(view.to_view([0.0, 0.0, -1.7]));
            let size = [300.0 * aspect as f32, 300.0];
            assert!(x > 0.1 * size[0] && x < 0.9 * size[0], "{fov}, {aspect}: {x}");
            assert!(y > 0.55 * size[1] && y < 0.95 * size[1], "{fov}, {aspect}: {y}");
        }
    }

    #[test]
    fn what_is_high_and_thin_is_seen_whole() {
        let mast = (0..9000)
            .map(|i| (DVec2::from_angle(f64::from(i) * 2.4) * 0.5).extend(100.0 * (f64::from(i) * 0.618034).fract()));
        let camera = auto(&swept(DVec3::ZERO, TAU, mast), 40.0, 1.5);
        let view = camera.view(DVec3::ZERO, [300, 200]).expect("a view");
        let [_, y] = view.to_pixel(view.to_view([0.0, 0.0, 100.0]));
        assert!(y > 0.0, "its top is above the picture: {y}");
    }

    #[test]
    fn an_orthographic_camera_stays_one() {
        for axes in [Axes::ZUp, Axes::Camera] {
            let projection = Projection::OrthographicHeight(1.0);
            let cloud = swept(DVec3::ZERO, TAU, []);
            let camera = Camera::fit(&cloud, axes, ViewDirection::Auto, 1.5, projection).expect("a fit");
            assert!(matches!(camera.projection, Projection::OrthographicHeight(height) if height > 10.0), "{camera:?}");
        }
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
