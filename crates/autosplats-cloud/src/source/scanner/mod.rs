//! Simulated scanners around a moving surface, like the three in the paper [Paper, Figure 12].
//!
//! # How it works
//!
//! In each frame every scanner sends out rays at equal steps of azimuth and elevation ([`Rays`]). Each ray ends at the
//! first surface on its way ([`Target`]), so surfaces hidden from a scanner are missing. Most rays hit nothing.
//! Therefore triangles and parts of a scene look up the rays that may hit them, instead of each ray searching the
//! surface. Ranges get noise, some rays return nothing, and points are placed with the scanner's assumed pose, which
//! may differ from the true one. Random numbers depend only on the seed, the frame, the scanner and the ray, so threads
//! change nothing.

mod rays;
mod target;
mod triangles;

use std::{
    f64::consts::TAU,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
};

use glam::{DMat4, DQuat, DVec3};
use rayon::prelude::*;

use self::{rays::Rays, target::Target};
use super::animation::{Frames, Surface};
use crate::{Error, PointCloud, Progress, Scan, Timeline, memory::check_memory, progress::tick, random::Random};

/// Maximum number of rays of a scanner.
const MAX_RAYS: u64 = 1 << 28;

/// Bytes of memory per ray: its result, and a copy in the cloud.
const BYTES_PER_RAY: u64 = 64;

/// A simulated scanner. Lengths are in the unit of the surface it scans.
///
/// ```
/// use autosplats_cloud::{
///     Animation, LatestOptions, Player, ReadOptions, Scanner, read_mesh_bytes,
/// };
///
/// let text = b"v -1 -1 2\nv 1 -1 2\nv 1 1 2\nv -1 1 2\nf 1 2 3 4\n";
/// let wall = read_mesh_bytes("wall.obj".as_ref(), text, &ReadOptions::default(), &())?;
/// // At the origin, looking along z.
/// let scanner = Scanner { columns: 64, rows: 48, ..Scanner::default() };
/// let scanned = Animation::still(wall).scanned(vec![scanner], 1)?;
/// let mut player = Player::new(Box::new(scanned.play()), LatestOptions::default());
/// let cloud = player.frame(0, &())?;
/// assert!(cloud.len() > 1000 && cloud.positions().iter().all(|[_, _, z]| (z - 2.0).abs() < 1e-5));
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

    fn check(&self) -> Result<(), Error> {
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
    fn believed(&self, random: &mut Random) -> DMat4 {
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

/// A measured point and its colour, if the target has colours.
type ScanPoint = ([f32; 3], Option<[u8; 3]>);

/// Scans of a moving surface, one channel per scanner.
pub(super) struct Scanned {
    frames: Arc<dyn Frames>,
    scanners: Vec<Scanner>,
    seed: u64,
}

impl Scanned {
    pub(super) fn new(frames: Arc<dyn Frames>, scanners: Vec<Scanner>, seed: u64) -> Result<Self, Error> {
        scanners.iter().try_for_each(Scanner::check)?;
        if scanners.is_empty() {
            return Err(Error::BadValue { name: "number of scanners", value: 0.0, rule: "at least 1" });
        }
        let rays = scanners.iter().map(|scanner| u64::from(scanner.columns) * u64::from(scanner.rows)).sum::<u64>();
        check_memory(&format!("the rays of {} scanners", scanners.len()), rays.saturating_mul(BYTES_PER_RAY))?;
        Ok(Self { frames, scanners, seed })
    }

    /// Random numbers for one ray of a scanner in a frame.
    fn random(&self, scanner: usize, frame: usize, ray: u64) -> Random {
        let mut mixed = Random::new(self.seed, scanner as u64);
        Random::new(Random::new(mixed.bits(), frame as u64).bits(), ray)
    }

    fn scan(&self, index: usize, frame: usize, target: &Target, progress: &dyn Progress) -> Result<PointCloud, Error> {
        let scanner = &self.scanners[index];
        // The error of the assumed pose is the same in all frames.
        let believed = scanner.believed(&mut self.random(index, usize::MAX, 0));
        let rays = Rays::new(scanner);
        let sight = target.prepared_for(&rays);
        let origin = target.origin();
        let row = |row: u32| {
            if progress.cancelled() {
                return Vec::new();
            }
            let seen = |column: u32| {
                let ray = row as usize * scanner.columns as usize + column as usize;
                if !sight.may_meet(ray) {
                    return None;
                }
                let direction = rays.direction(column, row);
                let hit = sight.hit(&rays, ray, direction)?;
                let mut random = self.random(index, frame, ray as u64);
                if random.unit() < scanner.dropouts {
                    return None;
                }
                let range = hit.distance + scanner.noise * random.normal();
                let place = believed.transform_point3(direction * range);
                (range > 0.0).then(|| ((place - origin).as_vec3().to_array(), hit.color))
            };
            (0..scanner.columns).filter_map(seen).collect()
        };
        let rows: Vec<Vec<ScanPoint>> = (0..scanner.rows).into_par_iter().map(row).collect();
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        let positions: Vec<[f32; 3]> = rows.iter().flatten().map(|(position, _)| *position).collect();
        let name = Some(format!("scanner {}", index + 1));
        let scan = Scan { name, world_from_sensor: believed, points: 0..positions.len() };
        let mut cloud = PointCloud::new(origin, positions).with_scans(vec![scan]).with_crs(target.crs());
        cloud.axes = target.axes();
        if target.is_colored() {
            cloud = cloud.with_colors(rows.iter().flatten().map(|(_, color)| color.unwrap_or_default()).collect())?;
        }
        Ok(cloud)
    }
}

impl Frames for Scanned {
    fn timeline(&self) -> &Timeline {
        self.frames.timeline()
    }

    fn channels(&self) -> usize {
        self.scanners.len()
    }

    fn read(&self, frame: usize, progress: &dyn Progress) -> Result<Vec<Arc<PointCloud>>, Error> {
        let target = Target::new(self.frames.surface(frame, progress)?)?;
        let count = self.scanners.len();
        let done = AtomicUsize::new(0);
        let scan = |index| {
            let cloud = self.scan(index, frame, &target, progress)?;
            tick(progress, (done.fetch_add(1, Ordering::Relaxed) + 1) as f32 / count as f32)?;
            Ok(Arc::new(cloud))
        };
        (0..count).into_par_iter().map(scan).collect()
    }

    fn surface(&self, frame: usize, progress: &dyn Progress) -> Result<Surface, Error> {
        self.frames.surface(frame, progress)
    }
}
