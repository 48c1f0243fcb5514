//! Projection on the GPU: the steps of the CPU form, one pass each.

pub(crate) use super::Round;
use super::device_cloud::{Chunk, DeviceCloud};
use super::{COUNTED_BLOCK_PX, MARGIN_REACH, ScreenPoint, cpu, near};
use crate::Error;
use crate::gpu::{
    DISPATCH_BYTES, Gpu, Groups, INT64_ATOMICS, INT64_IN_LANES, Library, Pass, Step, constants, files, indices, passes,
};

/// Imports and constants of the passes.
const LIBRARY: Library = Library {
    files: &[files![
        "active",
        "add_sixteenth",
        "cell_order",
        "cell_sizes",
        "count_dropped",
        "count_near",
        "held",
        "keys",
        "list_near",
        "near_cells",
        "near_points"
    ]],
    constants: &[
        Counter::CONSTANTS,
        Work::CONSTANTS,
        constants!(in cpu: MAX_SECOND_DEPTH_PX, OCCUPANCY_BLOCK_PX, STRIP_SPACINGS),
        constants!(in near:
            FACE_CELLS, FIRST_OCTAVE, MOST_NEAR, NEAR_CELLS, NEAR_POINTS, NEAR_REACH, NEAR_REACHES, NEAR_REACH_GROWTH,
            OCTAVES, OCTAVE_CELLS, SPARSE_POINTS
        ),
        constants![COUNTED_BLOCK_PX, ENTRY_WORDS, MARGIN_REACH, POINTS_PER_LANE, RANK_BLOCK_FLAGS],
    ],
};

passes! {
    "project", LIBRARY;
    CLEAR = "clear",
    PROJECT = "project" needs INT64_ATOMICS,
    PROJECT_LANES = "project_lanes" needs INT64_IN_LANES,
    PROJECT_32 = "project_32",
    OCCUPANCY = "occupancy",
    COUNT = "count",
    COMPACT = "compact",
    GATHER = "gather",
    SPLIT_COUNT = "split_count",
    SPLIT = "split",
    WORK = "work",
}

indices! {
    /// Indirect dispatches whose number of workgroups depends on counters. A variant names the items and how many a
    /// workgroup takes; `Blocks` are blocks of [`RANK_BLOCK_FLAGS`]. `Drawn` are queries whose splats are drawn, 256 a
    /// workgroup, in no fewer than [`drawing_constant`] tells.
    pub(crate) enum Work {
        Visible256,
        VisibleBlocks,
        PassiveBlocks,
        Active64,
        Active256,
        Recovered64,
        Recovered256,
        Queries256,
        ActiveDrawn,
        RecoveredDrawn,
        QueriesDrawn,
        LeftActive64,
        LeftRecovered64,
    }
}

impl Round {
    /// Dispatch with 64 queries per workgroup.
    pub(crate) fn work_64(self) -> Work {
        [Work::Active64, Work::Recovered64][self as usize]
    }

    /// Dispatch that draws the splats of the round.
    pub(crate) fn work_drawn(self) -> Work {
        [Work::ActiveDrawn, Work::RecoveredDrawn][self as usize]
    }

    /// Dispatch for the queries that one pass of the search leaves to another, 64 per workgroup.
    pub(crate) fn left_64(self) -> Work {
        [Work::LeftActive64, Work::LeftRecovered64][self as usize]
    }

    /// Dispatch with 256 queries per workgroup.
    pub(crate) fn work_256(self) -> Work {
        [Work::Active256, Work::Recovered256][self as usize]
    }
}

/// The constant by which passes know the fewest workgroups that draw splats, so that large ones are not left to a few
/// invocations. Software has few threads and pays for each workgroup.
pub(crate) fn drawing_constant(gpu: &Gpu) -> (&'static str, f64) {
    ("DRAWING_GROUPS", if gpu.is_software() { 16.0 } else { 128.0 })
}

/// Points that an invocation of `project_lanes` takes, one after the other.
const POINTS_PER_LANE: u32 = 4;
/// Words of an entry of a cell around the eye: ordinal and position of a point.
const ENTRY_WORDS: usize = 4;
/// Invocations in a workgroup of most passes.
const GROUP: u32 = crate::gpu::LARGE_GROUP;
/// Flags that one workgroup ranks: a block.
pub(crate) const RANK_BLOCK_FLAGS: u32 = 2048;

indices! {
    /// Counts and choices of the device: indices into [`ScreenBuffers::counters`].
    pub(crate) enum Counter {
        /// Points that cannot own a pixel, by reason.
        NotFinite,
        Behind,
        Outside,
        /// Screen points, with those of sparse cells around the eye.
        Visible,
        /// Screen points without those.
        NearFirst,
        /// Octaves of distance from the eye whose sparse cells are listed.
        ListedOctaves,
        /// Points that serve as neighbours only, because they are near or listed without being near.
        SilentPoints,
        /// Blocks of the screen that hold screen points.
        Blocks,
        /// Height of a strip of cells in pixels.
        StripPx,
        /// Side of a density cell in pixels.
        CellPx,
        /// Density cells per row.
        CellColumns,
        Active,
        Passive,
        Recovered,
        /// Number of the round, its first query and its number of queries: at first the active points, then those that
        /// were recovered. So passes of both rounds are the same, and compiled once.
        Round,
        RoundFirst,
        RoundLen,
        /// Points with fewer than k neighbours because of a gap or the bound on work.
        Clamped,
        /// Points that reached the bound on work.
        Bounded,
        /// Discarded surfels.
        Outliers,
        /// Ends of the colour map, as bits of `f32`.
        RangeLow,
        RangeHigh,
        /// Pixels that show a surface.
        Covered,
        /// Splats that are too large for one workgroup.
        Large,
        /// Queries of each round that one pass of the search leaves to another.
        LeftActive,
        LeftRecovered,
        /// Surfels of each round that need balls of their own.
        BallsActive,
        BallsRecovered,
    }
}

/// Length of [`ScreenBuffers::counters`].
pub(crate) const COUNTERS: usize = Counter::CONSTANTS.len();

/// A cell of the density grid, laid out as in `shared/density.wgsl`.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct DensityCell {
    pub(crate) count: u32,
    pub(crate) nearest: f32,
}

/// [`ScreenPoints`](super::ScreenPoints) on the device.
#[derive(Debug)]
pub(crate) struct ScreenBuffers {
    pub(crate) size: [u32; 2],
    /// Whether each half of a pixel keeps a point.
    pub(crate) halves: bool,
    /// Largest possible number of screen points.
    pub(crate) capacity: u32,
    /// One `u32` per [`Counter`].
    pub(crate) counters: wgpu::Buffer,
    /// Keys of the owners of slots, which are empty between frames: `imports/keys.wgsl`.
    keys: wgpu::Buffer,
    /// Number of points of each cell around the eye, then entries for each.
    near: wgpu::Buffer,
    /// [`DensityCell`]s.
    pub(crate) density: wgpu::Buffer,
    /// Index of the first screen point of each cell.
    pub(crate) cell_start: wgpu::Buffer,
    /// Bits of the sixteenths that hold points, two pixels to a `u32`.
    pub(crate) sixteenths: wgpu::Buffer,
    /// Number of them in each block of [`COUNTED_BLOCK_PX`] pixels, row by row.
    pub(crate) held: wgpu::Buffer,
    /// Index in the cloud of each screen point.
    pub(crate) source: wgpu::Buffer,
    pixels: wgpu::Buffer,
    /// [`ScreenPoint`]s in cell order.
    pub(crate) points: wgpu::Buffer,
    /// Values of each screen point, packed as in [`DeviceCloud`].
    pub(crate) values: wgpu::Buffer,
    /// Indices of the screen points to reconstruct: the active points, then the recovered.
    pub(crate) queries: wgpu::Buffer,
    pub(crate) passive: wgpu::Buffer,
    /// What one pass leaves to another: queries of the search, then surfels that need balls of their own.
    pub(crate) left: wgpu::Buffer,
    pub(crate) block_sums: wgpu::Buffer,
    /// Depth per pixel, pushed back by ε, row by row, as `shared/depth_map.wgsl` has it; infinite where nothing is.
    pub(crate) depth: wgpu::Buffer,
    /// Centres of splats in each pixel, row by row (`splat/centers.rs`).
    pub(crate) centers: wgpu::Buffer,
    /// K-radii of the last frame and of this one, as `shared/past_radii.wgsl` has them; none unless `keeping_past`.
    pub(crate) past: wgpu::Buffer,
    /// Workgroup counts of each [`Work`], three `u32` each: those that `count` tells, those that `split` tells, and the
    /// others. A pass cannot write the buffer that has its own count.
    pub(crate) arguments: [wgpu::Buffer; 3],
}

impl ScreenBuffers {
    /// Whether the device can bind the keys of all slots of a screen, and a `T` for each possible screen point.
    pub(crate) fn has_room<T>(gpu: &Gpu, size: [u32; 2], halves: bool, points: usize) -> bool {
        gpu.binds::<[u32; 2]>(slots(size, halves)) && gpu.binds::<T>(capacity(size, halves, points))
    }

    /// Allocates buffers for a screen of `size` and a cloud of `points` points with `values` words each.
    ///
    /// # Errors
    /// [`Error::DeviceLimit`] or [`Error::DeviceMemory`] if the device has too little.
    pub(crate) fn new(gpu: &Gpu, size: [u32; 2], halves: bool, points: usize, values: usize) -> Result<Self, Error> {
        let [width, height] = size.map(|side| side as usize);
        let pixels = width * height;
        let slots = slots(size, halves);
        let capacity = capacity(size, halves, points);
        let arguments = || {
            let bytes = Work::CONSTANTS.len() as u64 * DISPATCH_BYTES;
            gpu.buffer("arguments", bytes, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::INDIRECT)
        };
        Ok(Self {
            size,
            halves,
            capacity: capacity as u32,
            counters: gpu.storage::<u32>("counters", COUNTERS)?,
            keys: gpu.storage::<[u32; 2]>("keys of pixels", slots)?,
            near: gpu.storage::<u32>(
                "cells around the eye",
                near::NEAR_CELLS * (1 + ENTRY_WORDS * near::SPARSE_POINTS as usize),
            )?,
            // Cells are two pixels wide at least.
            density: gpu.storage::<DensityCell>("density grid", width.div_ceil(2) * height.div_ceil(2))?,
            cell_start: gpu.storage::<u32>("starts of cells", pixels + 1)?,
            sixteenths: gpu.storage::<u32>("sixteenths of pixels", pixels.div_ceil(2))?,
            held: gpu.storage::<u32>(
                "sixteenths of blocks",
                width.div_ceil(COUNTED_BLOCK_PX) * height.div_ceil(COUNTED_BLOCK_PX),
            )?,
            source: gpu.storage::<u32>("sources of screen points", capacity)?,
            pixels: gpu.storage::<u32>("pixels of screen points", capacity)?,
            points: gpu.storage::<ScreenPoint>("screen points", capacity)?,
            values: gpu.storage::<u32>("values of screen points", capacity * values)?,
            queries: gpu.storage::<u32>("queries", capacity)?,
            passive: gpu.storage::<u32>("passive points", capacity)?,
            left: gpu.storage::<u32>("queries left", capacity)?,
            block_sums: gpu
                .storage::<u32>("sums of blocks", slots.max(capacity).div_ceil(RANK_BLOCK_FLAGS as usize))?,
            depth: gpu.storage::<u32>("depth map", pixels)?,
            centers: gpu.storage::<u32>("centres of splats", pixels)?,
            past: gpu.storage::<u32>("no k-radii", 0)?,
            arguments: [arguments()?, arguments()?, arguments()?],
        })
    }

    /// With room for the k-radii of two frames, which searches of frame after frame start from.
    ///
    /// # Errors
    /// [`Error::DeviceLimit`] or [`Error::DeviceMemory`] if the device has too little.
    pub(crate) fn keeping_past(self, gpu: &Gpu) -> Result<Self, Error> {
        let pixels = self.size.iter().map(|&side| side as usize).product::<usize>();
        Ok(Self { past: gpu.storage::<[u32; 2]>("k-radii of two frames", pixels)?, ..self })
    }

    /// Number of workgroups of `work`, as the device computed it last.
    pub(crate) fn groups(&self, work: Work) -> Groups {
        let told = match work {
            Work::Visible256 | Work::VisibleBlocks => 0,
            Work::PassiveBlocks | Work::Active64 | Work::Active256 | Work::ActiveDrawn => 1,
            _ => 2,
        };
        Groups::Counted(self.arguments[told].clone(), work as u64 * DISPATCH_BYTES)
    }
}

/// Number of places for points on a screen of this size.
fn slots([width, height]: [u32; 2], halves: bool) -> usize {
    (width as usize * height as usize) << u32::from(halves)
}

/// Largest possible number of screen points on a screen of this size, with those of sparse cells around the eye.
fn capacity(size: [u32; 2], halves: bool, points: usize) -> usize {
    points.min(slots(size, halves)) + points.min(near::MOST_NEAR)
}

/// Computes the number of workgroups of each [`Work`], where counters change in other passes than those that compute it
/// themselves.
#[derive(Debug)]
pub(crate) struct WorkPass(Pass);

impl WorkPass {
    /// # Errors
    /// [`Error::Device`].
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Error> {
        Pass::new(gpu, &WORK, &[drawing_constant(gpu)]).map(Self)
    }

    /// The step to run after counters of the search have changed.
    pub(crate) fn step(&self, gpu: &Gpu, frame: &wgpu::Buffer, screen: &ScreenBuffers) -> Step {
        let [.., last] = &screen.arguments;
        self.0.step(gpu, &[frame, &screen.counters, last], 1)
    }

    /// The steps to run after the host has written counters, for tests.
    #[cfg(test)]
    fn steps_all(&self, gpu: &Gpu, frame: &wgpu::Buffer, screen: &ScreenBuffers) -> [Step; 3] {
        screen.arguments.each_ref().map(|arguments| self.0.step(gpu, &[frame, &screen.counters, arguments], 1))
    }
}

/// The ways in which each pixel finds its nearest point, by what a device has. All give the same.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Nearest {
    /// With all 64-bit atomics and subgroups.
    InLanes,
    /// With a 64-bit atomic minimum.
    Once,
    /// With 32-bit atomics, by a pass that runs twice.
    Twice,
}

impl Nearest {
    /// The best way on a device. Software runs a lane after the other, so lanes spare each other nothing.
    pub(crate) fn best(gpu: &Gpu) -> Self {
        let ways = if gpu.is_software() { &[Self::Once][..] } else { &[Self::InLanes, Self::Once] };
        ways.iter().copied().find(|way| way.fits(gpu)).unwrap_or(Self::Twice)
    }

    /// Whether the device has the features for it.
    pub(crate) fn fits(self, gpu: &Gpu) -> bool {
        let needs = match self {
            Self::InLanes => INT64_IN_LANES,
            Self::Once => INT64_ATOMICS,
            Self::Twice => wgpu::Features::empty(),
        };
        gpu.device.features().contains(needs)
    }
}

/// The pass of a [`Nearest`].
#[derive(Debug)]
enum NearestPass {
    /// A pass, and the points that its workgroups take.
    Once(Pass, u32),
    /// With 32-bit atomics: the pass, and the uniform of each turn.
    Twice(Pass, [wgpu::Buffer; 2]),
}

impl NearestPass {
    fn new(gpu: &Gpu, way: Nearest) -> Result<Self, Error> {
        match way {
            Nearest::InLanes => return Ok(Self::Once(Pass::new(gpu, &PROJECT_LANES, &[])?, POINTS_PER_LANE * GROUP)),
            Nearest::Once => return Ok(Self::Once(Pass::new(gpu, &PROJECT, &[])?, GROUP)),
            Nearest::Twice => {}
        }
        let turn = |turn: u32| {
            let told = gpu.uniform::<u32>("turn")?;
            gpu.queue.write_buffer(&told, 0, bytemuck::bytes_of(&turn));
            Ok::<_, Error>(told)
        };
        Ok(Self::Twice(Pass::new(gpu, &PROJECT_32, &[])?, [turn(0)?, turn(1)?]))
    }

    fn steps(&self, gpu: &Gpu, frame: &wgpu::Buffer, cloud: &DeviceCloud, screen: &ScreenBuffers) -> Vec<Step> {
        let run = |pass: &Pass, per_group: u32, turn: Option<&wgpu::Buffer>| -> Vec<Step> {
            let step = |chunk: &Chunk| {
                let ScreenBuffers { keys, counters, sixteenths, near, .. } = screen;
                let buffers = [frame, &chunk.uniform, &chunk.positions, keys, counters, sixteenths, near];
                let buffers: Vec<_> = buffers.into_iter().chain(turn).collect();
                pass.step(gpu, &buffers, chunk.capacity.div_ceil(per_group))
            };
            cloud.chunks().iter().map(step).collect()
        };
        match self {
            Self::Once(pass, per_group) => run(pass, *per_group, None),
            Self::Twice(pass, turns) => turns.iter().flat_map(|turn| run(pass, GROUP, Some(turn))).collect(),
        }
    }
}

/// The passes of projection.
#[derive(Debug)]
pub(crate) struct ProjectPasses {
    clear: Pass,
    nearest: NearestPass,
    occupancy: Pass,
    count: Pass,
    compact: Pass,
    gather: Pass,
    split_count: Pass,
    split: Pass,
}

impl ProjectPasses {
    /// Compiles the passes for one way to find the nearest points.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(crate) fn new(gpu: &Gpu, way: Nearest) -> Result<Self, Error> {
        let [clear, occupancy, count, compact, gather, split_count, split] = Pass::all(
            gpu,
            [
                (&CLEAR, &[]),
                (&OCCUPANCY, &[]),
                (&COUNT, &[]),
                (&COMPACT, &[]),
                (&GATHER, &[]),
                (&SPLIT_COUNT, &[]),
                (&SPLIT, &[drawing_constant(gpu)]),
            ],
        )?;
        let nearest = NearestPass::new(gpu, way)?;
        Ok(Self { clear, nearest, occupancy, count, compact, gather, split_count, split })
    }

    /// Projects `cloud` into `screen`.
    pub(crate) fn steps(
        &self,
        gpu: &Gpu,
        frame: &wgpu::Buffer,
        cloud: &DeviceCloud,
        screen: &ScreenBuffers,
    ) -> Vec<Step> {
        // Without room there are no points.
        let Some(names) = cloud.names() else { return Vec::new() };
        let ScreenBuffers { counters, keys, near, density, cell_start, sixteenths, held, .. } = screen;
        let ScreenBuffers { source, pixels, points, values, block_sums, depth, centers, past, arguments, .. } = screen;
        let [width, height] = screen.size;
        let slots = (width * height) << u32::from(screen.halves);
        let slot_blocks = slots.div_ceil(RANK_BLOCK_FLAGS);
        let cleared = (width * height).max(near::NEAR_CELLS as u32);
        let clear = [frame, density, counters, sixteenths, near, depth, centers, past];
        let mut steps = vec![self.clear.step(gpu, &clear, cleared.div_ceil(GROUP))];
        steps.extend(self.nearest.steps(gpu, frame, cloud, screen));
        const BLOCK_PX: u32 = cpu::OCCUPANCY_BLOCK_PX as u32;
        let covered_blocks = width.div_ceil(BLOCK_PX) * height.div_ceil(BLOCK_PX);
        steps.push(self.occupancy.step(gpu, &[frame, keys, counters, sixteenths, held], covered_blocks));
        // Blocks beyond the slots, which only hold points of sparse cells, count none.
        let blocks = slots.max(screen.capacity).div_ceil(RANK_BLOCK_FLAGS);
        let count = [frame, keys, counters, block_sums, density, near, source, sixteenths, &arguments[0]];
        steps.push(self.count.step(gpu, &count, 1 + blocks));
        let compact = [frame, keys, counters, block_sums, source, pixels, cell_start, names, sixteenths];
        steps.push(self.compact.step(gpu, &compact, slot_blocks));
        for chunk in cloud.chunks() {
            let Chunk { uniform, positions, values: stored, .. } = chunk;
            let gather = [frame, uniform, positions, stored, counters, source, pixels, points, values, near];
            steps.push(self.gather.step(gpu, &gather, screen.groups(Work::Visible256)));
        }
        steps.push(self.split_count.step(
            gpu,
            &[frame, points, density, counters, block_sums],
            screen.groups(Work::VisibleBlocks),
        ));
        let split = [frame, points, density, counters, block_sums, &screen.queries, &screen.passive, &arguments[1]];
        steps.push(self.split.step(gpu, &split, screen.groups(Work::VisibleBlocks)));
        steps
    }
}

#[cfg(test)]
pub(crate) mod tests;
