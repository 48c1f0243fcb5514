//! Numbers of vertices in the bytes of a glTF.

use autosplats_cloud::Error;

use super::super::{
    Job,
    table::{ProgressRange, Scalar, collect},
};
use super::{
    buffers::Buffers,
    json::{Accessor, Root, Shape},
};

/// Progress of a step within a primitive. There are many primitives, so a step takes no share of its own.
pub(super) fn part(start: f32) -> ProgressRange {
    ProgressRange { start, len: 0.0 }
}

/// The numbers of an accessor, all within the bytes of the buffer.
pub(super) struct Values<'a> {
    base: Elements<'a>,
    normalized: bool,
    count: usize,
    width: usize,
    /// Indices and values of the elements that differ from the base.
    sparse: Option<(Elements<'a>, Elements<'a>)>,
    place: String,
}

/// A sequence of elements; all are zero if there are no bytes.
struct Elements<'a> {
    bytes: Option<&'a [u8]>,
    scalar: Scalar,
    stride: usize,
    count: usize,
}

pub(super) fn scalar(component_type: u32) -> Option<Scalar> {
    Some(match component_type {
        5120 => Scalar::I8,
        5121 => Scalar::U8,
        5122 => Scalar::I16,
        5123 => Scalar::U16,
        5125 => Scalar::U32,
        5126 => Scalar::F32,
        _ => return None,
    })
}

/// Numbers per element; `None` for matrices.
pub(super) fn width(shape: Shape) -> Option<usize> {
    match shape {
        Shape::Scalar => Some(1),
        Shape::Vec2 => Some(2),
        Shape::Vec3 => Some(3),
        Shape::Vec4 => Some(4),
        Shape::Mat2 | Shape::Mat3 | Shape::Mat4 => None,
    }
}

impl<'a> Values<'a> {
    /// Finds the numbers of accessor `index`. The numbers per element must be one of `widths`.
    pub(super) fn find(
        job: &Job<'_>,
        root: &Root<'_>,
        buffers: &'a Buffers<'_>,
        index: usize,
        widths: &[usize],
    ) -> Result<Self, Error> {
        let place = format!("accessor {index}");
        let fail = |what: &str| job.malformed(&place, format!("{what}; export the file again"));
        let accessor: &Accessor = root.accessors.get(index).ok_or_else(|| fail("there is no such accessor"))?;
        let width = width(accessor.shape).filter(|width| widths.contains(width));
        let width = width.ok_or_else(|| fail("its type does not fit its use"))?;
        let scalar = scalar(accessor.component_type).ok_or_else(|| fail("its componentType is unknown"))?;
        let size = scalar.size() * width;
        let elements = |view: usize, offset: usize, scalar: Scalar, size: usize, count: usize, own_stride: bool| {
            let view = root.buffer_views.get(view).ok_or_else(|| fail("there is no such bufferView"))?;
            if view.is_meshopt() && buffers.get(view.buffer).is_none() {
                return Err(unsupported_meshopt(job));
            }
            let stride = view.byte_stride.filter(|_| own_stride).unwrap_or(size);
            let bytes =
                buffers.get(view.buffer).and_then(|bytes| bytes.get(view.byte_offset..)?.get(..view.byte_length));
            let bytes = bytes.ok_or_else(|| fail("its bufferView does not fit into the buffer"))?;
            let end = count.saturating_sub(1).checked_mul(stride).and_then(|last| last.checked_add(size));
            let bytes = bytes.get(offset..).filter(|bytes| count == 0 || end.is_some_and(|end| end <= bytes.len()));
            let bytes = bytes.ok_or_else(|| fail(&format!("its {count} elements do not fit into the bufferView")))?;
            if stride < size && count > 1 {
                return Err(fail("its elements overlap"));
            }
            Ok(Elements { bytes: Some(bytes), scalar, stride, count })
        };
        let base = match accessor.buffer_view {
            Some(view) => elements(view, accessor.byte_offset, scalar, size, accessor.count, true)?,
            None => Elements { bytes: None, scalar, stride: size, count: accessor.count },
        };
        let sparse = match &accessor.sparse {
            Some(sparse) => {
                let kind =
                    self::scalar(sparse.indices.component_type).ok_or_else(|| fail("its indices are unknown"))?;
                let (indices, values) = (&sparse.indices, &sparse.values);
                if sparse.count > accessor.count {
                    let what = format!("{} sparse values for {} elements", sparse.count, accessor.count);
                    return Err(fail(&what));
                }
                Some((
                    elements(indices.buffer_view, indices.byte_offset, kind, kind.size(), sparse.count, false)?,
                    elements(values.buffer_view, values.byte_offset, scalar, size, sparse.count, false)?,
                ))
            }
            None => None,
        };
        Ok(Self { base, normalized: accessor.normalized, count: accessor.count, width, sparse, place })
    }

    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// The elements as vectors: missing numbers are 0, surplus numbers are dropped.
    pub(super) fn vectors(&self, job: &Job<'_>, part: ProgressRange) -> Result<Vec<[f32; 3]>, Error> {
        let mut vectors =
            collect("vertices", self.count, job, part, |i| self.base.vector(i, self.width, self.normalized))?;
        self.replace(job, |to, values, from| vectors[to] = values.vector(from, self.width, self.normalized))?;
        Ok(vectors)
    }

    /// All numbers, element by element.
    pub(super) fn numbers(&self, job: &Job<'_>, part: ProgressRange) -> Result<Vec<f64>, Error> {
        let width = self.width;
        let count = self.count.saturating_mul(width);
        let mut numbers = collect("numbers", count, job, part, |i| {
            f64::from(self.base.number(i / width, i % width, self.normalized))
        })?;
        self.replace(job, |to, values, from| {
            for number in 0..width {
                numbers[to * width + number] = f64::from(values.number(from, number, self.normalized));
            }
        })?;
        Ok(numbers)
    }

    /// The numbers as indices.
    pub(super) fn indices(&self, job: &Job<'_>, part: ProgressRange) -> Result<Vec<u32>, Error> {
        if !matches!(self.base.scalar, Scalar::U8 | Scalar::U16 | Scalar::U32) {
            return Err(job.malformed(&self.place, "indices must be unsigned integers; export the file again"));
        }
        let mut indices = collect("indices", self.count, job, part, |i| self.base.index(i))?;
        self.replace(job, |to, values, from| indices[to] = values.index(from))?;
        Ok(indices)
    }

    fn replace(&self, job: &Job<'_>, mut put: impl FnMut(usize, &Elements<'_>, usize)) -> Result<(), Error> {
        let Some((indices, values)) = &self.sparse else { return Ok(()) };
        for from in 0..indices.count {
            let to = indices.index(from) as usize;
            if to >= self.count {
                let what = format!("its sparse values go to {to} of {} elements; export the file again", self.count);
                return Err(job.malformed(&self.place, what));
            }
            put(to, values, from);
        }
        Ok(())
    }
}

pub(super) fn unsupported_meshopt(job: &Job<'_>) -> Error {
    job.unsupported("the mesh is compressed by meshopt, which is not read; export it without compression")
}

impl Elements<'_> {
    fn raw(&self, index: usize, number: usize) -> [u8; 4] {
        let mut raw = [0; 4];
        if let Some(bytes) = self.bytes {
            let size = self.scalar.size();
            let at = index * self.stride + number * size;
            raw[..size].copy_from_slice(&bytes[at..at + size]);
        }
        raw
    }

    fn index(&self, index: usize) -> u32 {
        // Narrower types are padded with zeros.
        u32::from_le_bytes(self.raw(index, 0))
    }

    fn vector(&self, index: usize, width: usize, normalized: bool) -> [f32; 3] {
        std::array::from_fn(|number| if number < width { self.number(index, number, normalized) } else { 0.0 })
    }

    fn number(&self, index: usize, number: usize, normalized: bool) -> f32 {
        let raw = self.raw(index, number);
        let (integer, largest) = match self.scalar {
            Scalar::F32 => return f32::from_le_bytes(raw),
            Scalar::I8 => (f32::from(raw[0] as i8), 127.0),
            Scalar::U8 => (f32::from(raw[0]), 255.0),
            Scalar::I16 => (f32::from(i16::from_le_bytes([raw[0], raw[1]])), 32767.0),
            Scalar::U16 => (f32::from(u16::from_le_bytes([raw[0], raw[1]])), 65535.0),
            _ => (u32::from_le_bytes(raw) as f32, u32::MAX as f32),
        };
        if normalized { (integer / largest).max(-1.0) } else { integer }
    }
}
