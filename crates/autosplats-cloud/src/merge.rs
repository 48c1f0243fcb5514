//! Joining several clouds.

use std::ops::Range;

use glam::{DMat3, DMat4, DVec3};
use rayon::prelude::*;

use crate::{
    Crs, Field, FieldValues, PointCloud, Scan, Unit, each_type,
    identity::Identity,
    precision::{degree_origin, residual, storage_origin},
    zeros::{common_fields, common_zeros},
};

/// Colour of the points of a part without colours, if another part has colours.
pub(crate) const GREY: [u8; 3] = [200; 3];

impl PointCloud {
    /// Joins clouds, each moved by its pose: an affine map of world coordinates, applied in `f64`.
    ///
    /// * The origin of the result is zero if all parts lie near zero, otherwise that of the first part that does not.
    ///   Parts without poses that share one origin keep that origin and their exact positions.
    /// * If any part has colours, the points of the others become grey.
    /// * A field is kept if every part [knows](Self::knows) it; it is zero where a reader left it out for being zero.
    ///   Case matters. Fields of different types become `f64`. Normals of floats are rotated with their points and keep
    ///   their lengths; other fields stay unchanged.
    /// * Axes are kept if all parts that state axes agree. Coordinate system and resolution are kept if all parts
    ///   agree.
    /// * Scans are kept, each moved with its part.
    /// * Residuals are kept if any part has some, and computed anew for parts that are moved.
    ///
    /// A single part without a pose is returned unchanged. Parts without points are ignored.
    ///
    /// # Examples
    ///
    /// ```
    /// use autosplats_cloud::{PointCloud, glam::{DMat4, DVec3}};
    ///
    /// let cloud = |x| PointCloud::new(DVec3::ZERO, vec![[x, 0.0, 0.0]; 10]);
    /// let pose = DMat4::from_translation(DVec3::new(0.0, 5.0, 0.0));
    /// let both = PointCloud::merge(vec![(cloud(1.0), DMat4::IDENTITY), (cloud(2.0), pose)]);
    /// assert_eq!(both.len(), 20);
    /// assert_eq!(both.world_position(19), DVec3::new(2.0, 5.0, 0.0));
    /// ```
    #[must_use]
    pub fn merge(parts: Vec<(Self, DMat4)>) -> Self {
        let (mut parts, empty): (Vec<_>, Vec<_>) = parts.into_iter().partition(|(cloud, _)| !cloud.is_empty());
        if parts.is_empty() {
            return empty.into_iter().next().map(|(cloud, _)| cloud).unwrap_or_default();
        }
        if parts.len() == 1 && parts[0].1 == DMat4::IDENTITY {
            return parts.swap_remove(0).0;
        }
        Self::merged(&parts.iter().map(|(cloud, pose)| (cloud, *pose)).collect::<Vec<_>>())
    }

    /// Like [`merge`](Self::merge), for borrowed clouds. A single part without a pose is copied.
    #[must_use]
    pub fn merged(parts: &[(&Self, DMat4)]) -> Self {
        let filled: Vec<_> = parts.iter().filter(|(cloud, _)| !cloud.is_empty()).copied().collect();
        let parts = match (&*filled, parts) {
            ([], []) => return Self::default(),
            ([], [(empty, _), ..]) => return (*empty).clone(),
            ([(only, pose)], _) if *pose == DMat4::IDENTITY => return (*only).clone(),
            (filled, _) => filled,
        };

        let origin = common_origin(parts);
        let total = parts.iter().map(|(cloud, _)| cloud.len()).sum();
        let exact = parts.iter().any(|(cloud, _)| cloud.residuals().is_some());
        let mut positions = Vec::with_capacity(total);
        let mut residuals = Vec::with_capacity(if exact { total } else { 0 });
        for (cloud, pose) in parts {
            if *pose == DMat4::IDENTITY && cloud.origin() == origin {
                positions.extend_from_slice(cloud.positions());
                match cloud.residuals() {
                    Some(own) => residuals.extend_from_slice(own),
                    None if exact => residuals.resize(positions.len(), [0.0; 3]),
                    None => {}
                }
            } else {
                let moved = |i| pose.transform_point3(cloud.world_position(i)) - origin;
                positions.par_extend((0..cloud.len()).into_par_iter().map(|i| moved(i).as_vec3().to_array()));
                if exact {
                    residuals.par_extend((0..cloud.len()).into_par_iter().map(|i| residual(moved(i))));
                }
            }
        }
        let colors = parts.iter().any(|(cloud, _)| cloud.colors().is_some()).then(|| {
            let mut colors = Vec::with_capacity(total);
            for (cloud, _) in parts {
                match cloud.colors() {
                    Some(own) => colors.extend_from_slice(own),
                    None => colors.resize(colors.len() + cloud.len(), GREY),
                }
            }
            colors
        });
        let first = parts[0].0;
        let clouds = parts.iter().map(|(cloud, _)| *cloud);
        let mut fields = common_fields(clouds.clone());
        for Field { name, values } in &mut fields {
            each_type!(&mut *values, v => v.reserve_exact(total));
            let columns = clouds.clone().filter_map(|cloud| Some((cloud.column(name)?, cloud.len())));
            columns.for_each(|(column, count)| column.append_to(values, count));
        }
        turn_normals(&mut fields, parts);
        let agreed = |same: fn(&Self, &Self) -> bool| parts.iter().all(|(cloud, _)| same(cloud, first));
        let stated = || parts.iter().filter_map(|(cloud, _)| cloud.axes());
        let mut scans = Vec::new();
        let mut start = 0;
        for (cloud, pose) in parts {
            scans.extend(cloud.scans().iter().map(|scan| Scan {
                name: scan.name.clone(),
                world_from_sensor: *pose * scan.world_from_sensor,
                points: scan.points.start + start..scan.points.end + start,
            }));
            start += cloud.len();
        }
        Self {
            origin,
            positions,
            residuals: exact.then_some(residuals),
            colors,
            fields,
            zeros: common_zeros(clouds),
            axes: stated().next().filter(|&axes| stated().all(|other| other == axes)),
            scans,
            crs: if agreed(|a, b| a.crs == b.crs) { first.crs().clone() } else { Crs::default() },
            resolution: first.resolution().filter(|_| agreed(|a, b| a.resolution == b.resolution)),
            identity: Identity::default(),
        }
    }
}

/// The matrix that transforms normals if `matrix` transforms positions: the inverse transpose times the positive |det|.
/// This cofactor form exists for singular matrices too.
pub fn normal_matrix(matrix: DMat3) -> DMat3 {
    let DMat3 { x_axis: x, y_axis: y, z_axis: z } = matrix;
    let sign = if matrix.determinant() < 0.0 { -1.0 } else { 1.0 };
    DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y)) * sign
}

/// Rotates the normals of each part by the part's pose.
fn turn_normals(fields: &mut [Field], parts: &[(&PointCloud, DMat4)]) {
    let mut start = 0;
    for (cloud, pose) in parts {
        let points = start..start + cloud.len();
        start = points.end;
        if *pose != DMat4::IDENTITY {
            turn(fields, points, pose, |_| true);
        }
    }
}

/// Rotates the normals of those `points` for which `which` is true, if all three fields are floats. Lengths are kept.
pub(crate) fn turn(fields: &mut [Field], points: Range<usize>, pose: &DMat4, which: impl Fn(usize) -> bool + Sync) {
    let find = |name: &str| {
        fields.iter().position(|Field { name: own, values }| {
            own == name && matches!(values, FieldValues::F32(_) | FieldValues::F64(_))
        })
    };
    let [Some(x), Some(y), Some(z)] = ["NormalX", "NormalY", "NormalZ"].map(find) else { return };
    let matrix = normal_matrix(DMat3::from_mat4(*pose));
    let turned = |i: usize| {
        let normal = DVec3::from([x, y, z].map(|field| fields[field].values.get(i)));
        if which(i) { (matrix * normal).normalize_or_zero() * normal.length() } else { normal }
    };
    let turned: Vec<DVec3> = points.clone().into_par_iter().map(turned).collect();
    for (axis, field) in [x, y, z].into_iter().enumerate() {
        match &mut fields[field].values {
            FieldValues::F32(v) => {
                v[points.clone()].iter_mut().zip(&turned).for_each(|(value, normal)| *value = normal[axis] as f32);
            }
            FieldValues::F64(v) => {
                v[points.clone()].iter_mut().zip(&turned).for_each(|(value, normal)| *value = normal[axis]);
            }
            _ => {}
        }
    }
}

fn common_origin(parts: &[(&PointCloud, DMat4)]) -> DVec3 {
    let first = parts[0].0.origin();
    if parts.iter().all(|(cloud, pose)| *pose == DMat4::IDENTITY && cloud.origin() == first) {
        return first;
    }
    let far = parts.iter().find_map(|(cloud, pose)| {
        let world = |i| pose.transform_point3(cloud.world_position(i));
        let degrees = cloud.crs().unit == Some(Unit::Degree);
        let origin = if degrees { degree_origin(cloud.len(), world) } else { storage_origin(cloud.len(), world) };
        let own = *pose == DMat4::IDENTITY && cloud.origin() != DVec3::ZERO;
        (origin != DVec3::ZERO).then_some(if own { cloud.origin() } else { origin })
    });
    far.unwrap_or(DVec3::ZERO)
}
