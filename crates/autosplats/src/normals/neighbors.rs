//! The k nearest neighbours of the sixteen points of a leaf, from one list of candidates.
//!
//! # How it works
//! The list is of all points within some radius of the box of the points searched for. Distances are rounded the same way
//! from a box as from a point in it, each step of them never falling as coordinates move apart; so what lies within the radius
//! of a point by the computed distance is on the list, and no margin is needed.

use pulp::Simd;

use super::nearest::Nearest;
use super::tree::{Bounds, Leaf, Tree};
use crate::search::moments::{squared_distances, sum_moments};
use crate::search::select::{GROUP, kth_smallest};
use crate::search::{LANES, Lanes, NeighborhoodBlock};

/// The first radius is the k-radius expected times this. 1.3 to 1.7 take the same time within 5 %.
const FIRST_REACH: f32 = 1.35;
/// Mean k-radius that a task expects at first, in those that the size of a leaf suggests: the mean of scanned surfaces.
const START_REACH: f32 = 0.9;
/// Least and most that is expected.
const REACH: [f32; 2] = [0.3, 3.0];
/// A radius with too few candidates grows by the first factor, one with enough for some by the second at most.
const GROWTH: [f32; 2] = [2.0, 1.6];
/// Lists read for one leaf before what is left is searched for alone.
const MOST_LISTS: usize = 8;

/// Candidates that a list may hold: more than twice what a surface or a volume of even density needs.
const fn most_candidates(k: u32) -> usize {
    8 * (k as usize + LANES) + 256
}

/// Memory of one thread.
#[derive(Default)]
pub(super) struct Scratch {
    candidates: Vec<[f32; 3]>,
    /// Squared distance of each candidate to each of the sixteen points.
    squared: Vec<Lanes>,
    nearest: Nearest,
    /// Mean k-radius of the leaf before, in those that the size of a leaf suggests. A guess: it decides what is read first,
    /// not what is found.
    reach: f32,
}

impl Scratch {
    /// Tasks are cut the same for any number of threads, and so must be what they start from.
    pub(super) fn start_task(&mut self) {
        self.reach = START_REACH;
    }
}

/// Finds the neighbourhoods of the points of `leaf`. There are more than `k` points.
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
    // Where the points coincide nothing is expected.
    let lists = if threshold.0[0] < f32::MIN_POSITIVE { 0 } else { MOST_LISTS };
    for _ in 0..lists {
        let squared_radius = radius * radius;
        let listed = list(simd, tree, &bounds, squared_radius, most_candidates(k), &mut scratch.candidates);
        let Some(listed) = listed else {
            radius *= 0.5;
            continue;
        };
        if listed <= k as usize {
            radius *= GROWTH[0];
            continue;
        }
        let candidates = &scratch.candidates[..listed.next_multiple_of(GROUP)];
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
        // What was read bounds the k-radius, but for a point apart from the others only loosely.
        radius = (furthest.sqrt() * 1.0001).min(GROWTH[1] * radius);
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
        let [least, most] = REACH;
        scratch.reach = (mean / suggested).clamp(least, most);
    }
    out
}

/// The positions of a leaf of so many points; the last one is repeated.
#[inline(always)]
fn positions(leaf: &Leaf, points: usize) -> [Lanes; 3] {
    let mut position = leaf.position;
    for axis in &mut position {
        let last = axis.0[points - 1];
        axis.0[points..].fill(last);
    }
    position
}

/// The k-radius to expect of a point of a leaf whose points are a surface or a line.
#[inline(always)]
fn suggested_radius(bounds: &Bounds, points: usize, k: u32) -> f32 {
    let [x, y, z] = bounds.extent();
    let area = x * y + y * z + z * x;
    let surface = (area * k as f32 / points as f32 * std::f32::consts::FRAC_1_PI).sqrt();
    surface.max(0.05 * (x + y + z))
}

/// Lists the points within a distance, given `squared`, of `bounds` at the front of `candidates`, in the tree's order, and returns their
/// number; a group of points infinitely far follows. `None` if there are more than `most`.
#[inline(always)]
fn list<S: Simd>(
    simd: S,
    tree: &Tree,
    bounds: &Bounds,
    squared: f32,
    most: usize,
    candidates: &mut Vec<[f32; 3]>,
) -> Option<usize> {
    if candidates.len() < most + LANES + GROUP {
        candidates.resize(most + LANES + GROUP, [0.0; 3]);
    }
    let mut len = 0;
    // Seven levels hold every cloud; each leaves fifteen children waiting at most.
    let mut stack = [(0u32, 0u32); 128];
    stack[0] = (tree.levels.len() as u32 - 1, 0);
    let mut depth = 1;
    while depth > 0 {
        depth -= 1;
        let (level, node) = stack[depth];
        let near = tree.levels[level as usize][node as usize].squared_distances(simd, bounds);
        if level > 0 {
            for lane in (0..LANES).rev() {
                // Written first and counted after: whether a node is near enough is anybody's guess.
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
    candidates[len..len + GROUP].fill([f32::INFINITY; 3]);
    Some(len)
}
