//! Spacing of points, measured at samples with a k-d tree over all points.

use std::f64::consts::PI;

use autosplats_cloud::{PointCloud, Random};
use rayon::prelude::*;
use serde::Serialize;

/// Memory in bytes per point of the tree, or of the sorting that finds duplicates.
pub(super) const BYTES_PER_POINT: u64 = 18;

/// Most points at which spacing and density are measured.
const MAX_SAMPLES: usize = 10_000;

/// Number of neighbours that the density is measured with.
const DENSITY_NEIGHBORS: usize = 12;

/// Most points of a leaf.
const MAX_LEAF_POINTS: usize = 16;

/// Least number of points of a subtree that is worth another thread.
const MIN_PARALLEL_POINTS: usize = 1 << 14;

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
    let finite = |&(position, _): &([f32; 3], u32)| position.iter().all(|value| value.is_finite());
    let numbered = cloud.positions().par_iter().enumerate().map(|(i, position)| (*position, i as u32));
    let mut points: Vec<_> = numbered.filter(finite).collect();
    if points.len() < 2 || u32::try_from(cloud.len()).is_err() {
        return (None, None);
    }
    // One random sample from each of equally many parts, in the file's order.
    let samples = points.len().min(MAX_SAMPLES);
    let part = |i: usize| (points.len() as u128 * i as u128 / samples as u128) as usize;
    let sampled: Vec<_> = (0..samples)
        .map(|i| {
            let (start, end) = (part(i), part(i + 1));
            points[start + Random::from_state(i as u64).modulo(end - start)]
        })
        .collect();

    let tree = Tree::new(&mut points);
    let count = DENSITY_NEIGHBORS.min(points.len() - 1);
    let distances: Vec<(f64, f64)> = sampled
        .par_iter()
        .map(|&(position, index)| {
            let mut nearest = Nearest { position, index, count, found: Vec::with_capacity(count + 1) };
            tree.search(&points, &mut nearest);
            // The search uses f32 coordinates; the found distances are measured in f64.
            let own = cloud.world_position(index as usize);
            let mut exact: Vec<f64> =
                nearest.found.iter().map(|&(_, i)| cloud.world_position(i as usize).distance(own)).collect();
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

/// A k-d tree over a slice of points that it has reordered. Each half of a node's points belongs to one child.
enum Tree {
    Leaf,
    Node { axis: usize, split: f32, children: Box<[Self; 2]> },
}

impl Tree {
    fn new(points: &mut [([f32; 3], u32)]) -> Self {
        if points.len() <= MAX_LEAF_POINTS {
            return Self::Leaf;
        }
        let (mut min, mut max) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for (position, _) in points.iter() {
            for axis in 0..3 {
                min[axis] = min[axis].min(position[axis]);
                max[axis] = max[axis].max(position[axis]);
            }
        }
        let extent = |axis: &usize| max[*axis] - min[*axis];
        let axis = (0..3).max_by(|a, b| extent(a).total_cmp(&extent(b))).unwrap_or(0);
        let middle = points.len() / 2;
        points.select_nth_unstable_by(middle, |a, b| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1)));
        let split = points[middle].0[axis];
        let (low, high) = points.split_at_mut(middle);
        let children = if low.len() >= MIN_PARALLEL_POINTS {
            rayon::join(|| Self::new(low), || Self::new(high))
        } else {
            (Self::new(low), Self::new(high))
        };
        Self::Node { axis, split, children: Box::new([children.0, children.1]) }
    }

    /// Searches the neighbours among `points`, the slice that the tree was made over.
    fn search(&self, points: &[([f32; 3], u32)], nearest: &mut Nearest) {
        match self {
            Self::Leaf => points.iter().for_each(|point| nearest.see(*point)),
            Self::Node { axis, split, children } => {
                let (low, high) = points.split_at(points.len() / 2);
                let beyond = f64::from(nearest.position[*axis]) - f64::from(*split);
                let order = if beyond < 0.0 { [(0, low), (1, high)] } else { [(1, high), (0, low)] };
                children[order[0].0].search(order[0].1, nearest);
                if beyond * beyond <= nearest.bound() {
                    children[order[1].0].search(order[1].1, nearest);
                }
            }
        }
    }
}

/// The nearest points found so far, by squared distance.
struct Nearest {
    position: [f32; 3],
    index: u32,
    count: usize,
    found: Vec<(f64, u32)>,
}

impl Nearest {
    /// Squared distance above which points are ignored.
    fn bound(&self) -> f64 {
        if self.found.len() < self.count { f64::INFINITY } else { self.found[self.count - 1].0 }
    }

    fn see(&mut self, (position, index): ([f32; 3], u32)) {
        let square = |axis: usize| (f64::from(position[axis]) - f64::from(self.position[axis])).powi(2);
        let distance = square(0) + square(1) + square(2);
        if index == self.index || distance >= self.bound() {
            return;
        }
        let place = self.found.partition_point(|(other, _)| *other <= distance);
        self.found.insert(place, (distance, index));
        self.found.truncate(self.count);
    }
}

#[cfg(test)]
mod tests {
    use autosplats_cloud::glam::DVec3;

    use super::*;

    fn random(count: u64) -> Vec<[f32; 3]> {
        let unit = |seed: u64| (Random::from_state(seed).bits() >> 40) as f32 / (1 << 24) as f32;
        (0..count).map(|i| [unit(3 * i) * 10.0, unit(3 * i + 1), 0.1 * unit(3 * i + 2)]).collect()
    }

    #[test]
    fn the_tree_finds_what_looking_at_all_finds() {
        let mut positions = random(40_000);
        // Add many points at one position, and more of equal x.
        positions.extend([[5.0, 0.5, 0.05]; 100]);
        positions.extend((0..500).map(|i| [5.0, i as f32 / 500.0, 0.0]));
        let mut points: Vec<_> = positions.iter().zip(0..).map(|(position, i)| (*position, i)).collect();
        let asked: Vec<_> = points.iter().copied().step_by(97).collect();
        let tree = Tree::new(&mut points);
        for (position, index) in asked {
            let nearest = || Nearest { position, index, count: 5, found: Vec::new() };
            let (mut fast, mut slow) = (nearest(), nearest());
            tree.search(&points, &mut fast);
            points.iter().for_each(|point| slow.see(*point));
            let distances = |nearest: Nearest| nearest.found.iter().map(|(distance, _)| *distance).collect::<Vec<_>>();
            assert_eq!(distances(fast), distances(slow), "around point {index}");
        }
    }

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
