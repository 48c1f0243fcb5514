//! Evenly distributed points on the triangles of a mesh.
//!
//! # How it works
//!
//! A curve runs through the whole surface. It visits the triangles in an order that keeps neighbours together. Within a
//! triangle the curve is a Sierpiński curve, which halves the triangle again and again. Position along the curve is
//! measured in area. Cut into `count` equal pieces, the curve yields connected patches of equal area, and each patch
//! gets one point near its middle. The density is exactly even, without the clumps and holes of random points. Dart
//! throwing and sample elimination cover more evenly still. But they search neighbours in a fixed order, while here
//! each point is computed on its own.
//!
//! The centroid of a part of a triangle has a closed form. Halves before a position on the curve add their centroids,
//! weighted by area. Only the half that contains the position is subdivided.

mod surface_samples;
mod triangle;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

pub use self::surface_samples::SurfaceSamples;
use self::{surface_samples::Place, triangle::Triangle};
use crate::{Contents, Error, Field, PointCloud, Progress, memory::check_memory, random::Random, reserve::reserving};

/// Points computed between two checks for cancellation.
const BLOCK: usize = 1 << 18;

/// Points that one thread computes at a time.
const PIECE: usize = 1 << 12;

/// How far a point moves from the middle of its patch towards a random place in the patch, so that no pattern shows.
const JITTER: f64 = 0.3;

/// Share of a patch that must lie in one triangle for the point to be at that part's own middle. Otherwise the point is
/// at the place nearest to the patch's middle. That place is on an edge, where points of other patches may lie too.
const MIN_OWN_MIDDLE_SHARE: f64 = 0.3;

/// Halvings beyond those that make a piece as small as a patch.
const EXTRA_HALVINGS: i32 = 6;

/// Samples exactly `count` points on the triangles of `mesh`, evenly by area. Every point has a patch of the same area.
///
/// Colours and float fields are interpolated; other fields take the value of the nearest corner; normals get unit
/// length. Origin, axes and coordinate system are the mesh's. Triangles without area, or with missing or non-finite
/// corners, get no points. The same `seed` gives the same points on any number of threads.
///
/// # Errors
/// [`Error::NoSurface`] if no triangle has an area, [`Error::OutOfMemory`], [`Error::Cancelled`] if `progress` says so.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{Contents, PointCloud, glam::DVec3, sample_surface};
///
/// let corners = vec![[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [1.0, 1.0, 2.0], [0.0, 1.0, 2.0]];
/// let cloud = PointCloud::new(DVec3::ZERO, corners);
/// let mesh = Contents { cloud, triangles: vec![[0, 1, 2], [0, 2, 3]] };
/// let cloud = sample_surface(&mesh, 1000, 1, &())?;
/// assert_eq!(cloud.len(), 1000);
/// assert!(cloud.positions().iter().all(|[_, _, z]| *z == 2.0));
/// # Ok::<(), autosplats_cloud::Error>(())
/// ```
pub fn sample_surface(mesh: &Contents, count: usize, seed: u64, progress: &dyn Progress) -> Result<PointCloud, Error> {
    let sampled = SurfaceSamples::new(mesh, count, seed, progress)?.on(&mesh.cloud, progress)?;
    progress.tick(1.0)?;
    Ok(sampled)
}

impl SurfaceSamples {
    /// Computes places for `count` points on `mesh`, as [`sample_surface`] does.
    ///
    /// # Errors
    /// Those of [`sample_surface`].
    pub fn new(mesh: &Contents, count: usize, seed: u64, progress: &dyn Progress) -> Result<Self, Error> {
        progress.tick(0.0)?;
        let cloud = &mesh.cloud;
        let value = |field: &Field| field.values.byte_len().checked_div(cloud.len()).unwrap_or(0);
        let per_point = 12 + 3 + size_of::<Place>() + cloud.fields().iter().map(value).sum::<usize>();
        let bytes = (count as u64).saturating_mul(per_point as u64).saturating_add(mesh.triangles.len() as u64 * 16);
        check_memory(&format!("{count} points on a surface"), bytes)?;
        let surface = Surface::new(mesh);
        if surface.area() <= 0.0 {
            return Err(Error::NoSurface);
        }
        progress.tick(0.1)?;

        let mut places: Vec<Place> = Vec::new();
        let bytes = count.saturating_mul(per_point);
        let full = |_| Error::OutOfMemory { what: format!("{count} points on a surface"), bytes };
        reserving(|| places.try_reserve_exact(count)).map_err(full)?;
        for start in (0..count).step_by(BLOCK) {
            progress.tick(0.1 + 0.7 * start as f32 / count as f32)?;
            let pieces = (start..count.min(start + BLOCK)).into_par_iter().step_by(PIECE);
            let made: Vec<Vec<Place>> = pieces
                .map(|first| surface.places(first..count.min(start + BLOCK).min(first + PIECE), count, seed))
                .collect();
            made.into_iter().for_each(|piece| places.extend(piece));
        }
        Ok(Self { vertices: cloud.len(), triangles: surface.triangles, places })
    }
}

/// A piece of a triangle: each of its corners as weights of the triangle's second and third corner. The curve runs
/// through the piece from its first corner to its second.
type Piece = [DVec2; 3];

const WHOLE: Piece = [DVec2::ZERO, DVec2::X, DVec2::Y];

/// The two halves of a piece, in the curve's order.
fn halves([from, to, apex]: Piece) -> [Piece; 2] {
    let middle = 0.5 * (from + to);
    [[from, apex, middle], [apex, to, middle]]
}

fn centre([a, b, c]: Piece) -> DVec2 {
    (a + b + c) / 3.0
}

/// Integral of the place over the first part `way`, 0 to 1, of the curve through a triangle of area one.
fn moment(mut way: f64, depth: i32) -> DVec2 {
    let (mut piece, mut area, mut sum) = (WHOLE, 1.0, DVec2::ZERO);
    for _ in 0..depth {
        let [first, second] = halves(piece);
        area *= 0.5;
        way *= 2.0;
        if way < 1.0 {
            piece = first;
        } else {
            sum += area * centre(first);
            piece = second;
            way -= 1.0;
        }
    }
    sum + area * way * centre(piece)
}

/// Place at `way`, 0 to 1, along the curve through a triangle.
fn place(mut way: f64, depth: i32) -> DVec2 {
    let mut piece = WHOLE;
    for _ in 0..depth {
        way *= 2.0;
        let second = way >= 1.0;
        piece = halves(piece)[usize::from(second)];
        way -= f64::from(u8::from(second));
    }
    centre(piece)
}

/// The triangles that have an area, in the curve's order.
struct Surface<'a> {
    mesh: &'a Contents,
    /// Corners, ordered such that the curve runs from the first to the second.
    triangles: Vec<[u32; 3]>,
    /// Cumulative area up to and including each triangle.
    ways: Vec<f64>,
}

impl<'a> Surface<'a> {
    fn new(mesh: &'a Contents) -> Self {
        let mut surface = Self { mesh, triangles: Vec::new(), ways: Vec::new() };
        let exists = |corners: &[u32; 3]| corners.iter().all(|&corner| (corner as usize) < mesh.cloud.len());
        let sound = |corners: &&[u32; 3]| {
            exists(corners) && {
                let area = surface.triangle_of(corners).area();
                area > 0.0 && area.is_finite()
            }
        };
        let mut triangles: Vec<[u32; 3]> = mesh.triangles.par_iter().filter(sound).copied().collect();
        surface.sort(&mut triangles);
        let enter = surface.entrances(&triangles);
        surface.triangles = triangles
            .par_iter()
            .zip(enter)
            .map(|(&[a, b, c], turn)| match turn {
                0 => [a, b, c],
                1 => [b, c, a],
                2 => [c, a, b],
                3 => [b, a, c],
                4 => [c, b, a],
                _ => [a, c, b],
            })
            .collect();
        let mut way = 0.0;
        surface.ways = Vec::with_capacity(surface.triangles.len());
        for corners in &surface.triangles {
            way += surface.triangle_of(corners).area();
            surface.ways.push(way);
        }
        surface
    }

    fn triangle_of(&self, corners: &[u32; 3]) -> Triangle {
        Triangle(corners.map(|corner| DVec3::from(self.mesh.cloud.positions()[corner as usize].map(f64::from))))
    }

    fn triangle(&self, index: u32) -> Triangle {
        self.triangle_of(&self.triangles[index as usize])
    }

    fn area(&self) -> f64 {
        self.ways.last().copied().unwrap_or(0.0)
    }

    /// Sorts triangles along a Hilbert curve through space, which keeps neighbours together.
    fn sort(&self, triangles: &mut [[u32; 3]]) {
        let middle = |corners: &[u32; 3]| {
            let [a, b, c] = self.triangle_of(corners).0;
            (a + b + c) / 3.0
        };
        let empty = || [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let both = |[a, b]: [DVec3; 2], [c, d]: [DVec3; 2]| [a.min(c), b.max(d)];
        let [low, high] = triangles.par_iter().map(|corners| [middle(corners); 2]).reduce(empty, both);
        let size = (high - low).max_element().max(f64::MIN_POSITIVE);
        let key = |corners: &[u32; 3]| {
            let cell = (middle(corners) - low) / size * f64::from((1 << HILBERT_BITS) - 1);
            hilbert(cell.to_array().map(|value| value as u32))
        };
        triangles.par_sort_by_cached_key(key);
    }

    /// How the curve passes through each triangle: along the longest edge, so that halves are no needles. Of the two
    /// directions it takes the one that ends nearer to the next triangle.
    fn entrances(&self, triangles: &[[u32; 3]]) -> Vec<u8> {
        let turn = |index: usize| {
            let [a, b, c] = self.triangle_of(&triangles[index]).0;
            let lengths = [(b - a).length_squared(), (c - b).length_squared(), (a - c).length_squared()];
            let longest = if lengths[0] >= lengths[1] && lengths[0] >= lengths[2] {
                0
            } else if lengths[1] >= lengths[2] {
                1
            } else {
                2
            };
            let (from, to) = [(a, b), (b, c), (c, a)][longest];
            let next = triangles.get(index + 1).map(|corners| {
                let [a, b, c] = self.triangle_of(corners).0;
                (a + b + c) / 3.0
            });
            let back = next.is_some_and(|next| next.distance_squared(from) < next.distance_squared(to));
            longest as u8 + if back { 3 } else { 0 }
        };
        (0..triangles.len()).into_par_iter().map(turn).collect()
    }

    /// Places of the points `range` out of `count`.
    fn places(&self, range: std::ops::Range<usize>, count: usize, seed: u64) -> Vec<Place> {
        let patch = self.area() / count as f64;
        let mut triangle = self.ways.partition_point(|&way| way <= patch * range.start as f64);
        range.map(|i| self.place(i, patch, &mut triangle, seed)).collect()
    }

    /// A place near the middle of patch `i`. `triangle` is at or before the triangle in which the patch begins, and is
    /// moved to the triangle in which the patch ends.
    fn place(&self, i: usize, patch: f64, triangle: &mut usize, seed: u64) -> Place {
        let (start, end) = (patch * i as f64, patch * (i + 1) as f64);
        let last = self.triangles.len() - 1;
        *triangle = (*triangle).min(last);
        while *triangle < last && self.ways[*triangle] <= start {
            *triangle += 1;
        }
        // The middle of the whole patch, which need not lie on the surface.
        let first = *triangle;
        let (mut sum, mut total) = (DVec3::ZERO, 0.0);
        let mut after = first;
        loop {
            let (area, middle) = self.part(after, start, end, patch);
            let triangle = self.triangle(after as u32);
            sum += area * triangle.at(middle.x as f32, middle.y as f32);
            total += area;
            if after == last || self.ways[after] >= end {
                break;
            }
            after += 1;
        }
        *triangle = after;
        let random = Random::new(seed, i as u64);
        if first == after {
            let middle = self.part(first, start, end, patch).1;
            return self.jittered(first, middle, start, end, patch, random);
        }
        let parts = (first..=after).map(|index| (self.part(index, start, end, patch), index));
        let largest = parts.max_by(|a, b| a.0.0.total_cmp(&b.0.0));
        if let Some(((_, weights), index)) = largest.filter(|((area, _), _)| *area >= MIN_OWN_MIDDLE_SHARE * patch) {
            return self.jittered(index, weights, start, end, patch, random);
        }
        let goal = sum / total;
        let nearest = (first..=after).map(|index| {
            let triangle = self.triangle(index as u32);
            let weights = triangle.nearest(goal);
            (triangle.at(weights.x as f32, weights.y as f32).distance_squared(goal), index, weights)
        });
        let nearest = nearest.min_by(|a, b| a.0.total_cmp(&b.0));
        let (_, index, weights) = nearest.unwrap_or((0.0, first, DVec2::splat(1.0 / 3.0)));
        self.jittered(index, weights, start, end, patch, random)
    }

    /// The part of triangle `index` that lies between two positions on the curve: its start and end along the curve
    /// through that triangle, 0 to 1.
    fn ends(&self, index: usize, start: f64, end: f64) -> [f64; 2] {
        let before = if index == 0 { 0.0 } else { self.ways[index - 1] };
        let area = self.ways[index] - before;
        let way = |at: f64| if area > 0.0 { ((at - before) / area).clamp(0.0, 1.0) } else { 0.0 };
        [way(start), way(end)]
    }

    /// Area and middle of the part of triangle `index` between two positions on the curve.
    fn part(&self, index: usize, start: f64, end: f64, patch: f64) -> (f64, DVec2) {
        let before = if index == 0 { 0.0 } else { self.ways[index - 1] };
        let area = self.ways[index] - before;
        let [from, to] = self.ends(index, start, end);
        if !(to - from > 1e-9) {
            return (0.0, place(from, 1));
        }
        if to - from == 1.0 {
            return (area, centre(WHOLE));
        }
        let depth = depth(area, patch);
        (area * (to - from), (moment(to, depth) - moment(from, depth)) / (to - from))
    }

    fn jittered(&self, index: usize, middle: DVec2, start: f64, end: f64, patch: f64, mut random: Random) -> Place {
        let before = if index == 0 { 0.0 } else { self.ways[index - 1] };
        let [from, to] = self.ends(index, start, end);
        let way = from + (to - from) * random.unit();
        let weights = middle.lerp(place(way, depth(self.ways[index] - before, patch)), JITTER);
        // Rounding must not move a point out of its triangle.
        let (second, third) = (weights.x.clamp(0.0, 1.0), weights.y.clamp(0.0, 1.0));
        Place { triangle: index as u32, second: second as f32, third: third.min(1.0 - second) as f32 }
    }
}

/// Number of halvings of a triangle until its pieces are much smaller than a patch.
fn depth(area: f64, patch: f64) -> i32 {
    (EXTRA_HALVINGS + (area / patch).log2().ceil().clamp(0.0, 40.0) as i32).min(46)
}

/// Bits per axis of the Hilbert curve.
const HILBERT_BITS: u32 = 16;

/// Position of a cell on a Hilbert curve through a cube (Skilling, "Programming the Hilbert curve", 2004).
fn hilbert(mut cell: [u32; 3]) -> u64 {
    let mut bit = 1 << (HILBERT_BITS - 1);
    while bit > 1 {
        let below = bit - 1;
        for axis in 0..3 {
            if cell[axis] & bit != 0 {
                cell[0] ^= below;
            } else {
                let swapped = (cell[0] ^ cell[axis]) & below;
                cell[0] ^= swapped;
                cell[axis] ^= swapped;
            }
        }
        bit >>= 1;
    }
    cell[1] ^= cell[0];
    cell[2] ^= cell[1];
    let mut turned = 0;
    let mut bit = 1 << (HILBERT_BITS - 1);
    while bit > 1 {
        if cell[2] & bit != 0 {
            turned ^= bit - 1;
        }
        bit >>= 1;
    }
    let cell = cell.map(|value| value ^ turned);
    let bits = |level: u32| cell.iter().fold(0, |key, value| key << 1 | u64::from(value >> level & 1));
    (0..HILBERT_BITS).rev().fold(0, |key, level| key << 3 | bits(level))
}
