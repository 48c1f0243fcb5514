//! World coordinates in `f32`: the origin that positions are stored about, and what rounding loses.

use glam::DVec3;

/// Coordinates below this magnitude need no origin: the `f32` step there is below a millimetre.
const MAX_WITHOUT_ORIGIN: f64 = 1e4;

/// Number of points that the middle of a cloud is taken of.
const MIDDLE_SAMPLES: usize = 1024;

/// The origin for points at `world(0)` to `world(count - 1)`: their [middle](sampled_middle), or zero near zero.
pub fn storage_origin(count: usize, world: impl Fn(usize) -> DVec3) -> DVec3 {
    let middle = sampled_middle(count, world);
    if middle.abs().max_element() < MAX_WITHOUT_ORIGIN { DVec3::ZERO } else { middle }
}

/// A place of whole numbers in the middle of the points: the median of a sample. Outliers do not move a median as they
/// move the centre of the bounds.
pub fn sampled_middle(count: usize, world: impl Fn(usize) -> DVec3) -> DVec3 {
    let step = count.div_ceil(MIDDLE_SAMPLES).max(1);
    let sample: Vec<DVec3> = (0..count).step_by(step).map(world).filter(|point| point.is_finite()).collect();
    let median = |axis: usize| {
        let mut values: Vec<f64> = sample.iter().map(|point| point[axis]).collect();
        let index = values.len() / 2;
        values.sort_by(f64::total_cmp);
        values.get(index).copied().unwrap_or_default().round()
    };
    DVec3::new(median(0), median(1), median(2))
}

/// What rounding a position to `f32` loses.
pub fn residual(position: DVec3) -> [f32; 3] {
    let lost = (position - position.as_vec3().as_dvec3()).as_vec3();
    // Infinite and NaN positions have no residual.
    if lost.is_finite() { lost.to_array() } else { [0.0; 3] }
}
