//! Fields that are zero at every point, of which a cloud keeps the names only.
//!
//! # How it works
//!
//! Files of the LAS family have a fixed set of values, most of which a scan does not record. Readers leave out those
//! that are zero at every point, but keep their names. So joining tells a field that is zero, which is filled up beside
//! other values, from a field that a file cannot have, about which nothing is known.

use crate::{Field, FieldValues, PointCloud, each_type};

/// The values of one name.
pub(crate) enum Column<'a> {
    /// One value per point.
    Values(&'a FieldValues),
    /// All are zero.
    Zeros,
}

impl PointCloud {
    /// Tells which fields were left out because they are zero at every point. Names of fields that the cloud has are
    /// ignored.
    ///
    /// # Examples
    ///
    /// ```
    /// use autosplats_cloud::{FieldValues, PointCloud, glam::{DMat4, DVec3}};
    ///
    /// let tile = |x| PointCloud::new(DVec3::ZERO, vec![[x, 0.0, 0.0]; 2]);
    /// let roofs = tile(1.0).with_field("Classification", FieldValues::U8(vec![6, 6]))?;
    /// let pose = DMat4::IDENTITY;
    /// let both = PointCloud::merge(vec![(roofs.clone(), pose), (tile(2.0).with_zeros(["Classification"]), pose)]);
    /// assert_eq!(both.fields()[0].values, FieldValues::U8(vec![6, 6, 0, 0]));
    /// let unknown = PointCloud::merge(vec![(roofs, pose), (tile(2.0), pose)]);
    /// assert!(unknown.fields().is_empty(), "nothing is known of the second tile");
    /// # Ok::<(), autosplats_cloud::Error>(())
    /// ```
    #[must_use]
    pub fn with_zeros(mut self, names: impl IntoIterator<Item = impl Into<String>>) -> Self {
        self.zeros = names.into_iter().map(Into::into).collect();
        self.settle_zeros();
        self
    }

    /// Whether the value called `name` is known at every point: there is such a field, or it was left out because it is
    /// zero everywhere. Letter case matters.
    pub fn knows(&self, name: &str) -> bool {
        self.column(name).is_some()
    }

    /// Forgets zeros of which there are values now.
    pub(crate) fn settle_zeros(&mut self) {
        let Self { zeros, fields, .. } = self;
        zeros.retain(|name| fields.iter().all(|field| field.name != *name));
    }

    /// The values called `name`; `None` if nothing is known of them.
    pub(crate) fn column(&self, name: &str) -> Option<Column<'_>> {
        let values = self.fields.iter().find(|field| field.name == name).map(|field| Column::Values(&field.values));
        values.or_else(|| self.zeros.iter().any(|zero| zero == name).then_some(Column::Zeros))
    }
}

impl Column<'_> {
    /// Appends `count` points' values to those of other points, which are of the same type or `f64`.
    #[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one of the types is f64 itself")]
    pub(crate) fn append_to(&self, all: &mut FieldValues, count: usize) {
        macro_rules! append {
            ($($variant:ident),*) => {
                match (all, self) {
                    (all, Self::Zeros) => each_type!(all, v => v.resize(v.len() + count, Default::default())),
                    $((FieldValues::$variant(all), Self::Values(FieldValues::$variant(own))) => {
                        all.extend_from_slice(own);
                    })*
                    (FieldValues::F64(all), Self::Values(own)) => {
                        each_type!(own, v => all.extend(v.iter().map(|&value| value as f64)));
                    }
                    _ => unreachable!("values of several types are f64"),
                }
            };
        }
        append!(U8, I8, U16, I16, U32, I32, U64, I64, F32, F64);
    }
}

/// The fields of joined clouds, without values: those that some have and all others know, in the order in which they
/// come. Zeros fit any type; values of different types become `f64`.
pub(crate) fn common_fields<'a>(clouds: impl Iterator<Item = &'a PointCloud> + Clone) -> Vec<Field> {
    let mut common: Vec<Field> = Vec::new();
    for field in clouds.clone().flat_map(|cloud| &cloud.fields) {
        if common.iter().any(|other| other.name == field.name) || !clouds.clone().all(|cloud| cloud.knows(&field.name))
        {
            continue;
        }
        let mut own = clouds.clone().filter_map(|cloud| match cloud.column(&field.name)? {
            Column::Values(values) => Some(values),
            Column::Zeros => None,
        });
        let same = own.all(|values| std::mem::discriminant(values) == std::mem::discriminant(&field.values));
        let values = if same { field.values.slice(0..0) } else { FieldValues::F64(Vec::new()) };
        common.push(Field { name: field.name.clone(), values });
    }
    common
}

/// The names of values that are zero in all joined clouds.
pub(crate) fn common_zeros<'a>(mut clouds: impl Iterator<Item = &'a PointCloud>) -> Vec<String> {
    let mut zeros = clouds.next().map_or_else(Vec::new, |first| first.zeros.clone());
    clouds.for_each(|cloud| zeros.retain(|name| cloud.zeros.contains(name)));
    zeros
}
