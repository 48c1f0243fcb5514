//! Some points of a cloud: copied to a cloud of their own, or moved within the cloud.

use std::ops::Range;

use glam::{DMat4, DVec3};
use rayon::prelude::*;

use crate::{Field, FieldValues, LocalMetres, PointCloud, Scan, identity::Identity, merge::turn, precision::residual};

impl PointCloud {
    /// Copies the points with the given indices, in ascending order, with all attributes to a new cloud.
    ///
    /// # Panics
    /// If an index is not below [`len`](Self::len).
    #[must_use]
    pub fn pick(&self, points: &[u32]) -> Self {
        debug_assert!(points.is_sorted_by(|a, b| a < b), "scans are runs of points");
        let place = |index: usize| points.partition_point(|&point| (point as usize) < index);
        let scans = self
            .scans
            .iter()
            .map(|scan| Scan { points: place(scan.points.start)..place(scan.points.end), ..scan.clone() });
        let field = |Field { name, values }: &Field| Field { name: name.clone(), values: values.pick(points) };
        Self {
            origin: self.origin,
            positions: gather(&self.positions, points),
            residuals: self.residuals.as_ref().map(|residuals| gather(residuals, points)),
            colors: self.colors.as_ref().map(|colors| gather(colors, points)),
            fields: self.fields.iter().map(field).collect(),
            zeros: self.zeros.clone(),
            axes: self.axes,
            scans: scans.collect(),
            crs: self.crs.clone(),
            resolution: self.resolution,
            identity: Identity::default(),
        }
    }

    /// Copies points that follow each other, with all attributes but the scans, to a new cloud.
    ///
    /// # Panics
    /// If the range reaches beyond the cloud's points.
    #[must_use]
    pub fn slice(&self, points: Range<usize>) -> Self {
        let field = |Field { name, values }: &Field| Field { name: name.clone(), values: values.slice(points.clone()) };
        Self {
            positions: self.positions[points.clone()].to_vec(),
            residuals: self.residuals.as_ref().map(|residuals| residuals[points.clone()].to_vec()),
            colors: self.colors.as_ref().map(|colors| colors[points.clone()].to_vec()),
            fields: self.fields.iter().map(field).collect(),
            ..self.clone_without_points()
        }
    }

    /// Moves the points for which `which` is true by an affine map of world coordinates, in `f64`. All other points
    /// keep their exact positions. Normals of floats are rotated with their points; scans stay where they are.
    ///
    /// Rounding errors go to the residuals if the cloud has some; set [zeros](Self::with_residuals) first to keep all
    /// digits. For a cloud in degrees pass the map `local`; `matrix` then applies to metres on that map.
    ///
    /// # Examples
    ///
    /// ```
    /// use autosplats_cloud::{PointCloud, glam::{DMat4, DVec3}};
    ///
    /// let mut cloud = PointCloud::new(DVec3::ZERO, vec![[1.0, 0.0, 0.0]; 2]);
    /// cloud.move_points(|index| index == 1, &DMat4::from_translation(DVec3::Z), None);
    /// assert_eq!(cloud.world_position(0), DVec3::new(1.0, 0.0, 0.0));
    /// assert_eq!(cloud.world_position(1), DVec3::new(1.0, 0.0, 1.0));
    /// ```
    pub fn move_points(&mut self, which: impl Fn(usize) -> bool + Sync, matrix: &DMat4, local: Option<&LocalMetres>) {
        let moved = |place: DVec3| match local {
            None => matrix.transform_point3(place),
            Some(local) => local.degrees(matrix.transform_point3(local.metres(place))),
        };
        let origin = self.origin;
        let world = |position: [f32; 3]| DVec3::from(position.map(f64::from));
        match &mut self.residuals {
            None => self.positions.par_iter_mut().enumerate().filter(|(i, _)| which(*i)).for_each(|(_, position)| {
                *position = (moved(origin + world(*position)) - origin).as_vec3().to_array();
            }),
            Some(residuals) => {
                let both = self.positions.par_iter_mut().zip(residuals).enumerate();
                both.filter(|(i, _)| which(*i)).for_each(|(_, (position, lost))| {
                    let place = moved(origin + (world(*position) + world(*lost))) - origin;
                    (*position, *lost) = (place.as_vec3().to_array(), residual(place));
                });
            }
        }
        let all = 0..self.positions.len();
        turn(&mut self.fields, all, matrix, which);
        self.identity = Identity::default();
    }
}

impl FieldValues {
    /// Values that follow each other.
    pub(crate) fn slice(&self, points: Range<usize>) -> Self {
        macro_rules! each {
            ($($variant:ident),*) => {
                match self { $(Self::$variant(values) => Self::$variant(values[points].to_vec()),)* }
            };
        }
        each!(U8, I8, U16, I16, U32, I32, U64, I64, F32, F64)
    }

    /// The values with the given indices.
    fn pick(&self, points: &[u32]) -> Self {
        macro_rules! each {
            ($($variant:ident),*) => {
                match self { $(Self::$variant(values) => Self::$variant(gather(values, points)),)* }
            };
        }
        each!(U8, I8, U16, I16, U32, I32, U64, I64, F32, F64)
    }
}

fn gather<T: Copy + Send + Sync>(values: &[T], points: &[u32]) -> Vec<T> {
    points.par_iter().map(|&point| values[point as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Crs, Unit};

    /// Points on a line far from zero, each with its index and a normal, seen by two sensors.
    fn cloud() -> PointCloud {
        let scan = |points| Scan { name: None, world_from_sensor: DMat4::IDENTITY, points };
        let line = (0..100).map(|i| [i as f32, 0.5, 0.25]).collect();
        PointCloud::new(DVec3::new(5e5, 5e6, 0.0), line)
            .with_residuals(vec![[1e-9, 0.0, 0.0]; 100])
            .and_then(|cloud| cloud.with_colors((0..100).map(|i| [i; 3]).collect()))
            .and_then(|cloud| cloud.with_field("Id", FieldValues::U64((0..100).map(|i| u64::MAX - i).collect())))
            .and_then(|cloud| cloud.with_field("NormalX", FieldValues::F32(vec![2.0; 100])))
            .and_then(|cloud| cloud.with_field("NormalY", FieldValues::F32(vec![0.0; 100])))
            .and_then(|cloud| cloud.with_field("NormalZ", FieldValues::F32(vec![0.0; 100])))
            .expect("one value a point")
            .with_scans(vec![scan(0..40), scan(40..100)])
    }

    #[test]
    fn picked_points_are_those_retained() {
        for step in [1, 3, 40, 200] {
            let points: Vec<u32> = (1..100).step_by(step).collect();
            let mut kept = cloud();
            kept.retain(|i| points.contains(&(i as u32)));
            let picked = cloud().pick(&points);
            assert_eq!(picked, kept, "every {step}th point");
            assert_ne!(picked.identity(), cloud().identity(), "another cloud");
        }
        assert!(cloud().pick(&[]).is_empty(), "no point");
    }

    #[test]
    fn moved_points_keep_their_digits_and_others_their_bits() {
        let quarter = DMat4::from_translation(DVec3::new(0.125, -3e6, 1e-7)) * DMat4::from_rotation_z(0.5);
        let (before, mut after) = (cloud(), cloud());
        after.move_points(|i| i % 2 == 1, &quarter, None);
        for i in 0..100 {
            let expected =
                if i % 2 == 1 { quarter.transform_point3(before.world_position(i)) } else { before.world_position(i) };
            // Two `f32` have 48 bits; the points lie three million units from the origin.
            assert!(after.world_position(i).abs_diff_eq(expected, 1e-8), "point {i}");
            let [x, y] = ["NormalX", "NormalY"].map(|name| after.field(name).map(|field| field.values.get(i)));
            let (sin, cos) = if i % 2 == 1 { 0.5_f64.sin_cos() } else { (0.0, 1.0) };
            let near = |value: Option<f64>, wanted: f64| value.is_some_and(|value| (value - wanted).abs() < 1e-6);
            assert!(near(x, 2.0 * cos) && near(y, 2.0 * sin), "normal of point {i}: {x:?}, {y:?}");
        }
        let even = |cloud: &PointCloud| cloud.pick(&(0..100).step_by(2).collect::<Vec<_>>());
        assert_eq!(even(&after), even(&before), "points that stay");
        assert_ne!(after.identity(), before.identity(), "another cloud");
        let mut coarse = before.clone();
        coarse.residuals = None;
        coarse.move_points(|_| true, &DMat4::from_translation(DVec3::X), None);
        assert_eq!((coarse.positions()[3], coarse.residuals()), ([4.0, 0.5, 0.25], None), "no digits, none made");
    }

    #[test]
    fn degrees_are_moved_by_metres() {
        let crs = Crs { unit: Some(Unit::Degree), ..Crs::default() };
        let mut cloud = PointCloud::new(DVec3::new(10.0, 50.0, 100.0), vec![[0.0; 3], [0.01, 0.0, 0.0]])
            .with_residuals(vec![[0.0; 3]; 2])
            .expect("a residual each")
            .with_crs(crs);
        let local = cloud.local_metres(None).expect("degrees");
        let before = local.metres(cloud.world_position(1));
        cloud.move_points(|i| i == 1, &DMat4::from_translation(DVec3::new(3.0, 4.0, 5.0)), Some(&local));
        let way = local.metres(cloud.world_position(1)) - before;
        // One step of `f64` at 50 degrees is less than a nanometre.
        assert!(way.abs_diff_eq(DVec3::new(3.0, 4.0, 5.0), 1e-8), "{way}");
        assert_eq!(cloud.world_position(0), DVec3::new(10.0, 50.0, 100.0), "the other stays");
        assert_eq!(cloud.crs().unit, Some(Unit::Degree), "in degrees still");
    }
}
