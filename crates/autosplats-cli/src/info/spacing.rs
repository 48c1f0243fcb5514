//! Spacing of points, measured at samples with a k-d tree over all points.

use std::{f64::consts::PI, num::NonZero};

use autosplats_cloud::{PointCloud, Random};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use serde::Serialize;

/// Memory in bytes per point of the tree, or of the sorting that finds duplicates.
pub(super) const BYTES_PER_POINT: u64 = 40;

/// Most points at which spacing and density are measured.
const MAX_SAMPLES: usize = 10_000;

/// Number of neighbours that the density is measured with.
const DENSITY_NEIGHBORS: usize = 12;

/// Points with a coordinate beyond this, at the scale of computing, are left out: squares of their distances may exceed
/// `f32`.
const MAX_COORDINATE: f32 = 1e18;

/// Distance to the nearest other point, in the file's units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Spacing {
    pub(super) median: f64,
    pub(super) p5: f64,
    pub(super) p95: f64,
    pub(super) mean: f64,
    pub(super) samples: usize,
}

/// Points per square unit of the surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Density {
    pub(super) median: f64,
    pub(super) neighbors: usize,
    pub(super) samples: usize,
}

/// Measures at up to [`MAX_SAMPLES`] points spread over the cloud. The choice of samples is deterministic.
pub(super) fn measure(cloud: &PointCloud) -> (Option<Spacing>, Option<Density>) {
    let Ok(len) = u32::try_from(cloud.len()) else { return (None, None) };
    let factor = cloud.computing_scale();
    let scaled = |index: u32| cloud.positions()[index as usize].map(|along| (f64::from(along) * factor) as f32);
    let near = |&index: &u32| scaled(index).iter().all(|value| value.abs() < MAX_COORDINATE);
    let indices: Vec<u32> = (0..len).into_par_iter().filter(near).collect();
    let points: Vec<[f32; 3]> = indices.par_iter().map(|&index| scaled(index)).collect();
    if points.len() < 2 {
        return (None, None);
    }
    // One random sample from each of equally many parts, in the file's order.
    let samples = points.len().min(MAX_SAMPLES);
    let part = |i: usize| (points.len() as u128 * i as u128 / samples as u128) as usize;
    let sample = |i: usize| part(i) + Random::from_state(i as u64).modulo(part(i + 1) - part(i));

    let Ok(tree) = ImmutableKdTree::<f32, 3>::new_from_slice(&points) else { return (None, None) };
    let count = DENSITY_NEIGHBORS.min(points.len() - 1);
    let asked = NonZero::<usize>::MIN.saturating_add(count);
    let distances: Vec<(f64, f64)> = (0..samples)
        .into_par_iter()
        .map(|i| {
            let own = sample(i);
            let found = tree.query(&points[own]).nearest_n::<SquaredEuclidean<f32>>(asked).execute();
            // The search uses f32 coordinates; the found distances are measured in f64.
            let place = |point: usize| cloud.world_position(indices[point] as usize);
            // The point itself is found too, unless too many coincide with it.
            let others = found.iter().map(|found| found.item as usize).filter(|&other| other != own).take(count);
            let mut exact: Vec<f64> = others.map(|other| place(other).distance(place(own))).collect();
            exact.sort_unstable_by(f64::total_cmp);
            (exact[0], exact[count - 1])
        })
        .collect();

    let mut nearest: Vec<f64> = distances.iter().map(|(nearest, _)| *nearest).collect();
    nearest.sort_unstable_by(f64::total_cmp);
    let at = |fraction: f64| nearest[((nearest.len() - 1) as f64 * fraction).round() as usize];
    let mean = nearest.iter().sum::<f64>() / samples as f64;
    let spacing = Spacing { median: at(0.5), p5: at(0.05), p95: at(0.95), mean, samples };

    let mut densities: Vec<f64> = distances.iter().map(|(_, r)| count as f64 / (PI * r * r)).collect();
    densities.sort_unstable_by(f64::total_cmp);
    let median = densities[samples / 2];
    let density = Density { median, neighbors: count, samples };
    let finite = |spacing: &Spacing| spacing.mean.is_finite();
    (Some(spacing).filter(finite), Some(density).filter(|_| count == DENSITY_NEIGHBORS && median.is_finite()))
}

/// Number of points at exactly the position of an earlier one, by a 64-bit hash of the coordinates.
pub(super) fn duplicates(cloud: &PointCloud) -> u64 {
    let hash = |i: usize| {
        let position = cloud.world_position(i);
        // Adding 0 turns -0 into 0.
        let hash = |hash: u64, value: f64| Random::from_state(hash ^ (value + 0.0).to_bits()).bits();
        position.is_finite().then(|| position.to_array().into_iter().fold(1, hash))
    };
    let mut hashes: Vec<u64> = (0..cloud.len()).into_par_iter().filter_map(hash).collect();
    hashes.par_sort_unstable();
    hashes.par_windows(2).filter(|pair| pair[0] == pair[1]).count() as u64
}

#[cfg(test)]
mod tests {
    use autosplats_cloud::glam::DVec3;

    use super::*;

    #[test]
    fn a_grid_has_its_spacing_and_density() {
        let grid = (0..40_000).map(|i| [(i % 200) as f32 * 0.5, (i / 200) as f32 * 0.5, 0.0]).collect();
        let (spacing, density) = measure(&PointCloud::new(DVec3::new(5e5, 5e6, 0.0), grid));
        let spacing = spacing.expect("there are points");
        assert_eq!([spacing.median, spacing.p95, spacing.mean], [0.5; 3], "exactly");
        assert_eq!(spacing.samples, 10_000, "a part of them");
        // The twelfth neighbour on a grid is one of the four at two steps: 12 / (π 1²), for 4 points per square unit.
        assert_eq!(density.map(|density| density.median), Some(12.0 / PI), "points per square unit");
    }

    #[test]
    fn few_points() {
        let of = |points: &[[f32; 3]]| measure(&PointCloud::new(DVec3::ZERO, points.to_vec()));
        assert_eq!(of(&[]), (None, None), "none");
        assert_eq!(of(&[[1.0; 3], [f32::NAN; 3]]), (None, None), "one that is somewhere");
        let (spacing, density) = of(&[[0.0; 3], [3.0, 4.0, 0.0]]);
        assert_eq!((spacing.map(|spacing| spacing.median), density), (Some(5.0), None), "two");
    }

    #[test]
    fn duplicates_are_counted_beyond_the_first() {
        let points = vec![[0.0; 3], [1.0; 3], [-0.0, 0.0, 0.0], [0.0; 3], [f32::NAN; 3], [f32::NAN; 3]];
        assert_eq!(duplicates(&PointCloud::new(DVec3::ZERO, points)), 2, "zero has two signs, NaN no place");
    }
}
