//! The screen-grid search on the CPU: sixteen points at a time.

use std::ops::Range;

use rayon::prelude::*;

use super::window::Window;
use crate::camera::View;
use crate::project::{ScreenPoint, ScreenPoints};
use crate::search::{
    EarlyEnd, LANES, Lanes, MAX_CANDIDATES, NeighborhoodBlock, Neighborhoods, SearchCounts, SearchRules,
};

/// Blocks per task: enough to hide its start, few enough to share out evenly.
const TASK_BLOCKS: usize = 64;
/// The first window holds spheres of this many first search radii: most points find their k neighbours in it.
const FIRST_REACH: f32 = 1.3;
/// A radius that has to grow grows at least by this factor.
const LEAST_GROWTH: f32 = 1.3;
/// Threshold moves after which the k-th smallest distance is given up to the interval's upper end. Every other move
/// halves the interval of floats, so that this many always suffice.
const MOST_MOVES: usize = 80;

/// Finds the neighbourhoods of `queries`, indices of screen points, ascending.
pub(crate) fn search(
    screen: &ScreenPoints,
    queries: &[u32],
    view: &View,
    rules: &SearchRules,
    neighborhoods: &mut Neighborhoods,
) {
    neighborhoods.blocks.resize(queries.len().div_ceil(LANES), NeighborhoodBlock::default());
    neighborhoods.counts = neighborhoods
        .blocks
        .par_chunks_mut(TASK_BLOCKS)
        .zip(queries.par_chunks(TASK_BLOCKS * LANES))
        .map_init(Scratch::default, |scratch, (blocks, queries)| {
            search_blocks(&Task { screen, view, rules }, queries, blocks, scratch)
        })
        .reduce(SearchCounts::default, |a, b| a + b);
}

/// What all blocks share.
#[derive(Clone, Copy)]
struct Task<'a> {
    screen: &'a ScreenPoints,
    view: &'a View,
    rules: &'a SearchRules,
}

/// Memory of one thread.
#[derive(Default)]
struct Scratch {
    /// The current window's screen points.
    runs: Vec<Range<usize>>,
    /// Squared distance of each candidate to each of the sixteen points.
    squared: Vec<Lanes>,
    /// Squared distances of one lane, sorted.
    sorted: Vec<f32>,
}

/// Sixteen points and how far each has got.
struct Block {
    position: [Lanes; 3],
    /// r̃₀ [Paper, §5.1].
    initial_radius: Lanes,
    /// The window holds every point within this radius, once it has been read.
    radius: Lanes,
    /// Neighbours up to this squared distance are summed.
    threshold: Lanes,
    pending: [bool; LANES],
}

#[multiversion::multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl+avx2+bmi1+bmi2+lzcnt+popcnt",
    "x86_64+avx2+bmi1+bmi2+lzcnt+popcnt",
))]
fn search_blocks(task: &Task, queries: &[u32], out: &mut [NeighborhoodBlock], scratch: &mut Scratch) -> SearchCounts {
    let mut counts = SearchCounts::default();
    for (queries, out) in queries.chunks(LANES).zip(out) {
        search_block(task, queries, out, scratch, &mut counts);
    }
    counts
}

#[inline(always)]
fn search_block(
    task: &Task,
    queries: &[u32],
    out: &mut NeighborhoodBlock,
    scratch: &mut Scratch,
    counts: &mut SearchCounts,
) {
    let Task { screen, view, rules } = *task;
    let mut block = Block::new(task, queries);
    while block.pending.contains(&true) {
        let (window, group) = block.next_window(task);
        scratch.runs.clear();
        scratch.runs.extend(window.runs(&screen.cells).filter(|run| !run.is_empty()));
        let everything = window.is_all(view);
        squared_distances(&block.position, &screen.points, &scratch.runs, &mut scratch.squared);
        let enough = scratch.squared.len() > rules.k as usize;
        if enough {
            kth_smallest(&scratch.squared, rules.k, &group, &mut block.threshold);
        }
        let inside = block.spheres_inside(&window, view);
        let mut done = [false; LANES];
        for lane in (0..LANES).filter(|&lane| group[lane]) {
            let exact = enough & (inside[lane] | everything);
            let kth_radius = block.threshold.0[lane].sqrt();
            let initial_radius = block.initial_radius.0[lane];
            // From r̃₀ on no gap of factor √λ fits below this radius, so that the rules need not be looked at.
            let ruled = rules.gap_factor.is_some_and(|gap| kth_radius > gap.sqrt() * initial_radius)
                | (kth_radius > rules.outlier_radius(initial_radius));
            if exact & !ruled {
                done[lane] = true;
                continue;
            }
            let known = if everything {
                f32::INFINITY
            } else if exact {
                kth_radius
            } else {
                block.radius.0[lane]
            };
            sort_lane(&scratch.squared, lane, known, &mut scratch.sorted);
            let end = rules.early_end(&scratch.sorted, initial_radius, known);
            let found = scratch.sorted.len();
            done[lane] = match end {
                Some(EarlyEnd::Outlier) => {
                    counts.outliers += usize::from(lane < queries.len());
                    block.threshold.0[lane] = 0.0;
                    true
                }
                Some(EarlyEnd::Gap(neighbors)) => {
                    counts.clamped += usize::from(lane < queries.len());
                    block.threshold.0[lane] = scratch.sorted[neighbors - 1];
                    true
                }
                None if exact => true,
                None => {
                    let growth = (rules.k as f32 / found.max(1) as f32).sqrt().max(LEAST_GROWTH);
                    // What was read bounds the k-radius, but across a depth step only loosely.
                    let grown = known * growth;
                    let next = if enough { kth_radius.min(2.0 * grown) } else { grown };
                    let next_window = Window::of_sphere(block.center(lane), next, view);
                    let stop = everything || next_window.candidates(&screen.cells) > MAX_CANDIDATES;
                    if stop {
                        let real = usize::from(lane < queries.len());
                        counts.bounded += if everything { 0 } else { real };
                        // Without any neighbour there is nothing to keep.
                        *(if found == 0 { &mut counts.outliers } else { &mut counts.clamped }) += real;
                        block.threshold.0[lane] = scratch.sorted.last().copied().unwrap_or(0.0);
                    } else {
                        block.radius.0[lane] = next;
                    }
                    stop
                }
            };
        }
        if done.contains(&true) {
            sum_moments(&block, &screen.points, scratch, &done, out);
            for lane in 0..LANES {
                block.pending[lane] &= !done[lane];
            }
        }
    }
}

impl Block {
    #[inline(always)]
    fn new(task: &Task, queries: &[u32]) -> Self {
        let Task { screen, view, rules } = *task;
        let mut block = Self {
            position: [Lanes::default(); 3],
            initial_radius: Lanes::default(),
            radius: Lanes::default(),
            threshold: Lanes::default(),
            pending: [true; LANES],
        };
        for lane in 0..LANES {
            let query = queries[lane.min(queries.len() - 1)];
            let point = &screen.points[query as usize];
            for axis in 0..3 {
                block.position[axis].0[lane] = point.position_view[axis];
            }
            let radius = screen.density.initial_radius(point, rules.k, view);
            block.initial_radius.0[lane] = radius;
            block.radius.0[lane] = FIRST_REACH * radius;
            block.threshold.0[lane] = radius * radius;
            block.pending[lane] = lane < queries.len();
        }
        block
    }

    #[inline(always)]
    fn center(&self, lane: usize) -> [f32; 3] {
        [self.position[0].0[lane], self.position[1].0[lane], self.position[2].0[lane]]
    }

    /// The window to read next and the lanes it serves.
    #[inline(always)]
    fn next_window(&self, task: &Task) -> (Window, [bool; LANES]) {
        let Task { screen, view, .. } = *task;
        let mut union = Window::EMPTY;
        let mut first = None;
        for lane in (0..LANES).filter(|&lane| self.pending[lane]) {
            let window = Window::of_sphere(self.center(lane), self.radius.0[lane], view);
            union = union.union(window);
            first = first.or(Some((lane, window)));
        }
        let union = union.to_strips(&screen.cells, view);
        // Points far apart share a block where the screen is sparse; what lies between them concerns none of them.
        if let Some((lane, window)) = first
            && union.candidates(&screen.cells) > 2 * MAX_CANDIDATES
        {
            let mut group = [false; LANES];
            group[lane] = true;
            return (window.to_strips(&screen.cells, view), group);
        }
        (union, self.pending)
    }

    /// For each lane, whether the sphere up to its threshold projects into the window.
    #[inline(always)]
    fn spheres_inside(&self, window: &Window, view: &View) -> [bool; LANES] {
        let mut inside = [false; LANES];
        for lane in 0..LANES {
            let sphere = Window::of_sphere(self.center(lane), self.threshold.0[lane].sqrt(), view);
            inside[lane] = window.contains(&sphere);
        }
        inside
    }
}

/// Squared distances from each candidate to each of the sixteen points.
#[inline(always)]
fn squared_distances(position: &[Lanes; 3], points: &[ScreenPoint], runs: &[Range<usize>], squared: &mut Vec<Lanes>) {
    let len = runs.iter().map(Range::len).sum();
    // Every entry is overwritten below.
    squared.resize(len, Lanes::default());
    let [x, y, z] = *position;
    let mut rest = squared.as_mut_slice();
    for run in runs {
        let (out, after) = rest.split_at_mut(run.len());
        rest = after;
        for (out, point) in out.iter_mut().zip(&points[run.clone()]) {
            let [qx, qy, qz] = point.position_view;
            for lane in 0..LANES {
                let [dx, dy, dz] = [qx - x.0[lane], qy - y.0[lane], qz - z.0[lane]];
                out.0[lane] = dx * dx + dy * dy + dz * dz;
            }
        }
    }
}

/// Moves the threshold of each lane in `group` to its k-th smallest squared distance, the point itself not counted.
///
/// `threshold` holds first guesses; there are more than `k` candidates.
#[inline(always)]
fn kth_smallest(squared: &[Lanes], k: u32, group: &[bool; LANES], threshold: &mut Lanes) {
    // The point itself is among the candidates, at distance 0.
    let target = k + 1;
    let mut low = [0f32; LANES];
    let mut high = [f32::INFINITY; LANES];
    let mut low_count = [1u32; LANES];
    let mut high_count = [squared.len() as u32; LANES];
    let mut at = *threshold;
    let mut open = *group;
    for step in 0..MOST_MOVES {
        let count = count_below(squared, &at);
        let mut any_open = false;
        for lane in 0..LANES {
            if !open[lane] {
                continue;
            }
            let [t, n] = [at.0[lane], count[lane] as f32];
            if count[lane] == target {
                open[lane] = false;
                continue;
            }
            if count[lane] < target {
                (low[lane], low_count[lane]) = (t, count[lane]);
            } else {
                (high[lane], high_count[lane]) = (t, count[lane]);
            }
            let [below, above] = [low[lane], high[lane]];
            let [below_bits, above_bits] = [below.to_bits(), above.to_bits()];
            if above_bits - below_bits <= 1 {
                // Several candidates at the same distance: all of them belong.
                at.0[lane] = above;
                open[lane] = false;
                continue;
            }
            any_open = true;
            // On a surface the count grows with the area, so with the squared distance; in odd steps it need not.
            let next = if above == f32::INFINITY {
                t * (target as f32 / n * 1.1).clamp(1.2, 4.0)
            } else if step < 6 || step % 2 == 0 {
                let share =
                    (target as f32 - 0.5 - low_count[lane] as f32) / (high_count[lane] as f32 - low_count[lane] as f32);
                below + (above - below) * share
            } else {
                f32::from_bits(below_bits + (above_bits - below_bits) / 2)
            };
            let inner = f32::from_bits(below_bits + 1)..=f32::from_bits(above_bits - 1);
            at.0[lane] = next.clamp(*inner.start(), *inner.end());
        }
        if !any_open {
            break;
        }
    }
    // The largest distance not above the threshold is the k-th smallest itself.
    let mut largest = [0f32; LANES];
    for candidate in squared {
        for lane in 0..LANES {
            let d = candidate.0[lane];
            largest[lane] = if (d <= at.0[lane]) & (d > largest[lane]) { d } else { largest[lane] };
        }
    }
    for lane in 0..LANES {
        threshold.0[lane] = if group[lane] { largest[lane] } else { threshold.0[lane] };
    }
}

/// How many candidates lie at or below each lane's threshold.
#[inline(always)]
fn count_below(squared: &[Lanes], threshold: &Lanes) -> [u32; LANES] {
    let mut count = [0u32; LANES];
    for candidate in squared {
        for lane in 0..LANES {
            count[lane] += u32::from(candidate.0[lane] <= threshold.0[lane]);
        }
    }
    count
}

/// Squared distances of `lane` up to distance `known`, the point itself left out, ascending.
fn sort_lane(squared: &[Lanes], lane: usize, known: f32, sorted: &mut Vec<f32>) {
    sorted.clear();
    sorted.extend(squared.iter().map(|candidate| candidate.0[lane]).filter(|&d| d <= known * known && d > 0.0));
    sorted.sort_unstable_by(f32::total_cmp);
}

/// Sums the neighbours below the threshold of each lane in `done`.
#[inline(always)]
fn sum_moments(
    block: &Block,
    points: &[ScreenPoint],
    scratch: &Scratch,
    done: &[bool; LANES],
    out: &mut NeighborhoodBlock,
) {
    let [x, y, z] = block.position;
    let mut sum = NeighborhoodBlock::default();
    let mut squared = scratch.squared.iter();
    for run in &scratch.runs {
        for (point, d) in points[run.clone()].iter().zip(squared.by_ref()) {
            let [qx, qy, qz] = point.position_view;
            for lane in 0..LANES {
                // The point itself adds nothing to the sums.
                let within = d.0[lane] <= block.threshold.0[lane];
                let dx = if within { qx - x.0[lane] } else { 0.0 };
                let dy = if within { qy - y.0[lane] } else { 0.0 };
                let dz = if within { qz - z.0[lane] } else { 0.0 };
                sum.count.0[lane] += if within { 1.0 } else { 0.0 };
                sum.offset[0].0[lane] += dx;
                sum.offset[1].0[lane] += dy;
                sum.offset[2].0[lane] += dz;
                sum.second[0].0[lane] += dx * dx;
                sum.second[1].0[lane] += dx * dy;
                sum.second[2].0[lane] += dx * dz;
                sum.second[3].0[lane] += dy * dy;
                sum.second[4].0[lane] += dy * dz;
                sum.second[5].0[lane] += dz * dz;
            }
        }
    }
    for lane in (0..LANES).filter(|&lane| done[lane]) {
        out.count.0[lane] = sum.count.0[lane] - 1.0;
        out.k_radius.0[lane] = block.threshold.0[lane].sqrt();
        for axis in 0..3 {
            out.offset[axis].0[lane] = sum.offset[axis].0[lane];
        }
        for term in 0..6 {
            out.second[term].0[lane] = sum.second[term].0[lane];
        }
    }
}
