//! The k nearest neighbours of the sixteen points of a leaf, from one list of candidates.
//!
//! # How it works
//! The list holds all points within some radius of the box around the searched points. Distances from a box and from a
//! point inside are rounded alike. Each step is monotonic in the coordinates. So every point within the radius of a
//! searched point, by the computed distance, is on the list without a margin.

use pulp::Simd;

use super::boxes::Bounds;
use super::nearest::Nearest;
use super::tree::{Leaf, Tree};
use crate::search::moments::{squared_distances, sum_moments};
use crate::search::select::{CANDIDATE_GROUP, kth_smallest};
use crate::search::{LANES, Lanes, NeighborhoodBlock};

/// Radius of the first list over the expected k-radius. The time hardly depends on this value.
const FIRST_REACH: f32 = 1.35;
/// Mean k-radius expected at the start of a task, over [`suggested_radius`]: the mean of scanned surfaces.
const START_REACH: f32 = 0.9;
/// Least and largest expected k-radius, over [`suggested_radius`].
const EXPECTED_REACH_RANGE: [f32; 2] = [0.3, 3.0];
/// Least and largest growth of a radius with too few candidates. Between them, growth assumes points on a line.
const LIST_GROWTH_RANGE: [f32; 2] = [2.0, 8.0];
/// Largest growth of a radius with enough candidates for some points.
const LAST_GROWTH: f32 = 1.6;
/// Most lists for one leaf. The points left are searched for one by one.
const MOST_LISTS: usize = 8;

/// Most candidates of a list, well above what an even surface or volume needs.
const fn most_candidates(k: u32) -> usize {
    8 * (k as usize + LANES) + 256
}

/// Buffers of one thread.
#[derive(Default)]
pub(super) struct Scratch {
    candidates: Vec<[f32; 3]>,
    /// Squared distance of each candidate to each of the sixteen points.
    squared: Vec<Lanes>,
    nearest: Nearest,
    /// Mean k-radius of the last leaf, over [`suggested_radius`]. Affects what is read first, not the result.
    reach: f32,
}

impl Scratch {
    /// Resets the expectation, so that results do not depend on which thread ran which task.
    pub(super) fn start_task(&mut self) {
        self.reach = START_REACH;
    }
}

/// Finds the neighbourhoods of the points of `leaf`. The tree must have more than `k` points.
#[inline(always)]
pub(super) fn search_leaf<S: Simd>(
    simd: S,
    tree: &Tree,
    leaf: usize,
    k: u32,
    scratch: &mut Scratch,
) -> NeighborhoodBlock {
    let mut out = NeighborhoodBlock::default();
    if k == 0 {
        return out;
    }
    let points = tree.lanes(leaf);
    let position = positions(&tree.leaves[leaf], points);
    let mut bounds = tree.bounds(leaf);
    let suggested = suggested_radius(&bounds, points, k);
    let expected = scratch.reach * suggested;
    let mut radius = FIRST_REACH * expected;
    let mut threshold = Lanes([expected * expected; LANES]);
    let mut pending: [bool; LANES] = std::array::from_fn(|lane| lane < points);
    // Coinciding points give no expectation.
    let lists = if threshold.0[0] < f32::MIN_POSITIVE { 0 } else { MOST_LISTS };
    for _ in 0..lists {
        let squared_radius = radius * radius;
        let listed = list(simd, tree, &bounds, squared_radius, most_candidates(k), &mut scratch.candidates);
        let Some(listed) = listed else {
            radius *= 0.5;
            continue;
        };
        if listed <= k as usize {
            let [least, most] = LIST_GROWTH_RANGE;
            radius *= (k as f32 / listed.max(1) as f32).clamp(least, most);
            continue;
        }
        let candidates = &scratch.candidates[..listed.next_multiple_of(CANDIDATE_GROUP)];
        squared_distances(simd, &position, candidates, &mut scratch.squared);
        kth_smallest(simd, &scratch.squared, k, &pending, &mut threshold);
        let mut done = [false; LANES];
        let mut furthest = 0f32;
        for lane in 0..LANES {
            done[lane] = pending[lane] & (threshold.0[lane] <= squared_radius);
            pending[lane] &= !done[lane];
            furthest = if pending[lane] { furthest.max(threshold.0[lane]) } else { furthest };
        }
        sum_moments(simd, &position, &threshold, candidates, &scratch.squared, &done, &mut out);
        if !pending.contains(&true) {
            break;
        }
        // The candidates read bound the k-radius, though only loosely for a distant point.
        radius = (furthest.sqrt() * 1.0001).min(LAST_GROWTH * radius);
        bounds = Bounds::EMPTY;
        for lane in (0..points).filter(|&lane| pending[lane]) {
            bounds.include(tree.leaves[leaf].point(lane));
        }
    }
    for lane in (0..points).filter(|&lane| pending[lane]) {
        scratch.nearest.search(tree, tree.leaves[leaf].point(lane), k, lane, &mut out);
    }
    if lists > 0 {
        let mean = out.k_radius.0[..points].iter().sum::<f32>() / points as f32;
        let [least, most] = EXPECTED_REACH_RANGE;
        scratch.reach = (mean / suggested).clamp(least, most);
    }
    out
}

/// The positions of a leaf with `points` points; the last one is repeated.
#[inline(always)]
fn positions(leaf: &Leaf, points: usize) -> [Lanes; 3] {
    let mut position = leaf.position;
    for axis in &mut position {
        let last = axis.0[points - 1];
        axis.0[points..].fill(last);
    }
    position
}

/// The expected k-radius of a leaf's points, if they form a surface or a line.
#[inline(always)]
fn suggested_radius(bounds: &Bounds, points: usize, k: u32) -> f32 {
    let [x, y, z] = bounds.extent();
    let area = x * y + y * z + z * x;
    let surface = (area * k as f32 / points as f32 * std::f32::consts::FRAC_1_PI).sqrt();
    surface.max(0.05 * (x + y + z))
}

/// Lists the points within a `squared` distance of `bounds` in `candidates`, in the tree's order, and returns their
/// number. A group of infinitely distant points follows. `None` if there are more than `most`.
#[inline(always)]
fn list<S: Simd>(
    simd: S,
    tree: &Tree,
    bounds: &Bounds,
    squared: f32,
    most: usize,
    candidates: &mut Vec<[f32; 3]>,
) -> Option<usize> {
    if candidates.len() < most + LANES + CANDIDATE_GROUP {
        candidates.resize(most + LANES + CANDIDATE_GROUP, [0.0; 3]);
    }
    let mut len = 0;
    // Seven levels hold every cloud, and each leaves at most fifteen children waiting.
    let mut stack = [(0u32, 0u32); 128];
    stack[0] = (tree.levels.len() as u32 - 1, 0);
    let mut depth = 1;
    while depth > 0 {
        depth -= 1;
        let (level, node) = stack[depth];
        let near = tree.levels[level as usize][node as usize].squared_distances(simd, bounds);
        if level > 0 {
            for lane in (0..LANES).rev() {
                // Written first and counted after: a branch would be unpredictable.
                stack[depth] = (level - 1, node * LANES as u32 + lane as u32);
                depth += usize::from(near.0[lane] <= squared);
            }
            continue;
        }
        let mut hits = [0; LANES];
        let mut count = 0;
        for lane in 0..LANES {
            hits[count] = lane;
            count += usize::from(near.0[lane] <= squared);
        }
        for &lane in &hits[..count] {
            let leaf = &tree.leaves[node as usize * LANES + lane];
            let near = leaf.squared_distances(simd, bounds);
            for lane in 0..LANES {
                candidates[len] = leaf.point(lane);
                len += usize::from(near.0[lane] <= squared);
            }
            if len > most {
                return None;
            }
        }
    }
    candidates[len..len + CANDIDATE_GROUP].fill([f32::INFINITY; 3]);
    Some(len)
}
