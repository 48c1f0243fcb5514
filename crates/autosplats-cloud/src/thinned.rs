//! Fewer points, and noisier points, of clouds that come in parts.

use std::{
    borrow::Cow,
    path::Path,
    sync::{
        Mutex,
        atomic::{AtomicU64, Ordering},
    },
};

use glam::DVec3;
use rayon::prelude::*;

use crate::{Clouds, Error, PointCloud, Progress, Random, Spill, SpillCell, lock, progress::Part, thin};

/// Points that one thread sorts into cubes at a time.
const PIECE: usize = 1 << 16;

/// Bytes of a record: world position and number.
const RECORD: usize = 32;

/// Memory in bytes per point while the points of cubes are chosen.
const BYTES_PER_POINT: u64 = 80;

/// Number of points that is assumed if it is not known.
const MANY: u64 = 1 << 32;

/// What is done to points, in this order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Thinning {
    /// Corners of the box in which points are kept, as by [`crop`](PointCloud::crop).
    pub bounds: Option<[DVec3; 2]>,
    /// Keeps the first of so many points, as [`keep_every`](PointCloud::keep_every) does.
    pub every: Option<usize>,
    /// Edge of the cubes of which one point each is kept, as by [`thin_by_voxel`](PointCloud::thin_by_voxel).
    pub voxel: Option<f64>,
    /// Standard deviation of the noise that is added, as by [`add_noise`](PointCloud::add_noise), and its seed.
    pub noise: Option<(f64, u64)>,
}

/// Points that are thinned as they come.
pub struct Thinned<'a> {
    clouds: &'a dyn Clouds,
    thinning: Thinning,
    /// For each point that the first two steps leave, whether it is the one of its cube.
    chosen: Option<Vec<u64>>,
    /// Number of points that came last time.
    kept: AtomicU64,
}

/// Takes points and the number of points before them.
type TakeCoarse<'a> = dyn FnMut(Cow<'_, PointCloud>, u64) -> Result<(), Error> + 'a;

impl<'a> Thinned<'a> {
    /// Prepares the work. For cubes all points are read once; their positions wait in a file without a name in
    /// `folder`, and `memory` bytes are used.
    ///
    /// # Errors
    /// Those of reading and of the operating system; [`Error::BadValue`] for sizes that cannot be; and
    /// [`Error::Cancelled`] if `progress` says so.
    ///
    /// # Examples
    ///
    /// ```
    /// use autosplats_cloud::{Clouds, Held, PointCloud, Thinned, Thinning, glam::DVec3};
    ///
    /// # let folder = tempfile::tempdir()?;
    /// let line = PointCloud::new(DVec3::ZERO, (0..40).map(|i| [0.25 * i as f32, 0.0, 0.0]).collect());
    /// let held = Held { name: "line".as_ref(), cloud: &line };
    /// let thinning = Thinning { voxel: Some(1.0), ..Thinning::default() };
    /// let thinned = Thinned::new(&held, thinning, folder.path(), 1 << 20, &())?;
    /// thinned.read(&(), &mut |part| Ok(assert_eq!(part.len(), 10)))?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn new(
        clouds: &'a dyn Clouds,
        thinning: Thinning,
        folder: &Path,
        memory: u64,
        progress: &dyn Progress,
    ) -> Result<Self, Error> {
        let mut thinned = Self { clouds, thinning, chosen: None, kept: AtomicU64::new(0) };
        if let Some(size) = thinning.voxel {
            thinned.chosen = Some(thinned.choose(size, folder, memory, progress)?);
        }
        Ok(thinned)
    }

    /// Number of points that came when all were read last.
    pub fn kept(&self) -> u64 {
        self.kept.load(Ordering::Relaxed)
    }

    /// Passes on what cropping and counting leave, with the number of points before. Returns the number of all points.
    fn coarse(&self, progress: &dyn Progress, take: &mut TakeCoarse<'_>) -> Result<u64, Error> {
        let (mut all, mut inside, mut left) = (0, 0, 0);
        self.clouds.read(progress, &mut |cloud| {
            all += cloud.len() as u64;
            let mut cloud = Cow::Borrowed(cloud);
            if let Some([min, max]) = self.thinning.bounds {
                cloud.to_mut().crop(min, max);
            }
            if let Some(step) = self.thinning.every {
                let (first, len) = (inside, cloud.len() as u64);
                cloud.to_mut().retain(|i| (first + i as u64).is_multiple_of(step as u64));
                inside += len;
            }
            let before = left;
            left += cloud.len() as u64;
            take(cloud, before)
        })?;
        Ok(all)
    }

    /// Chooses one point of each cube. A cube's points are all in one part of the file, whatever their order.
    fn choose(&self, size: f64, folder: &Path, memory: u64, progress: &dyn Progress) -> Result<Vec<u64>, Error> {
        thin::check_voxel(size)?;
        let points = self.clouds.points().unwrap_or(MANY);
        let parts = (points * BYTES_PER_POINT).div_ceil((memory / 2).max(1)).clamp(1, 1 << 12) as usize;
        let mut cells: Vec<Mutex<SpillCell>> = Vec::new();
        cells.resize_with(parts, Mutex::default);
        let spill = Spill::new(folder, RECORD, parts, (memory / 4) as usize)?;
        let mut origin = None;
        let mut count = 0;
        self.coarse(&Part { whole: progress, start: 0.0, len: 0.5 }, &mut |cloud, before| {
            let _ = origin.get_or_insert(cloud.origin());
            count += cloud.len() as u64;
            (0..cloud.len().div_ceil(PIECE)).into_par_iter().try_for_each(|piece| {
                let range = piece * PIECE..cloud.len().min((piece + 1) * PIECE);
                let mut placed = Vec::with_capacity(range.len());
                for i in range {
                    let place = cloud.world_position(i);
                    if let Some(cube) = thin::cube(place, size)? {
                        let hash = cube.iter().fold(0, |hash, &along| Random::scrambled(hash ^ along as u64));
                        placed.push(((hash % parts as u64) as usize, place, before + i as u64));
                    }
                }
                placed.sort_by_key(|(part, ..)| *part);
                let mut records = Vec::new();
                for own in placed.chunk_by(|a, b| a.0 == b.0) {
                    records.clear();
                    for (_, place, number) in own {
                        records.extend_from_slice(bytemuck::bytes_of(&place.to_array()));
                        records.extend_from_slice(bytemuck::bytes_of(number));
                    }
                    spill.append(&cells, own[0].0, &records)?;
                }
                Ok(())
            })
        })?;
        let origin = origin.unwrap_or_default();
        let mut chosen = vec![0_u64; count.div_ceil(64) as usize];
        for (part, cell) in cells.into_iter().enumerate() {
            progress.tick(0.5 + 0.5 * part as f32 / parts as f32)?;
            let cell = std::mem::take(&mut *lock(&cell));
            let mut entries = Vec::with_capacity(cell.count as usize);
            spill.take(cell, |records| {
                for record in records.chunks_exact(RECORD) {
                    let place = DVec3::from_array(bytemuck::pod_read_unaligned(&record[..24]));
                    let number: u64 = bytemuck::pod_read_unaligned(&record[24..]);
                    if let Some(cube) = thin::cube(place, size)? {
                        entries.push((cube, number, place - origin));
                    }
                }
                Ok(())
            })?;
            entries.par_sort_unstable_by_key(|(cube, number, _)| (*cube, *number));
            for cube in entries.chunk_by(|(a, ..), (b, ..)| a == b) {
                let number = cube[thin::nearest_to_mean(cube.len(), |i| cube[i].2)].1;
                chosen[(number / 64) as usize] |= 1 << (number % 64);
            }
        }
        Ok(chosen)
    }
}

impl Clouds for Thinned<'_> {
    fn name(&self) -> &Path {
        self.clouds.name()
    }

    fn points(&self) -> Option<u64> {
        let Thinning { bounds, every, voxel, .. } = self.thinning;
        match (bounds, every, voxel) {
            (None, every, None) => Some(self.clouds.points()?.div_ceil(every.unwrap_or(1) as u64)),
            _ => None,
        }
    }

    fn read(
        &self,
        progress: &dyn Progress,
        take: &mut dyn FnMut(&PointCloud) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let mut kept = 0;
        let all = self.coarse(progress, &mut |mut cloud, before| {
            if let Some(chosen) = &self.chosen {
                cloud.to_mut().retain(|i| {
                    let number = before + i as u64;
                    chosen[(number / 64) as usize] >> (number % 64) & 1 > 0
                });
            }
            if let Some((sigma, seed)) = self.thinning.noise {
                cloud.to_mut().add_noise_from(kept, sigma, seed, &())?;
            }
            kept += cloud.len() as u64;
            take(&cloud)
        })?;
        self.kept.store(kept, Ordering::Relaxed);
        if kept == 0 && all > 0 && self.thinning.bounds.is_some() {
            let what = format!("none of the {all} points lies inside; widen --bounds");
            return Err(Error::unsupported(self.name(), what));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FieldValues;

    /// A cloud in parts of unlike lengths.
    struct Parts(Vec<PointCloud>);

    impl Clouds for Parts {
        fn name(&self) -> &Path {
            Path::new("parts")
        }

        fn read(
            &self,
            _progress: &dyn Progress,
            take: &mut dyn FnMut(&PointCloud) -> Result<(), Error>,
        ) -> Result<(), Error> {
            self.0.iter().try_for_each(take)
        }
    }

    #[test]
    fn parts_are_thinned_like_the_whole() -> Result<(), Error> {
        let mut random = Random::from_state(5);
        let count = 3000;
        let positions: Vec<[f32; 3]> = (0..count)
            .map(|i| if i == 70 { [f32::NAN; 3] } else { [0, 1, 2].map(|_| 10.0 * random.unit() as f32) })
            .collect();
        let part = |range: std::ops::Range<usize>| {
            let cloud = PointCloud::new(DVec3::new(5e5, 5e6, 0.0), positions[range.clone()].to_vec());
            cloud.with_field("Number", FieldValues::U32(range.map(|i| i as u32).collect()))
        };
        let parts = Parts(vec![part(0..100)?, part(100..100)?, part(100..1777)?, part(1777..count)?]);
        let bounds = [DVec3::new(5e5 + 1.0, 5e6, 0.0), DVec3::new(5e5 + 9.0, 5e6 + 8.0, 10.0)];
        let each = |bounds, every, voxel, noise| Thinning { bounds, every, voxel, noise };
        for thinning in [
            each(None, None, None, None),
            each(Some(bounds), None, None, None),
            each(None, Some(7), None, None),
            each(None, None, Some(0.9), None),
            each(Some(bounds), Some(3), Some(1.3), Some((0.01, 9))),
        ] {
            let mut whole = part(0..count)?;
            if let Some([min, max]) = thinning.bounds {
                whole.crop(min, max);
            }
            if let Some(step) = thinning.every {
                whole.keep_every(step);
            }
            if let Some(size) = thinning.voxel {
                whole.thin_by_voxel(size, &())?;
            }
            if let Some((sigma, seed)) = thinning.noise {
                whole.add_noise(sigma, seed, &())?;
            }
            // So little memory that cubes are in many parts.
            let thinned = Thinned::new(&parts, thinning, &std::env::temp_dir(), 1 << 16, &())?;
            let mut found = Vec::new();
            thinned.read(&(), &mut |cloud| {
                found.push(cloud.clone());
                Ok(())
            })?;
            let found = PointCloud::joined(found.iter());
            let bits = |cloud: &PointCloud| bytemuck::cast_slice::<_, u32>(cloud.positions()).to_vec();
            assert_eq!((bits(&found), found.fields()), (bits(&whole), whole.fields()), "{thinning:?}");
            assert_eq!(thinned.kept(), whole.len() as u64, "{thinning:?}");
        }
        let none = Thinned::new(&parts, each(None, None, Some(0.0), None), &std::env::temp_dir(), 1 << 16, &());
        assert!(matches!(none, Err(Error::BadValue { .. })), "no size");
        Ok(())
    }
}
