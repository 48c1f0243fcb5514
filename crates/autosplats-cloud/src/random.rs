//! Random numbers: the same on every computer, and for an item the same whichever thread asks.

use std::f64::consts::TAU;

use glam::DVec3;

/// A stream of random numbers (splitmix64).
///
/// # Examples
///
/// ```
/// use autosplats_cloud::Random;
///
/// // Each point has numbers of its own, which depend on no other point.
/// let height = |point| Random::new(7, point).unit();
/// assert_eq!(height(3), height(3));
/// assert_ne!(height(3), height(4));
/// ```
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// Distance of two states that follow each other.
    pub const STEP: u64 = 0x9E37_79B9_7F4A_7C15;

    /// The numbers of item `number`, such as a point or a ray. Another seed changes the numbers of all items.
    pub fn new(seed: u64, number: u64) -> Self {
        let mut random = Self::numbered(seed, number);
        random.bits();
        random
    }

    /// Like [`new`](Self::new), with one more number at the start.
    pub(crate) fn numbered(seed: u64, number: u64) -> Self {
        Self(seed ^ number.wrapping_mul(0xD134_2543_DE82_EF95))
    }

    /// The numbers after a state of the generator.
    pub fn from_state(state: u64) -> Self {
        Self(state)
    }

    /// The next number, of 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(Self::STEP);
        Self::scrambled(self.0)
    }

    /// The number of a state: another one for each state.
    pub fn scrambled(state: u64) -> u64 {
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// A uniform number, at least 0 and below 1.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
    }

    /// A uniform integer, at least 0 and below `n`.
    pub fn below(&mut self, n: usize) -> usize {
        ((self.unit() * n as f64) as usize).min(n - 1)
    }

    /// A number of 0 to `n - 1`: the [next number](Self::bits) modulo `n`.
    pub fn modulo(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    /// A normally distributed number of mean 0 and standard deviation 1, by the Box-Muller method.
    pub fn normal(&mut self) -> f64 {
        let (length, turn) = (1.0 - self.unit(), self.unit());
        (-2.0 * length.ln()).sqrt() * (TAU * turn).cos()
    }

    /// A uniformly distributed unit vector.
    pub fn direction(&mut self) -> DVec3 {
        let (height, turn) = (2.0 * self.unit() - 1.0, TAU * self.unit());
        let width = (1.0 - height * height).sqrt();
        DVec3::new(width * turn.cos(), width * turn.sin(), height)
    }
}
