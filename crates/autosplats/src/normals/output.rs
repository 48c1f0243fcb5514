//! The result, written in the tree's order from several threads.

use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use rayon::prelude::*;

use super::Normals;

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
