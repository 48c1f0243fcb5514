//! A scanner: where it stands, which rays it sends, and its faults.

use std::f64::consts::TAU;

use autosplats_cloud::{Error, Random};
use glam::{DMat4, DQuat, DVec3};

/// Maximum number of rays of a scanner.
const MAX_RAYS: u64 = 1 << 28;

/// A simulated scanner. Lengths are in the unit of the surface it scans.
///
/// ```
/// use std::sync::Arc;
///
/// use autosplats_cloud::{Contents, PointCloud, glam::DVec3};
/// use autosplats_scenes::{Scanner, Scanners, Surface};
///
/// let corners = vec![[-1.0, -1.0, 2.0], [1.0, -1.0, 2.0], [1.0, 1.0, 2.0], [-1.0, 1.0, 2.0]];
/// let cloud = PointCloud::new(DVec3::ZERO, corners);
/// let wall = Contents { cloud, triangles: vec![[0, 1, 2], [0, 2, 3]] };
/// // At the origin, looking along z.
/// let scanner = Scanner { columns: 64, rows: 48, ..Scanner::default() };
/// let scans = Scanners::new(vec![scanner], 1)?.scan(Surface::Mesh(Arc::new(wall)), 0, &())?;
/// assert!(scans[0].len() > 1000);
/// assert!(scans[0].positions().iter().all(|[_, _, z]| (z - 2.0).abs() < 1e-5));
/// # Ok::<(), autosplats_cloud::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Scanner {
    /// Pose: maps the scanner's frame (x right, y down, z forward) to world coordinates. A rotation and a translation.
    pub world_from_sensor: DMat4,
    /// Rays per row.
    pub columns: u32,
    /// Rows of rays.
    pub rows: u32,
    /// Horizontal and vertical field of view in degrees, above 0 and up to 360 and 180.
    pub fov_degrees: [f64; 2],
    /// Standard deviation of ranges, 0 or more.
    pub noise: f64,
    /// Share of hits that return nothing, 0 to 1.
    pub dropouts: f64,
    /// Error of the assumed position: distance in a random direction, 0 or more.
    pub misplaced: f64,
    /// Error of the assumed orientation: angle about a random axis, 0 to 180 degrees.
    pub misturned_degrees: f64,
}

impl Default for Scanner {
    fn default() -> Self {
        Self {
            world_from_sensor: DMat4::IDENTITY,
            columns: 640,
            rows: 480,
            fov_degrees: [57.0, 43.0],
            noise: 0.0,
            dropouts: 0.0,
            misplaced: 0.0,
            misturned_degrees: 0.0,
        }
    }
}

/// Elevation of scanners placed around a surface, degrees.
const PLACED_ELEVATION_DEG: f64 = 15.0;

/// Factor on the distance of scanners, which leaves a margin around the surface.
const PLACED_DISTANCE_FACTOR: f64 = 1.1;

/// Noise of the first of several scanners, relative to the radius of the surface. The n-th scanner has n times as much.
const FIRST_NOISE_RADII: f64 = 1e-3;

impl Scanner {
    /// Places `count` scanners around the box from `low` to `high`, at equal angles and slightly above it. They look at
    /// the centre of the box, and each is noisier than the one before.
    pub fn around(low: DVec3, high: DVec3, up: DVec3, count: usize) -> Vec<Self> {
        let up = up.normalize_or(DVec3::Z);
        let (centre, radius) = (0.5 * (low + high), (0.5 * (high - low).length()).max(f64::MIN_POSITIVE));
        let own = Self::default();
        let distance = PLACED_DISTANCE_FACTOR * radius / (0.5 * own.fov_degrees[1]).to_radians().sin();
        let right = up.any_orthonormal_vector();
        let placed = |index: usize| {
            let around = DQuat::from_axis_angle(up, TAU * index as f64 / count as f64) * right;
            let (sin, cos) = PLACED_ELEVATION_DEG.to_radians().sin_cos();
            let eye = centre + distance * (cos * around + sin * up);
            let world_from_sensor = looking(eye, centre, up);
            Self { world_from_sensor, noise: FIRST_NOISE_RADII * (index + 1) as f64 * radius, ..own.clone() }
        };
        (0..count).map(placed).collect()
    }

    pub(super) fn check(&self) -> Result<(), Error> {
        let within = |name, value: f64, low: f64, high: f64, rule| {
            if value >= low && value <= high { Ok(()) } else { Err(Error::BadValue { name, value, rule }) }
        };
        let rays = u64::from(self.columns) * u64::from(self.rows);
        if rays == 0 || rays > MAX_RAYS {
            return Err(Error::BadValue { name: "rays of a scanner", value: rays as f64, rule: "1 to 268435456" });
        }
        within("field of view", self.fov_degrees[0], 1e-6, 360.0, "above 0 and at most 360 degrees")?;
        within("field of view", self.fov_degrees[1], 1e-6, 180.0, "above 0 and at most 180 degrees")?;
        within("noise of a scanner", self.noise, 0.0, 1e9, "from 0 to 1e9")?;
        within("dropouts of a scanner", self.dropouts, 0.0, 1.0, "from 0 to 1")?;
        within("misplacement of a scanner", self.misplaced, 0.0, 1e9, "from 0 to 1e9")?;
        within("misturning of a scanner", self.misturned_degrees, 0.0, 180.0, "from 0 to 180 degrees")?;
        let pose = self.world_from_sensor;
        let (det, place) = (pose.determinant(), pose.w_axis.truncate().length());
        within("determinant of a scanner's pose", det, 1.0 - 1e-6, 1.0 + 1e-6, "1, as of a rotation")?;
        within("distance of a scanner from the origin", place, 0.0, 1e9, "at most 1e9")
    }

    /// The assumed pose: the true pose with a random error.
    pub(super) fn believed(&self, random: &mut Random) -> DMat4 {
        let (offset, axis) = (random.direction() * self.misplaced, random.direction());
        let turn = DMat4::from_axis_angle(axis, self.misturned_degrees.to_radians());
        DMat4::from_translation(offset) * self.world_from_sensor * turn
    }
}

/// The pose of a sensor at `eye` that looks at `centre`.
fn looking(eye: DVec3, centre: DVec3, up: DVec3) -> DMat4 {
    let forward = (centre - eye).normalize_or(DVec3::X);
    let right = forward.cross(up).try_normalize().unwrap_or_else(|| forward.any_orthonormal_vector());
    let down = forward.cross(right);
    DMat4::from_cols(right.extend(0.0), down.extend(0.0), forward.extend(0.0), eye.extend(1.0))
}
