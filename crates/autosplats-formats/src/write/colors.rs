//! Colours of more than 8 bits, which an exactly read cloud has as fields.

use std::mem::{Discriminant, discriminant};

use autosplats_cloud::{FieldValues, PointCloud};
use rayon::prelude::*;

use crate::color_scale::{ColorScale, Levels};

/// Names of the colour fields.
pub(super) const CHANNELS: [&str; 3] = ["Red", "Green", "Blue"];

/// The fields `Red`, `Green` and `Blue`, if they have one type.
pub(super) fn channels(cloud: &PointCloud) -> Option<[&FieldValues; 3]> {
    let find = |name: &str| cloud.fields().iter().find(|field| field.name == name).map(|field| &field.values);
    let [red, green, blue] = CHANNELS.map(find);
    let three = [red?, green?, blue?];
    three.iter().all(|values| discriminant(*values) == discriminant(three[0])).then_some(three)
}

/// What is known of the [`channels`] of clouds.
#[derive(Clone, Copy, Debug)]
pub(super) struct WideColors {
    kind: Discriminant<FieldValues>,
    float: bool,
    levels: Levels,
    /// For each scale whether it gives the clouds' colours.
    fits: [bool; 3],
}

impl WideColors {
    pub(super) fn of(cloud: &PointCloud) -> Option<Self> {
        let wide = channels(cloud)?;
        let (kind, float) = (discriminant(wide[0]), matches!(wide[0], FieldValues::F32(_) | FieldValues::F64(_)));
        let Some(colors) = cloud.colors() else {
            return Some(Self { kind, float, levels: Levels::default(), fits: [true; 3] });
        };
        let values = |i: usize| wide.map(|values| values.get(i));
        let levels = Levels::of(cloud.len(), values);
        // Some formats round where others cut.
        let same = |scale: ColorScale| {
            let near = |i: usize| (0..3).all(|c| scale.byte(values(i)[c]).abs_diff(colors[i][c]) <= 1);
            (0..cloud.len()).into_par_iter().all(near)
        };
        Some(Self { kind, float, levels, fits: ColorScale::all().map(same) })
    }

    #[must_use]
    pub(super) fn and(self, other: Self) -> Self {
        let fits = [0, 1, 2].map(|scale| self.fits[scale] && other.fits[scale] && self.kind == other.kind);
        Self { levels: self.levels.and(other.levels), fits, ..self }
    }

    /// Whether a reader would derive the clouds' colours from the fields. That fails if parts of different scales were
    /// joined, or if only a cloud's dark points are left.
    pub(super) fn are_colors(&self) -> bool {
        self.fits[ColorScale::of_levels(self.levels, self.float).number()]
    }

    pub(super) fn are_short(&self) -> bool {
        self.kind == discriminant(&FieldValues::U16(Vec::new()))
    }
}
