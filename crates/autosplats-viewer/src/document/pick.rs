//! All there is to know about one point.

use std::path::PathBuf;

use autosplats::cloud::{FieldValues, PointCloud, glam::DVec3};

use super::{Document, LayerId, Shown};

/// A point that was pointed at.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PickedPoint {
    /// Its layer.
    pub(crate) layer: LayerId,
    /// The layer's name.
    pub(crate) name: String,
    /// The file it was read from.
    pub(crate) path: Option<PathBuf>,
    /// Which point of the file it is, as far as points were kept in reading, from 0.
    pub(crate) point: usize,
    /// World coordinates, with all that was done to it.
    pub(crate) position: DVec3,
    /// The file's own coordinates.
    pub(crate) file_position: DVec3,
    /// The file's own coordinates with the digits that the file has.
    pub(crate) file_text: [String; 3],
    /// Its own colour, sRGB.
    pub(crate) color: Option<[u8; 3]>,
    /// Name of the scan it belongs to.
    pub(crate) scan: Option<String>,
    /// Names and exact values of its attributes.
    pub(crate) fields: Vec<(String, String)>,
}

impl Document {
    /// Tells all about a shown point.
    pub(crate) fn describe(&self, shown: &Shown, index: usize) -> Option<PickedPoint> {
        let (id, point) = shown.point(index)?;
        let layer = self.layer(id).filter(|layer| point < layer.cloud.len())?;
        let cloud = &layer.cloud;
        let scan = cloud.scans().iter().find(|scan| scan.points.contains(&point));
        Some(PickedPoint {
            layer: id,
            name: layer.name.clone(),
            path: layer.path.clone(),
            point,
            position: layer.position(point),
            file_position: layer.file_position(point),
            file_text: file_text(cloud, point),
            color: cloud.colors().map(|colors| colors[point]),
            scan: scan.and_then(|scan| scan.name.clone()),
            fields: cloud.fields().iter().map(|field| (field.name.clone(), value_text(&field.values, point))).collect(),
        })
    }
}

/// A value with all its digits and no more.
fn value_text(values: &FieldValues, point: usize) -> String {
    macro_rules! each {
        ($($variant:ident),*) => { match values { $(FieldValues::$variant(values) => values[point].to_string(),)* } };
    }
    each!(U8, I8, U16, I16, U32, I32, U64, I64, F32, F64)
}

/// Points by which it is told how many digits a file has.
const SAMPLES: usize = 1000;
/// Digits that somebody may have rounded a number to.
const DIGITS: usize = 13;

/// Coordinates with the digits of the file: those of its steps, or as few as tell a number from its neighbours.
pub(super) fn file_text(cloud: &PointCloud, point: usize) -> [String; 3] {
    let place = cloud.world_position(point);
    let single = is_single(cloud);
    let lost = cloud.residuals().map_or([0.0; 3], |residuals| residuals[point]);
    let digits = |axis: usize| {
        if single { (place[axis] as f32).to_string() } else { file_digits(place[axis], lost[axis]) }
    };
    [0, 1, 2].map(|axis| {
        let stepped = cloud.resolution().and_then(|step| in_steps(place[axis], step[axis]));
        stepped.unwrap_or_else(|| digits(axis))
    })
}

/// Whether all coordinates could be those of a file of `f32`, by a part of them: a decimal that is not is no `f32` as a rule.
fn is_single(cloud: &PointCloud) -> bool {
    let step = cloud.len().div_ceil(SAMPLES).max(1);
    let same = |value: f64| f64::from(value as f32) == value || value.is_nan();
    (0..cloud.len()).step_by(step).all(|point| cloud.world_position(point).to_array().into_iter().all(same))
}

/// The digits of a coordinate, `lost` of which `f32` could not hold. That is an `f32`, too, and near zero it may not be all:
/// what the file says is the shortest number near enough then.
fn file_digits(value: f64, lost: f32) -> String {
    let error = 0.5 * f64::from(f32::EPSILON) * f64::from(lost.abs());
    let step = f64::EPSILON * value.abs();
    if error < 0.25 * step { value.to_string() } else { shortest(value, error + step) }
}

/// The shortest decimal that is no further than `error` from a number; all its digits where that would be no shorter than
/// numbers that nobody has rounded.
pub(crate) fn shortest(value: f64, error: f64) -> String {
    let digits = (0..DIGITS).find_map(|digits| {
        let short: f64 = format!("{value:.digits$e}").parse().ok()?;
        ((short - value).abs() <= error).then_some(short)
    });
    digits.unwrap_or(value).to_string()
}

/// A number with the decimals that all multiples of a step can be written with; nothing if that is not the number, as where
/// a file counts its steps from an odd place.
fn in_steps(value: f64, step: f64) -> Option<String> {
    let decimals = (0..=12).find(|&decimals| {
        let steps = step * 10_f64.powi(decimals);
        steps >= 0.5 && (steps - steps.round()).abs() < 1e-6 * steps
    })?;
    let text = format!("{value:.*}", decimals.unsigned_abs() as usize);
    let off = text.parse::<f64>().ok()? - value;
    (off.abs() < 1e-3 * step).then_some(text)
}
