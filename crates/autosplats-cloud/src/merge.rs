//! Several clouds to one.

use glam::{DMat4, DVec3};
use rayon::prelude::*;

use crate::{Field, FieldValues, PointCloud, cloud::each_type, read::SMALL, read::middle};

/// Colour of the points of a part that has none, beside parts that have.
const GREY: [u8; 3] = [200; 3];

impl PointCloud {
    /// Puts clouds together, each moved by its pose: an affine map of world coordinates, applied in `f64`.
    ///
    /// * The origin of the result is zero if all parts are near it, else that of the first part that is not; parts with
    ///   one common origin and no pose keep it, and their bits.
    /// * If any part has colours, the points of the others become mid grey.
    /// * A field is kept if every part has one of that name, letter case included; as `f64` where its widths differ.
    ///   Fields are not moved: normals keep their old directions.
    /// * The axes are kept if all parts agree on them.
    ///
    /// A single part without pose is returned as it is. Parts without points count for nothing.
    #[must_use]
    pub fn merge(parts: Vec<(Self, DMat4)>) -> Self {
        let (mut parts, empty): (Vec<_>, Vec<_>) = parts.into_iter().partition(|(cloud, _)| !cloud.is_empty());
        if parts.is_empty() {
            return empty.into_iter().next().map(|(cloud, _)| cloud).unwrap_or_default();
        }
        if parts.len() == 1 && parts[0].1 == DMat4::IDENTITY {
            return parts.swap_remove(0).0;
        }

        let origin = common_origin(&parts);
        let total = parts.iter().map(|(cloud, _)| cloud.len()).sum();
        let mut positions = Vec::with_capacity(total);
        for (cloud, pose) in &parts {
            if *pose == DMat4::IDENTITY && cloud.origin() == origin {
                positions.extend_from_slice(cloud.positions());
            } else {
                let moved = |i| (pose.transform_point3(cloud.world_position(i)) - origin).as_vec3().to_array();
                positions.par_extend((0..cloud.len()).into_par_iter().map(moved));
            }
        }
        let colors = parts.iter().any(|(cloud, _)| cloud.colors().is_some()).then(|| {
            let mut colors = Vec::with_capacity(total);
            for (cloud, _) in &parts {
                match cloud.colors() {
                    Some(own) => colors.extend_from_slice(own),
                    None => colors.resize(colors.len() + cloud.len(), GREY),
                }
            }
            colors
        });
        let first = &parts[0].0;
        let fields = first.fields().iter().filter_map(|field| common_field(&parts, &field.name)).collect();
        let axes = first.axes().filter(|_| parts.iter().all(|(cloud, _)| cloud.axes() == first.axes()));
        Self::from_parts(origin, positions, colors, fields, axes)
    }
}

fn common_origin(parts: &[(PointCloud, DMat4)]) -> DVec3 {
    let first = parts[0].0.origin();
    if parts.iter().all(|(cloud, pose)| *pose == DMat4::IDENTITY && cloud.origin() == first) {
        return first;
    }
    let far = parts.iter().find_map(|(cloud, pose)| {
        let middle = middle(cloud.len(), |i| pose.transform_point3(cloud.world_position(i)));
        let own = *pose == DMat4::IDENTITY && cloud.origin() != DVec3::ZERO;
        (middle.abs().max_element() >= SMALL).then_some(if own { cloud.origin() } else { middle })
    });
    far.unwrap_or(DVec3::ZERO)
}

/// The field `name` of all parts one after the other, if all have it.
fn common_field(parts: &[(PointCloud, DMat4)], name: &str) -> Option<Field> {
    let own = |cloud: &'_ PointCloud| cloud.fields().iter().position(|field| field.name == name);
    let all = parts.iter().map(|(cloud, _)| Some(&cloud.fields()[own(cloud)?].values)).collect::<Option<Vec<_>>>()?;

    macro_rules! join {
        ($($variant:ident),*) => {
            match all[0] {
                $(FieldValues::$variant(_) => {
                    let same = all.iter().map(|values| match values {
                        FieldValues::$variant(values) => Some(values.as_slice()),
                        _ => None,
                    });
                    same.collect::<Option<Vec<_>>>().map(|slices| FieldValues::$variant(slices.concat()))
                })*
            }
        };
    }
    let joined = join!(U8, I8, U16, I16, U32, I32, F32, F64);
    #[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one of the eight types is f64 itself")]
    let widened =
        |values: &FieldValues| -> Vec<f64> { each_type!(values, v => v.iter().map(|&value| value as f64).collect()) };
    let values = joined.unwrap_or_else(|| FieldValues::F64(all.iter().copied().flat_map(widened).collect()));
    Some(Field { name: name.into(), values })
}
