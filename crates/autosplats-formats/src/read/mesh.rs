//! Shared by the readers of meshes: faces to triangles, corners to points, positions to a cloud.

use std::{
    hash::{BuildHasher, Hash, Hasher, RandomState},
    sync::atomic::{AtomicU32, Ordering},
};

use autosplats_cloud::{Error, FieldValues, PointCloud, reserving};
use rayon::prelude::*;

use super::{
    Job,
    table::{Column, ProgressRange, Scalar, Table, collect, reserve},
};

/// Triangles made of faces while these are read. A corner is the index of a point, or negative if there is none.
pub(super) struct Faces {
    pub(super) triangles: Vec<[u32; 3]>,
    /// Number of points that corners may refer to.
    points: usize,
    /// Number of faces with corners that do not exist.
    left_out: usize,
}

impl Faces {
    pub(super) fn new(points: usize) -> Self {
        Self { triangles: Vec::new(), points, left_out: 0 }
    }

    pub(super) fn points(&self) -> usize {
        self.points
    }

    pub(super) fn set_points(&mut self, points: usize) {
        self.points = points;
    }

    /// The point that a corner refers to, if it exists.
    fn point(&self, corner: i64) -> Option<u32> {
        let index = u32::try_from(corner).ok()?;
        ((index as usize) < self.points).then_some(index)
    }

    /// Adds a face, cut into a fan of triangles about its first corner. Fewer than three corners are ignored.
    pub(super) fn polygon(&mut self, corners: &[i64]) -> Result<(), Error> {
        if corners.len() < 3 {
            return Ok(());
        }
        if corners.iter().any(|&corner| self.point(corner).is_none()) {
            self.left_out += 1;
            return Ok(());
        }
        reserve(&mut self.triangles, corners.len() - 2, "the triangles of a mesh")?;
        let corner = |i: usize| corners[i] as u32;
        self.triangles.extend((1..corners.len() - 1).map(|i| [corner(0), corner(i), corner(i + 1)]));
        Ok(())
    }

    /// Adds a triangle strip, in which every corner forms a triangle with the two before it. A corner of -1 begins
    /// another strip. Triangles that use a point twice are skipped: they only continue the strip elsewhere.
    pub(super) fn strip(&mut self, corners: impl Iterator<Item = i64>) -> Result<(), Error> {
        let mut last = [-1; 2];
        let mut len = 0;
        for corner in corners {
            if corner == -1 {
                len = 0;
                continue;
            }
            let [a, b] = last;
            last = [b, corner];
            len += 1;
            if len < 3 || a == b || b == corner || corner == a {
                continue;
            }
            // Every other triangle of a strip has the opposite orientation.
            self.polygon(&if len % 2 == 1 { [a, b, corner] } else { [b, a, corner] })?;
        }
        Ok(())
    }

    /// Adds a triangle fan, in which every corner forms a triangle with the corner before it and the first.
    pub(super) fn fan(&mut self, mut corners: impl Iterator<Item = i64>) -> Result<(), Error> {
        let (Some(first), Some(mut last)) = (corners.next(), corners.next()) else { return Ok(()) };
        corners.try_for_each(|corner| {
            let before = std::mem::replace(&mut last, corner);
            self.polygon(&[first, before, corner])
        })
    }

    pub(super) fn append(&mut self, other: Self) -> Result<(), Error> {
        reserve(&mut self.triangles, other.triangles.len(), "the triangles of a mesh")?;
        self.triangles.extend(other.triangles);
        self.left_out += other.left_out;
        Ok(())
    }

    /// The triangles; notes the number of faces left out.
    pub(super) fn finish(self, job: &Job<'_>) -> Vec<[u32; 3]> {
        if self.left_out > 0 {
            job.note(format!("{} faces have corners that do not exist; left out", self.left_out));
        }
        self.triangles
    }
}

/// A cloud of positions in world coordinates, with previews. `done` is the fraction of the work finished before.
pub(super) fn cloud(job: &Job<'_>, positions: &[[f64; 3]], done: f32) -> Result<PointCloud, Error> {
    columns(job, bytemuck::cast_slice(positions), Scalar::F64, done)
}

/// Like [`cloud`], with the file's `f32` values kept exactly.
pub(super) fn cloud_f32(job: &Job<'_>, positions: &[[f32; 3]], done: f32) -> Result<PointCloud, Error> {
    columns(job, bytemuck::cast_slice(positions), Scalar::F32, done)
}

fn columns(job: &Job<'_>, bytes: &[u8], scalar: Scalar, done: f32) -> Result<PointCloud, Error> {
    let size = scalar.size();
    let column =
        |(axis, name): (usize, &str)| Column { name: name.into(), scalar, offset: axis * size, stride: 3 * size };
    let table = Table {
        bytes,
        count: bytes.len() / (3 * size),
        big_endian: cfg!(target_endian = "big"),
        columns: ["x", "y", "z"].into_iter().enumerate().map(column).collect(),
        packed_rgb: false,
        done,
    };
    table.preview(job, "points")?;
    table.into_cloud(job, "points")
}

/// Adds colours given as sRGB of 0 to 1. If all digits are wanted and 8 bits lose some, adds 16-bit fields too.
pub(super) fn with_colors(
    job: &Job<'_>,
    mut cloud: PointCloud,
    color: impl Fn(usize) -> [f32; 3] + Sync + Send,
) -> Result<PointCloud, Error> {
    let part = ProgressRange { start: 1.0, len: 0.0 };
    let count = cloud.len();
    let colors = collect("colours", count, job, part, |i| color(i).map(|value| (value * 255.0 + 0.5) as u8))?;
    let lost = |i: usize| (0..3).any(|c| (f32::from(colors[i][c]) / 255.0 - color(i)[c]).abs() > 1e-6);
    if job.options.exact && (0..count).into_par_iter().any(lost) {
        for (channel, name) in ["Red", "Green", "Blue"].into_iter().enumerate() {
            let wide = collect(name, count, job, part, |i| (color(i)[channel] * 65535.0 + 0.5) as u16)?;
            cloud = cloud.with_field(name, FieldValues::U16(wide))?;
        }
    }
    cloud.with_colors(colors)
}

/// Result of welding: for each point the first corner at it, and for each corner its point.
pub(super) struct Welded {
    pub(super) firsts: Vec<u32>,
    pub(super) points: Vec<u32>,
}

/// Welds corners of equal `key` into one point, in the order of first appearance.
///
/// The hash of its key assigns each corner to a shard, and each shard keeps the first corner of every key. The number
/// of shards does not change the result.
pub(super) fn weld<K: Hash + Eq + Send>(
    job: &Job<'_>,
    count: usize,
    part: ProgressRange,
    key: impl Fn(usize) -> K + Sync + Send,
) -> Result<Welded, Error> {
    if u32::try_from(count).is_err() {
        return Err(job.unsupported(format!("a mesh of {} triangles; split it", count / 3)));
    }
    let what = "the corners of a mesh";
    let mut first: Vec<AtomicU32> = Vec::new();
    reserve(&mut first, count, what)?;
    first.resize_with(count, Default::default);
    let hash = SecretHasher::new();
    let shards = rayon::current_num_threads().next_power_of_two().min(64);
    (0..shards as u64).into_par_iter().try_for_each(|shard| {
        let mut seen = std::collections::HashMap::with_hasher(hash);
        for corner in 0..count {
            if corner % (1 << 16) == 0 {
                // All shards walk the corners side by side; only the first reports, so that progress never falls.
                if shard == 0 {
                    job.tick(part.start + part.len * corner as f32 / count as f32)?;
                } else {
                    job.go_on()?;
                }
            }
            let key = key(corner);
            // The map itself uses the uppermost and the lowest bits of the hash.
            if hash.hash_one(&key) >> 32 & (shards as u64 - 1) != shard {
                continue;
            }
            if seen.len() == seen.capacity() {
                let bytes = seen.len().saturating_mul(size_of::<(K, u32)>());
                let room = reserving(|| seen.try_reserve(seen.len().max(64)));
                room.map_err(|_| Error::OutOfMemory { what: what.into(), bytes })?;
            }
            let own = *seen.entry(key).or_insert(corner as u32);
            first[corner].store(own, Ordering::Relaxed);
        }
        Ok(())
    })?;
    let mut points: Vec<u32> = first.into_iter().map(AtomicU32::into_inner).collect();
    let mut firsts = Vec::new();
    for corner in 0..count {
        let own = points[corner] as usize;
        if own == corner {
            reserve(&mut firsts, 1, what)?;
            firsts.push(corner as u32);
            points[corner] = firsts.len() as u32 - 1;
        } else {
            // The corner is welded to an earlier one, whose point is known.
            points[corner] = points[own];
        }
    }
    Ok(Welded { firsts, points })
}

/// The bits of a coordinate, equal for both zeros.
pub(super) fn bits(value: f64) -> u64 {
    (value + 0.0).to_bits()
}

/// A fast hash with a secret, so that nobody can craft a file whose points all collide.
#[derive(Clone, Copy)]
struct SecretHasher {
    state: u64,
    secret: u64,
}

impl SecretHasher {
    fn new() -> Self {
        let random = RandomState::new();
        Self { state: random.hash_one(1_u64), secret: random.hash_one(2_u64) | 1 }
    }
}

impl BuildHasher for SecretHasher {
    type Hasher = Self;

    fn build_hasher(&self) -> Self {
        *self
    }
}

impl Hasher for SecretHasher {
    fn write(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            self.write_u64(u64::from_ne_bytes(word));
        }
    }

    fn write_u64(&mut self, value: u64) {
        let product = u128::from(self.state ^ value) * u128::from(self.secret);
        self.state = product as u64 ^ (product >> 64) as u64;
    }

    fn write_usize(&mut self, _len: usize) {}

    fn finish(&self) -> u64 {
        let product = u128::from(self.state) * u128::from(self.secret);
        product as u64 ^ (product >> 64) as u64
    }
}
