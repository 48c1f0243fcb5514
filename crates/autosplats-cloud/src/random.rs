//! Counter-based random numbers: the same for the same index, whichever thread asks.

use std::f64::consts::TAU;

use glam::DVec3;

/// Random numbers (splitmix64) of one item, such as a point or a ray.
pub(crate) struct Random(u64);

impl Random {
    /// The numbers of item `number`. Another seed changes the numbers of all items.
    pub(crate) fn new(seed: u64, number: u64) -> Self {
        let mut random = Self(seed ^ number.wrapping_mul(0xD134_2543_DE82_EF95));
        random.bits();
        random
    }

    /// The numbers of item `number` in generated scenes. The seeding is fixed: other numbers would be other points.
    pub(crate) fn of_scene(number: u64) -> Self {
        let mut seed = Self(number ^ 0x5EED_A570_5B1A_7500);
        Self(seed.bits())
    }

    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// A uniform number in 0..1.
    pub(crate) fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
    }

    /// A uniform integer in 0..n.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        ((self.unit() * n as f64) as usize).min(n - 1)
    }

    /// A normally distributed number, by the Box-Muller method.
    pub(crate) fn normal(&mut self) -> f64 {
        let (length, turn) = (1.0 - self.unit(), self.unit());
        (-2.0 * length.ln()).sqrt() * (TAU * turn).cos()
    }

    /// A uniformly distributed unit vector.
    pub(crate) fn direction(&mut self) -> DVec3 {
        let (height, turn) = (2.0 * self.unit() - 1.0, TAU * self.unit());
        let width = (1.0 - height * height).sqrt();
        DVec3::new(width * turn.cos(), width * turn.sin(), height)
    }
}
