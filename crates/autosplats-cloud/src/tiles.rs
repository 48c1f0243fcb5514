//! Points that lie near each other together, for work on neighbourhoods that needs no more memory than a part of them.
//!
//! # How it works
//!
//! Space is divided at medians of a sample until each box has few enough points, so dense places get small boxes. All
//! points go to the boxes they lie in, on the [disk](Spill). A box is a tile; it is loaded with a *halo*: the points of
//! other boxes that are no further away than that.

use std::{path::Path, sync::Mutex};

use glam::DVec3;
use rayon::prelude::*;

use crate::{Clouds, Error, PointCloud, Progress, Spill, SpillCell, lock, progress::Part};

/// Points of the sample by which space is divided.
const SAMPLE: usize = 1 << 18;

/// Points at least of which a [`sampled_median`] is that of all.
const MEDIAN_SAMPLE: u64 = 1 << 16;

/// Largest absolute coordinate of a point. Squared distances of larger ones exceed `f32`.
const MAX_COORDINATE: f32 = 1e18;

/// Points that one thread sorts into boxes at a time.
const PIECE: usize = 1 << 16;

/// Bytes of a record: position and index.
const RECORD: usize = 20;

/// Part of the progress that sampling takes.
const SAMPLING: f32 = 0.4;

/// A point of a tile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TilePoint {
    /// Index among all points.
    pub index: u64,
    /// Position about the origin.
    pub position: [f32; 3],
    /// Whether the point lies in the tile, and not in its halo.
    pub is_own: bool,
}

/// The points of a tile and its halo.
#[derive(Clone, Debug, Default)]
pub struct Tile {
    /// In order of their indices.
    pub points: Vec<TilePoint>,
    /// Corners of the box about the origin in which all points are known; infinite where it has no end.
    pub known: [[f32; 3]; 2],
}

/// All points with a finite position, divided into boxes.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{Held, PointCloud, Tiles, glam::DVec3};
///
/// # let folder = tempfile::tempdir()?;
/// let line = PointCloud::new(DVec3::ZERO, (0..1000).map(|x| [x as f32, 0.0, 0.0]).collect());
/// let tiles = Tiles::new(&Held { name: "line".as_ref(), cloud: &line }, 300, folder.path(), 1 << 20, &())?;
/// assert_eq!(tiles.len(), 4);
/// let tile = tiles.load(1, 2.0, usize::MAX)?.expect("it fits");
/// assert_eq!(tile.points.iter().filter(|point| point.is_own).count(), 250);
/// assert_eq!(tile.points.len(), 255, "two below its box, and three from its end on");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Tiles {
    origin: DVec3,
    middle: [f32; 3],
    splits: Splits,
    cells: Vec<Mutex<SpillCell>>,
    spill: Spill,
    points: u64,
    all: u64,
}

/// How space is divided.
struct Splits {
    nodes: Vec<Node>,
    /// Corners of each box.
    boxes: Vec<[[f32; 3]; 2]>,
}

#[derive(Clone, Copy)]
enum Node {
    /// Points below `at` along the axis are in the first node, others in the second.
    Split {
        axis: usize,
        at: f32,
        nodes: [u32; 2],
    },
    Box(u32),
}

impl Splits {
    fn new(mut sample: Vec<[f32; 3]>, most: f64) -> Self {
        let mut splits = Self { nodes: Vec::new(), boxes: Vec::new() };
        splits.divide(&mut sample, most.max(1.0), [[f32::NEG_INFINITY; 3], [f32::INFINITY; 3]]);
        splits
    }

    /// Divides a box until each part has at most `most` points of the sample. Returns its node.
    fn divide(&mut self, sample: &mut [[f32; 3]], most: f64, area: [[f32; 3]; 2]) -> u32 {
        let number = self.nodes.len() as u32;
        self.nodes.push(Node::Box(self.boxes.len() as u32));
        let plane = if sample.len() as f64 > most { median_plane(sample) } else { None };
        let Some((axis, at)) = plane else {
            self.boxes.push(area);
            return number;
        };
        sample.sort_unstable_by(|a, b| a[axis].total_cmp(&b[axis]));
        let (low, high) = sample.split_at_mut(sample.partition_point(|point| point[axis] < at));
        let (mut below, mut above) = (area, area);
        (below[1][axis], above[0][axis]) = (at, at);
        let nodes = [self.divide(low, most, below), self.divide(high, most, above)];
        self.nodes[number as usize] = Node::Split { axis, at, nodes };
        number
    }

    /// The box of a position.
    #[inline]
    fn find(&self, position: [f32; 3]) -> usize {
        let mut node = 0;
        loop {
            match self.nodes[node as usize] {
                Node::Split { axis, at, nodes } => node = nodes[usize::from(position[axis] >= at)],
                Node::Box(number) => return number as usize,
            }
        }
    }
}

/// A plane that has about half of the points on either side, across the longest edge that allows it: axis and place.
/// `None` if all points are at one place.
fn median_plane(sample: &[[f32; 3]]) -> Option<(usize, f32)> {
    let mut axes: Vec<(usize, f32, f32)> = (0..3)
        .map(|axis| {
            let values = || sample.iter().map(|point| point[axis]);
            let (low, high) = (values().fold(f32::INFINITY, f32::min), values().fold(f32::NEG_INFINITY, f32::max));
            (axis, low, high)
        })
        .collect();
    axes.sort_by(|a, b| (b.2 - b.1).total_cmp(&(a.2 - a.1)));
    let (axis, low, high) = axes[0];
    if !(low < high) {
        return None;
    }
    let mut values: Vec<f32> = sample.iter().map(|point| point[axis]).collect();
    let half = values.len() / 2;
    let (_, &mut median, above) = values.select_nth_unstable_by(half, f32::total_cmp);
    // Points at the plane are above it, so none may be below if most share the lowest value.
    let next = || above.iter().copied().filter(|&value| value > low).fold(f32::INFINITY, f32::min);
    Some((axis, if median > low { median } else { next() }))
}

/// The points of the sample: every so many of all, so that there are neither too many nor too few.
struct Sampler {
    step: u64,
    points: Vec<(u64, [f32; 3])>,
}

impl Sampler {
    fn add(&mut self, index: u64, position: [f32; 3]) {
        if !index.is_multiple_of(self.step) {
            return;
        }
        self.points.push((index, position));
        if self.points.len() > 2 * SAMPLE {
            self.step *= 2;
            let step = self.step;
            self.points.retain(|(index, _)| index.is_multiple_of(step));
        }
    }
}

/// Every so many of some points make a sample of `sample` to twice as many: a power of two.
fn step_of(points: u64, sample: u64) -> u64 {
    let mut step = 1;
    while points.div_ceil(step) > 2 * sample {
        step *= 2;
    }
    step
}

/// The median of each coordinate of some of the points, evenly taken from all; zero without points.
///
/// # Examples
///
/// ```
/// let points = [[0.0, 5.0, 1.0], [1.0, 4.0, 9.0], [2.0, 6.0, 2.0]];
/// assert_eq!(autosplats_cloud::sampled_median(3, |i| points[i]), [1.0, 5.0, 2.0]);
/// ```
pub fn sampled_median(points: usize, position: impl Fn(usize) -> [f32; 3]) -> [f32; 3] {
    let step = step_of(points as u64, MEDIAN_SAMPLE) as usize;
    let sample: Vec<[f32; 3]> = (0..points).step_by(step).map(position).collect();
    [0, 1, 2].map(|axis: usize| {
        let mut values: Vec<f32> = sample.iter().map(|point| point[axis]).collect();
        let half = values.len() / 2;
        if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(half, f32::total_cmp).1 }
    })
}

/// Positions about an origin.
fn about(origin: DVec3, cloud: &PointCloud, index: usize) -> [f32; 3] {
    if cloud.origin() == origin {
        cloud.positions()[index]
    } else {
        (cloud.world_position(index) - origin).as_vec3().to_array()
    }
}

fn is_finite(position: [f32; 3]) -> bool {
    position.iter().all(|value| value.abs() <= MAX_COORDINATE)
}

impl Tiles {
    /// Divides points into tiles of about `most` at most, unless more are at one place. Reads all points twice; their
    /// positions stay in a file without a name in `folder`. `memory` is what may be gathered before it is written, in
    /// bytes.
    ///
    /// # Errors
    /// Those of reading and of the operating system, and [`Error::Cancelled`] if `progress` says so.
    pub fn new(
        clouds: &dyn Clouds,
        most: usize,
        folder: &Path,
        memory: u64,
        progress: &dyn Progress,
    ) -> Result<Self, Error> {
        let mut origin = None;
        let mut sampler = Sampler { step: 1, points: Vec::new() };
        let (mut all, mut points) = (0, 0);
        clouds.read(&Part { whole: progress, start: 0.0, len: SAMPLING }, &mut |cloud| {
            let origin = *origin.get_or_insert(cloud.origin());
            for i in 0..cloud.len() {
                let position = about(origin, cloud, i);
                if is_finite(position) {
                    sampler.add(points, position);
                    points += 1;
                }
            }
            all += cloud.len() as u64;
            Ok(())
        })?;
        let origin = origin.unwrap_or_default();
        let sample: Vec<[f32; 3]> = sampler.points.into_iter().map(|(_, position)| position).collect();
        let step = (step_of(points, MEDIAN_SAMPLE) / sampler.step) as usize;
        let middle = sampled_median(sample.len().div_ceil(step), |i| sample[i * step]);
        let part = sample.len() as f64 / points.max(1) as f64;
        let splits = Splits::new(sample, most as f64 * part);
        let mut cells = Vec::new();
        cells.resize_with(splits.boxes.len(), Mutex::default);
        let spill = Spill::new(folder, RECORD, cells.len(), memory as usize)?;
        let tiles = Self { origin, middle, splits, cells, spill, points, all };
        tiles.distribute(clouds, &Part { whole: progress, start: SAMPLING, len: 1.0 - SAMPLING })?;
        Ok(tiles)
    }

    fn distribute(&self, clouds: &dyn Clouds, progress: &dyn Progress) -> Result<(), Error> {
        let mut first = 0;
        clouds.read(progress, &mut |cloud| {
            (0..cloud.len().div_ceil(PIECE)).into_par_iter().try_for_each(|piece| {
                let range = piece * PIECE..cloud.len().min((piece + 1) * PIECE);
                let placed = range.map(|i| (about(self.origin, cloud, i), first + i as u64));
                let placed = placed.filter(|(position, _)| is_finite(*position));
                let mut placed: Vec<_> =
                    placed.map(|(position, i)| (self.splits.find(position), position, i)).collect();
                // Stable, though the order of points in a box does not matter.
                placed.sort_by_key(|(number, ..)| *number);
                let mut records = Vec::new();
                for own in placed.chunk_by(|a, b| a.0 == b.0) {
                    records.clear();
                    for (_, position, index) in own {
                        records.extend_from_slice(bytemuck::bytes_of(position));
                        records.extend_from_slice(bytemuck::bytes_of(index));
                    }
                    self.spill.append(&self.cells, own[0].0, &records)?;
                }
                Ok(())
            })?;
            first += cloud.len() as u64;
            Ok(())
        })?;
        self.spill.write_all(&self.cells)
    }

    /// Number of tiles.
    #[allow(clippy::len_without_is_empty, reason = "there is at least one, even of no points")]
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// Number of points with a finite position.
    pub fn points(&self) -> u64 {
        self.points
    }

    /// Number of all points.
    pub fn all(&self) -> u64 {
        self.all
    }

    /// Whether a point of a cloud has a position that is in some tile.
    pub fn has(&self, cloud: &PointCloud, index: usize) -> bool {
        is_finite(about(self.origin, cloud, index))
    }

    /// The place in world coordinates that positions are about.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// The [`sampled_median`] of all points, about the origin.
    pub fn middle(&self) -> [f32; 3] {
        self.middle
    }

    /// Most bytes of the temporary file.
    pub fn bytes(&self) -> u64 {
        self.spill.bytes()
    }

    /// Number of points of a tile.
    pub fn count(&self, number: usize) -> u64 {
        lock(&self.cells[number]).count
    }

    /// Corners of the box of a tile, about the origin; infinite where it has no end.
    pub fn area(&self, number: usize) -> [[f32; 3]; 2] {
        self.splits.boxes[number]
    }

    /// Loads a tile with all points around it that are no further away than `halo` along each axis. `None` if these are
    /// more than `most`.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn load(&self, number: usize, halo: f32, most: usize) -> Result<Option<Tile>, Error> {
        let [low, high] = self.area(number);
        let known = [low.map(|value| value - halo), high.map(|value| value + halo)];
        let inside =
            |position: &[f32; 3]| (0..3).all(|axis| (known[0][axis]..=known[1][axis]).contains(&position[axis]));
        let meets = |other: &usize| {
            let [low, high] = self.area(*other);
            *other == number || (0..3).all(|axis| low[axis] <= known[1][axis] && high[axis] >= known[0][axis])
        };
        let boxes: Vec<usize> = (0..self.len()).filter(meets).collect();
        let total = std::sync::atomic::AtomicUsize::new(0);
        let read = |&other: &usize| {
            let cell = lock(&self.cells[other]);
            let is_own = other == number;
            let mut points = Vec::with_capacity(if is_own { cell.count as usize } else { 0 });
            self.spill.visit(&cell, |records| {
                let before = points.len();
                for record in records.chunks_exact(RECORD) {
                    let position: [f32; 3] = bytemuck::pod_read_unaligned(&record[..12]);
                    if is_own || inside(&position) {
                        let index = bytemuck::pod_read_unaligned(&record[12..]);
                        points.push(TilePoint { index, position, is_own });
                    }
                }
                // Nothing more is gathered once it is too much.
                let more = points.len() - before;
                if total.fetch_add(more, std::sync::atomic::Ordering::Relaxed) + more > most {
                    return Err(Error::Cancelled);
                }
                Ok(())
            })?;
            Ok(points)
        };
        let parts: Vec<Vec<TilePoint>> = match boxes.par_iter().map(read).collect::<Result<_, Error>>() {
            Err(Error::Cancelled) => return Ok(None),
            parts => parts?,
        };
        let mut points = Vec::with_capacity(parts.iter().map(Vec::len).sum());
        parts.into_iter().for_each(|mut part| points.append(&mut part));
        points.par_sort_unstable_by_key(|point: &TilePoint| point.index);
        Ok(Some(Tile { points, known }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Held, Random};

    /// A dense place, a plane, far points, and some that are nowhere.
    fn cloud(count: usize) -> PointCloud {
        let mut random = Random::from_state(7);
        let positions = (0..count).map(|i| {
            let mut unit = || random.unit() as f32;
            match i % 8 {
                0 => [unit() * 1e-3, unit() * 1e-3, 0.0],
                1 if i % 64 == 1 => [f32::NAN, 0.0, 1e30],
                2 if i % 512 == 2 => [1e6 * unit(), 0.0, 1e5],
                _ => [unit(), unit(), 0.1 * unit()],
            }
        });
        PointCloud::new(DVec3::new(5e5, 5e6, 0.0), positions.collect())
    }

    fn tiles(cloud: &PointCloud, most: usize) -> Tiles {
        let held = Held { name: "cloud".as_ref(), cloud };
        Tiles::new(&held, most, &std::env::temp_dir(), 1 << 16, &()).expect("the disk has room")
    }

    #[test]
    fn every_point_is_in_one_tile() {
        let cloud = cloud(20_000);
        let tiles = tiles(&cloud, 1000);
        assert!(tiles.len() >= 20, "{} tiles", tiles.len());
        let mut found = Vec::new();
        for number in 0..tiles.len() {
            let tile = tiles.load(number, 0.0, usize::MAX).expect("the file is there").expect("it fits");
            let own: Vec<_> = tile.points.iter().filter(|point| point.is_own).collect();
            assert!(own.len() <= 1100 && own.len() as u64 == tiles.count(number), "{} points", own.len());
            let [low, high] = tiles.area(number);
            for point in own {
                let inside = |axis: usize| (low[axis]..high[axis]).contains(&point.position[axis]);
                assert!((0..3).all(inside), "{point:?} in {low:?} to {high:?}");
                assert_eq!(point.position, cloud.positions()[point.index as usize]);
                found.push(point.index);
            }
        }
        found.sort_unstable();
        let finite = |i: &u64| is_finite(cloud.positions()[*i as usize]);
        assert_eq!(found, (0..20_000).filter(finite).collect::<Vec<u64>>());
        assert_eq!((tiles.points(), tiles.all()), (found.len() as u64, 20_000));
        let finite: Vec<[f32; 3]> = found.iter().map(|&i| cloud.positions()[i as usize]).collect();
        assert_eq!(tiles.middle(), sampled_median(finite.len(), |i| finite[i]));
    }

    #[test]
    fn a_halo_has_all_points_near() {
        let cloud = cloud(5000);
        let tiles = tiles(&cloud, 300);
        for halo in [0.01, 0.3, f32::INFINITY] {
            for number in 0..tiles.len() {
                let tile = tiles.load(number, halo, usize::MAX).expect("the file is there").expect("it fits");
                let [low, high] = tile.known;
                let known = |position: [f32; 3]| {
                    is_finite(position) && (0..3).all(|axis| (low[axis]..=high[axis]).contains(&position[axis]))
                };
                let wanted: Vec<u64> = (0..5000).filter(|&i| known(cloud.positions()[i as usize])).collect();
                assert_eq!(tile.points.iter().map(|point| point.index).collect::<Vec<_>>(), wanted, "halo {halo}");
            }
        }
        assert!(tiles.load(0, f32::INFINITY, 1000).expect("the file is there").is_none(), "too many");
    }

    #[test]
    fn samples_are_neither_small_nor_large() {
        let mut sampler = Sampler { step: 1, points: Vec::new() };
        let count = 5 * SAMPLE as u64;
        (0..count).for_each(|i| sampler.add(i, [i as f32, 0.0, 0.0]));
        let found: Vec<u64> = sampler.points.iter().map(|(index, _)| *index).collect();
        assert_eq!(sampler.step, step_of(count, SAMPLE as u64));
        assert_eq!(found, (0..count).step_by(sampler.step as usize).collect::<Vec<_>>());
        assert!((SAMPLE..=2 * SAMPLE).contains(&found.len()), "{} points", found.len());
    }

    #[test]
    fn points_at_one_place_are_one_tile() {
        let cloud = PointCloud::new(DVec3::ZERO, vec![[1.0; 3]; 1000]);
        let tiles = tiles(&cloud, 10);
        assert_eq!((tiles.len(), tiles.count(0), tiles.middle()), (1, 1000, [1.0; 3]));
        let none = self::tiles(&PointCloud::default(), 10);
        assert_eq!((none.len(), none.points()), (1, 0));
        assert_eq!(none.load(0, 1.0, 10).expect("the file is there").map(|tile| tile.points.len()), Some(0));
    }
}
