//! Scale of a cloud, for what computes with squares and higher powers of lengths in `f32`.

use glam::DVec3;

use crate::{PointCloud, Scan};

/// Points in the sample that tells the size.
const SIZE_SAMPLES: usize = 1 << 10;
/// Powers of two of lengths that are computed with as they are: 6e-8 to 3e7 units.
const ORDINARY_EXPONENTS: std::ops::Range<i32> = -24..25;

/// Factor that brings a length to a size at which its fourth power is exact enough in `f32`. The factor is 1 for 0 and
/// for lengths of 6e-8 to 3e7, and otherwise the power of two that brings the length to between 1 and 2.
///
/// ```
/// use autosplats_cloud::computing_scale_of;
///
/// assert_eq!([0.0, 1e-6, 12.0, 1e7].map(computing_scale_of), [1.0; 4]);
/// assert!((1.0..2.0).contains(&(1e-12 * computing_scale_of(1e-12))));
/// ```
pub fn computing_scale_of(length: f64) -> f64 {
    // The exponent in the bits of a normal number: 2^exponent <= length < 2^(exponent + 1).
    let exponent = (length.to_bits() >> 52) as i32 - 1023;
    let is_extraordinary = length > 0.0 && length.is_finite() && !ORDINARY_EXPONENTS.contains(&exponent);
    if is_extraordinary { 2f64.powi(-exponent) } else { 1.0 }
}

impl PointCloud {
    /// Factor that brings the cloud to a size at which fourth powers of its lengths are exact enough in `f32`: that of
    /// the distance from the middle that half of the points do not exceed; see [`computing_scale_of`]. Multiplying by
    /// it rounds nothing.
    ///
    /// # Examples
    ///
    /// ```
    /// use autosplats_cloud::{PointCloud, glam::DVec3};
    ///
    /// let atoms = PointCloud::new(DVec3::ZERO, vec![[0.0; 3], [3e-10, 0.0, 0.0], [0.0, 3e-10, 0.0]]);
    /// let factor = atoms.computing_scale();
    /// assert!((0.9..2.1).contains(&(3e-10 * factor)));
    /// assert_eq!(atoms.scaled(factor).computing_scale(), 1.0);
    /// ```
    pub fn computing_scale(&self) -> f64 {
        let step = self.positions.len().div_ceil(SIZE_SAMPLES).max(1);
        let sampled = self.positions.iter().step_by(step).map(|&p| DVec3::from(p.map(f64::from)));
        let places: Vec<DVec3> = sampled.filter(|p| p.is_finite()).collect();
        let middle_one = |mut values: Vec<f64>| {
            let middle = values.len() / 2;
            (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
        };
        let Some(middle) = middle_one(places.iter().map(|p| p.x).collect())
            .zip(middle_one(places.iter().map(|p| p.y).collect()))
            .zip(middle_one(places.iter().map(|p| p.z).collect()))
            .map(|((x, y), z)| DVec3::new(x, y, z))
        else {
            return 1.0;
        };
        let size = middle_one(places.iter().map(|p| p.distance(middle)).collect()).unwrap_or_default();
        computing_scale_of(size)
    }

    /// A copy whose lengths are all multiplied by `factor`, about the world's origin. Units and fields stay as stated.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let scaled = |place: &[f32; 3]| place.map(|along| (f64::from(along) * factor) as f32);
        let scan = |scan: &Scan| {
            let mut scan = scan.clone();
            scan.world_from_sensor.w_axis = (scan.position() * factor).extend(scan.world_from_sensor.w_axis.w);
            scan
        };
        Self {
            origin: self.origin * factor,
            positions: self.positions.iter().map(scaled).collect(),
            residuals: self.residuals.as_ref().map(|residuals| residuals.iter().map(scaled).collect()),
            colors: self.colors.clone(),
            fields: self.fields.clone(),
            zeros: self.zeros.clone(),
            axes: self.axes,
            scans: self.scans.iter().map(scan).collect(),
            crs: self.crs.clone(),
            resolution: self.resolution.map(|step| step * factor),
            identity: crate::identity::Identity::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DMat4;

    use super::*;

    fn body(size: f32) -> PointCloud {
        let positions = (0..5000).map(|i| [i % 17, i % 19, i % 23].map(|side| side as f32 / 16.0 * size)).collect();
        let scan =
            Scan { name: None, world_from_sensor: DMat4::from_translation(DVec3::X * f64::from(size)), points: 0..9 };
        PointCloud::new(DVec3::splat(f64::from(size)), positions).with_scans(vec![scan])
    }

    #[test]
    fn only_extraordinary_sizes_are_scaled_and_nothing_is_rounded() {
        for exponent in [-23, -10, 0, 10, 24] {
            assert_eq!(body(2f32.powi(exponent)).computing_scale(), 1.0, "2^{exponent}");
        }
        for exponent in [-120, -60, -30, 30, 60, 120] {
            let cloud = body(2f32.powi(exponent));
            let factor = cloud.computing_scale();
            let size = factor * 2f64.powi(exponent);
            assert!((0.5..=2.0).contains(&size), "2^{exponent} becomes {size}");
            assert_eq!(cloud.scaled(factor), body(size as f32), "2^{exponent}");
        }
    }

    #[test]
    fn a_few_far_points_and_none_at_all_change_no_scale() {
        let mut positions = body(1.0).positions().to_vec();
        positions.extend([[1e30, 0.0, 0.0], [f32::NAN; 3], [f32::INFINITY, 0.0, 0.0]]);
        for positions in [positions, Vec::new(), vec![[5.0; 3]; 10], vec![[f32::NAN; 3]; 10]] {
            assert_eq!(PointCloud::new(DVec3::ZERO, positions).computing_scale(), 1.0);
        }
    }
}
