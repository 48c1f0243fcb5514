//! Colours of more than 8 bits, which an exactly read cloud has as fields.

use std::mem::discriminant;

use autosplats_cloud::{FieldValues, PointCloud};
use rayon::prelude::*;

use crate::color_scale::ColorScale;

/// Names of the colour fields.
pub(super) const CHANNELS: [&str; 3] = ["Red", "Green", "Blue"];

/// The fields `Red`, `Green` and `Blue`, if a reader would derive the cloud's colours from them. That fails if parts of
/// different scales were joined, or if only a cloud's dark points are left.
pub(super) fn wide_colors(cloud: &PointCloud) -> Option<[&FieldValues; 3]> {
    let find = |name: &str| cloud.fields().iter().find(|field| field.name == name).map(|field| &field.values);
    let [red, green, blue] = CHANNELS.map(find);
    let wide = [red?, green?, blue?];
    if wide.iter().any(|values| discriminant(*values) != discriminant(wide[0])) {
        return None;
    }
    let Some(colors) = cloud.colors() else { return Some(wide) };
    let float = matches!(wide[0], FieldValues::F32(_) | FieldValues::F64(_));
    let points = || (0..cloud.len()).into_par_iter();
    let scale = ColorScale::of(cloud.len(), float, |i| wide.map(|values| values.get(i)));
    // Some formats round where others cut.
    let same = |i: usize| (0..3).all(|c| scale.byte(wide[c].get(i)).abs_diff(colors[i][c]) <= 1);
    points().all(same).then_some(wide)
}
