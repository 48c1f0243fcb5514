//! Splatting on the GPU.
//!
//! # How it works
//! The depth map takes minima, which do not depend on the order. An invocation draws a splat, a workgroup draws a large
//! one, by atomic minima of integers that order as depths do. Few splats die in a refinement, and most of them were
//! hidden. So refinement erases their depths from the map, and redraws only splats that meet a cell of 8×8 pixels with
//! erased depths (`shared/redraw.wgsl`).
//!
//! Attributes are sums, which have to equal those of the CPU and be the same each time. So a pixel draws its splats in
//! list order. A workgroup per patch of 16×32 pixels finds them by a tree over the list instead of bins
//! (`shared/splat.wgsl`, `shared/patch.wgsl`). The centres for trimming are counted in integers, again independent of
//! the order.

use super::centers::CENTER_STEPS;
use super::layers::{Channels, LayerBuffers};
use super::raster::KERNEL_SLOPE;
use super::setup::{DOT_RADIUS_PX, EPSILON_RADII, MAX_AXIS_PER_DEPTH, MIN_FACING_COSINE, RECOVER_DISTANCE_RADII};
use super::trim::blurred::{
    BLOCK_PX, BLOCKS_BEYOND_FRINGE, BLURRING_NOISE_SHARE, FRINGE_NOISES, FULL_NOISE_SINE, HALF_WAY_OFFSET_SHARE,
    MAX_BLURRED_OFFSET, MAX_PIXEL_WINDOW_PX, MAX_WINDOW_PX, MIN_BLURRING_NOISE_PX, MIN_WINDOW_PX,
    MIN_WINDOW_SIXTEENTHS, SPREAD_WEIGHT, SURE_NOISE_DISTANCES, SURE_NOISE_PX, WINDOW_PER_KERNEL_VARIANCE,
    WINDOW_PER_NOISE_VARIANCE,
};
use super::trim::{
    CORE_WEIGHT, DECISIVE_SIXTEENTHS, EXTRA_STRIDES, FINE_DIRECTION_SIXTEENTHS, INNER_WEIGHT, LINE_LENGTH_REACHES,
    MAX_ALIGNED_STRIDE_PX, MAX_NARROW_REACH_PX, MAX_SPLAT_MEAN_OFFSET_PX, MIN_SIXTEENTHS, MIN_SPLATS,
    SIDE_SHARE_DIVISOR, SPLAT_WINDOW_PX, STRIDES_PER_REACH,
};
use crate::Error;
use crate::adapt::gpu::NOISE_FLOATS;
use crate::fit::SUPPORT;
use crate::gpu::{Gpu, Pass, PassSource, Step};
use crate::project::MARGIN_REACH;
use crate::project::gpu::{Counter, Round, ScreenBuffers, Work, WorkPass, scan_pass};

#[cfg(test)]
pub(crate) const PASSES: &[PassSource] = &[
    SET_UP,
    BOXES,
    CLEAR_DEPTH,
    DEPTH,
    DEPTH_LARGE,
    RECOVER_COUNT,
    RECOVER,
    CLEAR_WORDS,
    REFINE,
    ERASE,
    ERASE_LARGE,
    REDRAW,
    ATTRIBUTES,
    ADD_CENTERS,
    SUM_BLOCKS,
    TRIM,
];
const SET_UP: PassSource = PassSource::new("splat/set_up", include_str!("set_up.wgsl"));
const BOXES: PassSource = PassSource::new("splat/boxes", include_str!("boxes.wgsl"));
const CLEAR_DEPTH: PassSource = PassSource::new("splat/clear_depth", include_str!("clear_depth.wgsl"));
const DEPTH_LARGE: PassSource = PassSource::new("splat/depth_large", include_str!("depth_large.wgsl"));
const DEPTH: PassSource = PassSource::new("splat/depth", include_str!("depth.wgsl"));
const RECOVER_COUNT: PassSource = PassSource::new("splat/recover_count", include_str!("recover_count.wgsl"));
const RECOVER: PassSource = PassSource::new("splat/recover", include_str!("recover.wgsl"));
pub(super) const CLEAR_WORDS: PassSource = PassSource::new("splat/clear_words", include_str!("clear_words.wgsl"));
const REFINE: PassSource = PassSource::new("splat/refine", include_str!("refine.wgsl"));
const ERASE: PassSource = PassSource::new("splat/erase", include_str!("erase.wgsl"));
const ERASE_LARGE: PassSource = PassSource::new("splat/erase_large", include_str!("erase_large.wgsl"));
const REDRAW: PassSource = PassSource::new("splat/redraw", include_str!("redraw.wgsl"));
const ATTRIBUTES: PassSource = PassSource::new("splat/attributes", include_str!("attributes.wgsl"));
const ADD_CENTERS: PassSource = PassSource::new("splat/add_centers", include_str!("add_centers.wgsl"));
const SUM_BLOCKS: PassSource = PassSource::new("splat/sum_blocks", include_str!("sum_blocks.wgsl"));
const TRIM: PassSource = PassSource::new("splat/trim", include_str!("trim.wgsl"));

/// Most pixels of a splat's bounds that one invocation draws. On hardware the other invocations of its group wait for
/// it; on a software device, the second value, a workgroup costs more.
const MAX_INVOCATION_PX: [u32; 2] = [128, 1024];
/// Columns and rows of a patch, and splats that are drawn into it at a time.
const PATCH: [u32; 2] = [16, 32];
const BATCH: u32 = 64;
/// Side in pixels of the square that a workgroup trims.
const SQUARE: u32 = 32;
/// Side in pixels of a cell that refinement marks.
const CELL: u32 = 8;
/// Splats below each top node of the tree, and nodes there (`shared/splat.wgsl`).
const TOP_SPLATS: u32 = 4096;
const TOP_NODES: u32 = 1 + 16 + 256 + 4096;
/// Bytes of a splat.
const SPLAT_BYTES: usize = 48;

/// Options of drawing the layers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LayerRules<'a> {
    /// Refine the depth map twice first [Paper, §7].
    pub(crate) depth_refinement: bool,
    /// Trim the layers in the end.
    pub(crate) trim: bool,
    /// Noise of the frame in the layout of `shared/noise.wgsl`; `None` if it is not measured.
    pub(crate) noise: Option<&'a wgpu::Buffer>,
}

/// Splats on the device, and the depth map.
#[derive(Debug)]
pub(crate) struct SplatBuffers {
    splats: wgpu::Buffer,
    tree: wgpu::Buffer,
    /// Indices of splats too large for one invocation.
    large: wgpu::Buffer,
    /// Depth per pixel, pushed back by ε, row by row, as `shared/depth_map.wgsl` has it; infinite where nothing is.
    pub(crate) depth: wgpu::Buffer,
    /// Change of each splat in the last refinement, and the marks of cells with erased depths (`shared/redraw.wgsl`).
    changes: wgpu::Buffer,
    cells: wgpu::Buffer,
    /// Centres of splats in each pixel, row by row (`centers.rs`).
    centers: wgpu::Buffer,
    /// Blocks of pixels, row by row (`shared/blocks.wgsl`).
    blocks: wgpu::Buffer,
    /// Zeros for frames whose noise is not measured.
    no_noise: wgpu::Buffer,
}

impl SplatBuffers {
    /// Buffers for `screen_capacity` splats and a picture of `size`.
    ///
    /// # Errors
    /// [`Error::DeviceLimit`], [`Error::DeviceMemory`] if the device has too little.
    pub(crate) fn new(gpu: &Gpu, screen_capacity: u32, size: [u32; 2]) -> Result<Self, Error> {
        let pixels = size[0] as usize * size[1] as usize;
        let nodes = 1 + screen_capacity.div_ceil(TOP_SPLATS) as usize * TOP_NODES as usize;
        Ok(Self {
            splats: gpu.storage::<[u8; SPLAT_BYTES]>("splats", screen_capacity as usize)?,
            large: gpu.storage::<u32>("large splats", screen_capacity as usize)?,
            tree: gpu.storage::<[u32; 2]>("tree of splats", nodes)?,
            depth: gpu.storage::<u32>("depth map", pixels)?,
            changes: gpu.storage::<u32>("changes of splats", screen_capacity as usize)?,
            cells: gpu.storage::<u32>("cells of the depth map", cells(size) as usize)?,
            centers: gpu.storage::<u32>("centres of splats", pixels)?,
            blocks: gpu.storage::<u32>("blocks of pixels", block_count(size) as usize)?,
            no_noise: gpu.storage::<f32>("no noise", NOISE_FLOATS)?,
        })
    }
}

/// The passes of splatting.
#[derive(Debug)]
pub(crate) struct SplatPasses {
    /// For each [`Round`].
    set_up: [Pass; 2],
    boxes: Pass,
    clear_depth: Pass,
    depth: [Pass; 2],
    /// For each [`Round`].
    depth_large: [Pass; 2],
    redraw_large: Pass,
    recover_count: Pass,
    scan_recovered: Pass,
    recover: Pass,
    work: WorkPass,
    clear_words: Pass,
    refine: Pass,
    erase: Pass,
    erase_large: Pass,
    redraw: Pass,
    attributes: Pass,
    add_centers: Pass,
    sum_blocks: Pass,
    /// The pass that only counts covered pixels, and the pass that trims too.
    trim: [Pass; 2],
    /// Linear value of each 8-bit step of a colour.
    linear: wgpu::Buffer,
}

impl SplatPasses {
    /// Compiles the passes for splats that carry `channels`; `linear` has the linear value of each 8-bit step of a
    /// colour.
    ///
    /// # Errors
    /// [`Error::Device`], [`Error::DeviceMemory`].
    pub(crate) fn new(gpu: &Gpu, channels: Channels, linear: &[f32; 256]) -> Result<Self, Error> {
        let pass = |source: &PassSource| Pass::new(gpu, source, &[]);
        let most_px = ("MAX_INVOCATION_PX", MAX_INVOCATION_PX[usize::from(gpu.is_software())].into());
        let dot_radius = ("DOT_RADIUS_PX", f64::from(DOT_RADIUS_PX));
        let set_up = |recovered: f64| {
            let constants = [
                ("RECOVERED_ONLY", recovered),
                most_px,
                dot_radius,
                ("SUPPORT", SUPPORT.into()),
                ("MIN_FACING_COSINE", MIN_FACING_COSINE.into()),
                ("EPSILON_RADII", EPSILON_RADII.into()),
                ("MAX_AXIS_PER_DEPTH", MAX_AXIS_PER_DEPTH.into()),
            ];
            Pass::new(gpu, &SET_UP, &constants)
        };
        let depth = |recovered: f64| Pass::new(gpu, &DEPTH, &[("RECOVERED_ONLY", recovered), dot_radius, most_px]);
        let depth_large = |recovered: f64, redrawn: f64| {
            let constants = [("RECOVERED_ONLY", recovered), ("REDRAWN_ONLY", redrawn), dot_radius];
            Pass::new(gpu, &DEPTH_LARGE, &constants)
        };
        let Channels { color, scalar, measures, backs } = channels;
        let slots = |carried: bool| if carried { f64::from(BATCH) } else { 1.0 };
        let attributes = [
            dot_radius,
            ("COLOR", color.into()),
            ("SCALAR", scalar.into()),
            ("MEASURES", measures.into()),
            ("BACKS", backs.into()),
            ("COLOR_SLOTS", slots(color)),
            ("SCALAR_SLOTS", slots(scalar)),
            ("MEASURE_SLOTS", slots(measures)),
            ("BACK_SLOTS", slots(backs)),
            ("KERNEL_SLOPE", KERNEL_SLOPE.into()),
            ("CORE_WEIGHT", CORE_WEIGHT.into()),
            ("INNER_WEIGHT", INNER_WEIGHT.into()),
        ];
        let trim = |trims: f64| {
            let constants = [
                ("TRIMS", trims),
                ("LINE_LENGTH_REACHES", LINE_LENGTH_REACHES.into()),
                ("STRIDES_PER_REACH", STRIDES_PER_REACH.into()),
                ("EXTRA_STRIDES", EXTRA_STRIDES as f64),
                ("MAX_ALIGNED_STRIDE_PX", MAX_ALIGNED_STRIDE_PX as f64),
                ("SIDE_SHARE_DIVISOR", SIDE_SHARE_DIVISOR.into()),
                ("MIN_SIXTEENTHS_NARROW", MIN_SIXTEENTHS[0].into()),
                ("MIN_SIXTEENTHS_WIDE", MIN_SIXTEENTHS[1].into()),
                ("DECISIVE_SIXTEENTHS", DECISIVE_SIXTEENTHS.into()),
                ("FINE_DIRECTION_SIXTEENTHS", FINE_DIRECTION_SIXTEENTHS.into()),
                ("SPLAT_WINDOW_PX", SPLAT_WINDOW_PX.into()),
                ("MAX_SPLAT_MEAN_OFFSET_PX", MAX_SPLAT_MEAN_OFFSET_PX.into()),
                ("MIN_SPLATS_NARROW", MIN_SPLATS[0].into()),
                ("MIN_SPLATS_WIDE", MIN_SPLATS[1].into()),
                ("MAX_NARROW_REACH_PX", MAX_NARROW_REACH_PX.into()),
                ("CENTER_STEPS", CENTER_STEPS.into()),
                ("MIN_BLURRING_NOISE_PX", MIN_BLURRING_NOISE_PX.into()),
                ("MIN_WINDOW_PX", MIN_WINDOW_PX.into()),
                ("WINDOW_PER_KERNEL_VARIANCE", WINDOW_PER_KERNEL_VARIANCE.into()),
                ("WINDOW_PER_NOISE_VARIANCE", WINDOW_PER_NOISE_VARIANCE.into()),
                ("FULL_NOISE_SINE", FULL_NOISE_SINE.into()),
                ("BLURRING_NOISE_SHARE", BLURRING_NOISE_SHARE.into()),
                ("MAX_WINDOW_PX", MAX_WINDOW_PX.into()),
                ("MAX_PIXEL_WINDOW_PX", MAX_PIXEL_WINDOW_PX.into()),
                ("SPREAD_WEIGHT", SPREAD_WEIGHT.into()),
                ("MAX_OFFSET_UNSURE", MAX_BLURRED_OFFSET[0].into()),
                ("MAX_OFFSET_SURE", MAX_BLURRED_OFFSET[1].into()),
                ("SURE_NOISE_PX", SURE_NOISE_PX.into()),
                ("SURE_NOISE_DISTANCES", SURE_NOISE_DISTANCES.into()),
                ("MIN_WINDOW_SIXTEENTHS", MIN_WINDOW_SIXTEENTHS.into()),
                ("FRINGE_NOISES", FRINGE_NOISES.into()),
                ("BLOCKS_BEYOND_FRINGE", BLOCKS_BEYOND_FRINGE.into()),
                ("HALF_WAY_OFFSET_SHARE", HALF_WAY_OFFSET_SHARE.into()),
                ("SUPPORT", SUPPORT.into()),
            ];
            Pass::new(gpu, &TRIM, &constants)
        };
        let reach = [("RECOVER_DISTANCE_RADII", RECOVER_DISTANCE_RADII.into()), ("MARGIN_REACH", MARGIN_REACH.into())];
        let steps = gpu.uniform::<[f32; 256]>("linear values of colours")?;
        gpu.queue.write_buffer(&steps, 0, bytemuck::cast_slice(linear));
        Ok(Self {
            set_up: [set_up(0.0)?, set_up(1.0)?],
            boxes: pass(&BOXES)?,
            clear_depth: pass(&CLEAR_DEPTH)?,
            depth: [depth(0.0)?, depth(1.0)?],
            depth_large: [depth_large(0.0, 0.0)?, depth_large(1.0, 0.0)?],
            redraw_large: depth_large(0.0, 1.0)?,
            recover_count: Pass::new(gpu, &RECOVER_COUNT, &reach)?,
            scan_recovered: scan_pass(gpu, Counter::Recovered, Some(Counter::Passive))?,
            recover: pass(&RECOVER)?,
            work: WorkPass::new(gpu)?,
            clear_words: pass(&CLEAR_WORDS)?,
            refine: pass(&REFINE)?,
            erase: Pass::new(gpu, &ERASE, &[dot_radius, most_px])?,
            erase_large: Pass::new(gpu, &ERASE_LARGE, &[dot_radius])?,
            redraw: Pass::new(gpu, &REDRAW, &[dot_radius, most_px])?,
            attributes: Pass::new(gpu, &ATTRIBUTES, &attributes)?,
            add_centers: Pass::new(gpu, &ADD_CENTERS, &[("CENTER_STEPS", CENTER_STEPS.into())])?,
            sum_blocks: pass(&SUM_BLOCKS)?,
            trim: [trim(0.0)?, trim(1.0)?],
            linear: steps,
        })
    }

    /// Visibility pass: draws the surfels of a round into the depth map, which the first round clears [Paper, §7].
    pub(crate) fn steps_visibility(
        &self,
        gpu: &Gpu,
        frame: &wgpu::Buffer,
        screen: &ScreenBuffers,
        surfels: &wgpu::Buffer,
        splats: &SplatBuffers,
        round: Round,
    ) -> Vec<Step> {
        let SplatBuffers { splats: list, tree, large, depth, changes, cells: marks, .. } = splats;
        let counters = &screen.counters;
        let set_up = [frame, counters, surfels, list, tree, large];
        let mut steps = vec![self.set_up[round as usize].step(gpu, &set_up, screen.groups(round.work_256()))];
        steps.push(self.work.step(gpu, frame, screen));
        let work = match round {
            Round::Active => {
                steps.push(self.clear_depth.step(gpu, &[frame, depth], pixel_groups(screen)));
                Work::Queries256
            }
            Round::Recovered => Work::Recovered256,
        };
        let small = [frame, counters, list, tree, depth];
        steps.push(self.depth[round as usize].step(gpu, &small, screen.groups(work)));
        let larges = screen.groups(Work::LargeSplats);
        let large = [frame, counters, list, tree, large, changes, marks, depth];
        steps.push(self.depth_large[round as usize].step(gpu, &large, larges));
        steps
    }

    /// Refinement: removes splats from the depth map whose point it hides [Paper, §7, Depth Refinement].
    fn steps_refine(
        &self,
        gpu: &Gpu,
        frame: &wgpu::Buffer,
        screen: &ScreenBuffers,
        splats: &SplatBuffers,
    ) -> [Step; 6] {
        let SplatBuffers { splats: list, tree, large, depth, changes, cells: marks, .. } = splats;
        let counters = &screen.counters;
        let all = || screen.groups(Work::Queries256);
        let larges = || screen.groups(Work::LargeSplats);
        [
            self.clear_words.step(gpu, &[frame, marks], cells(screen.size).div_ceil(256)),
            self.refine.step(gpu, &[frame, counters, list, depth, tree, changes], all()),
            self.erase.step(gpu, &[frame, counters, list, tree, changes, depth, marks], all()),
            self.erase_large.step(gpu, &[frame, counters, list, tree, changes, large, depth, marks], larges()),
            self.redraw.step(gpu, &[frame, counters, list, tree, changes, marks, depth], all()),
            self.redraw_large.step(gpu, &[frame, counters, list, tree, large, changes, marks, depth], larges()),
        ]
    }

    /// Appends to the queries the passive points that the depth map does not surely hide [Paper, §7, Grid Culling].
    pub(crate) fn steps_recover(
        &self,
        gpu: &Gpu,
        frame: &wgpu::Buffer,
        screen: &ScreenBuffers,
        splats: &SplatBuffers,
    ) -> Vec<Step> {
        let ScreenBuffers { counters, density, points, passive, block_sums, queries, .. } = screen;
        let depth = &splats.depth;
        let blocks = || screen.groups(Work::PassiveBlocks);
        let count = [frame, points, passive, counters, density, depth, block_sums];
        vec![
            self.recover_count.step(gpu, &count, blocks()),
            self.scan_recovered.step(gpu, &[frame, block_sums, counters], 1),
            self.recover.step(gpu, &[frame, passive, counters, block_sums, queries], blocks()),
            self.work.step(gpu, frame, screen),
        ]
    }

    /// Draws the attributes of all rounds' surfels and trims them, by `rules`.
    #[allow(clippy::too_many_arguments, reason = "each is a buffer or a set of them")]
    pub(crate) fn steps_layers(
        &self,
        gpu: &Gpu,
        frame: &wgpu::Buffer,
        screen: &ScreenBuffers,
        surfels: &wgpu::Buffer,
        splats: &SplatBuffers,
        layers: &LayerBuffers,
        rules: LayerRules<'_>,
    ) -> Vec<Step> {
        let SplatBuffers { splats: list, tree, depth, centers, blocks: summed, no_noise, .. } = splats;
        let ScreenBuffers { counters, values, sixteenths, .. } = screen;
        let LayerBuffers { surface, cover, extras, .. } = layers;
        let mut steps = Vec::new();
        for _ in 0..if rules.depth_refinement { 2 } else { 0 } {
            steps.extend(self.steps_refine(gpu, frame, screen, splats));
        }
        steps.push(self.boxes.step(gpu, &[frame, counters, tree], tops(screen)));
        let attributes = [frame, &self.linear, list, tree, surfels, values, depth, surface, cover, extras];
        steps.push(self.attributes.step(gpu, &attributes, patches(screen, PATCH)));
        let noise = rules.noise.unwrap_or(no_noise);
        if rules.trim {
            steps.push(self.clear_words.step(gpu, &[frame, centers], pixel_groups(screen)));
            let all = screen.groups(Work::Queries256);
            steps.push(self.add_centers.step(gpu, &[frame, counters, list, tree, centers], all));
            let blocks = [frame, cover, sixteenths, noise, summed];
            steps.push(self.sum_blocks.step(gpu, &blocks, block_count(screen.size).div_ceil(64)));
        }
        let trim = [frame, surface, cover, extras, counters, centers, sixteenths, noise, summed];
        let pass = &self.trim[usize::from(rules.trim)];
        steps.push(pass.step(gpu, &trim, patches(screen, [SQUARE; 2])));
        steps
    }
}

/// Workgroups for the upper levels of the tree; at least one, which stores the number of splats.
fn tops(screen: &ScreenBuffers) -> u32 {
    screen.capacity.div_ceil(TOP_SPLATS).max(1)
}

/// Cells in a picture of this size, with one more column and row.
fn cells([columns, rows]: [u32; 2]) -> u32 {
    (columns / CELL + 1) * (rows / CELL + 1)
}

/// Blocks of pixels in a picture of this size.
fn block_count(size: [u32; 2]) -> u32 {
    size.map(|side| side.div_ceil(BLOCK_PX as u32)).iter().product()
}

/// Workgroups with an invocation per pixel.
fn pixel_groups(screen: &ScreenBuffers) -> u32 {
    (screen.size[0] * screen.size[1]).div_ceil(256)
}

/// Workgroups for rectangles of this many columns and rows.
fn patches(screen: &ScreenBuffers, [columns, rows]: [u32; 2]) -> u32 {
    screen.size[0].div_ceil(columns) * screen.size[1].div_ceil(rows)
}

#[cfg(test)]
mod tests;
