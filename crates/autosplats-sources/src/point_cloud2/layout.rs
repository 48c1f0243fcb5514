//! Parses and checks the layout of a PointCloud2 message.

use std::borrow::Cow;

use autosplats_cloud::excerpt;
use autosplats_formats::table::{Column, MAX_COLUMNS, Scalar, numbered};

use crate::wire::{Encoding, Fault, Wire, frame_name, header};

/// The layout of a message.
pub(super) struct Layout<'a> {
    pub(super) stamp: i64,
    pub(super) frame_id: String,
    /// Number of points in all rows.
    pub(super) count: usize,
    pub(super) columns: Vec<Column>,
    pub(super) big_endian: bool,
    /// Offset in the message at which the points begin.
    pub(super) data_at: usize,
    data: &'a [u8],
    height: usize,
    /// Bytes of the points in a row. `row_step` counts the bytes from one row to the next.
    row: usize,
    row_step: usize,
}

/// Smallest size of a field in bytes: length of the name, offset, type and count.
const MIN_FIELD_BYTES: usize = 13;

impl<'a> Layout<'a> {
    pub(super) fn parse(bytes: &'a [u8], encoding: Encoding) -> Result<Self, Fault> {
        let mut wire = Wire::message(bytes, encoding)?;
        let (stamp, frame) = header(&mut wire, encoding)?;
        let size_at = wire.at();
        let (height, width) = (wire.u32("the size")? as usize, wire.u32("the size")? as usize);
        let fields = wire.clone();
        let number = wire.list(MIN_FIELD_BYTES, "fields")?;
        if number > MAX_COLUMNS {
            return Err(Fault::new(fields.at(), format!("{number} fields a point; at most {MAX_COLUMNS}")));
        }
        for _ in 0..number {
            Field::parse(&mut wire)?;
        }
        let big_endian = wire.u8("the byte order")? != 0;
        let step_at = wire.at();
        let step = wire.u32("the size of a point")? as usize;
        let row_step = wire.u32("the size of a row")? as usize;
        let data = wire.bytes("the points")?;
        let data_at = wire.at() - data.len();

        // A single row may have no height, or a single column no width.
        let (width, height) = match (width, height) {
            (points, 0) | (0, points) if step > 0 && points.checked_mul(step) == Some(data.len()) => (points, 1),
            size => size,
        };
        let size = width.checked_mul(height).zip(width.checked_mul(step));
        let Some((count, row)) = size.filter(|(count, _)| count.checked_mul(step).is_some()) else {
            return Err(Fault::new(
                size_at,
                format!("{width} × {height} points of {step} bytes are more than any memory"),
            ));
        };
        // Some programs send an empty message, with arbitrary other numbers, while nothing is visible.
        let empty = count == 0 || data.is_empty() && number == 0;
        let mut layout = Self {
            stamp,
            frame_id: frame_name(&frame),
            count: if empty { 0 } else { count },
            columns: Vec::new(),
            big_endian,
            data_at,
            data,
            height,
            row,
            row_step,
        };
        if empty {
            return Ok(layout);
        }
        if step == 0 {
            return Err(Fault::new(step_at, format!("{count} points of 0 bytes")));
        }
        if row * height > data.len() {
            let what = format!("{width} × {height} points of {step} bytes do not fit into {} bytes", data.len());
            return Err(Fault::new(data_at, what));
        }
        layout.columns = columns(fields, number, step)?;
        Ok(layout)
    }

    /// The points without padding between rows.
    pub(super) fn rows(&self) -> Cow<'a, [u8]> {
        // Writers often leave the row step at 0, or at a value from before cropping. A step that does not fit is
        // ignored.
        let end =
            self.height.saturating_sub(1).checked_mul(self.row_step).and_then(|start| start.checked_add(self.row));
        if self.row_step <= self.row || self.height < 2 || end.is_none_or(|end| end > self.data.len()) {
            return Cow::Borrowed(self.data);
        }
        let rows = self.data.chunks(self.row_step).take(self.height);
        Cow::Owned(rows.flat_map(|row| &row[..self.row]).copied().collect())
    }
}

/// Maximum length of a field's name in bytes.
const MAX_NAME_BYTES: usize = 1024;

/// A field as the message describes it.
struct Field<'a> {
    at: usize,
    name: Cow<'a, str>,
    offset: usize,
    datatype: u8,
    count: usize,
}

impl<'a> Field<'a> {
    fn parse(wire: &mut Wire<'a>) -> Result<Self, Fault> {
        let at = wire.at();
        let name = wire.string("a field's name")?;
        if name.len() > MAX_NAME_BYTES {
            return Err(Fault::new(at, format!("a field's name of {} bytes", name.len())));
        }
        let offset = wire.u32("a field's offset")? as usize;
        let datatype = wire.u8("a field's type")?;
        let count = wire.u32("a field's count")? as usize;
        // Old programs write 0 for one value.
        Ok(Self { at, name, offset, datatype, count: count.max(1) })
    }

    /// The type of the field's values. PCL uses the last three types, ROS has them since 2025.
    fn scalar(&self) -> Option<Scalar> {
        const SCALARS: [Scalar; 11] = [
            Scalar::I8,
            Scalar::U8,
            Scalar::I16,
            Scalar::U16,
            Scalar::I32,
            Scalar::U32,
            Scalar::F32,
            Scalar::F64,
            Scalar::I64,
            Scalar::U64,
            Scalar::U8,
        ];
        SCALARS.get(usize::from(self.datatype).checked_sub(1)?).copied()
    }
}

/// The columns of the fields. Fails if a field exceeds a point of `step` bytes, or if fields overlap too much.
fn columns(mut fields: Wire<'_>, number: usize, step: usize) -> Result<Vec<Column>, Fault> {
    let fields_at = fields.at();
    fields.list(MIN_FIELD_BYTES, "fields")?;
    let mut columns = Vec::new();
    for _ in 0..number {
        let field = Field::parse(&mut fields)?;
        let name = excerpt(field.name.as_bytes());
        let Some(scalar) = field.scalar() else {
            if ["x", "y", "z"].contains(&&*field.name) {
                return Err(Fault::new(field.at, format!("{name} is of the unknown type {}", field.datatype)));
            }
            continue;
        };
        let end = field.count.checked_mul(scalar.size()).and_then(|size| size.checked_add(field.offset));
        if end.is_none_or(|end| end > step) {
            let (count, offset) = (field.count, field.offset);
            let what = format!("{count} values of '{name}' at {offset} do not fit into a point of {step} bytes");
            return Err(Fault::new(field.at, what));
        }
        for (index, name) in numbered(&field.name, field.count).into_iter().enumerate() {
            columns.push(Column { name, scalar, offset: field.offset + index * scalar.size(), stride: step });
        }
    }
    // A colour may appear twice, packed and as channels. More overlap would only waste memory.
    let total: usize = columns.iter().map(|column| column.scalar.size()).sum();
    if total / 2 > step {
        let what = format!("the fields are {total} bytes of a point of {step}: they lie over one another");
        return Err(Fault::new(fields_at, what));
    }
    Ok(columns)
}
