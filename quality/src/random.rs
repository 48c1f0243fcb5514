//! Counter-based random numbers: a counter gives the same numbers on every thread.

use autosplats::cloud::glam::DVec3;

/// A stream of random numbers (splitmix64).
#[derive(Debug)]
pub struct Random(u64);

impl Random {
    /// The stream number `counter` of a seed.
    pub fn new(seed: u64, counter: usize) -> Self {
        let mut start = Self((counter as u64) ^ seed.wrapping_mul(0xD6E8_FEB8_6659_FD93));
        Self(start.bits())
    }

    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// A uniform number, at least 0 and below 1.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
    }

    /// A normally distributed number of mean 0 and standard deviation 1.
    pub fn gauss(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.unit()).cos()
    }

    /// Three independent numbers of [`gauss`](Self::gauss).
    pub fn gauss3(&mut self) -> DVec3 {
        DVec3::from([(); 3].map(|()| self.gauss()))
    }
}

#[test]
fn gauss_has_mean_0_and_deviation_1() {
    let values: Vec<f64> = (0..20_000).map(|i| Random::new(7, i).gauss()).collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let square = values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64;
    assert!(mean.abs() < 0.02 && (square - 1.0).abs() < 0.03, "mean {mean}, mean square {square}");
}
