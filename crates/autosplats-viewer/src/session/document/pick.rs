//! Information on a picked point.

use std::{path::PathBuf, sync::Arc};

use autosplats::cloud::{Error, Field, FieldValues, Key, PointCloud, Progress, Wanted, glam::DVec3};

use super::{Document, Layer, LayerId, LayerTree, ShownCloud};

/// A picked point.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PickedPoint {
    pub(crate) layer: LayerId,
    pub(crate) name: String,
    /// The file that the layer was read from.
    pub(crate) path: Option<PathBuf>,
    /// Index of the point among those kept in reading, from 0.
    pub(crate) point: usize,
    /// For an octree, the node and the index among its points that are shown.
    pub(crate) node: Option<(Key, usize)>,
    /// World coordinates, with all edits.
    pub(crate) position: DVec3,
    /// Coordinates in the file.
    pub(crate) file_position: DVec3,
    /// Coordinates in the file, with the file's digits.
    pub(crate) file_text: [String; 3],
    /// The point's own colour, sRGB.
    pub(crate) color: Option<[u8; 3]>,
    /// Name of the scan that the point belongs to.
    pub(crate) scan: Option<String>,
    /// Names and exact values of the attributes.
    pub(crate) fields: Vec<(String, String)>,
}

impl Document {
    /// Information on the shown point `index`; `None` if the point no longer exists.
    pub(crate) fn describe(&self, shown: &ShownCloud, index: usize) -> Option<PickedPoint> {
        let (id, point) = shown.point(index)?;
        // The points of an octree may have been replaced since.
        let own = self.layer(id)?;
        let layer = if own.tree.is_some() { shown.layer(id)? } else { own };
        let layer = Some(layer).filter(|layer| point < layer.cloud.len())?;
        let scan = layer.cloud.scans().iter().find(|scan| scan.points.contains(&point));
        let mut picked = PickedPoint {
            layer: id,
            name: layer.name.clone(),
            path: layer.path.clone(),
            point,
            node: layer.tree.as_ref().and_then(|tree| tree.place_of(point)),
            position: layer.position(point),
            file_position: DVec3::ZERO,
            file_text: [const { String::new() }; 3],
            color: None,
            scan: scan.and_then(|scan| scan.name.clone()),
            fields: Vec::new(),
        };
        picked.describe(layer, point);
        Some(picked)
    }
}

impl PickedPoint {
    /// Adds the exact place and all attributes of a point of an octree, from the points of its node as the file has
    /// them. Blocks while the node is read.
    ///
    /// # Errors
    /// Why the node cannot be read.
    pub(crate) fn with_attributes(mut self, layer: &Layer, progress: &dyn Progress) -> Result<Self, Error> {
        let (Some((key, point)), Some(LayerTree { open, .. })) = (self.node, &layer.tree) else { return Ok(self) };
        let stored = open.tree.fetch(&[key], progress)?.concat();
        let wanted = Wanted { fields: None, exact: true, ..open.wanted.clone() };
        let cloud = open.tree.decode(key, &stored, &wanted)?;
        if point < cloud.len() {
            let mut layer = layer.clone();
            layer.cloud = Arc::new(cloud);
            self.position = layer.position(point);
            self.describe(&layer, point);
        }
        Ok(self)
    }

    /// Describes a point of a layer.
    fn describe(&mut self, layer: &Layer, point: usize) {
        let cloud = &layer.cloud;
        self.file_position = layer.file_position(point);
        self.file_text = file_text(cloud, point);
        self.color = cloud.colors().map(|colors| colors[point]);
        let field = |field: &Field| (field.name.clone(), value_text(&field.values, point));
        self.fields = cloud.fields().iter().map(field).collect();
    }
}

/// A value with exactly the digits it has.
fn value_text(values: &FieldValues, point: usize) -> String {
    macro_rules! each {
        ($($variant:ident),*) => { match values { $(FieldValues::$variant(values) => values[point].to_string(),)* } };
    }
    each!(U8, I8, U16, I16, U32, I32, U64, I64, F32, F64)
}

/// Number of points tested to find out how many digits a file has.
const DIGIT_SAMPLE_COUNT: usize = 1000;
/// Largest number of significant digits that a coordinate may have been rounded to.
const MAX_SIGNIFICANT_DIGITS: usize = 13;

/// Coordinates with the digits of the file: those of its resolution, or the fewest that identify the number.
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

/// Whether all coordinates fit into `f32`, judged by a sample of points. Most decimal numbers of a double-precision
/// file do not fit.
fn is_single(cloud: &PointCloud) -> bool {
    let step = cloud.len().div_ceil(DIGIT_SAMPLE_COUNT).max(1);
    let same = |value: f64| f64::from(value as f32) == value || value.is_nan();
    (0..cloud.len()).step_by(step).all(|point| cloud.world_position(point).to_array().into_iter().all(same))
}

/// Text of a coordinate. `lost` is the part that `f32` could not hold; it is itself an `f32` and so not exact. Near
/// zero its error may exceed the step of `f64`; then the shortest number within the error is taken.
fn file_digits(value: f64, lost: f32) -> String {
    let error = 0.5 * f64::from(f32::EPSILON) * f64::from(lost.abs());
    let step = f64::EPSILON * value.abs();
    if error < 0.25 * step { value.to_string() } else { shortest(value, error + step) }
}

/// The shortest decimal within `error` of a number. If that takes more than `MAX_SIGNIFICANT_DIGITS` digits, nobody has
/// rounded the number, and all digits are kept.
pub(crate) fn shortest(value: f64, error: f64) -> String {
    let digits = (0..MAX_SIGNIFICANT_DIGITS).find_map(|digits| {
        let short: f64 = format!("{value:.digits$e}").parse().ok()?;
        ((short - value).abs() <= error).then_some(short)
    });
    digits.unwrap_or(value).to_string()
}

/// A number with the decimals that multiples of `step` need. `None` if the number is not such a multiple, as when a
/// file counts its steps from an odd offset.
fn in_steps(value: f64, step: f64) -> Option<String> {
    let decimals = (0..=12).find(|&decimals| {
        let steps = step * 10_f64.powi(decimals);
        steps >= 0.5 && (steps - steps.round()).abs() < 1e-6 * steps
    })?;
    let text = format!("{value:.*}", decimals.unsigned_abs() as usize);
    let off = text.parse::<f64>().ok()? - value;
    (off.abs() < 1e-3 * step).then_some(text)
}
