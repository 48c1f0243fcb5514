//! Normals of more points than memory holds, tile by tile.
//!
//! # How it works
//! The points are divided into [`Tiles`]. Each is loaded with a halo and estimated like a cloud. A neighbourhood is
//! exact if it ends where all points are known. The distance to the k-th neighbour among some of the points is never
//! less than among all, so a halo of that width is enough. Only neighbourhoods that may end beyond the first halo are
//! looked at for it. Results wait in a file, in the input's order.
//!
//! The sums over a neighbourhood run in another order than for the whole cloud, so their last bits differ.

use std::{
    fs::File,
    ops::Range,
    path::{Path, PathBuf},
    sync::{
        Mutex,
        atomic::{AtomicBool, Ordering::Relaxed},
    },
};

use autosplats_cloud::{
    Clouds, Part, PointCloud, Progress, Spill, SpillCell, Tile, TilePoint, Tiles, lock, read_exact_at,
    temporary_failed, temporary_unnamed, write_all_at,
};
use rayon::prelude::*;

use super::{NormalSettings, Normals, Orientation, Scope, Viewpoint, Wanted, check, estimate, k_radius_of};
use crate::Error;

/// Memory in bytes per point of a tile and its halo: the point, its neighbourhood, and its result.
const BYTES_PER_POINT: u64 = 120;

/// Part of the points in memory that lie in the tile and not in its halo. The rest is for wide halos.
const OWN_PART: u64 = 4;

/// Part of the memory in which records are gathered before they are written.
const GATHERED: u64 = 8;

/// The first halo, in distances to the k-th neighbour of points that lie evenly on the largest side of a tile.
const FIRST_HALO: f32 = 3.0;

/// Binary logarithm of the number of points whose results lie together while they wait.
const RUN_BITS: u32 = 18;

/// Bytes of a waiting result, with the place in its run; and of a result.
const WAITING: usize = 24;
const RESULT: usize = 20;

/// Part of the progress that dividing takes.
const DIVIDING: f32 = 0.3;
/// Part of a tile's progress that looking for the halo takes.
const LOOKING: f32 = 0.2;

/// What distances to a neighbour are multiplied by, so that rounding hides none.
const MARGIN: f32 = 1.001;

/// Points whose results are sorted together.
const PIECE: usize = 1 << 16;

/// Memory and place for work on points in parts.
#[derive(Clone, Debug)]
pub struct PartsOptions {
    /// Memory to use, in bytes.
    pub memory: u64,
    /// Folder for temporary files.
    pub folder: PathBuf,
}

/// The normals of all points, in a temporary file.
pub struct NormalsInParts {
    folder: PathBuf,
    file: File,
    len: u64,
    in_doubt: u64,
    tiles: usize,
}

/// Estimates like [`estimate_normals`](super::estimate_normals), in bounded memory. The points are read twice. Their
/// normals have the bits of any other run, but not always those of `estimate_normals`, which adds in another order.
///
/// # Errors
/// Those of `estimate_normals`, of reading and of the operating system, and out of memory if too many points are at one
/// place.
///
/// # Examples
///
/// ```
/// use autosplats::{
///     NormalSettings, Orientation, PartsOptions, cloud::{Held, PointCloud, glam::DVec3}, estimate_normals_in_parts,
/// };
///
/// # let folder = std::env::temp_dir();
/// let floor = (0..100).map(|i| [(i % 10) as f32, (i / 10) as f32, 0.0]).collect();
/// let cloud = PointCloud::new(DVec3::ZERO, floor);
/// let settings = NormalSettings { orientation: Orientation::Direction(DVec3::Z), ..NormalSettings::default() };
/// let options = PartsOptions { memory: 64 << 20, folder };
/// let held = Held { name: "floor".as_ref(), cloud: &cloud };
/// let estimated = estimate_normals_in_parts(&held, &settings, &options, &())?;
/// assert_eq!((estimated.len(), estimated.in_doubt()), (100, 0));
/// assert!(estimated.read(90..100)?.normals.iter().all(|[_, _, z]| *z > 0.99));
/// # Ok::<(), autosplats::Error>(())
/// ```
pub fn estimate_normals_in_parts(
    clouds: &dyn Clouds,
    settings: &NormalSettings,
    options: &PartsOptions,
    progress: &dyn Progress,
) -> Result<NormalsInParts, Error> {
    check(settings)?;
    let folder = &options.folder;
    let most = (options.memory / BYTES_PER_POINT).max(1);
    let own = (most / OWN_PART) as usize;
    let gathered = options.memory / GATHERED;
    let dividing = Part { whole: progress, start: 0.0, len: DIVIDING };
    let tiles = Tiles::new(clouds, own.max(1), folder, gathered, &dividing)?;
    let runs = tiles.all().div_ceil(1 << RUN_BITS).max(1) as usize;
    let mut cells: Vec<Mutex<SpillCell>> = Vec::new();
    cells.resize_with(runs, Mutex::default);
    let spill = Spill::new(folder, WAITING, runs, gathered as usize)?;
    let work = Work { tiles: &tiles, settings, most: most as usize };
    let (mut in_doubt, mut done) = (0, 0);
    for number in 0..tiles.len() {
        let at = |done: u64| DIVIDING + (1.0 - DIVIDING) * done as f32 / tiles.points().max(1) as f32;
        let len = at(done + tiles.count(number)) - at(done);
        let part = Part { whole: progress, start: at(done), len };
        in_doubt += work.tile(number, &spill, &cells, &part)?;
        done += tiles.count(number);
    }
    let (all, count) = (tiles.all(), tiles.len());
    drop(tiles);
    let file = collect(folder, &spill, cells, all, progress)?;
    Ok(NormalsInParts { folder: folder.clone(), file, len: all, in_doubt, tiles: count })
}

/// What is needed for each tile.
struct Work<'a> {
    tiles: &'a Tiles,
    settings: &'a NormalSettings,
    /// Most points in memory.
    most: usize,
}

impl Work<'_> {
    /// Estimates the points of a tile. Returns how many may have neighbours that are not known.
    fn tile(
        &self,
        number: usize,
        spill: &Spill,
        cells: &[Mutex<SpillCell>],
        progress: &dyn Progress,
    ) -> Result<u64, Error> {
        if self.tiles.count(number) == 0 {
            return Ok(0);
        }
        let looking = Part { whole: progress, start: 0.0, len: LOOKING };
        let Some(mut tile) = self.first(number)? else {
            let count = self.tiles.count(number);
            let what = format!("{count} points at one place, or nearly so, of which normals are estimated together,");
            return Err(autosplats_cloud::Error::OutOfMemory { what, bytes: (count * BYTES_PER_POINT) as usize }.into());
        };
        let skipped = AtomicBool::new(false);
        let is_looked_at = |points: &[u32]| {
            let may_need_more = self.may_need_more(&tile, points);
            skipped.fetch_or(!may_need_more, Relaxed);
            may_need_more
        };
        let looked = self.estimate(&tile, &|points| owns(&tile, points) && is_looked_at(points), &looking)?;
        let mut needs = self.needs(number, &tile, &looked);
        let normals = if needs.is_empty() && !skipped.into_inner() {
            looked
        } else {
            drop(looked);
            if !needs.is_empty()
                && let Some(wider) = self.second(number, &needs)?
            {
                tile = wider;
            }
            let estimating = Part { whole: progress, start: LOOKING, len: 1.0 - LOOKING };
            let normals = self.estimate(&tile, &|points| owns(&tile, points), &estimating)?;
            needs = self.needs(number, &tile, &normals);
            normals
        };
        write(&tile, &normals, spill, cells)?;
        progress.tick(1.0)?;
        Ok(needs.len() as u64)
    }

    /// The tile with its first halo, or else with none. `None` if not even the tile fits into memory.
    fn first(&self, number: usize) -> Result<Option<Tile>, Error> {
        let Some(own) = self.tiles.load(number, 0.0, self.most)? else { return Ok(None) };
        let mut sides = [0, 1, 2].map(|axis| {
            let values = || own.points.iter().map(|point| point.position[axis]);
            values().fold(f32::NEG_INFINITY, f32::max) - values().fold(f32::INFINITY, f32::min)
        });
        sides.sort_by(f32::total_cmp);
        let each = sides[1] * sides[2] / own.points.len() as f32;
        let halo = FIRST_HALO * (each * self.settings.k as f32 / std::f32::consts::PI).sqrt();
        Ok(Some(self.tiles.load(number, halo, self.most)?.unwrap_or(own)))
    }

    /// The tile with the halo that points in doubt need, as far as it fits into memory.
    fn second(&self, number: usize, needs: &[f32]) -> Result<Option<Tile>, Error> {
        // A few far points may need a halo that does not fit; the others are served nevertheless.
        let mut skipped = 0;
        while skipped < needs.len() {
            if let Some(tile) = self.tiles.load(number, needs[needs.len() - 1 - skipped], self.most)? {
                return Ok(Some(tile));
            }
            skipped = (2 * skipped).max(1);
        }
        Ok(None)
    }

    /// Whether some of these points, which lie close together, may have neighbours that are not known.
    fn may_need_more(&self, tile: &Tile, points: &[u32]) -> bool {
        let positions = || points.iter().map(|&point| tile.points[point as usize].position);
        let [low, high] = [f32::min as fn(f32, f32) -> f32, f32::max]
            .map(|pick| positions().reduce(|a, b| [0, 1, 2].map(|axis| pick(a[axis], b[axis]))).unwrap_or_default());
        // Of more than k points, each has k others no further away than the opposite corner of their box.
        let corner = (0..3).map(|axis| (high[axis] - low[axis]).powi(2)).sum::<f32>().sqrt();
        let known = |axis: usize| (low[axis] - tile.known[0][axis]).min(tile.known[1][axis] - high[axis]);
        points.len() <= self.settings.k as usize || !(corner * MARGIN * MARGIN < known(0).min(known(1)).min(known(2)))
    }

    /// Estimates the points of a tile in the leaves that `wanted` accepts. The others stay NaN.
    fn estimate(&self, tile: &Tile, wanted: Wanted<'_>, progress: &dyn Progress) -> Result<Normals, Error> {
        let positions = tile.points.iter().map(|point| point.position).collect();
        let cloud = PointCloud::new(self.tiles.origin(), positions);
        let orientation = match &self.settings.orientation {
            Orientation::Viewpoints(all) => {
                // Points are in order of their indices, so those of a viewpoint follow each other here too.
                let place = |index: usize| tile.points.partition_point(|point| point.index < index as u64);
                let here = all.iter().map(|seen| Viewpoint {
                    position: seen.position,
                    points: place(seen.points.start)..place(seen.points.end),
                });
                Orientation::Viewpoints(here.collect())
            }
            other => other.clone(),
        };
        let settings = NormalSettings { k: self.settings.k, orientation };
        let scope = Scope { middle: Some(self.tiles.middle()), wanted: Some(wanted) };
        estimate(&cloud, &settings, &scope, progress)
    }

    /// The halos that the tile's own points need whose k-th neighbour may be another one, in order.
    fn needs(&self, number: usize, tile: &Tile, normals: &Normals) -> Vec<f32> {
        let [low, high] = self.tiles.area(number);
        // With fewer points than neighbours, all others are neighbours.
        let few = tile.points.len() <= self.settings.k as usize && (tile.points.len() as u64) < self.tiles.points();
        let k_radius = k_radius_of(self.settings.k.min(tile.points.len() as u32 - 1));
        // What was not looked at needs no more.
        let looked_at = |(point, radius): &(&TilePoint, &f32)| point.is_own && !radius.is_nan();
        let own = tile.points.par_iter().zip(&normals.radius).filter(looked_at);
        let need = own.filter_map(|(point, radius)| {
            let distance = |to: [[f32; 3]; 2]| {
                let along = |axis: usize| (point.position[axis] - to[0][axis]).min(to[1][axis] - point.position[axis]);
                along(0).min(along(1)).min(along(2))
            };
            let reach = if few { f32::INFINITY } else { radius * k_radius * MARGIN };
            (!(reach < distance(tile.known))).then(|| reach - distance([low, high]).min(reach))
        });
        let mut needs: Vec<f32> = need.collect();
        needs.sort_by(f32::total_cmp);
        needs
    }
}

/// Whether any of these points lies in the tile.
fn owns(tile: &Tile, points: &[u32]) -> bool {
    points.iter().any(|&point| tile.points[point as usize].is_own)
}

/// Adds the results of a tile's own points to those that wait.
fn write(tile: &Tile, normals: &Normals, spill: &Spill, cells: &[Mutex<SpillCell>]) -> Result<(), Error> {
    let Normals { normals, curvature, radius } = normals;
    let pieces = tile.points.par_chunks(PIECE).enumerate();
    Ok(pieces.try_for_each(|(piece, points)| {
        let mut records = Vec::new();
        let numbered = points.iter().enumerate().filter(|(_, point)| point.is_own);
        let mut run = None;
        for (place, point) in numbered {
            let i = piece * PIECE + place;
            let own = (point.index >> RUN_BITS) as usize;
            if run.is_some_and(|run| run != own) {
                spill.append(cells, run.unwrap_or(own), &records)?;
                records.clear();
            }
            run = Some(own);
            let within = (point.index & ((1 << RUN_BITS) - 1)) as u32;
            records.extend(within.to_le_bytes());
            let values = normals[i].into_iter().chain([curvature[i], radius[i]]);
            values.for_each(|value| records.extend(value.to_le_bytes()));
        }
        match run {
            Some(run) => spill.append(cells, run, &records),
            None => Ok(()),
        }
    })?)
}

/// Puts the results into the order of the points, in a file. Points that are nowhere get NaN.
fn collect(
    folder: &Path,
    spill: &Spill,
    cells: Vec<Mutex<SpillCell>>,
    points: u64,
    progress: &dyn Progress,
) -> Result<File, Error> {
    let io = |source| temporary_failed(folder, &source);
    let file = temporary_unnamed(folder).map_err(io)?;
    let nan = f32::NAN.to_le_bytes().repeat(RESULT / 4);
    for (run, cell) in cells.into_iter().enumerate() {
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        let first = (run as u64) << RUN_BITS;
        let mut results = nan.repeat((points - first).min(1 << RUN_BITS) as usize);
        let cell = std::mem::take(&mut *lock(&cell));
        spill.take(cell, |records| {
            for record in records.chunks_exact(WAITING) {
                let within = u32::from_le_bytes([record[0], record[1], record[2], record[3]]) as usize;
                results[within * RESULT..(within + 1) * RESULT].copy_from_slice(&record[4..]);
            }
            Ok(())
        })?;
        write_all_at(&file, &results, first * RESULT as u64).map_err(io)?;
    }
    Ok(file)
}

impl NormalsInParts {
    /// Number of points.
    #[must_use]
    pub fn len(&self) -> u64 {
        self.len
    }

    /// Whether there are no points.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Number of points whose neighbours may not all be known, because the memory did not suffice for a wider halo.
    /// Their planes are fitted to the known ones.
    #[must_use]
    pub fn in_doubt(&self) -> u64 {
        self.in_doubt
    }

    /// Number of tiles that the points were divided into.
    #[must_use]
    pub fn tiles(&self) -> usize {
        self.tiles
    }

    /// The normals of some points, in the input's order.
    ///
    /// # Errors
    /// Those of the operating system.
    ///
    /// # Panics
    /// If there are no such points.
    pub fn read(&self, points: Range<u64>) -> Result<Normals, autosplats_cloud::Error> {
        assert!(points.start <= points.end && points.end <= self.len, "points {points:?} of {}", self.len);
        let count = (points.end - points.start) as usize;
        let mut values = vec![[0.0_f32; RESULT / 4]; count];
        read_exact_at(&self.file, bytemuck::cast_slice_mut(&mut values), points.start * RESULT as u64)
            .map_err(|source| temporary_failed(&self.folder, &source))?;
        Ok(Normals {
            normals: values.iter().map(|&[x, y, z, ..]| [x, y, z]).collect(),
            curvature: values.iter().map(|values| values[3]).collect(),
            radius: values.iter().map(|values| values[4]).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use autosplats_cloud::{Held, glam::DVec3};

    use super::*;
    use crate::normals::estimate_normals;

    /// A wavy floor with a dense patch, and a point that is nowhere.
    fn cloud(count: usize) -> PointCloud {
        let mut random = autosplats_cloud::Random::from_state(3);
        let positions = (0..count).map(|i| {
            let [x, y] = [random.unit(), random.unit()];
            let size = if i % 3 == 0 { 0.05 } else { 1.0 };
            let (x, y) = (x * size, y * size);
            match i {
                7 => [f32::NAN, 0.0, 0.0],
                _ => [x as f32, y as f32, (0.05 * (20.0 * x).sin() + 0.02 * (31.0 * y).cos()) as f32],
            }
        });
        PointCloud::new(DVec3::new(5e5, 5e6, 100.0), positions.collect())
    }

    fn in_parts(cloud: &PointCloud, settings: &NormalSettings, points: u64) -> NormalsInParts {
        let options = PartsOptions { memory: points * BYTES_PER_POINT, folder: std::env::temp_dir() };
        let held = Held { name: "cloud".as_ref(), cloud };
        estimate_normals_in_parts(&held, settings, &options, &()).expect("the disk has room")
    }

    fn same(a: &Normals, b: &Normals) {
        for i in 0..a.normals.len() {
            if a.radius[i].is_nan() {
                assert!(b.radius[i].is_nan() && b.normals[i][0].is_nan(), "point {i} is nowhere");
                continue;
            }
            assert!((a.radius[i] - b.radius[i]).abs() <= 1e-6 * a.radius[i], "radius of {i}");
            assert!((a.curvature[i] - b.curvature[i]).abs() < 1e-4, "curvature of {i}");
            let cosine: f32 = (0..3).map(|axis| a.normals[i][axis] * b.normals[i][axis]).sum();
            assert!(cosine > 0.9999, "point {i}: {:?} and {:?}", a.normals[i], b.normals[i]);
        }
    }

    #[test]
    fn tiles_give_what_the_whole_cloud_gives() {
        let cloud = cloud(20_000);
        let up = Orientation::Direction(DVec3::Z);
        let seen = |points, z| Viewpoint { position: cloud.origin() + DVec3::new(0.5, 0.5, z), points };
        let viewpoints = Orientation::Viewpoints(vec![seen(0..9000, 5.0), seen(9000..20_000, -5.0)]);
        for (orientation, points) in [(up.clone(), 12_000), (up, 40_000), (viewpoints, 12_000)] {
            let settings = NormalSettings { orientation, ..NormalSettings::default() };
            let whole = estimate_normals(&cloud, &settings, &()).expect("settings are valid");
            let parts = in_parts(&cloud, &settings, points);
            assert_eq!((parts.len(), parts.tiles() > 3), (20_000, points < 40_000), "{} tiles", parts.tiles());
            let all = parts.read(0..20_000).expect("the file is there");
            same(&whole, &all);
            assert_eq!(parts.in_doubt(), 0);
            assert_eq!(parts.read(6..9).expect("the file is there").radius[2], all.radius[8], "a part");
        }
    }

    #[test]
    fn far_points_are_in_doubt_if_memory_is_little() {
        // Each of the far points needs neighbours that are everywhere.
        let mut positions = cloud(20_000).positions().to_vec();
        for (i, place) in [[90.0, 0.0, 0.0], [-90.0, 0.0, 0.0], [0.0, 90.0, 0.0]].into_iter().enumerate() {
            positions[100 * i] = place;
        }
        let cloud = PointCloud::new(DVec3::ZERO, positions);
        let parts = in_parts(&cloud, &NormalSettings::default(), 16_000);
        assert!((1..=4).contains(&parts.in_doubt()), "{} in doubt", parts.in_doubt());
    }

    #[test]
    fn few_points() {
        for count in [0, 1, 2, 9] {
            let positions = (0..count).map(|i| [i as f32, (i * i) as f32, 0.0]).collect();
            let cloud = PointCloud::new(DVec3::ZERO, positions);
            let settings = NormalSettings { orientation: Orientation::Direction(DVec3::Z), ..Default::default() };
            let whole = estimate_normals(&cloud, &settings, &()).expect("settings are valid");
            let parts = in_parts(&cloud, &settings, 12);
            assert_eq!(parts.read(0..count as u64).expect("the file is there").radius, whole.radius, "{count} points");
        }
    }
}
