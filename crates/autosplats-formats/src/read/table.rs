//! Columns of numbers to a cloud, shared by binary and text formats.

mod settle;

use std::{ops::Range, path::Path};

use autosplats_cloud::{Error, FieldValues, PointCloud, reserving};
use glam::DVec3;
use rayon::prelude::*;

pub(super) use self::settle::{Look, Plan, Settled};
pub use super::columns::{MAX_COLUMNS, numbered};
use super::{Attribute, Job, ReadOptions};

/// Points processed between two checks for cancellation: a few milliseconds of work.
const BLOCK: usize = 1 << 18;

/// Number types in files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the variants say it")]
pub enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Scalar {
    /// Size in bytes.
    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::I8 => "int8",
            Self::U8 => "uint8",
            Self::I16 => "int16",
            Self::U16 => "uint16",
            Self::I32 => "int32",
            Self::U32 => "uint32",
            Self::I64 => "int64",
            Self::U64 => "uint64",
            Self::F32 => "float32",
            Self::F64 => "float64",
        }
    }
}

/// A number that can be stored in either byte order.
trait Number: Copy + Send + Sync {
    fn read(bytes: &[u8], at: usize, big_endian: bool) -> Self;
}

macro_rules! number {
    ($($type:ty),*) => {$(
        impl Number for $type {
            #[inline]
            fn read(bytes: &[u8], at: usize, big_endian: bool) -> Self {
                let mut raw = [0; size_of::<Self>()];
                raw.copy_from_slice(&bytes[at..at + size_of::<Self>()]);
                if big_endian { Self::from_be_bytes(raw) } else { Self::from_le_bytes(raw) }
            }
        }
    )*};
}
number!(i8, u8, i16, u16, i32, u32, i64, u64, f32, f64);

/// One number per point: the number of point `i` starts at byte `offset + i * stride`.
#[derive(Clone, Debug)]
pub struct Column {
    /// Name as files have it: `x`, `red`, `intensity`.
    pub name: String,
    /// Type of the numbers.
    pub scalar: Scalar,
    /// Byte at which the number of the first point starts.
    pub offset: usize,
    /// Bytes from one point's number to the next point's.
    pub stride: usize,
}

impl Column {
    pub(super) fn attribute(&self) -> Attribute {
        Attribute::new(&self.name, self.scalar.name())
    }
}

/// Points of a preview chunk, about 16 MB of a file.
pub(super) const CHUNK: usize = 1 << 20;

/// Columns over a piece of memory: points as binary files and messages hold them.
///
/// ```
/// use autosplats_formats::{ReadOptions, table::{Column, Scalar, Table}};
///
/// let bytes: Vec<u8> = [1.0_f32, 2.0, 3.0, 4.0, 5.0, 6.0].iter().flat_map(|value| value.to_le_bytes()).collect();
/// let column = |(index, name): (usize, &str)| {
///     Column { name: name.into(), scalar: Scalar::F32, offset: 4 * index, stride: 12 }
/// };
/// let columns = ["x", "y", "z"].into_iter().enumerate().map(column).collect();
/// let table = Table { bytes: &bytes, count: 2, big_endian: false, columns, packed_rgb: false, done: 0.0 };
/// let cloud = table.cloud("message".as_ref(), "byte 0", &ReadOptions::default())?;
/// assert_eq!(cloud.positions(), [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
/// # Ok::<(), autosplats_cloud::Error>(())
/// ```
pub struct Table<'a> {
    /// The memory.
    pub bytes: &'a [u8],
    /// Number of points.
    pub count: usize,
    /// Whether the most significant byte of a number comes first.
    pub big_endian: bool,
    /// The values of a point. `x`, `y` and `z`, or other names of coordinates, must be among them.
    pub columns: Vec<Column>,
    /// Whether a column named `rgb` or `rgba` holds a colour packed into 32 bits.
    pub packed_rgb: bool,
    /// Fraction of the whole work that is finished before this table is read.
    pub done: f32,
}

/// Whether a value is a colour packed into 32 bits.
pub(super) fn is_packed_color(name: &str, scalar: Scalar) -> bool {
    scalar.size() == 4 && ["rgb", "rgba"].contains(&&*name.to_ascii_lowercase())
}

impl Table<'_> {
    /// Makes the cloud. Errors name `name`, and `place` where coordinates are missing.
    ///
    /// # Errors
    /// [`Error::Malformed`] if there are no coordinates, or if columns end beyond the memory; [`Error::OutOfMemory`].
    pub fn cloud(self, name: &Path, place: &str, options: &ReadOptions) -> Result<PointCloud, Error> {
        // Messages state their units elsewhere, and all frames of a stream must be in one.
        self.made(&Job { path: name, progress: &(), bytes: &[], options, triangles: false }, place, false)
    }

    /// Makes the cloud. `place` is the place in errors about missing coordinates.
    pub(super) fn into_cloud(self, job: &Job<'_>, place: &str) -> Result<PointCloud, Error> {
        self.made(job, place, true)
    }

    /// Makes the cloud; for `guess` see [`Plan::of`].
    fn made(self, job: &Job<'_>, place: &str, guess: bool) -> Result<PointCloud, Error> {
        let plan = Plan::of(&self, job, place, guess)?;
        job.check_memory(self.count, plan.point_bytes())?;
        let mut look = Look::default();
        plan.look(&self, job, &mut look)?;
        plan.settle(&look, job).build(&self, job)
    }

    /// Passes the points to the caller chunk by chunk, if the caller wants chunks.
    pub(super) fn preview(&self, job: &Job<'_>, place: &str) -> Result<(), Error> {
        if !job.progress.wants_chunks() {
            return Ok(());
        }
        self.check_size(job, place)?;
        for start in (0..self.count).step_by(CHUNK) {
            let columns = self.columns.iter().map(|column| {
                let offset = column.offset + start * column.stride;
                Column { offset, ..column.clone() }
            });
            let count = CHUNK.min(self.count - start);
            let piece = Self { bytes: self.bytes, columns: columns.collect(), count, ..*self };
            let quiet = Job { progress: &(), ..*job };
            job.preview(|| piece.into_cloud(&quiet, place))?;
        }
        Ok(())
    }

    /// Checks that every value lies within the bytes. Readers check first, with better messages.
    fn check_size(&self, job: &Job<'_>, place: &str) -> Result<(), Error> {
        let fits = |column: &Column| {
            let last = self.count.saturating_sub(1).checked_mul(column.stride)?;
            let end = last.checked_add(column.offset)?.checked_add(column.scalar.size())?;
            (end <= self.bytes.len()).then_some(())
        };
        if self.count > 0 && !self.columns.iter().all(|column| fits(column).is_some()) {
            return Err(job.malformed(place, format!("{} points do not fit into the file", self.count)));
        }
        Ok(())
    }

    fn value<T: Number>(&self, column: &Column, index: usize) -> T {
        T::read(self.bytes, column.offset + index * column.stride, self.big_endian)
    }

    /// World coordinates of a point.
    fn world(&self, xyz: &[Column; 3], index: usize) -> DVec3 {
        DVec3::from(xyz.each_ref().map(|column| self.value_f64(column, index)))
    }

    fn value_f64(&self, column: &Column, index: usize) -> f64 {
        match column.scalar {
            Scalar::I8 => self.value::<i8>(column, index).into(),
            Scalar::U8 => self.value::<u8>(column, index).into(),
            Scalar::I16 => self.value::<i16>(column, index).into(),
            Scalar::U16 => self.value::<u16>(column, index).into(),
            Scalar::I32 => self.value::<i32>(column, index).into(),
            Scalar::U32 => self.value::<u32>(column, index).into(),
            Scalar::I64 => self.value::<i64>(column, index) as f64,
            Scalar::U64 => self.value::<u64>(column, index) as f64,
            Scalar::F32 => self.value::<f32>(column, index).into(),
            Scalar::F64 => self.value(column, index),
        }
    }

    fn positions(
        &self,
        job: &Job<'_>,
        xyz: &[Column; 3],
        origin: DVec3,
        part: ProgressRange,
    ) -> Result<Vec<[f32; 3]>, Error> {
        let [x, y, z] = xyz;
        let floats = xyz.iter().all(|column| column.scalar == Scalar::F32 && column.stride == x.stride);
        // All three lie within one record, not each in a run of its own.
        let first = x.offset.min(y.offset).min(z.offset);
        let together = x.offset.max(y.offset).max(z.offset) - first + 4 <= x.stride;
        let adjacent = y.offset == x.offset + 4 && z.offset == x.offset + 8;
        if origin == DVec3::ZERO && floats && together && adjacent && !self.big_endian {
            // The common case, and the fast one: twelve adjacent bytes, copied unchanged.
            self.collect("positions", x, job, part, |record| {
                let mut raw = [0; 12];
                raw.copy_from_slice(&record[..12]);
                bytemuck::cast::<[u8; 12], [[u8; 4]; 3]>(raw).map(f32::from_le_bytes)
            })
        } else if origin == DVec3::ZERO && floats && together {
            let offsets = xyz.each_ref().map(|column| column.offset - first);
            let start = Column { offset: first, ..x.clone() };
            self.collect("positions", &start, job, part, |record| {
                offsets.map(|offset| f32::read(record, offset, self.big_endian))
            })
        } else if origin == DVec3::ZERO && floats {
            let xyz = xyz.each_ref();
            collect("positions", self.count, job, part, |i| xyz.map(|column| self.value::<f32>(column, i)))
        } else {
            collect("positions", self.count, job, part, |i| (self.world(xyz, i) - origin).as_vec3().to_array())
        }
    }

    /// Like [`collect`], from the records that start at the values of `column`. The last record may end after its
    /// value.
    fn collect<T: Send>(
        &self,
        what: &str,
        column: &Column,
        job: &Job<'_>,
        part: ProgressRange,
        value: impl Fn(&[u8]) -> T + Sync + Send,
    ) -> Result<Vec<T>, Error> {
        let mut values = Vec::new();
        reserve(&mut values, self.count, what)?;
        for block in blocks(self.count) {
            job.tick(part.start + part.len * block.start as f32 / self.count as f32)?;
            let records = self.bytes[column.offset + block.start * column.stride..].par_chunks(column.stride.max(1));
            values.par_extend(records.take(block.len()).map(&value));
        }
        Ok(values)
    }

    fn field(&self, job: &Job<'_>, column: &Column, part: ProgressRange) -> Result<FieldValues, Error> {
        macro_rules! typed {
            ($variant:ident) => {
                FieldValues::$variant(
                    self.collect(&column.name, column, job, part, |record| Number::read(record, 0, self.big_endian))?,
                )
            };
        }
        Ok(match column.scalar {
            Scalar::I8 => typed!(I8),
            Scalar::U8 => typed!(U8),
            Scalar::I16 => typed!(I16),
            Scalar::U16 => typed!(U16),
            Scalar::I32 => typed!(I32),
            Scalar::U32 => typed!(U32),
            Scalar::I64 => typed!(I64),
            Scalar::U64 => typed!(U64),
            Scalar::F32 => typed!(F32),
            Scalar::F64 => typed!(F64),
        })
    }
}

/// The range of the progress bar that a step covers: start and length, as fractions of the whole.
#[derive(Clone, Copy)]
pub(super) struct ProgressRange {
    pub(super) start: f32,
    pub(super) len: f32,
}

/// Computes one value per point in parallel, in place.
pub(super) fn collect<T: Send>(
    what: &str,
    count: usize,
    job: &Job<'_>,
    part: ProgressRange,
    value: impl Fn(usize) -> T + Sync + Send,
) -> Result<Vec<T>, Error> {
    let mut values = Vec::new();
    reserve(&mut values, count, what)?;
    for block in blocks(count) {
        job.tick(part.start + part.len * block.start as f32 / count as f32)?;
        values.par_extend(block.into_par_iter().map(&value));
    }
    Ok(values)
}

fn blocks(count: usize) -> impl Iterator<Item = Range<usize>> {
    (0..count).step_by(BLOCK).map(move |start| start..count.min(start + BLOCK))
}

/// Reserves room for `additional` values; `what` names them in the error.
pub(super) fn reserve<T>(values: &mut Vec<T>, additional: usize, what: &str) -> Result<(), Error> {
    reserving(|| values.try_reserve(additional))
        .map_err(|_| Error::OutOfMemory { what: what.into(), bytes: additional.saturating_mul(size_of::<T>()) })
}
