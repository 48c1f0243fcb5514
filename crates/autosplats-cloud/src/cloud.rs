//! The point cloud, which every reader makes and every renderer takes.

use std::ops::Range;

use glam::{DMat4, DVec3};

use crate::{Axes, Crs, Error, identity::Identity};

/// Points of one frame: positions and the attributes that the scanner recorded.
///
/// A position is stored as three `f32` relative to an `f64` [`origin`](Self::origin). Survey coordinates reach 5e6,
/// where one `f32` step is half a metre. World coordinates are `origin + position`, plus a [residual](Self::residuals)
/// if all digits of a file are kept. Every attribute has one entry per point.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{FieldValues, PointCloud, glam::DVec3};
///
/// let origin = DVec3::new(512_000.0, 5_400_000.0, 310.0);
/// let cloud = PointCloud::new(origin, vec![[0.5, 0.25, 0.0], [1.5, 0.25, 0.125]])
///     .with_colors(vec![[200, 180, 160]; 2])?
///     .with_field("Intensity", FieldValues::U16(vec![900, 1200]))?;
/// assert_eq!(cloud.len(), 2);
/// assert_eq!(cloud.world_position(1), DVec3::new(512_001.5, 5_400_000.25, 310.125));
/// assert_eq!(cloud.field("intensity").map(|field| field.values.get(1)), Some(1200.0));
/// # Ok::<(), autosplats_cloud::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud {
    pub(crate) origin: DVec3,
    pub(crate) positions: Vec<[f32; 3]>,
    pub(crate) residuals: Option<Vec<[f32; 3]>>,
    pub(crate) colors: Option<Vec<[u8; 3]>>,
    pub(crate) fields: Vec<Field>,
    /// Names of values that are zero at every point.
    pub(crate) zeros: Vec<String>,
    pub(crate) axes: Option<Axes>,
    pub(crate) scans: Vec<Scan>,
    pub(crate) crs: Crs,
    pub(crate) resolution: Option<DVec3>,
    pub(crate) identity: Identity,
}

/// A contiguous range of points that one sensor saw from one place.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{PointCloud, Scan, glam::{DMat4, DVec3}};
///
/// let place = DVec3::new(0.0, 0.0, 1.8);
/// let scan = Scan {
///     name: Some("hall".into()),
///     world_from_sensor: DMat4::from_translation(place),
///     points: 0..2,
/// };
/// let cloud = PointCloud::new(DVec3::ZERO, vec![[4.0, 0.0, 0.0]; 3]).with_scans(vec![scan]);
/// assert_eq!(cloud.scans()[0].position(), place);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// Name in the file.
    pub name: Option<String>,
    /// Pose of the sensor: maps its frame to world coordinates and keeps lengths. The points already are in world
    /// coordinates.
    pub world_from_sensor: DMat4,
    /// Indices of the points that the sensor saw.
    pub points: Range<usize>,
}

impl Scan {
    /// Position of the sensor in world coordinates.
    pub fn position(&self) -> DVec3 {
        self.world_from_sensor.w_axis.truncate()
    }
}

/// A named scalar attribute with one value per point.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// PDAL's name of the attribute, such as `Intensity` or `Classification`; the file's name if PDAL has none.
    pub name: String,
    /// Values in the file's number type.
    pub values: FieldValues,
}

impl Field {
    /// A field of the same name and type without values.
    pub(crate) fn without_values(&self) -> Self {
        Self { name: self.name.clone(), values: self.values.slice(0..0) }
    }
}

/// Values of a [`Field`], stored in the file's number type to save memory.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "the variants say it")]
pub enum FieldValues {
    U8(Vec<u8>),
    I8(Vec<i8>),
    U16(Vec<u16>),
    I16(Vec<i16>),
    U32(Vec<u32>),
    I32(Vec<i32>),
    U64(Vec<u64>),
    I64(Vec<i64>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

/// Evaluates `$body` with `$v` bound to the typed vector inside `$values`, which are [`FieldValues`].
#[macro_export]
macro_rules! each_type {
    ($values:expr, $v:ident => $body:expr) => {
        match $values {
            $crate::FieldValues::U8($v) => $body,
            $crate::FieldValues::I8($v) => $body,
            $crate::FieldValues::U16($v) => $body,
            $crate::FieldValues::I16($v) => $body,
            $crate::FieldValues::U32($v) => $body,
            $crate::FieldValues::I32($v) => $body,
            $crate::FieldValues::U64($v) => $body,
            $crate::FieldValues::I64($v) => $body,
            $crate::FieldValues::F32($v) => $body,
            $crate::FieldValues::F64($v) => $body,
        }
    };
}

impl FieldValues {
    /// Number of values.
    pub fn len(&self) -> usize {
        each_type!(self, v => v.len())
    }

    /// Whether there are no values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The value of point `index` as `f64`. Integers beyond 2⁵³ are rounded.
    ///
    /// # Panics
    /// If `index` is not below [`len`](Self::len).
    pub fn get(&self, index: usize) -> f64 {
        #[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one of the types is f64 itself")]
        {
            each_type!(self, v => v[index] as f64)
        }
    }

    /// Size of the values in memory, in bytes.
    pub fn byte_len(&self) -> usize {
        each_type!(self, v => size_of_val(v.as_slice()))
    }
}

impl PointCloud {
    /// Makes a cloud of positions without attributes. World coordinates are `origin + position`.
    ///
    /// Non-finite positions are allowed, because scanners record them. The renderer drops and counts them.
    pub fn new(origin: DVec3, positions: Vec<[f32; 3]>) -> Self {
        Self { origin, positions, ..Self::default() }
    }

    /// Sets the colours: sRGB, 8 bits per channel.
    ///
    /// # Errors
    /// [`Error::AttributeLength`] if there is not exactly one colour per point.
    pub fn with_colors(mut self, colors: Vec<[u8; 3]>) -> Result<Self, Error> {
        self.check_length("colours", colors.len())?;
        self.identity = Identity::default();
        self.colors = Some(colors);
        Ok(self)
    }

    /// Adds a scalar field, or replaces the field of the same name.
    ///
    /// # Errors
    /// [`Error::AttributeLength`] if there is not exactly one value per point.
    pub fn with_field(mut self, name: impl Into<String>, values: FieldValues) -> Result<Self, Error> {
        let name = name.into();
        self.check_length(&name, values.len())?;
        self.identity = Identity::default();
        self.fields.retain(|field| field.name != name);
        self.fields.push(Field { name, values });
        self.settle_zeros();
        Ok(self)
    }

    /// Keeps the fields for whose names `keep` is true.
    pub fn retain_fields(&mut self, keep: impl Fn(&str) -> bool) {
        self.identity = Identity::default();
        self.fields.retain(|field| keep(&field.name));
        self.zeros.retain(|name| keep(name));
    }

    /// Sets which axis points up.
    #[must_use]
    pub fn with_axes(mut self, axes: Axes) -> Self {
        self.axes = Some(axes);
        self
    }

    /// Sets the residuals: what rounding each position to `f32` lost.
    ///
    /// # Errors
    /// [`Error::AttributeLength`] if there is not exactly one residual per point.
    pub fn with_residuals(mut self, residuals: Vec<[f32; 3]>) -> Result<Self, Error> {
        self.check_length("residuals", residuals.len())?;
        self.residuals = Some(residuals);
        Ok(self)
    }

    /// Sets the scans: which points were seen from where. The sensor of points in no scan is unknown. A point in
    /// several scans belongs to the one that starts first.
    ///
    /// # Panics
    /// If a scan's range reaches beyond the cloud's points.
    #[must_use]
    pub fn with_scans(mut self, scans: Vec<Scan>) -> Self {
        let len = self.len();
        for Scan { points, .. } in &scans {
            assert!(points.start <= points.end && points.end <= len, "points {points:?} of {len}");
        }
        self.identity = Identity::default();
        self.scans = scans;
        self
    }

    /// Sets the coordinate system and its units.
    #[must_use]
    pub fn with_crs(mut self, crs: Crs) -> Self {
        self.crs = crs;
        self
    }

    /// Sets the step of which coordinates are multiples, per axis. Files that store integers have such a step.
    #[must_use]
    pub fn with_resolution(mut self, step: DVec3) -> Self {
        self.resolution = Some(step);
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

    /// Whether the finite points span less than 1 m along each axis, assuming metres: nobody could stand among them.
    pub fn is_small(&self) -> bool {
        const SMALL: f32 = 1.0;
        let none = [f32::INFINITY, f32::NEG_INFINITY];
        (0..3).all(|axis| {
            let coordinates = self.positions.iter().map(|position| position[axis]);
            let [low, high] = coordinates.fold(none, |[low, high], at| [low.min(at), high.max(at)]);
            (0.0..SMALL).contains(&(high - low))
        })
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Whether at least `least` points have a finite position. Stops reading at the point that settles it.
    pub fn has_finite(&self, least: usize) -> bool {
        let finite = self.positions.iter().filter(|position| position.iter().all(|value| value.is_finite()));
        finite.take(least).count() == least
    }

    /// Identifies the cloud's points and attributes within this process. Clones share the number; changed points,
    /// colours, fields or scans get another. A cached copy, as on a graphics card, is outdated if the number differs.
    pub fn identity(&self) -> u64 {
        self.identity.0
    }

    /// Origin of the positions, in world coordinates.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Positions relative to the [`origin`](Self::origin), in the file's unit.
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    /// World coordinates of point `index`.
    ///
    /// # Panics
    /// If `index` is not below [`len`](Self::len).
    pub fn world_position(&self, index: usize) -> DVec3 {
        let position = DVec3::from(self.positions[index].map(f64::from));
        match &self.residuals {
            None => self.origin + position,
            Some(residuals) => self.origin + (position + DVec3::from(residuals[index].map(f64::from))),
        }
    }

    /// What rounding each position to `f32` lost; present only if the cloud keeps all digits of the file.
    pub fn residuals(&self) -> Option<&[[f32; 3]]> {
        self.residuals.as_deref()
    }

    /// Colours, sRGB, 8 bits per channel.
    pub fn colors(&self) -> Option<&[[u8; 3]]> {
        self.colors.as_deref()
    }

    /// Scalar fields, in the file's order.
    pub fn fields(&self) -> &[Field] {
        &self.fields
    }

    /// The field called `name`; letter case is ignored.
    pub fn field(&self, name: &str) -> Option<&Field> {
        self.fields.iter().find(|field| field.name.eq_ignore_ascii_case(name))
    }

    /// Which axis points up, if the file or its format states it.
    pub fn axes(&self) -> Option<Axes> {
        self.axes
    }

    /// Which points were seen from where, as far as the file states it.
    pub fn scans(&self) -> &[Scan] {
        &self.scans
    }

    /// The coordinate system and its units, as far as the file states them.
    pub fn crs(&self) -> &Crs {
        &self.crs
    }

    /// The step of which coordinates are multiples, per axis, if the file stores integers.
    pub fn resolution(&self) -> Option<DVec3> {
        self.resolution
    }

    /// Size of the cloud in memory, in bytes.
    pub fn byte_len(&self) -> usize {
        size_of_val(self.positions.as_slice())
            + self.residuals.as_ref().map_or(0, |residuals| size_of_val(residuals.as_slice()))
            + self.colors.as_ref().map_or(0, |colors| size_of_val(colors.as_slice()))
            + self.fields.iter().map(|field| field.values.byte_len()).sum::<usize>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whatever_changes_a_cloud_changes_its_identity() {
        let new = || PointCloud::new(DVec3::ZERO, vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
        let cloud = new();
        assert_eq!(cloud.clone().identity(), cloud.identity(), "a clone is the same cloud");
        assert_eq!(new(), cloud, "identities do not matter to equality");
        type Change = fn(&mut PointCloud);
        let changes: [Change; 8] = [
            |cloud| *cloud = PointCloud::new(DVec3::ZERO, cloud.positions.clone()),
            |cloud| *cloud = cloud.clone().with_colors(vec![[1, 2, 3]; 2]).expect("a colour each"),
            |cloud| *cloud = cloud.clone().with_field("A", FieldValues::U8(vec![1, 2])).expect("a value each"),
            |cloud| *cloud = cloud.clone().with_scans(Vec::new()),
            |cloud| cloud.retain(|index| index == 1),
            |cloud| cloud.crop(DVec3::ZERO, DVec3::splat(3.5)),
            |cloud| cloud.add_noise(0.1, 1, &()).expect("noise"),
            |cloud| assert!(cloud.to_local_metres(), "it was in degrees"),
        ];
        for (number, change) in changes.into_iter().enumerate() {
            let degrees = Crs { unit: Some(crate::Unit::Degree), ..Crs::default() };
            let mut changed = cloud.clone().with_crs(degrees);
            change(&mut changed);
            assert_ne!(changed.identity(), cloud.identity(), "change {number}");
        }
    }
}
