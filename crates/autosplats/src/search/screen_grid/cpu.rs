//! The screen-grid search on the CPU: sixteen points at a time.

#[cfg(test)]
mod tests;

use pulp::Simd;
use rayon::prelude::*;

use super::window::Window;
use crate::camera::View;
use crate::cancel::Cancel;
use crate::project::ScreenPoints;
use crate::room::fit;
use crate::search::moments::{squared_distances, sum_moments};
use crate::search::past::{Past, Trust};
use crate::search::select::{CANDIDATE_GROUP, kth_smallest, largest_below};
use crate::search::{
    BOUND_STEP, EarlyEnd, LANES, Lanes, MAX_CANDIDATES, MIN_CROWDED_CANDIDATES, NeighborhoodBlock, Neighborhoods,
    SearchCounts, SearchRules,
};

/// Blocks per task: enough to hide the start of a task, few enough for an even distribution.
const TASK_BLOCKS: usize = 64;
/// Factor on the expected k-radius for the spheres of the first window, in which most points find their k neighbours.
/// The expected k-radius, in first search radii, is the mean of the block before.
pub(super) const FIRST_WINDOW_SLACK: f32 = 1.3;
/// Range of the expected k-radius, in first search radii.
const EXPECTED_FIRST_RADII_RANGE: [f32; 2] = [0.8, 4.0];
/// Least growth factor of a radius that is too small.
pub(super) const MIN_RADIUS_GROWTH: f32 = 1.3;

/// Finds the neighbourhoods of `queries`, ascending indices of screen points. The `past` decides what is read first,
/// but does not change the result.
pub(crate) fn search(
    screen: &ScreenPoints,
    queries: &[u32],
    view: &View,
    rules: &SearchRules,
    past: &Past,
    neighborhoods: &mut Neighborhoods,
    cancel: &Cancel<'_>,
) {
    fit(&mut neighborhoods.blocks, queries.len().div_ceil(LANES));
    neighborhoods.counts = neighborhoods
        .blocks
        .par_chunks_mut(TASK_BLOCKS)
        .zip(queries.par_chunks(TASK_BLOCKS * LANES))
        .map_init(Scratch::default, |scratch, (blocks, queries)| {
            if cancel.is_given_up() {
                return SearchCounts::default();
            }
            // Tasks do not depend on the number of threads, so neither may the guesses that a task starts from.
            scratch.reach = 1.0;
            scratch.trust = Trust::default();
            search_blocks(&SearchInput { screen, view, rules, past }, queries, blocks, scratch)
        })
        .reduce(SearchCounts::default, |a, b| a + b);
}

/// Inputs that all blocks share.
#[derive(Clone, Copy)]
struct SearchInput<'a> {
    screen: &'a ScreenPoints,
    view: &'a View,
    rules: &'a SearchRules,
    past: &'a Past,
}

/// Buffers and guesses of one thread.
struct Scratch {
    /// Screen points of the present window.
    candidates: Vec<[f32; 3]>,
    /// Squared distance of each candidate to each of the sixteen points.
    squared: Vec<Lanes>,
    /// Squared distances of one lane, sorted.
    sorted: Vec<f32>,
    /// Expected k-radius in first search radii: the mean of the block before. A guess that does not change the result.
    reach: f32,
    /// Trust in the radii of the last frame.
    trust: Trust,
}

impl Default for Scratch {
    fn default() -> Self {
        Self { candidates: Vec::new(), squared: Vec::new(), sorted: Vec::new(), reach: 1.0, trust: Trust::default() }
    }
}

/// Sixteen points and the state of their searches.
struct Block {
    position: [Lanes; 3],
    /// First search radius r̃₀ [Paper, §5.1].
    initial_radius: Lanes,
    /// Radius up to which the window, once read, holds every point.
    radius: Lanes,
    /// Squared distance up to which neighbours are summed.
    threshold: Lanes,
    /// K-radius in the last frame; 0 if unknown.
    likely: Lanes,
    pending: [bool; LANES],
    /// Whether a lane's neighbours are sought among the points of sparse cells.
    near: [bool; LANES],
}

#[pulp::with_simd(search_blocks = pulp::Arch::new())]
#[inline(always)]
fn search_blocks_with<'a, S: Simd>(
    simd: S,
    task: &'a SearchInput<'a>,
    queries: &'a [u32],
    out: &'a mut [NeighborhoodBlock],
    scratch: &'a mut Scratch,
) -> SearchCounts {
    let mut counts = SearchCounts::default();
    for (queries, out) in queries.chunks(LANES).zip(out) {
        search_block(simd, task, queries, out, scratch, &mut counts);
    }
    counts
}

#[inline(always)]
fn search_block<S: Simd>(
    simd: S,
    task: &SearchInput,
    queries: &[u32],
    out: &mut NeighborhoodBlock,
    scratch: &mut Scratch,
    counts: &mut SearchCounts,
) {
    let SearchInput { screen, view, rules, .. } = *task;
    let mut block = Block::new(task, queries, scratch.reach, &mut scratch.trust);
    while block.pending.contains(&true) {
        let near = block.pending_near();
        let (window, group) = if near.contains(&true) { (Window::EMPTY, near) } else { block.next_window(task) };
        let of_near = near.contains(&true);
        let everything = of_near | window.is_all();
        let crowded = !of_near && window.candidates(&screen.cells) > MIN_CROWDED_CANDIDATES;
        let mut bound: [f32; LANES] = std::array::from_fn(|lane| match crowded & group[lane] {
            true => block.bound_radius(lane, task),
            false => f32::INFINITY,
        });
        let candidates = gather(screen, if of_near { None } else { Some(&window) }, &mut scratch.candidates);
        let padded = candidates.next_multiple_of(CANDIDATE_GROUP);
        squared_distances(simd, &block.position, &scratch.candidates[..padded], &mut scratch.squared);
        let enough = candidates > rules.k as usize;
        let mut exact = [false; LANES];
        let mut done = [false; LANES];
        if enough {
            kth_smallest(simd, &scratch.squared, rules.k, &group, &mut block.threshold);
            let spheres = block.spheres(view);
            for lane in 0..LANES {
                // Points whose squared distance overflows are nobody's neighbours.
                let inside = window.contains(&spheres[lane]) | everything;
                exact[lane] = group[lane] & inside & block.threshold.0[lane].is_finite();
                // The bound applies where few points were read too, if there are many a little further out. The result
                // then does not depend on what was read.
                if exact[lane] & !crowded & !of_near && !spheres[lane].is_small() && block.meets_bound(lane, task) {
                    bound[lane] = block.bound_radius(lane, task);
                }
                exact[lane] &= block.threshold.0[lane].sqrt() <= bound[lane];
            }
            done = unruled(simd, &scratch.squared, &block, rules, &exact);
        }
        for lane in 0..LANES {
            if !group[lane] | done[lane] {
                continue;
            }
            let kth_radius = block.threshold.0[lane].sqrt();
            let known = if everything {
                f32::INFINITY
            } else if exact[lane] {
                kth_radius
            } else {
                block.radius.0[lane]
            };
            let known = known.min(bound[lane]);
            let upper = if enough { kth_radius } else { f32::INFINITY };
            sort_lane(&scratch.squared, lane, known, &mut scratch.sorted);
            let crowded = crowded | bound[lane].is_finite();
            let verdict = judge(
                task,
                &block,
                lane,
                &scratch.sorted,
                KnownNeighbors { radius: known, exact: exact[lane], upper, crowded },
            );
            if let Verdict::Grow(radius) = verdict {
                block.radius.0[lane] = radius;
                continue;
            }
            done[lane] = true;
            block.threshold.0[lane] = match verdict {
                Verdict::Outlier | Verdict::Bounded(0) => 0.0,
                Verdict::Clamped(neighbors) | Verdict::Bounded(neighbors) => scratch.sorted[neighbors - 1],
                Verdict::Exact | Verdict::Grow(_) => block.threshold.0[lane],
            };
            match verdict {
                Verdict::Outlier => counts.outliers += 1,
                Verdict::Clamped(_) => counts.clamped += 1,
                Verdict::Bounded(neighbors) => {
                    // A point without any neighbour has nothing to keep.
                    *(if neighbors == 0 { &mut counts.outliers } else { &mut counts.clamped }) += 1;
                    counts.bounded += 1;
                }
                Verdict::Exact | Verdict::Grow(_) => {}
            }
        }
        if done.contains(&true) {
            let Scratch { candidates, squared, .. } = &*scratch;
            sum_moments(simd, &block.position, &block.threshold, candidates, squared, &done, out);
            for lane in 0..LANES {
                block.pending[lane] &= !done[lane];
            }
        }
    }
    scratch.reach = block.reach(queries.len(), out, rules.k);
    if let Some(missed) = block.missed(queries.len(), out, rules.k) {
        scratch.trust.learn(missed);
    }
}

/// What to do with a point after its window was read.
#[derive(Clone, Copy)]
enum Verdict {
    /// No rule ends the neighbourhood early.
    Exact,
    Outlier,
    /// A gap, or the end of the points, follows this many neighbours.
    Clamped(usize),
    /// The bound on search work ends the search; this many neighbours are certain.
    Bounded(usize),
    /// A window for this radius must be read.
    Grow(f32),
}

/// Knowledge of a point's neighbours after a window was read.
#[derive(Clone, Copy)]
struct KnownNeighbors {
    /// Distance up to which all neighbours are known.
    radius: f32,
    /// Whether the k-th neighbour is among the known.
    exact: bool,
    /// Upper bound of the k-radius.
    upper: f32,
    /// Whether the bound on search work may be near.
    crowded: bool,
}

/// Applies the rules to one point; `squared` holds its squared distances up to the known radius, ascending.
fn judge(task: &SearchInput, block: &Block, lane: usize, squared: &[f32], known: KnownNeighbors) -> Verdict {
    let SearchInput { screen, view, rules, .. } = *task;
    let KnownNeighbors { radius, exact, upper, crowded } = known;
    match rules.early_end(squared, block.initial_radius.0[lane], radius) {
        Some(EarlyEnd::Outlier) => return Verdict::Outlier,
        Some(EarlyEnd::Gap(neighbors)) => return Verdict::Clamped(neighbors),
        None if exact => return Verdict::Exact,
        None => {}
    }
    if radius == f32::INFINITY {
        return if squared.is_empty() { Verdict::Outlier } else { Verdict::Clamped(squared.len()) };
    }
    let growth = (rules.k as f32 / squared.len().max(1) as f32).sqrt().max(MIN_RADIUS_GROWTH);
    // The candidates bound the k-radius, but only loosely across a depth step.
    let next = upper.min(2.0 * radius * growth);
    if !crowded && Window::of_sphere(block.center(lane), next, view).candidates(&screen.cells) <= MIN_CROWDED_CANDIDATES
    {
        return Verdict::Grow(next);
    }
    let bound = block.bound_radius(lane, task);
    if bound > radius {
        return Verdict::Grow(next.min(bound));
    }
    Verdict::Bounded(squared.partition_point(|&d| d <= bound * bound))
}

/// Lanes of `exact` whose neighbourhoods certainly no rule ends early (`unruled`); the others are judged one by one.
///
/// A gap is an annulus (b, √λ·b] without a point, with b ≥ r̃₀. Starting at b = r̃₀, the furthest point within √λ·b
/// becomes the next b, until √λ·b reaches the k-radius. If there is no such point, there may be a gap, or no point
/// near. Lenient rules have no further gaps.
#[inline(always)]
fn unruled<S: Simd>(
    simd: S,
    squared: &[Lanes],
    block: &Block,
    rules: &SearchRules,
    exact: &[bool; LANES],
) -> [bool; LANES] {
    let Some(growth) = rules.gap_factor else {
        return std::array::from_fn(|lane| {
            exact[lane] & (block.threshold.0[lane].sqrt() <= rules.outlier_radius(block.initial_radius.0[lane]))
        });
    };
    let mut unruled = [false; LANES];
    let mut open = *exact;
    let mut base = block.initial_radius;
    for lane in 0..LANES {
        // The first step below finds a neighbour within √λ·r̃₀ or fails. The neighbour breaks no outlier rule if that
        // distance does not exceed the outlier radius.
        open[lane] &= growth.sqrt() * base.0[lane] <= rules.outlier_radius(base.0[lane]);
        base.0[lane] *= base.0[lane];
    }
    while open.contains(&true) {
        // The square of √λ·b; `base` is b².
        let reach = Lanes(base.0.map(|base| growth * base));
        for lane in 0..LANES {
            unruled[lane] |= open[lane] & (block.threshold.0[lane] <= reach.0[lane]);
            open[lane] &= !unruled[lane];
        }
        if !open.contains(&true) {
            break;
        }
        let [furthest] = largest_below(simd, squared, &reach);
        for lane in 0..LANES {
            open[lane] &= furthest.0[lane] > base.0[lane];
        }
        base = furthest;
    }
    unruled
}

impl Block {
    /// A block of at most sixteen queries. `reach` is the expected k-radius in first search radii.
    #[inline(always)]
    fn new(task: &SearchInput, queries: &[u32], reach: f32, trust: &mut Trust) -> Self {
        let SearchInput { screen, view, rules, past } = *task;
        let mut block = Self {
            position: [Lanes::default(); 3],
            initial_radius: Lanes::default(),
            radius: Lanes::default(),
            threshold: Lanes::default(),
            likely: Lanes::default(),
            pending: [true; LANES],
            near: [false; LANES],
        };
        let looks_back = trust.looks_back();
        for lane in 0..LANES {
            let query = queries[lane.min(queries.len() - 1)];
            let point = &screen.points[query as usize];
            for axis in 0..3 {
                block.position[axis].0[lane] = point.position_view[axis];
            }
            let radius = screen.density.initial_radius(point, rules.k, view);
            block.initial_radius.0[lane] = radius;
            block.near[lane] = point.is_near();
            let (mut likely, mut slack) = if point.is_near() {
                (point.position_view[2].abs(), 1.0)
            } else {
                (reach * radius, FIRST_WINDOW_SLACK)
            };
            if looks_back && let Some(past_radius) = past.radius(point.position_view, radius) {
                block.likely.0[lane] = past_radius;
                if let Some(past_slack) = trust.slack() {
                    (likely, slack) = (past_radius, past_slack);
                }
            }
            // A radius that rounds to 0 would never grow.
            block.radius.0[lane] = (slack * likely).max(f32::MIN_POSITIVE);
            block.threshold.0[lane] = likely * likely;
            block.pending[lane] = lane < queries.len();
        }
        block
    }

    /// The next [`Scratch::reach`]: mean k-radius, in first search radii, of the first `lanes` lanes, counting only
    /// those that found k neighbours.
    #[inline(always)]
    fn reach(&self, lanes: usize, out: &NeighborhoodBlock, k: u32) -> f32 {
        let full = (0..lanes).filter(|&lane| out.count.0[lane] >= k as f32 && !self.near[lane]);
        let ratios = full.map(|lane| out.k_radius.0[lane] / self.initial_radius.0[lane]);
        let (count, sum) = ratios.fold((0.0, 0.0), |(count, sum), ratio| (count + 1.0, sum + ratio));
        let [least, most] = EXPECTED_FIRST_RADII_RANGE;
        (sum / f32::max(count, 1.0)).clamp(least, most)
    }

    /// Largest factor by which the last frame's radii fell short in the first `lanes` lanes; `None` without any.
    #[inline(always)]
    fn missed(&self, lanes: usize, out: &NeighborhoodBlock, k: u32) -> Option<f32> {
        let full = (0..lanes).filter(|&lane| out.count.0[lane] >= k as f32 && self.likely.0[lane] > 0.0);
        full.map(|lane| out.k_radius.0[lane] / self.likely.0[lane]).reduce(f32::max)
    }

    /// Whether the bound on search work may be nearer than the threshold of a lane.
    #[inline(never)]
    fn meets_bound(&self, lane: usize, task: &SearchInput) -> bool {
        let SearchInput { screen, view, .. } = *task;
        let beyond = 1.01 * BOUND_STEP * self.threshold.0[lane].sqrt();
        let window = Window::of_sphere(self.center(lane), beyond, view);
        screen.near_first > MAX_CANDIDATES && window.candidates(&screen.cells) > MAX_CANDIDATES
    }

    /// Radius of the bound on search work, world units; infinite without a bound.
    #[cold]
    fn bound_radius(&self, lane: usize, task: &SearchInput) -> f32 {
        let SearchInput { screen, view, .. } = *task;
        if screen.near_first <= MAX_CANDIDATES {
            return f32::INFINITY;
        }
        let center = self.center(lane);
        let fits = |radius| Window::of_sphere(center, radius, view).candidates(&screen.cells) <= MAX_CANDIDATES;
        let mut radius = self.initial_radius.0[lane].max(f32::MIN_POSITIVE);
        while !fits(radius) && radius > f32::MIN_POSITIVE {
            radius /= BOUND_STEP;
        }
        // Ends at the whole picture at the latest, which does not fit.
        while fits(radius * BOUND_STEP) {
            radius *= BOUND_STEP;
        }
        radius
    }

    #[inline(always)]
    fn center(&self, lane: usize) -> [f32; 3] {
        [self.position[0].0[lane], self.position[1].0[lane], self.position[2].0[lane]]
    }

    /// The lanes that are pending and near.
    #[inline(always)]
    fn pending_near(&self) -> [bool; LANES] {
        std::array::from_fn(|lane| self.pending[lane] & self.near[lane])
    }

    /// The window to read next, and the lanes that the window serves.
    #[inline(always)]
    fn next_window(&self, task: &SearchInput) -> (Window, [bool; LANES]) {
        let SearchInput { screen, view, .. } = *task;
        let mut union = Window::EMPTY;
        let mut first = None;
        for lane in (0..LANES).filter(|&lane| self.pending[lane]) {
            let window = Window::of_sphere(self.center(lane), self.radius.0[lane], view);
            union = union.union(window);
            first = first.or(Some((lane, window)));
        }
        let union = union.grown(&screen.cells, view);
        // On a sparse screen a block's points may be far apart, with many points of no use between them.
        if let Some((lane, window)) = first
            && union.candidates(&screen.cells) > 2 * MAX_CANDIDATES
        {
            let mut group = [false; LANES];
            group[lane] = true;
            return (window.grown(&screen.cells, view), group);
        }
        (union, self.pending)
    }

    /// Windows of the spheres with the threshold radii.
    #[inline(always)]
    fn spheres(&self, view: &View) -> [Window; LANES] {
        // A loop, because the closure of `from_fn` would not be compiled for the processor's vectors.
        let mut spheres = [Window::EMPTY; LANES];
        for lane in 0..LANES {
            spheres[lane] = Window::of_sphere(self.center(lane), self.threshold.0[lane].sqrt(), view);
        }
        spheres
    }
}

/// Lists the screen points in `window`, or the points of sparse cells if it is `None`, at the front of `candidates`,
/// then a group at infinity; returns their number.
#[inline(always)]
fn gather(screen: &ScreenPoints, window: Option<&Window>, candidates: &mut Vec<[f32; 3]>) -> usize {
    let Some(window) = window else {
        candidates.clear();
        candidates.extend(screen.points[screen.near_first..].iter().map(|point| point.position_view));
        let len = candidates.len();
        candidates.resize(len + CANDIDATE_GROUP, [f32::INFINITY; 3]);
        return len;
    };
    let most = window.candidates(&screen.cells);
    if candidates.len() < most + CANDIDATE_GROUP {
        candidates.resize(most + CANDIDATE_GROUP, [0.0; 3]);
    }
    let mut len = 0;
    for run in window.runs(&screen.cells) {
        for point in &screen.points[run] {
            // Write first and count afterwards: the test of depths is unpredictable for a branch.
            candidates[len] = point.position_view;
            let depth = point.position_view[2];
            len += usize::from((window.near <= depth) & (depth <= window.far));
        }
    }
    candidates[len..len + CANDIDATE_GROUP].fill([f32::INFINITY; 3]);
    len
}

/// Collects the finite squared distances of `lane` up to distance `known`, ascending, without the point itself.
fn sort_lane(squared: &[Lanes], lane: usize, known: f32, sorted: &mut Vec<f32>) {
    sorted.clear();
    let most = (known * known).min(f32::MAX);
    sorted.extend(squared.iter().map(|candidate| candidate.0[lane]).filter(|&d| d <= most && d > 0.0));
    sorted.sort_unstable_by(f32::total_cmp);
}
