//! The point cloud: what every reader makes and every renderer takes.

use std::{ops::Range, path::Path};

use glam::{DMat4, DVec3};

use crate::{Crs, Error, Progress, identity::Identity};

/// Points of one frame: positions, and whatever else the scanner recorded.
///
/// A position is stored as three `f32` about an `f64` [`origin`](Self::origin): survey coordinates reach 5e6, where one
/// `f32` step is half a metre. World coordinates are `origin + position`, plus a [residual](Self::residuals) where a file
/// was read [exactly](crate::ReadOptions::exact). All attributes have one entry per point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud {
    pub(crate) origin: DVec3,
    pub(crate) positions: Vec<[f32; 3]>,
    pub(crate) residuals: Option<Vec<[f32; 3]>>,
    pub(crate) colors: Option<Vec<[u8; 3]>>,
    pub(crate) fields: Vec<Field>,
    pub(crate) axes: Option<Axes>,
    pub(crate) scans: Vec<Scan>,
    pub(crate) crs: Crs,
    pub(crate) resolution: Option<DVec3>,
    pub(crate) identity: Identity,
}

/// A run of points that one sensor saw from one place.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// What the file calls it.
    pub name: Option<String>,
    /// Where the sensor stood, and how it was turned: maps its own frame to world coordinates, lengths kept. The points
    /// are in world coordinates already.
    pub world_from_sensor: DMat4,
    /// The points it saw, by index.
    pub points: Range<usize>,
}

impl Scan {
    /// World coordinates of the sensor.
    pub fn position(&self) -> DVec3 {
        self.world_from_sensor.w_axis.truncate()
    }
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
    U64(Vec<u64>),
    I64(Vec<i64>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

/// Calls `$body` with `$v` bound to the typed vector inside `$values`.
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

    /// The value of point `index` as `f64`; 64-bit integers beyond 2⁵³ are rounded.
    ///
    /// # Panics
    /// If `index` is not below [`len`](Self::len).
    pub fn get(&self, index: usize) -> f64 {
        #[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one of the types is f64 itself")]
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
        Self { origin, positions, ..Self::default() }
    }

    /// Reads a file of any format known; see [`read`](crate::read).
    ///
    /// # Errors
    /// Those of [`read`](crate::read).
    pub fn from_path(path: impl AsRef<Path>, progress: &dyn Progress) -> Result<Self, Error> {
        crate::read(path.as_ref(), progress)
    }

    /// Adds colours, sRGB, 8 bits a channel, replacing any.
    ///
    /// # Errors
    /// [`Error::AttributeLength`] if there is not exactly one per point.
    pub fn with_colors(mut self, colors: Vec<[u8; 3]>) -> Result<Self, Error> {
        self.check_length("colours", colors.len())?;
        self.identity = Identity::default();
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
        self.identity = Identity::default();
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

    /// Adds to each position what `f32` has lost of it, replacing any residuals.
    ///
    /// # Errors
    /// [`Error::AttributeLength`] if there is not exactly one per point.
    pub fn with_residuals(mut self, residuals: Vec<[f32; 3]>) -> Result<Self, Error> {
        self.check_length("residuals", residuals.len())?;
        self.residuals = Some(residuals);
        Ok(self)
    }

    /// States which points were seen from where, replacing what was known. Points of no scan were seen from nobody knows
    /// where; one that several claim belongs to the first of them, by the places where they begin.
    ///
    /// # Panics
    /// If a scan's points are not among the cloud's.
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

    /// States the coordinate system and its units.
    #[must_use]
    pub fn with_crs(mut self, crs: Crs) -> Self {
        self.crs = crs;
        self
    }

    /// States that coordinates are multiples of a step, in each of x, y and z, as files that store integers have it.
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

    /// Whether its points, in metres, lie so close together that nobody could stand among them.
    pub(crate) fn is_small(&self) -> bool {
        const SMALL: f32 = 1.0;
        let none = [f32::INFINITY, f32::NEG_INFINITY];
        (0..3).all(|axis| {
            let coordinates = self.positions.iter().map(|position| position[axis]);
            let [low, high] = coordinates.fold(none, |[low, high], at| [low.min(at), high.max(at)]);
            (0.0..SMALL).contains(&(high - low))
        })
    }

    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// A number that tells this cloud's points and attributes from all others' in this process: clones have the same, and
    /// whatever changes a cloud changes it. So whoever keeps a copy, as on a graphics card, knows when it is out of date.
    pub fn identity(&self) -> u64 {
        self.identity.0
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
        let position = DVec3::from(self.positions[index].map(f64::from));
        match &self.residuals {
            None => self.origin + position,
            Some(residuals) => self.origin + (position + DVec3::from(residuals[index].map(f64::from))),
        }
    }

    /// What is to be added to each position to get all digits of the file, where `f32` cannot hold them.
    pub fn residuals(&self) -> Option<&[[f32; 3]]> {
        self.residuals.as_deref()
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

    /// Which points were seen from where, as far as the file says.
    pub fn scans(&self) -> &[Scan] {
        &self.scans
    }

    /// The coordinate system and its units, as far as the file says.
    pub fn crs(&self) -> &Crs {
        &self.crs
    }

    /// The step of which coordinates are multiples, where the file stores them as integers.
    pub fn resolution(&self) -> Option<DVec3> {
        self.resolution
    }

    /// Bytes the cloud takes in memory.
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
