//! The scans that several scanners take of a surface.

use std::sync::{
    Arc,
    atomic::{AtomicUsize, Ordering},
};

use autosplats_cloud::{Error, PointCloud, Progress, Random, Scan, check_memory};
use rayon::prelude::*;

use super::{Scanner, rays::Rays, target::Target};
use crate::Surface;

/// Bytes of memory per ray: its result, and a copy in the cloud.
const BYTES_PER_RAY: u64 = 64;

/// A measured point and its colour, if the target has colours.
type ScanPoint = ([f32; 3], Option<[u8; 3]>);

/// Scanners that stand around a surface, which may move.
#[derive(Clone, Debug)]
pub struct Scanners {
    scanners: Vec<Scanner>,
    seed: u64,
}

impl Scanners {
    /// Checks the scanners. The same `seed` gives the same scans.
    ///
    /// # Errors
    /// [`Error::BadValue`] for invalid properties of a scanner, and [`Error::OutOfMemory`].
    pub fn new(scanners: Vec<Scanner>, seed: u64) -> Result<Self, Error> {
        scanners.iter().try_for_each(Scanner::check)?;
        if scanners.is_empty() {
            return Err(Error::BadValue { name: "number of scanners", value: 0.0, rule: "at least 1" });
        }
        let rays = scanners.iter().map(|scanner| u64::from(scanner.columns) * u64::from(scanner.rows)).sum::<u64>();
        check_memory(&format!("the rays of {} scanners", scanners.len()), rays.saturating_mul(BYTES_PER_RAY))?;
        Ok(Self { scanners, seed })
    }

    /// Number of scanners, at least 1.
    #[allow(clippy::len_without_is_empty, reason = "there is always one")]
    pub fn len(&self) -> usize {
        self.scanners.len()
    }

    /// The scans of a surface, one per scanner. Noise differs from frame to frame.
    ///
    /// # Errors
    /// [`Error::NoSurface`] if no triangle has an area, and [`Error::Cancelled`] if `progress` says so.
    pub fn scan(&self, surface: Surface, frame: usize, progress: &dyn Progress) -> Result<Vec<Arc<PointCloud>>, Error> {
        let target = Target::new(surface)?;
        let count = self.scanners.len();
        let done = AtomicUsize::new(0);
        let scan = |index| {
            let cloud = self.scan_one(index, frame, &target, progress)?;
            progress.tick((done.fetch_add(1, Ordering::Relaxed) + 1) as f32 / count as f32)?;
            Ok(Arc::new(cloud))
        };
        (0..count).into_par_iter().map(scan).collect()
    }

    /// Random numbers for one ray of a scanner in a frame.
    fn random(&self, scanner: usize, frame: usize, ray: u64) -> Random {
        let mut mixed = Random::new(self.seed, scanner as u64);
        Random::new(Random::new(mixed.bits(), frame as u64).bits(), ray)
    }

    fn scan_one(
        &self,
        index: usize,
        frame: usize,
        target: &Target,
        progress: &dyn Progress,
    ) -> Result<PointCloud, Error> {
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
        if let Some(axes) = target.axes() {
            cloud = cloud.with_axes(axes);
        }
        if target.is_colored() {
            cloud = cloud.with_colors(rows.iter().flatten().map(|(_, color)| color.unwrap_or_default()).collect())?;
        }
        Ok(cloud)
    }
}
