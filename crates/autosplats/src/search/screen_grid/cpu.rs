//! The screen-grid search on the CPU: sixteen points at a time.

use pulp::Simd;
use rayon::prelude::*;

use super::window::Window;
use crate::camera::View;
use crate::project::ScreenPoints;
use crate::search::{
    EarlyEnd, LANES, Lanes, MAX_CANDIDATES, NeighborhoodBlock, Neighborhoods, SearchCounts, SearchRules,
};
use crate::simd::F32s;

/// Blocks per task: enough to hide its start, few enough to share out evenly.
const TASK_BLOCKS: usize = 64;
/// The first window holds spheres of this many k-radii, as those of late lead to expect: most points find their k
/// neighbours in it.
const FIRST_REACH: f32 = 1.3;
/// Range of the k-radius that is expected, in first search radii.
const EXPECTED: [f32; 2] = [0.5, 3.0];
/// Weight of the last block in what is expected of the next.
const NEWS: f32 = 0.3;
/// A radius that has to grow grows at least by this factor.
const LEAST_GROWTH: f32 = 1.3;
/// Candidates counted at a time, each into a sum of its own: one sum would wait for itself.
const GROUP: usize = 4;
/// A threshold with no more than this many candidates too many is near enough: the largest distances below it are listed.
const SURPLUS: usize = 3;
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
    candidates: Vec<[f32; 3]>,
    /// Squared distance of each candidate to each of the sixteen points.
    squared: Vec<Lanes>,
    /// Squared distances of one lane.
    listed: Vec<f32>,
    /// A task's queries, those in front of the culling planes first, and where each stands in the task.
    order: Vec<(u32, u32)>,
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

#[pulp::with_simd(search_blocks = pulp::Arch::new())]
#[inline(always)]
fn search_blocks_with<'a, S: Simd>(
    simd: S,
    task: &'a Task<'a>,
    queries: &'a [u32],
    out: &'a mut [NeighborhoodBlock],
    scratch: &'a mut Scratch,
) -> SearchCounts {
    let Task { screen, .. } = *task;
    // Points of different surfaces want different windows, in place and in size.
    let mut order = std::mem::take(&mut scratch.order);
    order.clear();
    let layer = |behind: bool| {
        let places = queries.iter().zip(0..).map(|(&query, place)| (query, place));
        places.filter(move |&(query, _)| screen.density.culls(&screen.points[query as usize]) == behind)
    };
    order.extend(layer(false));
    let front = order.len();
    order.extend(layer(true));

    let mut counts = SearchCounts::default();
    for layer in [&order[..front], &order[front..]] {
        let mut expected = 1.0;
        for places in layer.chunks(LANES) {
            let mut block = Block::new(task, places, expected);
            let mut found = NeighborhoodBlock::default();
            search_block(simd, task, &mut block, &mut found, scratch, &mut counts);
            expected += NEWS * (block.expected(&found, places.len()) - expected);
            for (lane, &(_, place)) in places.iter().enumerate() {
                let place = place as usize;
                out[place / LANES].set_lane(place % LANES, &found, lane);
            }
        }
    }
    scratch.order = order;
    counts
}

#[inline(always)]
fn search_block<S: Simd>(
    simd: S,
    task: &Task,
    block: &mut Block,
    out: &mut NeighborhoodBlock,
    scratch: &mut Scratch,
    counts: &mut SearchCounts,
) {
    let Task { screen, view, rules } = *task;
    while block.pending.contains(&true) {
        let (window, group) = block.next_window(task);
        let everything = window.is_all();
        let candidates = gather(screen, &window, &mut scratch.candidates);
        let padded = candidates.next_multiple_of(GROUP);
        squared_distances(simd, &block.position, &scratch.candidates[..padded], &mut scratch.squared);
        let enough = candidates > rules.k as usize;
        if enough {
            kth_smallest(simd, &scratch.squared, rules.k, &group, &mut block.threshold);
        }
        let inside = block.spheres_inside(&window, view);
        let within = block.count_within(simd, &scratch.squared);
        let mut done = [false; LANES];
        for lane in (0..LANES).filter(|&lane| group[lane]) {
            let exact = enough & (inside[lane] | everything);
            let kth_radius = block.threshold.0[lane].sqrt();
            let initial_radius = block.initial_radius.0[lane];
            if exact & !rules.may_end(initial_radius, kth_radius) {
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
            let mut found = within.0[lane] as usize;
            let mut end = None;
            if rules.may_end(initial_radius, known) {
                list_lane(&scratch.squared, lane, known, &mut scratch.listed);
                scratch.listed.sort_unstable_by(f32::total_cmp);
                end = rules.early_end(&scratch.listed, initial_radius, known);
                found = scratch.listed.len();
            }
            done[lane] = match end {
                Some(EarlyEnd::Outlier) => {
                    counts.outliers += 1;
                    block.threshold.0[lane] = 0.0;
                    true
                }
                Some(EarlyEnd::Gap(neighbors)) => {
                    counts.clamped += 1;
                    block.threshold.0[lane] = scratch.listed[neighbors - 1];
                    true
                }
                None if exact => true,
                None => {
                    let growth = (rules.k as f32 / found.max(1) as f32).sqrt().max(LEAST_GROWTH);
                    // What was read bounds the k-radius, but across a depth step only loosely.
                    let grown = known * growth;
                    let mut next = if enough { kth_radius.min(2.0 * grown) } else { grown };
                    let too_large = |radius: f32| {
                        let window = Window::of_sphere(block.center(lane), radius, view);
                        window.candidates(&screen.cells) > MAX_CANDIDATES
                    };
                    let mut stop = everything || too_large(next);
                    if stop & !everything {
                        // A smaller step may still find them.
                        next = next.min(LEAST_GROWTH * known);
                        stop = too_large(next);
                    }
                    if stop {
                        list_lane(&scratch.squared, lane, known, &mut scratch.listed);
                        counts.bounded += usize::from(!everything);
                        // Without any neighbour there is nothing to keep.
                        *(if scratch.listed.is_empty() { &mut counts.outliers } else { &mut counts.clamped }) += 1;
                        block.threshold.0[lane] = scratch.listed.iter().copied().fold(0.0, f32::max);
                    } else {
                        block.radius.0[lane] = next;
                    }
                    stop
                }
            };
        }
        if done.contains(&true) {
            sum_moments(simd, block, scratch, &done, out);
            for lane in 0..LANES {
                block.pending[lane] &= !done[lane];
            }
        }
    }
}

impl Block {
    #[inline(always)]
    fn new(task: &Task, places: &[(u32, u32)], expected: f32) -> Self {
        let Task { screen, view, rules } = *task;
        let mut block = Self {
            position: [Lanes::default(); 3],
            initial_radius: Lanes::default(),
            radius: Lanes::default(),
            threshold: Lanes::default(),
            pending: [true; LANES],
        };
        for lane in 0..LANES {
            let (query, _) = places[lane.min(places.len() - 1)];
            let point = &screen.points[query as usize];
            for axis in 0..3 {
                block.position[axis].0[lane] = point.position_view[axis];
            }
            let initial_radius = screen.density.initial_radius(point, rules.k, view);
            let radius = expected * initial_radius;
            block.initial_radius.0[lane] = initial_radius;
            block.radius.0[lane] = FIRST_REACH * radius;
            block.threshold.0[lane] = radius * radius;
            block.pending[lane] = lane < places.len();
        }
        block
    }

    /// Mean k-radius of the first `len` points, in first search radii.
    fn expected(&self, found: &NeighborhoodBlock, len: usize) -> f32 {
        let [least, most] = EXPECTED;
        let lanes = found.k_radius.0.iter().zip(&self.initial_radius.0).take(len);
        lanes.map(|(found, initial)| (found / initial).clamp(least, most)).sum::<f32>() / len as f32
    }

    /// How many candidates lie within the radius of each lane, the point itself not counted.
    #[inline(always)]
    fn count_within<S: Simd>(&self, simd: S, squared: &[Lanes]) -> Lanes {
        let mut count = count_below(simd, squared, &Lanes(self.radius.0.map(|radius| radius * radius)));
        count.0.iter_mut().for_each(|count| *count -= 1.0);
        count
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
        let union = union.grown(&screen.cells, view);
        // Points far apart share a block where the screen is sparse; what lies between them concerns none of them.
        if let Some((lane, window)) = first
            && union.candidates(&screen.cells) > 2 * MAX_CANDIDATES
        {
            let mut group = [false; LANES];
            group[lane] = true;
            return (window.grown(&screen.cells, view), group);
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

/// Lists the screen points in `window` at the front of `candidates` and returns their number; a group of points infinitely
/// far follows.
#[inline(always)]
fn gather(screen: &ScreenPoints, window: &Window, candidates: &mut Vec<[f32; 3]>) -> usize {
    let most = window.candidates(&screen.cells);
    if candidates.len() < most + GROUP {
        candidates.resize(most + GROUP, [0.0; 3]);
    }
    let mut len = 0;
    for run in window.runs(&screen.cells) {
        for point in &screen.points[run] {
            // Written first and counted after: whether a point lies within the depths is anybody's guess.
            candidates[len] = point.position_view;
            let depth = point.position_view[2];
            len += usize::from((window.near <= depth) & (depth <= window.far));
        }
    }
    candidates[len..len + GROUP].fill([f32::INFINITY; 3]);
    len
}

/// Vectors that sixteen lanes take.
const fn vectors<S: Simd>() -> usize {
    LANES / S::F32_LANES
}

/// Squared distances from each candidate to each of the sixteen points.
#[inline(always)]
fn squared_distances<S: Simd>(simd: S, position: &[Lanes; 3], candidates: &[[f32; 3]], squared: &mut Vec<Lanes>) {
    // Every entry is overwritten below.
    squared.resize(candidates.len(), Lanes::default());
    for vector in 0..vectors::<S>() {
        let [x, y, z] = [0, 1, 2].map(|axis: usize| F32s::load(simd, &position[axis].0, vector));
        for (out, &[qx, qy, qz]) in squared.iter_mut().zip(candidates) {
            let dx = F32s::splat(simd, qx) - x;
            let dy = F32s::splat(simd, qy) - y;
            let dz = F32s::splat(simd, qz) - z;
            (dx * dx + dy * dy + dz * dz).store(&mut out.0, vector);
        }
    }
}

/// Moves the threshold of each lane in `group` to its k-th smallest squared distance, the point itself not counted.
///
/// `threshold` holds first guesses; there are more than `k` candidates.
#[inline(always)]
fn kth_smallest<S: Simd>(simd: S, squared: &[Lanes], k: u32, group: &[bool; LANES], threshold: &mut Lanes) {
    // The point itself is among the candidates, at distance 0.
    let target = (k + 1) as f32;
    let mut low = [0f32; LANES];
    let mut high = [f32::INFINITY; LANES];
    let mut low_count = [1f32; LANES];
    let mut high_count = [f32::INFINITY; LANES];
    let mut at = *threshold;
    let mut open = *group;
    let mut surplus = [0; LANES];
    for step in 0..MOST_MOVES {
        let count = count_below(simd, squared, &at);
        let mut any_open = false;
        for lane in 0..LANES {
            if !open[lane] {
                continue;
            }
            let [t, n] = [at.0[lane], count.0[lane]];
            if (n >= target) & (n <= target + SURPLUS as f32) {
                open[lane] = false;
                surplus[lane] = (n - target) as usize;
                continue;
            }
            if n < target {
                (low[lane], low_count[lane]) = (t, n);
            } else {
                (high[lane], high_count[lane]) = (t, n);
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
                t * (target / n * 1.1).clamp(1.2, 4.0)
            } else if step < 4 || step % 2 == 0 {
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
    let largest = largest_below(simd, squared, &at);
    for lane in (0..LANES).filter(|&lane| group[lane]) {
        threshold.0[lane] = largest[surplus[lane]].0[lane];
    }
}

/// How many candidates lie at or below each lane's threshold.
#[inline(always)]
fn count_below<S: Simd>(simd: S, squared: &[Lanes], threshold: &Lanes) -> Lanes {
    let mut count = Lanes::default();
    let one = F32s::splat(simd, 1.0);
    for vector in 0..vectors::<S>() {
        let threshold = F32s::load(simd, &threshold.0, vector);
        let mut sums = [F32s::splat(simd, 0.0); GROUP];
        for group in squared.chunks_exact(GROUP) {
            for (sum, candidate) in sums.iter_mut().zip(group) {
                *sum += F32s::load(simd, &candidate.0, vector).at_most(threshold).keep(one);
            }
        }
        let [a, b, c, d] = sums;
        ((a + b) + (c + d)).store(&mut count.0, vector);
    }
    count
}

/// The largest squared distances at or below each lane's threshold, descending.
#[inline(always)]
fn largest_below<S: Simd>(simd: S, squared: &[Lanes], threshold: &Lanes) -> [Lanes; SURPLUS + 1] {
    let mut largest = [Lanes::default(); SURPLUS + 1];
    for vector in 0..vectors::<S>() {
        let threshold = F32s::load(simd, &threshold.0, vector);
        let mut list = [F32s::splat(simd, 0.0); SURPLUS + 1];
        for candidate in squared {
            let d = F32s::load(simd, &candidate.0, vector);
            let mut sinking = d.at_most(threshold).keep(d);
            for entry in &mut list {
                let above = entry.max(sinking);
                sinking = entry.min(sinking);
                *entry = above;
            }
        }
        for (largest, entry) in largest.iter_mut().zip(list) {
            entry.store(&mut largest.0, vector);
        }
    }
    largest
}

/// Lists the squared distances of `lane` up to distance `known`, the point itself left out.
#[inline(always)]
fn list_lane(squared: &[Lanes], lane: usize, known: f32, listed: &mut Vec<f32>) {
    listed.resize(squared.len(), 0.0);
    let mut len = 0;
    for candidate in squared {
        // Written first and counted after, as in `gather`.
        let d = candidate.0[lane];
        listed[len] = d;
        len += usize::from((d <= known * known) & (d > 0.0) & (d < f32::INFINITY));
    }
    listed.truncate(len);
}

/// Sums the neighbours below the threshold of each lane in `done`.
#[inline(always)]
fn sum_moments<S: Simd>(simd: S, block: &Block, scratch: &Scratch, done: &[bool; LANES], out: &mut NeighborhoodBlock) {
    let one = F32s::splat(simd, 1.0);
    for vector in 0..vectors::<S>() {
        let [x, y, z] = [0, 1, 2].map(|axis: usize| F32s::load(simd, &block.position[axis].0, vector));
        let threshold = F32s::load(simd, &block.threshold.0, vector);
        // The point itself adds nothing but to the count.
        let mut count = F32s::splat(simd, -1.0);
        let mut offset = [F32s::splat(simd, 0.0); 3];
        let mut second = [F32s::splat(simd, 0.0); 6];
        for (squared, &[qx, qy, qz]) in scratch.squared.iter().zip(&scratch.candidates) {
            let within = F32s::load(simd, &squared.0, vector).at_most(threshold);
            let dx = within.keep(F32s::splat(simd, qx) - x);
            let dy = within.keep(F32s::splat(simd, qy) - y);
            let dz = within.keep(F32s::splat(simd, qz) - z);
            count += within.keep(one);
            offset[0] += dx;
            offset[1] += dy;
            offset[2] += dz;
            second[0] += dx * dx;
            second[1] += dx * dy;
            second[2] += dx * dz;
            second[3] += dy * dy;
            second[4] += dy * dz;
            second[5] += dz * dz;
        }
        let sums = [count, threshold.sqrt()].into_iter().chain(offset).chain(second);
        let outs = [&mut out.count, &mut out.k_radius].into_iter().chain(&mut out.offset).chain(&mut out.second);
        for (out, sum) in outs.zip(sums) {
            let mut lanes = Lanes::default();
            sum.store(&mut lanes.0, vector);
            for lane in vector * S::F32_LANES..(vector + 1) * S::F32_LANES {
                out.0[lane] = if done[lane] { lanes.0[lane] } else { out.0[lane] };
            }
        }
    }
}
