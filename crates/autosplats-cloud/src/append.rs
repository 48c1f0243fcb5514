//! Joining parts of one scan, as they are read.

use crate::{Field, FieldValues, PointCloud, each_type, identity::Identity};

impl PointCloud {
    /// Appends points of the same scan, whose positions have the same origin. Nothing is rounded.
    ///
    /// What one of both lacks is zero there, because readers leave out values that are zero at every point: a missing
    /// field is 0, missing colours are black. A field with values of two types becomes `f64`. Axes, coordinate system
    /// and resolution are taken from the first cloud that has points. Scans are kept.
    ///
    /// # Panics
    /// If both have points and their origins differ.
    ///
    /// # Examples
    ///
    /// ```
    /// use autosplats_cloud::{FieldValues, PointCloud, glam::DVec3};
    ///
    /// let mut cloud = PointCloud::new(DVec3::ONE, vec![[0.0; 3]]);
    /// let more = PointCloud::new(DVec3::ONE, vec![[1.0; 3]]).with_field("Intensity", FieldValues::U16(vec![7]))?;
    /// cloud.append(more);
    /// assert_eq!(cloud.field("Intensity").map(|field| &field.values), Some(&FieldValues::U16(vec![0, 7])));
    /// # Ok::<(), autosplats_cloud::Error>(())
    /// ```
    pub fn append(&mut self, mut other: Self) {
        if other.is_empty() {
            return;
        }
        if self.is_empty() {
            *self = other;
            return;
        }
        assert!(self.origin == other.origin, "the origins {} and {} differ", self.origin, other.origin);
        self.identity = Identity::default();
        let (before, added) = (self.len(), other.len());
        self.positions.append(&mut other.positions);
        append_values(&mut self.residuals, other.residuals, before, added);
        append_values(&mut self.colors, other.colors, before, added);
        for Field { name, values } in other.fields {
            match self.fields.iter_mut().find(|field| field.name == name) {
                Some(field) => append_field(&mut field.values, values),
                None => self.fields.push(Field { name, values: behind_zeros(values, before) }),
            }
        }
        for field in &mut self.fields {
            each_type!(&mut field.values, v => v.resize(before + added, Default::default()));
        }
        self.settle_zeros();
        self.scans.extend(other.scans.into_iter().map(|mut scan| {
            scan.points = scan.points.start + before..scan.points.end + before;
            scan
        }));
    }

    /// [Appends](Self::append) all parts in order, in memory for no more points than theirs.
    ///
    /// # Panics
    /// If parts with points differ in their origins.
    #[must_use]
    pub fn joined<'a>(parts: impl Iterator<Item = &'a Self> + Clone) -> Self {
        let total: usize = parts.clone().map(Self::len).sum();
        let mut parts = parts.filter(|part| !part.is_empty());
        let mut all = parts.next().cloned().unwrap_or_default();
        let more = total - all.len();
        all.positions.reserve_exact(more);
        if let Some(residuals) = &mut all.residuals {
            residuals.reserve_exact(more);
        }
        if let Some(colors) = &mut all.colors {
            colors.reserve_exact(more);
        }
        for field in &mut all.fields {
            each_type!(&mut field.values, v => v.reserve_exact(more));
        }
        parts.for_each(|part| all.append(part.clone()));
        all
    }
}

fn append_values<T: Copy + Default>(all: &mut Option<Vec<T>>, other: Option<Vec<T>>, before: usize, added: usize) {
    match (&mut *all, other) {
        (None, None) => {}
        (Some(all), Some(mut other)) => all.append(&mut other),
        (Some(all), None) => all.resize(before + added, T::default()),
        (None, Some(other)) => {
            let mut values = vec![T::default(); before];
            values.extend(other);
            *all = Some(values);
        }
    }
}

fn append_field(all: &mut FieldValues, other: FieldValues) {
    macro_rules! append {
        ($($variant:ident),*) => {
            match (&mut *all, other) {
                $((FieldValues::$variant(all), FieldValues::$variant(mut other)) => all.append(&mut other),)*
                (own, other) => {
                    let numbers = |values: &FieldValues| (0..values.len()).map(|i| values.get(i)).collect::<Vec<_>>();
                    let mut joined = numbers(own);
                    joined.extend(numbers(&other));
                    *all = FieldValues::F64(joined);
                }
            }
        };
    }
    append!(U8, I8, U16, I16, U32, I32, U64, I64, F32, F64);
}

fn behind_zeros(values: FieldValues, zeros: usize) -> FieldValues {
    macro_rules! extend {
        ($($variant:ident),*) => {
            match values {
                $(FieldValues::$variant(values) => {
                    let mut all = vec![Default::default(); zeros];
                    all.extend(values);
                    FieldValues::$variant(all)
                })*
            }
        };
    }
    extend!(U8, I8, U16, I16, U32, I32, U64, I64, F32, F64)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::Axes;

    #[test]
    fn what_a_part_lacks_is_zero() {
        let part = |x: f32| PointCloud::new(DVec3::X, vec![[x, 0.0, 0.0]; 2]);
        let mut cloud = part(0.0).with_axes(Axes::ZUp).with_field("A", FieldValues::U8(vec![1, 2])).expect("two");
        cloud.append(part(1.0).with_colors(vec![[9; 3]; 2]).expect("two"));
        let last = part(2.0).with_field("B", FieldValues::I32(vec![-3, 4])).expect("two");
        cloud.append(last.with_field("A", FieldValues::F32(vec![0.5, 1.5])).expect("two"));
        cloud.append(PointCloud::default());
        assert_eq!(cloud.positions().iter().map(|p| p[0]).collect::<Vec<_>>(), [0.0, 0.0, 1.0, 1.0, 2.0, 2.0]);
        assert_eq!(cloud.colors(), Some(&[[0; 3], [0; 3], [9; 3], [9; 3], [0; 3], [0; 3]][..]));
        let values = |name: &str| cloud.field(name).map(|field| &field.values);
        assert_eq!(values("A"), Some(&FieldValues::F64(vec![1.0, 2.0, 0.0, 0.0, 0.5, 1.5])), "of two types");
        assert_eq!(values("B"), Some(&FieldValues::I32(vec![0, 0, 0, 0, -3, 4])));
        assert_eq!(cloud.axes(), Some(Axes::ZUp));
        let parts = [PointCloud::default(), part(5.0), cloud.clone(), part(6.0)];
        let mut one_by_one = PointCloud::default();
        parts.iter().for_each(|part| one_by_one.append(part.clone()));
        assert_eq!(PointCloud::joined(parts.iter()), one_by_one);
        assert_eq!(PointCloud::joined([].iter()), PointCloud::default());
        let mut empty = PointCloud::default();
        empty.append(cloud.clone());
        assert_eq!(empty, cloud, "the first part");
    }
}
