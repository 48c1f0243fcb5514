//! Columns of numbers to a cloud, shared by binary and text formats.

use std::{ops::Range, path::Path};

use autosplats_cloud::{Crs, Error, FieldValues, PointCloud, Unit, degree_origin, residual, storage_origin};
use glam::DVec3;
use rayon::prelude::*;

pub use super::columns::{MAX_COLUMNS, numbered};
use super::{
    Attribute, Job, ReadOptions,
    columns::{AGAIN, field_name, find_axes, find_color, is_longitude},
    units::{LOOKS_LIKE_DEGREES, look_like_degrees},
};
use crate::color_scale::ColorScale;

/// Points processed between two checks for cancellation: a few milliseconds of work.
const BLOCK: usize = 1 << 18;

/// Columns of 3D Gaussian splats that hold the coefficients of the colour seen from everywhere.
const SPLAT_COLORS: [&str; 3] = ["f_dc_0", "f_dc_1", "f_dc_2"];

/// The spherical harmonic of degree 0: 1 / (2 √π).
const SPLAT_COLOR_STEP: f64 = 0.282_094_791_773_878_14;

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

    /// Makes the cloud; `guess` tells whether coordinates without a unit may be taken for degrees by their shape.
    fn made(mut self, job: &Job<'_>, place: &str, guess: bool) -> Result<PointCloud, Error> {
        if self.columns.len() > MAX_COLUMNS {
            return Err(job.malformed(place, format!("{} values a point; at most {MAX_COLUMNS}", self.columns.len())));
        }
        let names: Vec<String> = self.columns.iter().map(|column| column.name.clone()).collect();
        let Some(axes) = find_axes(&names) else {
            return Err(job.malformed(place, "there are no x, y and z among the values of a point"));
        };
        self.check_size(job, place)?;
        let xyz = self.take(axes);
        let world = |i| DVec3::from(xyz.each_ref().map(|column| self.value_f64(column, i)));
        let fine = xyz[..2].iter().all(|column| column.scalar == Scalar::F64);
        let named = is_longitude(&names[axes[0]]);
        let guessed = guess && !named && fine && job.options.columns.is_none() && look_like_degrees(self.count, world);
        let degrees = named || guessed;
        let origin = if degrees { degree_origin(self.count, world) } else { storage_origin(self.count, world) };
        let exact = if job.options.exact { 12 } else { 0 };
        let fields: usize = self.columns.iter().map(|column| column.scalar.size()).sum();
        job.check_memory(self.count, 12 + exact + fields)?;
        let names: Vec<String> = self.columns.iter().map(|column| column.name.clone()).collect();
        let colors = find_color(&names).map(|three| self.take(three));
        let is_packed = |column: &Column| self.packed_rgb && is_packed_color(&column.name, column.scalar);
        let packed = self.columns.iter().position(is_packed).map(|index| self.columns.remove(index));
        let splats = match (&colors, &packed) {
            (None, None) => self.find(SPLAT_COLORS).map(|indices| indices.map(|index| self.columns[index].clone())),
            _ => None,
        };

        let colored = colors.is_some() || packed.is_some() || splats.is_some();
        let steps = 1 + usize::from(colored) + self.columns.len();
        let part = |step: usize| ProgressRange {
            start: self.done + (1.0 - self.done) * step as f32 / steps as f32,
            len: (1.0 - self.done) / steps as f32,
        };
        let mut cloud = PointCloud::new(origin, self.positions(job, &xyz, origin, part(0))?);
        if degrees {
            cloud = cloud.with_crs(Crs { unit: Some(Unit::Degree), ..Crs::default() });
        }
        if guessed {
            job.note(LOOKS_LIKE_DEGREES);
        }
        if let Some(residuals) = self.residuals(job, &xyz, &cloud)? {
            cloud = cloud.with_residuals(residuals)?;
        }
        let mut step = 1;
        if let Some(rgb) = &colors {
            let (bytes, exact) = self.colors(job, rgb, part(step))?;
            cloud = cloud.with_colors(bytes)?;
            if job.options.exact && !exact {
                for (column, name) in rgb.iter().zip(["Red", "Green", "Blue"]) {
                    cloud = cloud.with_field(name, self.field(job, column, part(step))?)?;
                }
            }
            step += 1;
        } else if let Some(column) = &packed {
            let alpha = |i| self.value::<u32>(column, i).to_be_bytes()[0];
            let varies = column.name.eq_ignore_ascii_case("rgba")
                && (1..self.count).into_par_iter().any(|i| alpha(i) != alpha(0));
            if varies {
                let values = collect("alpha", self.count, job, part(step), alpha)?;
                cloud = cloud.with_field("Alpha", FieldValues::U8(values))?;
            }
            let unpack = |i| {
                let [_, red, green, blue] = self.value::<u32>(column, i).to_be_bytes();
                [red, green, blue]
            };
            cloud = cloud.with_colors(collect("colours", self.count, job, part(step), unpack)?)?;
            step += 1;
        } else if let Some(rgb) = &splats {
            job.note("these are 3D Gaussian splats; shown as points in their base colours");
            let byte = |column: &Column, i| ((0.5 + SPLAT_COLOR_STEP * self.value_f64(column, i)) * 255.0 + 0.5) as u8;
            let color = |i| rgb.each_ref().map(|column| byte(column, i));
            cloud = cloud.with_colors(collect("colours", self.count, job, part(step), color)?)?;
            step += 1;
        }
        let known = xyz.iter().chain(colors.iter().flatten());
        let known: Vec<String> = known.map(|column| column.name.to_lowercase()).collect();
        for column in &self.columns {
            let values = self.field(job, column, part(step))?;
            step += 1;
            // Two columns may map to one name, as `intensity` and `scalar_Intensity` do.
            let mut name = field_name(&column.name);
            let again = known.contains(&name.to_lowercase());
            if again {
                job.note(format!("there is more than one {name}; the first is read, another is kept as {name}{AGAIN}"));
                name.push_str(AGAIN);
            }
            while cloud.fields().iter().any(|field| field.name == name) {
                name.push_str(if again { AGAIN } else { "_" });
            }
            cloud = cloud.with_field(name, values)?;
        }
        Ok(cloud)
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

    /// Indices of the columns of three names, if all are there. Letter case is ignored.
    fn find(&self, names: [&str; 3]) -> Option<[usize; 3]> {
        let find = |name: &str| self.columns.iter().position(|column| column.name.eq_ignore_ascii_case(name));
        Some([find(names[0])?, find(names[1])?, find(names[2])?])
    }

    /// Removes and returns three columns.
    fn take(&mut self, indices: [usize; 3]) -> [Column; 3] {
        let taken = indices.map(|index| self.columns[index].clone());
        let mut index = 0;
        self.columns.retain(|_| {
            index += 1;
            !indices.contains(&(index - 1))
        });
        taken
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
        let world = |i| DVec3::from(xyz.each_ref().map(|column| self.value_f64(column, i)));
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
            collect("positions", self.count, job, part, |i| (world(i) - origin).as_vec3().to_array())
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

    /// What `f32` loses of the positions, if all digits are wanted and some are lost.
    fn residuals(&self, job: &Job<'_>, xyz: &[Column; 3], cloud: &PointCloud) -> Result<Option<Vec<[f32; 3]>>, Error> {
        let lossless = |column: &Column| column.scalar == Scalar::F32 || column.scalar.size() < 4;
        if !job.options.exact || cloud.origin() == DVec3::ZERO && xyz.iter().all(lossless) {
            return Ok(None);
        }
        let origin = cloud.origin();
        let lost = |i| residual(DVec3::from(xyz.each_ref().map(|column| self.value_f64(column, i))) - origin);
        if (0..self.count).into_par_iter().all(|i| lost(i) == [0.0; 3]) {
            return Ok(None);
        }
        collect("residuals", self.count, job, ProgressRange { start: 1.0, len: 0.0 }, lost).map(Some)
    }

    /// Colours of any number type as 8 bits, and whether 8 bits keep them exactly.
    fn colors(&self, job: &Job<'_>, rgb: &[Column; 3], part: ProgressRange) -> Result<(Vec<[u8; 3]>, bool), Error> {
        let rgb = rgb.each_ref();
        if rgb.iter().all(|column| column.scalar == Scalar::U8) {
            let colors = collect("colours", self.count, job, part, |i| rgb.map(|column| self.value::<u8>(column, i)))?;
            return Ok((colors, true));
        }
        job.tick(part.start)?;
        let float = rgb.iter().any(|column| matches!(column.scalar, Scalar::F32 | Scalar::F64));
        let scale = ColorScale::of(self.count, float, |i| rgb.map(|column| self.value_f64(column, i)));
        let wide = !float && rgb.iter().any(|column| column.scalar.size() > 1) && self.count > 0;
        if let Some(note) = scale.note() {
            job.note(note);
        } else if wide && scale.full() == 255.0 {
            job.note("colours of 16 bits or more have no value above 255; read as 8 bits");
        }
        let colors =
            collect("colours", self.count, job, part, |i| rgb.map(|column| scale.byte(self.value_f64(column, i))))?;
        let same = |i| rgb.iter().all(|column| scale.keeps(self.value_f64(column, i)));
        let exact = !job.options.exact || (0..self.count).into_par_iter().all(same);
        Ok((colors, exact))
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
    values
        .try_reserve(additional)
        .map_err(|_| Error::OutOfMemory { what: what.into(), bytes: additional.saturating_mul(size_of::<T>()) })
}
