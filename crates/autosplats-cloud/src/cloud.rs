//! The point cloud: what every reader makes and every renderer takes.

use std::path::Path;

use glam::DVec3;

use crate::{Error, Progress};

/// Points of one frame: positions, and whatever else the scanner recorded.
///
/// A position is stored as three `f32` about an `f64` [`origin`](Self::origin): survey coordinates reach 5e6, where one
/// `f32` step is half a metre. World coordinates are `origin + position`. All attributes have one entry per point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud {
    origin: DVec3,
    positions: Vec<[f32; 3]>,
    colors: Option<Vec<[u8; 3]>>,
    fields: Vec<Field>,
    axes: Option<Axes>,
}

/// Which way is up, and where a viewer would stand first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axes {
    /// Z up, seen first from -Y: surveys, robots.
    ZUp,
    /// Y up, seen first from +Z: models.
    YUp,
    /// A camera's own frame: x right, y down, z forward. Such points were seen from the origin only, so that is where
    /// they look right.
    Camera,
}

/// A named scalar attribute, one value per point. Names are PDAL's where PDAL has one (`Intensity`, `Classification`).
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// Name, as PDAL spells it where PDAL knows the attribute, else as the file does.
    pub name: String,
    /// The values, in the width the file has them.
    pub values: FieldValues,
}

/// Values of a [`Field`], kept in their own width so that a byte per point costs a byte per point.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "the variants say it")]
pub enum FieldValues {
    U8(Vec<u8>),
    I8(Vec<i8>),
    U16(Vec<u16>),
    I16(Vec<i16>),
    U32(Vec<u32>),
    I32(Vec<i32>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

/// Calls `$body` with `$v` bound to the typed vector inside `$values`.
macro_rules! each_type {
    ($values:expr, $v:ident => $body:expr) => {
        match $values {
            FieldValues::U8($v) => $body,
            FieldValues::I8($v) => $body,
            FieldValues::U16($v) => $body,
            FieldValues::I16($v) => $body,
            FieldValues::U32($v) => $body,
            FieldValues::I32($v) => $body,
            FieldValues::F32($v) => $body,
            FieldValues::F64($v) => $body,
        }
    };
}
pub(crate) use each_type;

impl FieldValues {
    /// Number of values.
    pub fn len(&self) -> usize {
        each_type!(self, v => v.len())
    }

    /// Whether there is no value.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The value of point `index` as `f64`.
    ///
    /// # Panics
    /// If `index` is not below [`len`](Self::len).
    pub fn get(&self, index: usize) -> f64 {
        #[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one of the eight types is f64 itself")]
        {
            each_type!(self, v => v[index] as f64)
        }
    }

    /// Bytes the values take in memory.
    pub fn byte_len(&self) -> usize {
        each_type!(self, v => size_of_val(v.as_slice()))
    }
}

impl PointCloud {
    /// A cloud of bare positions, each `origin + position` in world coordinates.
    ///
    /// Non-finite positions are allowed, as scanners record them; the renderer drops and counts them.
    pub fn new(origin: DVec3, positions: Vec<[f32; 3]>) -> Self {
        Self { origin, positions, colors: None, fields: Vec::new(), axes: None }
    }

    /// Reads a file of any format known; see [`read`](crate::read).
    ///
    /// # Errors
    /// Those of [`read`](crate::read).
    pub fn from_path(path: impl AsRef<Path>, progress: &dyn Progress) -> Result<Self, Error> {
        crate::read(path.as_ref(), progress)
    }

    /// A cloud of attributes that are known to fit.
    pub(crate) fn from_parts(
        origin: DVec3,
        positions: Vec<[f32; 3]>,
        colors: Option<Vec<[u8; 3]>>,
        fields: Vec<Field>,
        axes: Option<Axes>,
    ) -> Self {
        Self { origin, positions, colors, fields, axes }
    }

    /// Adds colours, sRGB, 8 bits a channel, replacing any.
    ///
    /// # Errors
    /// [`Error::AttributeLength`] if there is not exactly one per point.
    pub fn with_colors(mut self, colors: Vec<[u8; 3]>) -> Result<Self, Error> {
        self.check_length("colours", colors.len())?;
        self.colors = Some(colors);
        Ok(self)
    }

    /// Adds a scalar field, replacing one of the same name.
    ///
    /// # Errors
    /// [`Error::AttributeLength`] if there is not exactly one value per point.
    pub fn with_field(mut self, name: impl Into<String>, values: FieldValues) -> Result<Self, Error> {
        let name = name.into();
        self.check_length(&name, values.len())?;
        self.fields.retain(|field| field.name != name);
        self.fields.push(Field { name, values });
        Ok(self)
    }

    /// States which way is up, where the file or its format says so.
    #[must_use]
    pub fn with_axes(mut self, axes: Axes) -> Self {
        self.axes = Some(axes);
        self
    }

    fn check_length(&self, name: &str, len: usize) -> Result<(), Error> {
        let points = self.positions.len();
        if len == points { Ok(()) } else { Err(Error::AttributeLength { name: name.into(), len, points }) }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// What has to be added to a position to get world coordinates.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Positions about the [`origin`](Self::origin), in the file's unit.
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    /// World coordinates of point `index`.
    ///
    /// # Panics
    /// If `index` is not below [`len`](Self::len).
    pub fn world_position(&self, index: usize) -> DVec3 {
        self.origin + DVec3::from(self.positions[index].map(f64::from))
    }

    /// Colours, sRGB, 8 bits a channel, if the points have any.
    pub fn colors(&self) -> Option<&[[u8; 3]]> {
        self.colors.as_deref()
    }

    /// The scalar fields, in the file's order.
    pub fn fields(&self) -> &[Field] {
        &self.fields
    }

    /// The field called `name`, letter case ignored.
    pub fn field(&self, name: &str) -> Option<&Field> {
        self.fields.iter().find(|field| field.name.eq_ignore_ascii_case(name))
    }

    /// Which way is up, where the file or its format says so.
    pub fn axes(&self) -> Option<Axes> {
        self.axes
    }

    /// Bytes the cloud takes in memory.
    pub fn byte_len(&self) -> usize {
        size_of_val(self.positions.as_slice())
            + self.colors.as_ref().map_or(0, |colors| size_of_val(colors.as_slice()))
            + self.fields.iter().map(|field| field.values.byte_len()).sum::<usize>()
    }
}
