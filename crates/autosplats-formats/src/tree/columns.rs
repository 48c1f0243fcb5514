//! Records of points: for each point the same values one after the other.

use autosplats_cloud::{Axes, Error, FieldValues, PointCloud, residual, shown_number};
use glam::DVec3;

use crate::{
    color_scale::Levels,
    read::{
        Attribute,
        las::{Colors, Decoded, Shape},
        table::{MAX_COLUMNS, Scalar},
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

/// A value of a point.
#[derive(Clone, Debug)]
pub(super) struct Column {
    pub(super) name: String,
    pub(super) scalar: Scalar,
    /// Byte in a record.
    pub(super) at: usize,
    /// Scale and offset, unless they change nothing.
    pub(super) scaled: Option<(f64, f64)>,
}

/// The values of a point.
#[derive(Debug)]
pub(super) struct Columns {
    /// Bytes of a record.
    pub(super) stride: usize,
    pub(super) xyz: [Column; 3],
    pub(super) rgb: Option<[Column; 3]>,
    pub(super) others: Vec<Column>,
}

impl Column {
    /// A value at byte `at` of a record. Fails with one line if the scale or the offset is none.
    pub(super) fn new(name: &str, scalar: Scalar, at: usize, [scale, offset]: [f64; 2]) -> Result<Self, String> {
        if scale == 0.0 || !scale.is_finite() || !offset.is_finite() {
            return Err(format!("invalid scale {} or offset {}", shown_number(scale), shown_number(offset)));
        }
        let scaled = ([scale, offset] != [1.0, 0.0]).then_some((scale, offset));
        Ok(Self { name: name.into(), scalar, at, scaled })
    }

    pub(super) fn attribute(&self) -> Attribute {
        let stored = match self.scaled {
            None => self.scalar.name().into(),
            Some((scale, _)) => format!("{} × {}", self.scalar.name(), shown_number(scale)),
        };
        Attribute { name: self.name.clone(), stored }
    }

    /// Bytes of a value in the cloud.
    fn size(&self) -> usize {
        if self.scaled.is_some() { 8 } else { self.scalar.size() }
    }
}

impl Columns {
    /// Takes coordinates and colours from all values of a record. Fails with one line.
    pub(super) fn new(list: Vec<Column>) -> Result<Self, String> {
        if list.len() > MAX_COLUMNS {
            return Err(format!("{} values a point; at most {MAX_COLUMNS}", list.len()));
        }
        let stride = list.iter().map(|column| column.scalar.size()).sum();
        let mut others: Vec<Column> = Vec::new();
        for mut column in list {
            while others.iter().any(|other| other.name.eq_ignore_ascii_case(&column.name)) {
                column.name.push('_');
            }
            others.push(column);
        }
        let mut take = |names: [&str; 3]| {
            let at = |name: &str| others.iter().position(|column| column.name.eq_ignore_ascii_case(name));
            let [Some(a), Some(b), Some(c)] = names.map(at) else { return None };
            let taken = [a, b, c].map(|index| others[index].clone());
            others.retain(|column| taken.iter().all(|other| other.at != column.at));
            Some(taken)
        };
        let xyz = take(["X", "Y", "Z"]).ok_or("there are no X, Y and Z in the schema")?;
        let rgb = take(["Red", "Green", "Blue"]);
        Ok(Self { stride, xyz, rgb, others })
    }

    /// Step of the coordinates, if all have one.
    pub(super) fn resolution(&self) -> Option<DVec3> {
        let [x, y, z] = self.xyz.each_ref().map(|column| column.scaled.map(|(scale, _)| scale.abs()));
        Some(DVec3::new(x?, y?, z?))
    }

    /// Most bytes of memory that a decoded point takes.
    pub(super) fn point_bytes(&self, exact: bool, residuals: bool, shape: &Shape<'_>) -> usize {
        let colors = self.rgb.is_some() && shape.colors != Colors::Unwanted;
        let needs = |column: &&Column| shape.wanted.is_none_or(|wanted| wanted.needs(&column.name));
        let fields: usize = self.others.iter().filter(needs).map(Column::size).sum();
        let color = if exact { 9 } else { 3 };
        (if residuals { 24 } else { 12 }) + if colors { color } else { 0 } + fields
    }

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
        let mut zeros = Vec::new();
        for column in self.others.iter().filter(needs).chain(full) {
            let values = values(records, self.stride, column);
            if (0..values.len()).any(|index| values.get(index) != 0.0) {
                cloud = cloud.with_field(&column.name, values)?;
            } else {
                zeros.push(&*column.name);
            }
        }
        Ok(Decoded { cloud: cloud.with_zeros(zeros), levels, lost: 0 })
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
