//! World coordinates in `f32`: the origin that positions are stored about, and what rounding loses. Values of fields in
//! `f32` likewise.

use glam::DVec3;

use crate::{FieldValues, PointCloud};

/// Coordinates below this magnitude need no origin: the `f32` step there is below a millimetre.
const MAX_WITHOUT_ORIGIN: f64 = 1e4;

/// Number of points that the middle of a cloud is taken of.
const MIDDLE_SAMPLES: usize = 1024;

/// The step between sampled indices of `count` points or values; the first is 0. What is taken of a sample here is
/// taken of these.
pub fn sample_step(count: usize) -> usize {
    count.div_ceil(MIDDLE_SAMPLES).max(1)
}

/// The origin for points at `world(0)` to `world(count - 1)`: their [middle](sampled_middle), or zero near zero.
pub fn storage_origin(count: usize, world: impl Fn(usize) -> DVec3) -> DVec3 {
    let middle = sampled_middle(count, world);
    if middle.abs().max_element() < MAX_WITHOUT_ORIGIN { DVec3::ZERO } else { middle }
}

impl PointCloud {
    /// Makes a cloud of the points at `world(0)` to `world(count - 1)`, in world coordinates, about their
    /// [origin](storage_origin). If `exact`, [residuals](Self::residuals) keep what `f32` loses, if it loses anything.
    ///
    /// # Examples
    ///
    /// ```
    /// use autosplats_cloud::{PointCloud, glam::DVec3};
    ///
    /// let survey = [DVec3::new(512_000.123, 5_400_000.456, 310.789), DVec3::new(512_001.0, 5_400_001.0, 311.0)];
    /// let cloud = PointCloud::from_world(2, |i| survey[i], true);
    /// assert_eq!([0, 1].map(|i| cloud.world_position(i)), survey);
    /// ```
    pub fn from_world(count: usize, world: impl Fn(usize) -> DVec3, exact: bool) -> Self {
        let origin = storage_origin(count, &world);
        let about = |i: usize| world(i) - origin;
        let mut cloud = Self::new(origin, (0..count).map(|i| about(i).as_vec3().to_array()).collect());
        if exact && (0..count).any(|i| residual(about(i)) != [0.0; 3]) {
            cloud.residuals = Some((0..count).map(|i| residual(about(i))).collect());
        }
        cloud
    }
}

/// Parts of a degree to which the origin of points in degrees is rounded; a part is about 11 cm.
const PARTS_PER_DEGREE: f64 = 1e6;

/// The origin for points in degrees: their middle, to a millionth. At a whole number, one step of `f32` would be up to
/// half a metre on the ground.
pub fn degree_origin(count: usize, world: impl Fn(usize) -> DVec3) -> DVec3 {
    sampled_middle(count, |i| world(i) * PARTS_PER_DEGREE) / PARTS_PER_DEGREE
}

/// The box of a sample of the points; `None` if no sampled point is finite.
pub fn sampled_bounds(count: usize, world: impl Fn(usize) -> DVec3) -> Option<[DVec3; 2]> {
    let sample = (0..count).step_by(sample_step(count)).map(world).filter(|point| point.is_finite());
    sample.map(|point| [point; 2]).reduce(|[a, b], [c, d]| [a.min(c), b.max(d)])
}

/// A place of whole numbers in the middle of the points: the median of a sample. Outliers do not move a median as they
/// move the centre of the bounds.
pub fn sampled_middle(count: usize, world: impl Fn(usize) -> DVec3) -> DVec3 {
    let sample: Vec<DVec3> =
        (0..count).step_by(sample_step(count)).map(world).filter(|point| point.is_finite()).collect();
    let median = |axis: usize| {
        let mut values: Vec<f64> = sample.iter().map(|point| point[axis]).collect();
        let index = values.len() / 2;
        values.sort_by(f64::total_cmp);
        values.get(index).copied().unwrap_or_default().round()
    };
    DVec3::new(median(0), median(1), median(2))
}

/// The values of a field in `f32`, relative to a value among them. Times of an era in seconds have more digits than
/// `f32` holds.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{FieldValues, RelativeValues};
///
/// let times = FieldValues::F64(vec![300_000_000.0, 300_000_000.25, 300_000_000.5]);
/// let relative = RelativeValues::new(&times);
/// assert_eq!(relative.about().origin, 300_000_000.25);
/// assert_eq!([0, 1, 2].map(|index| relative.get(index)), [-0.25, 0.0, 0.25]);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct RelativeValues<'a> {
    values: &'a FieldValues,
    /// What is subtracted from each: the origin, or zero if that has been done.
    subtracted: f64,
    about: ValueOrigin,
}

/// What values are relative to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ValueOrigin {
    /// The value that is added to each.
    pub origin: f64,
    /// Step between numbers of the field's type at the origin; 0 for integers.
    pub precision: f64,
}

impl<'a> RelativeValues<'a> {
    /// Finds the origin: the median of a sample, or zero for types that `f32` holds exactly.
    pub fn new(values: &'a FieldValues) -> Self {
        let median = || {
            let sample = (0..values.len()).step_by(sample_step(values.len())).map(|index| values.get(index));
            let mut sample: Vec<f64> = sample.filter(|value| value.is_finite()).collect();
            sample.sort_by(f64::total_cmp);
            sample.get(sample.len() / 2).copied().unwrap_or_default()
        };
        let about = match values {
            FieldValues::F64(_) => {
                let origin = median();
                ValueOrigin { origin, precision: origin.abs() * f64::EPSILON }
            }
            FieldValues::U32(_) | FieldValues::I32(_) | FieldValues::U64(_) | FieldValues::I64(_) => {
                ValueOrigin { origin: median(), precision: 0.0 }
            }
            _ => ValueOrigin::default(),
        };
        Self { values, subtracted: about.origin, about }
    }

    /// Values that are stored without their origin.
    pub(crate) fn stored(values: &'a FieldValues, about: ValueOrigin) -> Self {
        Self { values, subtracted: 0.0, about }
    }

    /// What the values are relative to.
    pub fn about(&self) -> ValueOrigin {
        self.about
    }

    /// Number of values.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Whether there are no values.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// The value of point `index`, with the origin.
    ///
    /// # Panics
    /// If `index` is not below the number of values.
    pub fn absolute(&self, index: usize) -> f64 {
        self.values.get(index) - self.subtracted + self.about.origin
    }

    /// The value of point `index`, without the origin.
    ///
    /// # Panics
    /// If `index` is not below the number of values.
    pub fn get(&self, index: usize) -> f32 {
        (self.values.get(index) - self.subtracted) as f32
    }
}

/// What rounding a position to `f32` loses.
pub fn residual(position: DVec3) -> [f32; 3] {
    let lost = (position - position.as_vec3().as_dvec3()).as_vec3();
    // Infinite and NaN positions have no residual.
    if lost.is_finite() { lost.to_array() } else { [0.0; 3] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clouds_of_world_coordinates_keep_what_is_asked() {
        let far = |i: usize| DVec3::new(512_000.0, 5_400_000.0, 300.0) + 0.1 * i as f64;
        for (exact, most) in [(true, 1e-9), (false, 0.01)] {
            let cloud = PointCloud::from_world(1000, far, exact);
            assert_eq!(cloud.residuals().is_some(), exact);
            let worst = (0..1000).map(|i| (cloud.world_position(i) - far(i)).abs().max_element()).fold(0.0, f64::max);
            assert!(worst <= most, "{worst}");
        }
        let near = PointCloud::from_world(3, |i| DVec3::splat(i as f64), true);
        assert_eq!((near.origin(), near.residuals()), (DVec3::ZERO, None), "nothing is lost");
        let odd = PointCloud::from_world(2, |i| if i == 0 { DVec3::NAN } else { DVec3::INFINITY }, true);
        assert!(odd.positions()[0][0].is_nan() && odd.positions()[1][0].is_infinite(), "as they are");
        assert!(PointCloud::from_world(0, |_| DVec3::ZERO, true).is_empty());
    }
}
