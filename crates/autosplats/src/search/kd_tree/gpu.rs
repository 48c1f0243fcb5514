//! The kd-tree on the GPU: passes that build the tree level by level, then search it.

use crate::Error;
use crate::gpu::{DISPATCH_BYTES, Gpu, Groups, LARGE_GROUP, Library, Pass, Step, constants, files, indices, passes};
use crate::project::Chunk;
use crate::project::gpu::{Counter, Round};
use crate::search::engine::{EnginePasses, EngineSteps, SearchBuffers};

/// Imports and constants of the passes.
const LIBRARY: Library = Library {
    files: &[files!["kd_build", "kd_chunk", "kd_tree"]],
    constants: &[
        Counter::CONSTANTS,
        Work::CONSTANTS,
        constants![CHUNK_POINTS, MAX_SMALL_NODE_POINTS, MAX_WALK_VISITS, MIN_LEAF_POINTS, STEP_COST_POINTS],
    ],
};

passes! {
    "search/kd_tree", LIBRARY;
    BEGIN = "build/begin",
    SPLIT = "build/split",
    COUNT = "build/count",
    PLACE = "build/place",
    SCATTER = "build/scatter",
    SMALL_TREE = "build/small_tree",
    SEARCH = "search",
    MOMENTS = "moments",
}

/// Most points of a small node.
const MAX_SMALL_NODE_POINTS: usize = 64;
/// Fewest points of a leaf, where there are more.
const MIN_LEAF_POINTS: usize = 8;
/// Number of points whose reading costs as much as a step down the tree. See docs/decisions/0015-search-engines.md.
const STEP_COST_POINTS: f32 = 16.0;
/// Points of a large node that one workgroup processes.
const CHUNK_POINTS: usize = 256;
/// Most nodes and points that one walk through the tree visits. Software devices end an invocation silently after
/// 65535 rounds of its loops, and a search is two walks.
const MAX_WALK_VISITS: u32 = 12_000;

/// `KdPoint` of `imports/kd_tree.wgsl`.
type Point = [u32; 4];
/// `KdNode` of `imports/kd_tree.wgsl`: a corner, a child or a point, the other corner, a number of points.
type Node = [u32; 8];
/// `KdLarge` of `imports/kd_build.wgsl`.
type Large = [u32; 16];
/// `KdSmall` of `imports/kd_build.wgsl`.
type Small = [u32; 4];
/// `KdState` of `imports/kd_build.wgsl`.
type State = [u32; 6];

/// Structs of WGSL with their sizes here.
#[cfg(test)]
pub(crate) const SIZES: &[(&str, usize)] = &[
    ("KdNode", size_of::<Node>()),
    ("KdLarge", size_of::<Large>()),
    ("KdSmall", size_of::<Small>()),
    ("KdState", size_of::<State>()),
];

indices! {
    /// Indirect dispatches of the engine.
    enum Work in "Work" {
        Large,
        Chunks,
        Small,
        Points,
    }
}

/// Number of levels of large nodes to record: 5/2 per halving of the points, and some for inexact sampled medians. A
/// split that leaves three quarters on one side is not yet lopsided and takes 1/log₂(4/3) = 2.41 levels per halving. A
/// lopsided split and the median after it take two. The number is even, so that all points end in the first list.
fn levels(capacity: usize) -> usize {
    let halvings = capacity.div_ceil(MAX_SMALL_NODE_POINTS).next_power_of_two().ilog2() as usize;
    (5 * halvings).div_ceil(4) * 2 + 6
}

/// Buffers of a tree of up to `capacity` points, 52 bytes a point.
#[derive(Debug)]
struct TreeBuffers {
    capacity: u32,
    /// Points before and after a level, in turn; the finished tree's points are in the first.
    points: [wgpu::Buffer; 2],
    nodes: wgpu::Buffer,
    /// Large nodes of a level and of the next, in turn, like `state` and `arguments`.
    large: [wgpu::Buffer; 2],
    state: [wgpu::Buffer; 2],
    arguments: [wgpu::Buffer; 2],
    small: wgpu::Buffer,
    chunk_sums: wgpu::Buffer,
    /// For each point of the cloud, in its order, the k-radius or a little more; negative for points off the tree.
    radii: wgpu::Buffer,
}

impl TreeBuffers {
    /// # Errors
    /// [`Error::DeviceLimit`] or [`Error::DeviceMemory`] if the device has too little.
    fn new(gpu: &Gpu, capacity: usize) -> Result<Self, Error> {
        // Large nodes of a level have more than `MAX_SMALL_NODE_POINTS` points each, apart from the root.
        let large = capacity / (MAX_SMALL_NODE_POINTS + 1) + 1;
        // Nodes above the small nodes: twice the number with all small nodes half full.
        let upper = capacity / 8 + 64;
        let lower = capacity / (MIN_LEAF_POINTS / 2) + 1;
        let points = |_| gpu.storage::<Point>("points of the kd-tree", capacity);
        let arguments = |_| {
            let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::INDIRECT;
            gpu.buffer("arguments of the kd-tree", Work::CONSTANTS.len() as u64 * DISPATCH_BYTES, usage)
        };
        Ok(Self {
            capacity: capacity as u32,
            points: both(points)?,
            nodes: gpu.storage::<Node>("nodes of the kd-tree", upper + lower)?,
            large: both(|_| gpu.storage::<Large>("large nodes of the kd-tree", large))?,
            state: both(|_| gpu.storage::<State>("state of the kd-tree", 1))?,
            arguments: both(arguments)?,
            small: gpu.storage::<Small>("small nodes of the kd-tree", upper)?,
            chunk_sums: gpu.storage::<u32>("chunks of the kd-tree", capacity.div_ceil(CHUNK_POINTS) + large + 1)?,
            radii: gpu.storage::<f32>("k-radii", capacity)?,
        })
    }

    /// Number of workgroups of `work` at a level of this parity.
    fn groups(&self, parity: usize, work: Work) -> Groups {
        Groups::Counted(self.arguments[parity].clone(), work as u64 * DISPATCH_BYTES)
    }
}

/// Makes one value for each parity of levels.
fn both<T>(make: impl Fn(usize) -> Result<T, Error>) -> Result<[T; 2], Error> {
    Ok([make(0)?, make(1)?])
}

/// The passes of the engine.
#[derive(Debug)]
pub(crate) struct KdTreePasses {
    begin: Pass,
    split: Pass,
    count: Pass,
    place: Pass,
    scatter: Pass,
    small_tree: Pass,
    search: Pass,
    moments: Pass,
}

impl KdTreePasses {
    /// # Errors
    /// [`Error::Device`].
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Error> {
        let pass = |source| Pass::new(gpu, source, &[]);
        Ok(Self {
            begin: pass(&BEGIN)?,
            split: pass(&SPLIT)?,
            count: pass(&COUNT)?,
            place: pass(&PLACE)?,
            scatter: pass(&SCATTER)?,
            small_tree: pass(&SMALL_TREE)?,
            search: pass(&SEARCH)?,
            moments: pass(&MOMENTS)?,
        })
    }

    /// Builds the tree of all points of the cloud.
    fn build(&self, gpu: &Gpu, frame: &wgpu::Buffer, chunk: &Chunk, tree: &TreeBuffers) -> Vec<Step> {
        let TreeBuffers { points, nodes, large, state, arguments, small, chunk_sums, radii, .. } = tree;
        let begin = [frame, &chunk.uniform, &chunk.positions, &points[0], radii, &large[0], &state[0], &arguments[0]];
        let split = self.split.step(gpu, &[&state[0], &points[0], &large[0], nodes], tree.groups(0, Work::Large));
        let level = |at: usize| {
            let next = 1 - at;
            let chunks = || tree.groups(at, Work::Chunks);
            let split = [&state[at], &points[at], &large[at], nodes];
            let count = [&state[at], &large[at], &points[at], chunk_sums];
            let place =
                [&state[at], &large[at], chunk_sums, &state[next], &large[next], small, nodes, &arguments[next]];
            let scatter = [&state[at], &large[at], chunk_sums, &points[at], &points[next], &large[next]];
            [
                self.split.step(gpu, &split, tree.groups(at, Work::Large)),
                self.count.step(gpu, &count, chunks()),
                self.place.step(gpu, &place, 1),
                self.scatter.step(gpu, &scatter, chunks()),
            ]
        };
        let two_levels: Vec<Step> = (0..2).flat_map(level).collect();
        let mut steps = vec![self.begin.step(gpu, &begin, tree.capacity.div_ceil(LARGE_GROUP))];
        for _ in 0..levels(tree.capacity as usize) / 2 {
            steps.extend(two_levels.iter().cloned());
        }
        // Nodes that are still large after the last level become leaves.
        steps.push(split);
        let small_tree = [frame, &state[0], small, &points[0], &points[1], nodes];
        steps.push(self.small_tree.step(gpu, &small_tree, tree.groups(0, Work::Small)));
        steps
    }

    /// Builds the tree and searches it.
    fn steps_in(&self, gpu: &Gpu, buffers: SearchBuffers<'_>, tree: &TreeBuffers) -> [Vec<Step>; 2] {
        let SearchBuffers { frame, cloud, screen, neighborhoods, .. } = buffers;
        // A tree that fits one binding has one chunk of the cloud; an empty cloud has no chunk.
        let [chunk] = cloud.chunks() else { return [Vec::new(), Vec::new()] };
        let mut first = self.build(gpu, frame, chunk, tree);
        let TreeBuffers { points: [points, _], nodes, state: [state, _], radii, .. } = tree;
        let search = [frame, state, points, nodes, radii];
        first.push(self.search.step(gpu, &search, tree.groups(0, Work::Points)));
        let [active, recovered] = [Round::Active, Round::Recovered].map(|round| {
            let (source, queries) = (&screen.source, &screen.queries);
            let moments =
                [frame, &screen.counters, source, queries, &chunk.positions, radii, nodes, points, neighborhoods];
            self.moments.step(gpu, &moments, screen.groups(round.work_64()))
        });
        first.push(active);
        [first, vec![recovered]]
    }
}

impl EnginePasses for KdTreePasses {
    fn steps(&self, gpu: &Gpu, buffers: SearchBuffers<'_>) -> Result<EngineSteps, Error> {
        let tree = TreeBuffers::new(gpu, buffers.cloud.capacity())?;
        Ok(EngineSteps { rounds: self.steps_in(gpu, buffers, &tree), convergence: None })
    }
}

#[cfg(test)]
mod tests;
