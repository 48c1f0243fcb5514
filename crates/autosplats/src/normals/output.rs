//! The result, written in the tree's order from several threads.

use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use autosplats_cloud::{Error, FieldValues, PointCloud};
use rayon::prelude::*;

use super::Normals;

impl Normals {
    /// Adds the result to its cloud as fields: `NormalX`, `NormalY`, `NormalZ`, `Curvature` and `DensityRadius`. Fields
    /// of these names are replaced.
    ///
    /// # Errors
    /// [`Error::AttributeLength`] unless there is one of each per point.
    ///
    /// # Examples
    ///
    /// ```
    /// use autosplats::{NormalSettings, cloud::{PointCloud, glam::DVec3}, estimate_normals};
    ///
    /// let floor = (0..100).map(|i| [(i % 10) as f32, (i / 10) as f32, 0.0]).collect();
    /// let cloud = PointCloud::new(DVec3::ZERO, floor);
    /// let cloud = estimate_normals(&cloud, &NormalSettings::default(), &())?.add_to(cloud)?;
    /// assert!(cloud.field("NormalZ").is_some());
    /// # Ok::<(), autosplats::Error>(())
    /// ```
    pub fn add_to(self, cloud: PointCloud) -> Result<PointCloud, Error> {
        let Self { normals, curvature, radius } = self;
        let axis = |axis: usize| FieldValues::F32(normals.iter().map(|normal| normal[axis]).collect());
        let fields = [("NormalX", axis(0)), ("NormalY", axis(1)), ("NormalZ", axis(2))];
        let measures = [("Curvature", curvature), ("DensityRadius", radius)];
        let measures = measures.map(|(name, values)| (name, FieldValues::F32(values)));
        let mut fields = fields.into_iter().chain(measures);
        fields.try_fold(cloud, |cloud, (name, values)| cloud.with_field(name, values))
    }
}

/// The bits of the result's numbers. Atomic because threads write to interleaved places; each number is written once.
pub(super) struct Output {
    normals: Vec<[AtomicU32; 3]>,
    curvature: Vec<AtomicU32>,
    radius: Vec<AtomicU32>,
}

impl Output {
    /// All values NaN.
    pub(super) fn new(len: usize) -> Self {
        let nan = || AtomicU32::new(f32::NAN.to_bits());
        let all = || (0..len).into_par_iter();
        Self {
            normals: all().map(|_| [nan(), nan(), nan()]).collect(),
            curvature: all().map(|_| nan()).collect(),
            radius: all().map(|_| nan()).collect(),
        }
    }

    #[inline(always)]
    pub(super) fn set(&self, index: u32, normal: [f32; 3], curvature: f32, radius: f32) {
        let index = index as usize;
        for axis in 0..3 {
            self.normals[index][axis].store(normal[axis].to_bits(), Relaxed);
        }
        self.curvature[index].store(curvature.to_bits(), Relaxed);
        self.radius[index].store(radius.to_bits(), Relaxed);
    }

    pub(super) fn finish(self) -> Normals {
        // Collected in place, without copying.
        let value = |bits: AtomicU32| f32::from_bits(bits.into_inner());
        Normals {
            normals: self.normals.into_iter().map(|normal| normal.map(value)).collect(),
            curvature: self.curvature.into_iter().map(value).collect(),
            radius: self.radius.into_iter().map(value).collect(),
        }
    }
}
