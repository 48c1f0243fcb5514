//! Nodes of plain records, which may be compressed with Zstandard.

use std::borrow::Cow;
use std::io::Read as _;

use autosplats_cloud::{Axes, Error, FieldValues, PointCloud, residual};
use glam::DVec3;
use ruzstd::decoding::StreamingDecoder;

use super::meta::{Column, Encoding, Meta};
use crate::{
    color_scale::Levels,
    read::{
        las::{Colors, Decoded, MAX_RATIO, Shape},
        table::Scalar,
    },
};

/// Evaluates `$body` with `$type` as the number type of a column.
macro_rules! each_scalar {
    ($scalar:expr, $variant:ident, $type:ident => $body:expr) => {
        each_scalar!(@ $scalar, $variant, $type => $body; I8 i8, U8 u8, I16 i16, U16 u16, I32 i32, U32 u32,
            I64 i64, U64 u64, F32 f32, F64 f64)
    };
    (@ $scalar:expr, $variant:ident, $type:ident => $body:expr; $($name:ident $number:ty),*) => {
        match $scalar {
            $(Scalar::$name => {
                type $type = $number;
                #[allow(non_snake_case, reason = "it stands for a variant")]
                let $variant = FieldValues::$name;
                $body
            })*
        }
    };
}

/// The records of a node with so many points.
pub(super) fn unpacked<'a>(meta: &Meta, bytes: &'a [u8], points: u32) -> Result<Cow<'a, [u8]>, String> {
    let expected = u64::from(points) * meta.stride as u64;
    if u64::from(points) > MAX_RATIO as u64 * bytes.len() as u64 {
        return Err(format!("{points} points cannot be in {} bytes; copy the file again", bytes.len()));
    }
    let records = match meta.encoding {
        Encoding::Zstandard => {
            let frame = StreamingDecoder::new_with_max_window_size(bytes, expected.max(1 << 20));
            let mut records = Vec::new();
            // One byte more shows that there are too many.
            let frame = frame.map_err(|error| format!("it is no Zstandard frame ({error}); copy the file again"))?;
            let read = frame.take(expected + 1).read_to_end(&mut records);
            read.map_err(|error| format!("the compressed data are damaged ({error}); copy the file again"))?;
            Cow::Owned(records)
        }
        _ => Cow::Borrowed(bytes),
    };
    if records.len() as u64 == expected {
        Ok(records)
    } else {
        let stride = meta.stride;
        Err(format!(
            "{points} points of {stride} bytes take {expected} bytes, not {}; copy the file again",
            records.len()
        ))
    }
}

impl Meta {
    /// The points of whole records.
    pub(super) fn decode(&self, records: &[u8], exact: bool, shape: &Shape<'_>) -> Result<Decoded, Error> {
        let rows = || records.chunks_exact(self.stride);
        let [x, y, z] = &self.xyz;
        let origin = shape.origin.unwrap_or_default();
        let offsets = rows().map(|row| DVec3::new(number(row, x), number(row, y), number(row, z)) - origin);
        let positions = offsets.clone().map(|offset| offset.as_vec3().to_array()).collect();
        let mut cloud = PointCloud::new(origin, positions).with_axes(Axes::ZUp);
        if exact {
            cloud = cloud.with_residuals(offsets.map(residual).collect())?;
        }
        let mut levels = Levels::default();
        let rgb = self.rgb.as_ref().filter(|_| shape.colors != Colors::Unwanted);
        if let Some(rgb) = rgb {
            let color = |row: &[u8]| rgb.each_ref().map(|column| number(row, column));
            let row = |index: usize| &records[index * self.stride..(index + 1) * self.stride];
            levels = Levels::of(cloud.len(), |index| color(row(index)));
            let bytes = rgb.iter().all(|column| column.scalar.size() == 1);
            let wide = !bytes && if let Colors::Settled { wide } = shape.colors { wide } else { levels.are_wide() };
            let byte = |value: f64| (if wide { value / 256.0 } else { value }) as u8;
            if levels.any() {
                cloud = cloud.with_colors(rows().map(|row| color(row).map(byte)).collect())?;
            }
        }
        let full = rgb.into_iter().flatten().filter(|column| exact && column.scalar.size() > 1);
        let needs = |column: &&Column| shape.wanted.is_none_or(|wanted| wanted.needs(&column.name));
        for column in self.others.iter().filter(needs).chain(full) {
            let values = values(records, self.stride, column);
            if (0..values.len()).any(|index| values.get(index) != 0.0) {
                cloud = cloud.with_field(&column.name, values)?;
            }
        }
        Ok(Decoded { cloud, levels, lost: 0 })
    }
}

fn bytes_at<const LEN: usize>(row: &[u8], at: usize) -> [u8; LEN] {
    let mut bytes = [0; LEN];
    bytes.copy_from_slice(&row[at..at + LEN]);
    bytes
}

/// A value of a record, with its scale and offset.
#[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one of the types is f64 itself")]
fn number(row: &[u8], column: &Column) -> f64 {
    let stored = each_scalar!(column.scalar, _variant, T => T::from_le_bytes(bytes_at(row, column.at)) as f64);
    column.scaled.map_or(stored, |(scale, offset)| stored * scale + offset)
}

/// All values of a column.
fn values(records: &[u8], stride: usize, column: &Column) -> FieldValues {
    let rows = records.chunks_exact(stride);
    if column.scaled.is_some() {
        return FieldValues::F64(rows.map(|row| number(row, column)).collect());
    }
    each_scalar!(column.scalar, variant, T => {
        variant(rows.map(|row| T::from_le_bytes(bytes_at(row, column.at))).collect())
    })
}
