//! Spacing of points, measured at samples with a k-d tree over all points.

use std::{collections::HashMap, f64::consts::PI, num::NonZero, sync::Mutex};

use autosplats_cloud::{
    Clouds, Error, Part, PointCloud, Progress, Random, Spill, SpillCell, Tile, Tiles, glam::DVec3, lock,
};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use serde::Serialize;

use super::room::Room;

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

/// Number of points at places of others from which places are searched, and not points: a search that ends in a pile of
/// equal points looks at all of them.
const PILED: u64 = 1 << 10;

/// Points that are searched by their places.
struct Places<'a> {
    points: &'a [[f32; 3]],
    tree: ImmutableKdTree<f32, 3>,
    /// The points, place by place, and where those of each place begin; `None` if each point is a place.
    piles: Option<[Vec<u32>; 2]>,
}

impl<'a> Places<'a> {
    /// `None` if no tree can be made. If not `piled`, each point is a place.
    fn of(points: &'a [[f32; 3]], piled: bool) -> Option<Self> {
        let tree_of = |places: &[[f32; 3]]| ImmutableKdTree::<f32, 3>::new_from_slice(places).ok();
        let len = u32::try_from(points.len()).ok()?;
        if !piled {
            return Some(Self { points, tree: tree_of(points)?, piles: None });
        }
        // Adding 0 turns -0 into 0.
        let bits = |index: u32| points[index as usize].map(|along| (along + 0.0).to_bits());
        let mut order: Vec<u32> = (0..len).collect();
        order.par_sort_unstable_by_key(|&index| (bits(index), index));
        let begins = |&at: &u32| at == 0 || bits(order[at as usize - 1]) != bits(order[at as usize]);
        let mut starts: Vec<u32> = (0..len).into_par_iter().filter(begins).collect();
        let places: Vec<[f32; 3]> = starts.par_iter().map(|&at| points[order[at as usize] as usize]).collect();
        starts.push(len);
        Some(Self { points, tree: tree_of(&places)?, piles: Some([order, starts]) })
    }

    /// The `count` points nearest to point `own`, itself not counted, from near to far.
    fn nearest(&self, own: usize, count: usize) -> Vec<usize> {
        // Each place has a point at least, and one of them is the point itself.
        let asked = NonZero::<usize>::MIN.saturating_add(count);
        let found = self.tree.query(&self.points[own]).nearest_n::<SquaredEuclidean<f32>>(asked).execute();
        let at_place = |place: usize| match &self.piles {
            None => place..place + 1,
            Some([_, starts]) => starts[place] as usize..starts[place + 1] as usize,
        };
        let point = |at: usize| self.piles.as_ref().map_or(at, |[order, _]| order[at] as usize);
        let all = found.iter().flat_map(|found| at_place(found.item as usize)).map(point);
        all.filter(|&other| other != own).take(count).collect()
    }
}

/// Measures at up to [`MAX_SAMPLES`] points spread over the cloud, in which so many points are at places of others. The
/// choice of samples is deterministic.
pub(super) fn measure(cloud: &PointCloud, duplicates: u64) -> (Option<Spacing>, Option<Density>) {
    let Ok(len) = u32::try_from(cloud.len()) else { return (None, None) };
    let factor = cloud.computing_scale();
    let scaled = |index: u32| cloud.positions()[index as usize].map(|along| (f64::from(along) * factor) as f32);
    let near = |&index: &u32| scaled(index).iter().all(|value| value.abs() < MAX_COORDINATE);
    let indices: Vec<u32> = (0..len).into_par_iter().filter(near).collect();
    let points: Vec<[f32; 3]> = indices.par_iter().map(|&index| scaled(index)).collect();
    if points.len() < 2 {
        return (None, None);
    }
    let samples = points.len().min(MAX_SAMPLES);
    let sample = samples_of(points.len());

    let Some(places) = Places::of(&points, duplicates >= PILED) else { return (None, None) };
    let count = DENSITY_NEIGHBORS.min(points.len() - 1);
    let distances: Vec<(f64, f64)> = (0..samples)
        .into_par_iter()
        .map(|i| {
            let own = sample(i);
            // The search uses f32 coordinates; the found distances are measured in f64.
            let place = |point: usize| cloud.world_position(indices[point] as usize);
            let others = places.nearest(own, count);
            let mut exact: Vec<f64> = others.iter().map(|&other| place(other).distance(place(own))).collect();
            exact.sort_unstable_by(f64::total_cmp);
            (exact[0], exact[count - 1])
        })
        .collect();

    of_distances(distances, count)
}

/// Spacing and density by the distances to the nearest and to the `count`-th neighbour at each sample.
fn of_distances(distances: Vec<(f64, f64)>, count: usize) -> (Option<Spacing>, Option<Density>) {
    let samples = distances.len();
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

/// The numbers of samples among so many points, in order: one random one from each of equally many parts.
fn samples_of(points: usize) -> impl Fn(usize) -> usize {
    let samples = points.min(MAX_SAMPLES);
    let part = move |i: usize| (points as u128 * i as u128 / samples as u128) as usize;
    move |i| part(i) + Random::from_state(i as u64).modulo(part(i + 1) - part(i))
}

/// Like [`measure`], of points that come in parts. Where memory holds too few points around a sample to be sure of its
/// neighbours, it is left out.
pub(super) fn measure_in_parts(
    clouds: &dyn Clouds,
    room: Option<&Room>,
    progress: &dyn Progress,
) -> Result<(Option<Spacing>, Option<Density>), Error> {
    let Some(room) = room else { return Ok((None, None)) };
    let most = (room.memory() / BYTES_PER_POINT).max(1) as usize;
    let part = |start: f32, len: f32| Part { whole: progress, start, len };
    let tiles = Tiles::new(clouds, (most / 4).max(1), &room.folder, room.memory() / 8, &part(0.0, 0.4))?;
    let points = tiles.points() as usize;
    if points < 2 {
        return Ok((None, None));
    }
    let sample = samples_of(points);
    let count = DENSITY_NEIGHBORS.min(points - 1);
    let wanted: Vec<usize> = (0..points.min(MAX_SAMPLES)).map(sample).collect();
    let own = indices_of(clouds, &tiles, &wanted, &part(0.4, 0.1))?;
    // The index of each sample that is sure of its neighbours, then their indices.
    let mut found: Vec<Vec<u64>> = Vec::new();
    for number in 0..tiles.len() {
        progress.tick(0.5 + 0.4 * number as f32 / tiles.len() as f32)?;
        let Some(tile) = tiles.load(number, 0.0, most)? else { continue };
        let (mut sure, need) = neighbors(&tile, tiles.area(number), &own, count);
        if need > 0.0
            && let Some(wider) = tiles.load(number, need, most)?
        {
            sure = neighbors(&wider, tiles.area(number), &own, count).0;
        }
        found.append(&mut sure);
    }
    let places = places_of(clouds, found.iter().flatten().copied().collect(), &part(0.9, 0.1))?;
    let distances = found.iter().filter_map(|indices| {
        let own = places.get(&indices[0])?;
        let mut exact: Vec<f64> =
            indices[1..].iter().filter_map(|other| Some(places.get(other)?.distance(*own))).collect();
        exact.sort_unstable_by(f64::total_cmp);
        Some((*exact.first()?, *exact.get(count - 1)?))
    });
    let distances: Vec<(f64, f64)> = distances.collect();
    Ok(if distances.is_empty() { (None, None) } else { of_distances(distances, count) })
}

/// The indices of points by their numbers among those with a finite position. `wanted` does not fall.
fn indices_of(
    clouds: &dyn Clouds,
    tiles: &Tiles,
    wanted: &[usize],
    progress: &dyn Progress,
) -> Result<Vec<u64>, Error> {
    let (mut indices, mut number, mut index) = (Vec::with_capacity(wanted.len()), 0, 0_u64);
    clouds.read(progress, &mut |cloud| {
        for i in 0..cloud.len() {
            if tiles.has(cloud, i) {
                while wanted.get(indices.len()) == Some(&number) {
                    indices.push(index + i as u64);
                }
                number += 1;
            }
        }
        index += cloud.len() as u64;
        Ok(())
    })?;
    Ok(indices)
}

/// The neighbours of the samples in a tile that are sure of them, and the halo that the others need.
fn neighbors(tile: &Tile, area: [[f32; 3]; 2], samples: &[u64], count: usize) -> (Vec<Vec<u64>>, f32) {
    let own =
        tile.points.iter().enumerate().filter(|(_, point)| point.is_own && samples.binary_search(&point.index).is_ok());
    let own: Vec<usize> = own.map(|(place, _)| place).collect();
    let positions: Vec<[f32; 3]> = tile.points.iter().map(|point| point.position).collect();
    let infinite = || (Vec::new(), f32::INFINITY);
    if own.is_empty() {
        return (Vec::new(), 0.0);
    }
    if positions.len() <= count {
        return infinite();
    }
    let Some(places) = Places::of(&positions, true) else { return infinite() };
    let inside = |place: usize, [low, high]: [[f32; 3]; 2]| {
        let position = positions[place];
        let along = |axis: usize| (position[axis] - low[axis]).min(high[axis] - position[axis]);
        along(0).min(along(1)).min(along(2))
    };
    let each = own.par_iter().map(|&place| {
        let others = places.nearest(place, count);
        let apart = |&other: &usize| {
            let along = |axis: usize| positions[other][axis] - positions[place][axis];
            (along(0).powi(2) + along(1).powi(2) + along(2).powi(2)).sqrt()
        };
        // Rounding must not hide a neighbour.
        let reach = others.iter().map(apart).fold(0.0, f32::max) * 1.001;
        if reach < inside(place, tile.known) {
            let indices = std::iter::once(place).chain(others).map(|place| tile.points[place].index);
            (Some(indices.collect()), 0.0)
        } else {
            (None, reach - inside(place, area).min(reach))
        }
    });
    let (sure, needs): (Vec<Option<Vec<u64>>>, Vec<f32>) = each.unzip();
    (sure.into_iter().flatten().collect(), needs.into_iter().fold(0.0, f32::max))
}

/// The positions of points by their indices.
fn places_of(clouds: &dyn Clouds, mut wanted: Vec<u64>, progress: &dyn Progress) -> Result<HashMap<u64, DVec3>, Error> {
    wanted.sort_unstable();
    wanted.dedup();
    let mut places = HashMap::with_capacity(wanted.len());
    let (mut next, mut first) = (0, 0);
    clouds.read(progress, &mut |cloud| {
        let end = first + cloud.len() as u64;
        while let Some(&index) = wanted.get(next).filter(|&&index| index < end) {
            places.insert(index, cloud.world_position((index - first) as usize));
            next += 1;
        }
        first = end;
        Ok(())
    })?;
    Ok(places)
}

/// A 64-bit hash of a position; `None` if it is not finite.
fn hash(position: DVec3) -> Option<u64> {
    // Adding 0 turns -0 into 0.
    let hash = |hash: u64, value: f64| Random::from_state(hash ^ (value + 0.0).to_bits()).bits();
    position.is_finite().then(|| position.to_array().into_iter().fold(1, hash))
}

/// Number of hashes that are there already.
fn repeated(mut hashes: Vec<u64>) -> u64 {
    hashes.par_sort_unstable();
    hashes.par_windows(2).filter(|pair| pair[0] == pair[1]).count() as u64
}

/// Like [`duplicates`], of points that come in parts: hashes that begin alike wait together on the disk.
pub(super) fn duplicates_in_parts(
    clouds: &dyn Clouds,
    points: u64,
    room: Option<&Room>,
    progress: &dyn Progress,
) -> Result<u64, Error> {
    let Some(room) = room else { return Ok(0) };
    let parts = (points * 8).div_ceil((room.memory() / 4).max(1)).clamp(1, 1 << 12) as usize;
    let mut cells: Vec<Mutex<SpillCell>> = Vec::new();
    cells.resize_with(parts, Mutex::default);
    let spill = Spill::new(&room.folder, 8, parts, (room.memory() / 4) as usize)?;
    clouds.read(progress, &mut |cloud| {
        let mut hashes: Vec<u64> =
            (0..cloud.len()).into_par_iter().filter_map(|i| hash(cloud.world_position(i))).collect();
        let part = |hash: u64| ((u128::from(hash) * parts as u128) >> 64) as usize;
        hashes.par_sort_unstable();
        hashes.chunk_by(|&a, &b| part(a) == part(b)).try_for_each(|own| {
            let records: Vec<u8> = own.iter().flat_map(|hash| hash.to_le_bytes()).collect();
            spill.append(&cells, part(own[0]), &records)
        })
    })?;
    let mut all = 0;
    for cell in cells {
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        let cell = std::mem::take(&mut *lock(&cell));
        let mut hashes = Vec::with_capacity(cell.count as usize);
        spill.take(cell, |records| {
            hashes.extend(records.as_chunks().0.iter().map(|hash| u64::from_le_bytes(*hash)));
            Ok(())
        })?;
        all += repeated(hashes);
    }
    Ok(all)
}

/// Number of points at exactly the position of an earlier one, by a 64-bit hash of the coordinates.
pub(super) fn duplicates(cloud: &PointCloud) -> u64 {
    repeated((0..cloud.len()).into_par_iter().filter_map(|i| hash(cloud.world_position(i))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_has_its_spacing_and_density() {
        let grid = (0..40_000).map(|i| [(i % 200) as f32 * 0.5, (i / 200) as f32 * 0.5, 0.0]).collect();
        let (spacing, density) = measure(&PointCloud::new(DVec3::new(5e5, 5e6, 0.0), grid), 0);
        let spacing = spacing.expect("there are points");
        assert_eq!([spacing.median, spacing.p95, spacing.mean], [0.5; 3], "exactly");
        assert_eq!(spacing.samples, 10_000, "a part of them");
        // The twelfth neighbour on a grid is one of the four at two steps: 12 / (π 1²), for 4 points per square unit.
        assert_eq!(density.map(|density| density.median), Some(12.0 / PI), "points per square unit");
    }

    #[test]
    fn few_points() {
        let of = |points: &[[f32; 3]]| measure(&PointCloud::new(DVec3::ZERO, points.to_vec()), 0);
        assert_eq!(of(&[]), (None, None), "none");
        assert_eq!(of(&[[1.0; 3], [f32::NAN; 3]]), (None, None), "one that is somewhere");
        let (spacing, density) = of(&[[0.0; 3], [3.0, 4.0, 0.0]]);
        assert_eq!((spacing.map(|spacing| spacing.median), density), (Some(5.0), None), "two");
    }

    #[test]
    fn piles_of_equal_points_are_measured_as_other_points_are() {
        // Piles of up to 14 points on a line, so that neighbours lie in several piles.
        let pile = |i: usize| vec![[(i * i % 97) as f32, 0.0, -0.0]; 1 + i % 40 / 3];
        let points: Vec<[f32; 3]> = (0..300).flat_map(pile).collect();
        let cloud = PointCloud::new(DVec3::ZERO, points.clone());
        assert_eq!(measure(&cloud, PILED), measure(&cloud, 0), "either way");
        let places = Places::of(&points, true).expect("a tree");
        for own in (0..points.len()).step_by(7) {
            let apart = |other: &usize| (points[*other][0] - points[own][0]).abs();
            let mut nearest: Vec<f32> = (0..points.len()).filter(|&other| other != own).map(|i| apart(&i)).collect();
            nearest.sort_unstable_by(f32::total_cmp);
            let found: Vec<f32> = places.nearest(own, 30).iter().map(apart).collect();
            assert_eq!(found, nearest[..30], "as by trying all, of point {own}");
        }
    }

    #[test]
    fn equal_points_cost_no_more_than_others() {
        let cloud = PointCloud::new(DVec3::ZERO, vec![[1.0, 2.0, 3.0]; 1 << 20]);
        let begun = std::time::Instant::now();
        let (spacing, density) = measure(&cloud, duplicates(&cloud));
        assert_eq!((spacing.map(|spacing| spacing.p95), density), (Some(0.0), None), "all at one place");
        // A search through all points at each sample takes minutes.
        assert!(begun.elapsed().as_secs() < 30, "{:?}", begun.elapsed());
    }

    #[test]
    fn duplicates_are_counted_beyond_the_first() {
        let points = vec![[0.0; 3], [1.0; 3], [-0.0, 0.0, 0.0], [0.0; 3], [f32::NAN; 3], [f32::NAN; 3]];
        assert_eq!(duplicates(&PointCloud::new(DVec3::ZERO, points)), 2, "zero has two signs, NaN no place");
    }
}
