//! Counter-based random numbers: a counter gives the same numbers on every thread.

use autosplats::cloud::{Random, glam::DVec3};

/// The random numbers of item `counter` of a seed.
pub fn random(seed: u64, counter: usize) -> Random {
    let mut start = Random::from_state(counter as u64 ^ seed.wrapping_mul(0xD6E8_FEB8_6659_FD93));
    Random::from_state(start.bits())
}

/// Three independent numbers of [`Random::normal`].
pub fn normal3(random: &mut Random) -> DVec3 {
    DVec3::from([(); 3].map(|()| random.normal()))
}

#[test]
fn normal_has_mean_0_and_deviation_1() {
    let values: Vec<f64> = (0..20_000).map(|i| random(7, i).normal()).collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let square = values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64;
    assert!(mean.abs() < 0.02 && (square - 1.0).abs() < 0.03, "mean {mean}, mean square {square}");
}
