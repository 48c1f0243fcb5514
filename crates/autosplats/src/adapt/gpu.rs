//! Adapt on the GPU: the steps of the CPU form, one pass each.

use super::cells::{MOST_FINEST, MOST_LEVELS, SLABS, least_side_px};
use super::depth::{DepthNoise, DepthRun};
use super::noise::{FrameStatistics, MOST_SAMPLED, STEADY_SCALES};
use super::sheets::{SHEET_LEVELS, SHEETS};
use super::{self as adapt, SCALES, cells, depth, noise, quadric, rows, rules, sheets, through};
use crate::Error;
use crate::fit::{self, Surfel};
use crate::gpu::{DISPATCH_BYTES, Gpu, Groups, Library, Pass, SMALL_GROUP, Step, constants, files, passes};
use crate::project::gpu::{Counter, Round, ScreenBuffers};

/// Imports and constants of the passes.
const LIBRARY: Library = Library {
    files: &[files![
        "adapted",
        "alone",
        "ball_scatter",
        "balls",
        "base_radius",
        "calls",
        "cell_sheets",
        "choose",
        "clusters",
        "depth_noise",
        "filling",
        "later",
        "layout",
        "levels",
        "merging",
        "own_balls",
        "quadric",
        "quantiles",
        "rows",
        "scatters",
        "sheet",
        "sorted_sample",
        "surface",
        "through",
        "together",
    ]],
    constants: &[
        Counter::CONSTANTS,
        constants!(in adapt: MIN_BASE_FIRST_RADII, SCALES, STEP),
        constants!(in cells: MOST_LEVELS, SLABS),
        constants!(in depth: FARTHEST_ALONG, GRAZING_COSINE, LONGEST_SHADOW),
        constants!(in fit: LONGEST, SUPPORT, SWEEPS),
        constants!(in Surfel: BACK, LINE),
        constants!(in noise:
            CELL_SHIFT, CERTAIN_NOISE_SHARES, FULL_K_RADIUS_CONTRAST, GROWTH_END_DIVISOR, GROWTH_POWER_RAMP, LEAST_PAIRS,
            LEAST_SAMPLE, MAX_STEADY_RATIO, MAX_THIN_SHARE_RISE, MIN_BALL_SHARE_DIVISOR, MIN_K_RADIUS_CONTRAST,
            MOST_SAMPLED, NOISE_QUANTILE, NOISE_SAMPLE_COUNT, NOISE_SHARES, ROUNDING_SCATTER_RADII, STEADY_SCALES,
            STRUCTURE_GROWTH_POWER, THICK_NOISE, THIN_SCATTER_RADII, THIN_SHARE, UNEVEN_NOISE_QUANTILE,
            UNEVEN_NOISE_SHARES
        ),
        constants!(in quadric:
            CELLS_PER_RADIUS, EVEN_WEIGHT, FULL_WEIGHT_SQUARED_RADII, LEAST_CLUSTERS, LEAST_OF_PLANE, LEAST_PIVOT, RIDGE
        ),
        constants!(in rows:
            AREA_HALF_THICKNESS_RADII, BALL_OVER_SIDE_WEIGHT, BEYOND_LINE_DISTANCES, BEYOND_RADII,
            MAX_AREA_HEIGHT_RATIO, MAX_POINT_HEIGHT_RADII, MAX_SCAN_LINE_TILT_SINE, MAX_SEEN_THROUGH_SHARE,
            MAX_SEMI_AXIS_RADII, MIN_AREA_RATIO, MIN_SCAN_LINE_ANISOTROPY, MIN_SIDE_AREA_RATIO,
            SEMI_AXIS_LINE_DISTANCES, SIDE_SLACK_RADII, THIN_LINE_ASPECT
        ),
        constants!(in rules:
            AGREE_ERRORS, CROWD_WEIGHT_PER_NEIGHBOR, DOT_OUTLIER_SCORE, DOT_PX, DROPPED_OUTLIER_SCORE,
            GOOD_NORMAL_ERROR_RAD, ISOLATED_SCORE, LEAST_TRACE, MAX_K_RADIUS_FIRST_RADII, MAX_MEAN_DISTANCE_K_RADII,
            MAX_MOVE_NOISES, MAX_NOISE_BALL_RADII, MAX_NOISE_K_RADII, MAX_PLANE_DISTANCE_K_RADII,
            MAX_RELIABLE_ERROR_RAD, MAX_SCATTER_KNOWN_NOISES, MAX_SCATTER_NOISES, MOST_TINY,
            OUTLIER_OFFSET_KNOWN_NOISES, OUTLIER_OFFSET_NOISES, SPARSE_MEDIAN_K_RADII, TINY_PX, TINY_REACH_PX,
            TINY_SLOPE, WIDER_BALL_K_RADII
        ),
        constants!(in sheets:
            COVERED_NOISES, COVERED_REACH, K_RADIUS_PARTS_PER_PX, MAX_SUMMED_K_RADIUS_PX, SHEETS, SHEET_LEVELS
        ),
        constants!(in through:
            CELLS_TO_COUNT, LEAST_ON, MAX_SURFACE_MEAN_RADII, MAX_SURFACE_VARIATION, MIN_SURFACE_WIDTH_RATIO,
            MIN_TESTED_FIRST_RADII, ON_DISC, ON_DISC_NOISE, SURFACE_BALL_K_RADII
        ),
        constants![BUNCH, QUANTILE_ARGUMENTS, SAMPLE_PARTS, SCATTER_ARGUMENTS, TILE, TOGETHER],
    ],
};

passes! {
    "adapt", LIBRARY;
    FILL = "fill",
    MERGE = "merge",
    PICK = "pick",
    SCATTERS = "scatter",
    SCATTERS_ALONE = "scatter_alone",
    QUANTILES = "quantile",
    NOISE = "noise",
    ASK = "ask",
    FIT_SHEETS = "fit_sheets",
    FIT_SHEETS_ALONE = "fit_sheets_alone",
    ADAPT = "adapt",
    FIT_BALLS = "fit_balls",
    FIT_BALLS_ALONE = "fit_balls_alone",
}

/// Invocations that sum up a ball together, on hardware. On software each sums up balls of its own.
const TOGETHER: u32 = 32;
/// Surfels of the sample that a workgroup sorts, on hardware and on software.
const SORTED_PER_GROUP: [u32; 2] = [TOGETHER, SMALL_GROUP];
/// Balls of the sample, cells with sheets and listed surfels of a workgroup, on hardware and on software. On hardware
/// it takes one after the other: small numbers keep a GPU evenly busy. Cells are at most 32 there, the bits of a mask.
const BALLS_PER_GROUP: [u32; 2] = [1, SMALL_GROUP];
const CELLS_PER_GROUP: [u32; 2] = [4, SMALL_GROUP];
const SURFELS_PER_GROUP: [u32; 2] = [1, SMALL_GROUP];
/// Ball sizes that are measured at first, the others only where these do not tell the noise; on hardware and on
/// software. A size is judged by the next. Software saves the work. Hardware would wait longer for more dispatches.
const FIRST_SCALES: [usize; 2] = [SCALES, 2];
const _: () = assert!(TOGETHER.is_multiple_of(8), "eight rows of a ball are summed up at a time");
const _: () = assert!((MOST_SAMPLED as u32).is_multiple_of(SORTED_PER_GROUP[0]), "workgroups of the sample are full");
const _: () = assert!((MOST_SAMPLED as u32).is_multiple_of(SORTED_PER_GROUP[1]), "workgroups of the sample are full");
/// Places in [`AdaptBuffers::arguments`] of the workgroups that measure the other sizes, and that find their quantiles.
const SCATTER_ARGUMENTS: u32 = 3;
const QUANTILE_ARGUMENTS: u32 = 4;
/// Clusters of a cell that are stored side by side.
const BUNCH: usize = 4;
/// Parts of the sample that have quantiles: its densest third, its sparsest third, all, and all by steady shares.
const SAMPLE_PARTS: usize = 4;
/// Columns and rows of cells in a workgroup's tile. It has an invocation for each cell.
const TILE: u32 = 16;
/// Coarser levels that a workgroup fills within its tile, on hardware and on a software device. There, invocations
/// without a cell take as long as others, so that each level is better filled by a dispatch of its own.
const COARSER: [usize; 2] = [TILE.trailing_zeros() as usize, 0];

/// `Level` of `imports/levels.wgsl`: side, columns, rows and first cell.
type Level = [u32; 4];
/// Kind and value.
type Quantile = [u32; 2];
/// Mean and count.
type Cluster = [f32; 4];
/// `Sheet` of `imports/sheet.wgsl`, padded.
type Sheet = [f32; 16];

/// Structs of WGSL with their sizes here.
#[cfg(test)]
pub(crate) const SIZES: &[(&str, usize)] =
    &[("Level", size_of::<Level>()), ("Quantile", size_of::<Quantile>()), ("Sheet", size_of::<Sheet>())];

/// Surfels that ask for the sheets of a cell, laid out as in `imports/sheet.wgsl`.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct Asked {
    pub(crate) count: u32,
    pub(crate) k_radii: u32,
    pub(crate) point: u32,
}

/// Buffers that the stage keeps on the device from pass to pass.
#[derive(Debug)]
pub(crate) struct AdaptBuffers {
    levels: wgpu::Buffer,
    /// Workgroups that fit sheets, those that fit the balls of each round, those that measure the larger balls of the
    /// sample and those that find their quantiles, three `u32` each.
    arguments: wgpu::Buffer,
    /// Most tiles of each level.
    tiles: [u32; MOST_LEVELS],
    clusters: wgpu::Buffer,
    /// [`Asked`] per cell.
    asked: wgpu::Buffer,
    sheets: wgpu::Buffer,
    /// Indices of the sampled surfels, then their number. `picked` is unordered, `sampled` is sorted by k-radius. What
    /// is behind: `imports/scatters.wgsl`.
    picked: wgpu::Buffer,
    sampled: wgpu::Buffer,
    scatters: wgpu::Buffer,
    /// Quantiles, then the steady shares of the first scales.
    quantiles: wgpu::Buffer,
    /// [`FrameStatistics`].
    statistics: wgpu::Buffer,
    /// Owned by [`DepthNoiseBuffer`].
    depth_noise: wgpu::Buffer,
}

impl AdaptBuffers {
    /// Allocates for pictures of `size`; `known` holds the noise of the cloud.
    ///
    /// # Errors
    /// [`Error::DeviceLimit`], [`Error::DeviceMemory`] if the device has too little.
    pub(crate) fn new(gpu: &Gpu, size: [u32; 2], known: &DepthNoiseBuffer) -> Result<Self, Error> {
        let most_finest = most_finest(gpu.most_bound());
        let sheet_cells = most_sheet_cells(size, most_finest);
        Ok(Self {
            levels: gpu.buffer(
                "levels of cells",
                size_of::<[Level; MOST_LEVELS]>() as u64,
                wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_SRC,
            )?,
            arguments: gpu.buffer(
                "arguments of sheets and balls",
                5 * DISPATCH_BYTES,
                wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::INDIRECT,
            )?,
            tiles: std::array::from_fn(|level| most_tiles(size, most_finest, level)),
            clusters: gpu.storage::<[Cluster; SLABS]>("clusters", most_cells(size, most_finest))?,
            asked: gpu.storage::<Asked>("surfels that ask for sheets", sheet_cells)?,
            sheets: gpu.storage::<[Sheet; SHEETS]>("sheets", sheet_cells)?,
            picked: gpu.storage::<u32>("picked surfels", MOST_SAMPLED + 2)?,
            sampled: gpu.storage::<u32>("sampled surfels", 2 * MOST_SAMPLED + 1)?,
            scatters: gpu.storage::<u32>("scatter of balls", SCALES * MOST_SAMPLED)?,
            quantiles: gpu.storage::<Quantile>("quantiles of scatter", SAMPLE_PARTS * SCALES + STEADY_SCALES)?,
            statistics: gpu.storage::<FrameStatistics>("statistics of surfels", 1)?,
            depth_noise: known.runs.clone(),
        })
    }

    /// [`FrameStatistics`], with the measured noise.
    pub(crate) fn noise(&self) -> &wgpu::Buffer {
        &self.statistics
    }
}

/// Known noise of a cloud's depths, on the device.
#[derive(Debug)]
pub(crate) struct DepthNoiseBuffer {
    runs: wgpu::Buffer,
    len: usize,
}

impl DepthNoiseBuffer {
    /// The buffer of a cloud without known noise.
    ///
    /// # Errors
    /// [`Error::DeviceMemory`] if the device has no room.
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Error> {
        // A new buffer is all zeros, which is a run without known noise.
        Ok(Self { runs: gpu.storage::<DepthRun>("noise of depths", 1)?, len: 1 })
    }

    /// Writes the runs of a cloud. Returns whether the buffer was replaced.
    ///
    /// # Errors
    /// [`Error::DeviceLimit`], [`Error::DeviceMemory`] if the device has too little.
    pub(crate) fn write(&mut self, gpu: &Gpu, noise: &DepthNoise) -> Result<bool, Error> {
        let runs = noise.on_device();
        let is_new = runs.len() != self.len;
        if is_new {
            *self = Self { runs: gpu.storage::<DepthRun>("noise of depths", runs.len())?, len: runs.len() };
        }
        gpu.queue.write_buffer(&self.runs, 0, bytemuck::cast_slice(&runs));
        Ok(is_new)
    }
}

/// Most finest cells on a device that binds `most_bound` bytes at once. All levels together take a third more, plus
/// rounding. A smaller limit than on the CPU makes cells of large pictures coarser.
fn most_finest(most_bound: u64) -> usize {
    (most_bound as usize / size_of::<[Cluster; SLABS]>() / 7 * 5).min(MOST_FINEST)
}

/// Largest number of cells of all levels, for a picture of `size`.
fn most_cells(size: [u32; 2], most_finest: usize) -> usize {
    let side_px = least_side_px(size, most_finest);
    let mut sides = size.map(|side| (side as usize).div_ceil(side_px));
    let mut cells = 0;
    for _ in 0..MOST_LEVELS {
        cells += sides[0] * sides[1];
        sides = sides.map(|side| side.div_ceil(2));
    }
    cells
}

/// Largest number of cells with sheets, for a picture of `size`.
fn most_sheet_cells(size: [u32; 2], most_finest: usize) -> usize {
    let side_px = least_side_px(size, most_finest) << SHEET_LEVELS[0];
    size.map(|side| (side as usize).div_ceil(side_px)).iter().product()
}

/// Largest number of tiles of a level, for a picture of `size`.
fn most_tiles(size: [u32; 2], most_finest: usize, level: usize) -> u32 {
    let tile_px = TILE * ((least_side_px(size, most_finest) as u32) << level);
    size.map(|side| side.div_ceil(tile_px)).iter().product()
}

/// The passes of the stage.
#[derive(Debug)]
pub(crate) struct AdaptPasses {
    fill: Pass,
    merge: Pass,
    /// Levels that a dispatch fills first, and a uniform with each.
    firsts: Vec<(usize, wgpu::Buffer)>,
    pick: Pass,
    scatter: Pass,
    /// Workgroups of `scatter` that sort the sample and measure the first sizes, and whether there are other sizes.
    scatters: u32,
    in_parts: bool,
    quantile: Pass,
    noise: Pass,
    fit_sheets: Pass,
    ask: Pass,
    adapt: Pass,
    fit_balls: Pass,
}

impl AdaptPasses {
    /// Compiles the passes.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Error> {
        Self::for_kind(gpu, gpu.is_software())
    }

    /// Compiles the passes that suit hardware or software.
    fn for_kind(gpu: &Gpu, software: bool) -> Result<Self, Error> {
        Self::with_first_scales(gpu, software, FIRST_SCALES[usize::from(software)])
    }

    /// Like [`for_kind`](Self::for_kind), with this number of ball sizes measured at first.
    fn with_first_scales(gpu: &Gpu, software: bool, first_scales: usize) -> Result<Self, Error> {
        let kind = usize::from(software);
        let coarser = ("COARSER", COARSER[kind] as f64);
        let first = |level: usize| {
            let told = gpu.uniform::<u32>("first level")?;
            gpu.queue.write_buffer(&told, 0, bytemuck::bytes_of(&(level as u32)));
            Ok::<_, Error>((level, told))
        };
        let step = COARSER[kind] + 1;
        let cells = &[("CELLS_PER_GROUP", CELLS_PER_GROUP[kind].into())][..];
        let balls = ("BALLS_PER_GROUP", BALLS_PER_GROUP[kind].into());
        let of_first = ("FIRST_SCALES", first_scales as f64);
        let surfels = ("SURFELS_PER_GROUP", SURFELS_PER_GROUP[kind].into());
        let most_finest = ("MOST_FINEST", most_finest(gpu.most_bound()) as f64);
        // What takes longest begins first.
        let [fit_balls, adapt, fit_sheets, scatter, fill, merge, pick, quantile, noise, ask] = Pass::all(
            gpu,
            [
                (if software { &FIT_BALLS_ALONE } else { &FIT_BALLS }, &[]),
                (&ADAPT, &[surfels]),
                if software { (&FIT_SHEETS_ALONE, &[]) } else { (&FIT_SHEETS, cells) },
                (if software { &SCATTERS_ALONE } else { &SCATTERS }, &[]),
                (&FILL, &[most_finest, coarser]),
                (&MERGE, &[coarser]),
                (&PICK, &[]),
                (&QUANTILES, &[of_first]),
                (&NOISE, &[cells[0], of_first, balls]),
                (&ASK, &[]),
            ],
        )?;
        Ok(Self {
            fill,
            merge,
            firsts: (step..MOST_LEVELS).step_by(step).map(first).collect::<Result<_, _>>()?,
            pick,
            scatter,
            scatters: MOST_SAMPLED as u32 / SORTED_PER_GROUP[kind]
                + (first_scales * MOST_SAMPLED) as u32 / BALLS_PER_GROUP[kind],
            in_parts: first_scales < SCALES,
            quantile,
            noise,
            fit_sheets,
            ask,
            adapt,
            fit_balls,
        })
    }

    /// Steps that sum up the screen points of a new frame.
    pub(crate) fn steps_cells(
        &self,
        gpu: &Gpu,
        frame: &wgpu::Buffer,
        screen: &ScreenBuffers,
        buffers: &AdaptBuffers,
    ) -> Vec<Step> {
        let ScreenBuffers { counters, cell_start, points, .. } = screen;
        let AdaptBuffers { levels, tiles, clusters, asked, sheets, picked, .. } = buffers;
        let fill = [frame, counters, levels, cell_start, points, clusters, asked, sheets];
        let fill = self.fill.step(gpu, &fill, tiles[0]);
        let merge = |(level, first): &(usize, wgpu::Buffer)| {
            self.merge.step(gpu, &[frame, levels, clusters, picked, first], tiles[*level])
        };
        [fill].into_iter().chain(self.firsts.iter().map(merge)).collect()
    }

    /// Steps that measure the noise (first round only, on active points) and adapt the surfels of `round`.
    pub(crate) fn steps(
        &self,
        gpu: &Gpu,
        frame: &wgpu::Buffer,
        screen: &ScreenBuffers,
        surfels: &wgpu::Buffer,
        buffers: &AdaptBuffers,
        round: Round,
    ) -> Vec<Step> {
        let ScreenBuffers { counters, density, left, .. } = screen;
        let AdaptBuffers { levels, arguments, clusters, asked, sheets, .. } = buffers;
        let AdaptBuffers { picked, sampled, scatters, quantiles, statistics, depth_noise, .. } = buffers;
        let mut steps = Vec::new();
        if round == Round::Active {
            let balls = [frame, counters, density, surfels, levels, clusters, picked, scatters, sampled];
            let quantile = [frame, sampled, scatters, quantiles, picked];
            let noise = [frame, surfels, sampled, quantiles, statistics, levels, depth_noise, arguments, picked];
            steps.extend([
                self.pick.step(gpu, &[frame, counters, surfels, picked], screen.groups(round.work_64())),
                self.scatter.step(gpu, &balls, self.scatters),
                self.quantile.step(gpu, &quantile, (SAMPLE_PARTS * SCALES) as u32),
                self.noise.step(gpu, &noise, 1),
            ]);
            if self.in_parts {
                let counted = |place: u32| Groups::Counted(arguments.clone(), u64::from(place) * DISPATCH_BYTES);
                steps.extend([
                    self.scatter.step(gpu, &balls, counted(SCATTER_ARGUMENTS)),
                    self.quantile.step(gpu, &quantile, counted(QUANTILE_ARGUMENTS)),
                    self.noise.step(gpu, &noise, 1),
                ]);
            }
        }
        let ask = [frame, counters, levels, statistics, surfels, depth_noise, asked];
        let fit = [frame, levels, clusters, statistics, asked, depth_noise, sheets];
        let adapt = [frame, counters, density, levels, statistics, sheets, depth_noise, surfels, left, arguments];
        let balls = [frame, counters, density, levels, clusters, statistics, sheets, depth_noise, surfels, left];
        let balls_at = (1 + round as u64) * DISPATCH_BYTES;
        steps.extend([
            self.ask.step(gpu, &ask, screen.groups(round.work_64())),
            self.fit_sheets.step(gpu, &fit, Groups::Counted(arguments.clone(), 0)),
            self.adapt.step(gpu, &adapt, screen.groups(round.work_64())),
            self.fit_balls.step(gpu, &balls, Groups::Counted(arguments.clone(), balls_at)),
        ]);
        steps
    }
}

#[cfg(test)]
pub(crate) mod tests;
