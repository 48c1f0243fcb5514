//! Splatting on the GPU.
//!
//! # How it works
//! The depth map takes minima, which do not depend on the order. A workgroup shares out the rows of 256 splats among
//! its invocations, and teams of 64 draw large splats, by atomic minima of integers that order as depths do. Few splats
//! die in a refinement, and most of them were hidden. So refinement erases their depths from the map, and redraws only
//! splats that meet a cell of 8×8 pixels with erased depths (`imports/redraw.wgsl`).
//!
//! Attributes are sums, which have to equal those of the CPU and be the same each time. So a pixel draws its splats in
//! list order. A workgroup per patch of 16×32 pixels finds them by a tree over the list instead of bins
//! (`imports/splat.wgsl`, `imports/patch.wgsl`). The centres for trimming are counted in integers, again independent of
//! the order.

use super::layers::{Channels, LayerBuffers, PATCH};
use super::trim::blurred;
use super::trim::{self, ACROSS, LINES, OWN_SIXTEENTHS, SIDES};
use super::{centers, raster, setup};
use crate::Error;
use crate::adapt::FrameStatistics;
use crate::fit::{SUPPORT, Surfel};
use crate::gpu::{Gpu, Library, Pass, Step, constants, files, passes};
use crate::project::MARGIN_REACH;
use crate::project::gpu::{Counter, RANK_BLOCK_FLAGS, Round, ScreenBuffers, Work, drawing_constant};

/// Imports and constants of the passes.
const LIBRARY: Library = Library {
    files: &[files![
        "blocks",
        "blurred",
        "draw_depth",
        "erased",
        "fragment",
        "hidden",
        "large",
        "marked",
        "patch",
        "patches",
        "recovered",
        "redraw",
        "splat",
    ]],
    constants: &[
        Counter::CONSTANTS,
        Work::CONSTANTS,
        constants!(in blurred:
            BLOCK_PX, BLOCKS_BEYOND_FRINGE, BLURRING_NOISE_SHARE, FRINGE_BLOCKS, FRINGE_NOISES, FULL_NOISE_SINE,
            HALF_WAY_OFFSET_SHARE, MAX_BLURRED_OFFSET, MAX_PIXEL_WINDOW_PX, MAX_WINDOW_PX, MIN_BLURRING_NOISE_PX,
            MIN_WINDOW_PX, MIN_WINDOW_SIXTEENTHS, SPREAD_WEIGHT, SURE_NOISE_DISTANCES, SURE_NOISE_PX,
            WINDOW_PER_KERNEL_VARIANCE, WINDOW_PER_NOISE_VARIANCE
        ),
        constants!(in Surfel: BACK, LINE),
        constants!(in centers: CENTER_STEPS),
        constants!(in raster: KERNEL_SLOPE),
        constants!(in setup:
            DOT_RADIUS_PX, EPSILON_RADII, MIN_DEPTH_SHARE, MIN_FACING_COSINE, RECOVER_DISTANCE_RADII
        ),
        constants!(in trim:
            ACROSS, CORE_WEIGHT, DECISIVE_SIXTEENTHS, FINE_DIRECTION_SIXTEENTHS, INNER_WEIGHT, LINE_LENGTH_REACHES,
            MARGIN, MAX_ALIGNED_STRIDE_PX, MAX_NARROW_REACH_PX, MAX_SPLAT_MEAN_OFFSET_PX, MIN_SIXTEENTHS, MIN_SPLATS,
            SIDE_SHARE_DIVISOR, SPLAT_WINDOW_PX, STRIDES_PER_REACH
        ),
        constants![
            DIRECTIONS = ACROSS.len(),
            EXTRA_STRIDES = trim::EXTRA_STRIDES as i32,
            LINES = LINES.len(),
            OWN_SIXTEENTHS = words(OWN_SIXTEENTHS),
            SIDES = side_masks(),
        ],
        constants![BATCH, CELL_BITS, FAN, FAN_BITS, MARGIN_REACH, MAX_GROUP_PX, PATCH, RANK_BLOCK_FLAGS],
        constants![SQUARE, SUPPORT, TOP_NODES],
    ],
};

passes! {
    "splat", LIBRARY;
    SET_UP = "set_up",
    BOXES = "boxes",
    DEPTH = "depth",
    RECOVER_COUNT = "recover_count",
    RECOVER = "recover",
    pub(super) CLEAR_WORDS = "clear_words",
    REFINE = "refine",
    ERASE = "erase",
    REDRAW = "redraw",
    ATTRIBUTES = "attributes",
    TRIM = "trim",
}

/// Most pixels of a splat's bounds whose rows one workgroup shares out among its invocations.
const MAX_GROUP_PX: u32 = 1024;
/// Splats that are drawn into a patch at a time.
const BATCH: u32 = 64;
/// Side in pixels of the square that a workgroup trims.
const SQUARE: u32 = 32;
/// Binary logarithm of the side in pixels of a cell, which is marked if depths in it were erased.
const CELL_BITS: u32 = 3;
/// Children of a node of the tree, and their binary logarithm.
const FAN: u32 = 1 << FAN_BITS;
const FAN_BITS: u32 = 4;
/// Splats below each top node of the tree, and nodes there.
const TOP_SPLATS: u32 = FAN * FAN * FAN;
const TOP_NODES: u32 = 1 + FAN + FAN * FAN + FAN * FAN * FAN;
/// Bytes of a splat.
const SPLAT_BYTES: usize = 48;

/// Structs of WGSL with their sizes here.
#[cfg(test)]
pub(crate) const SIZES: &[(&str, usize)] = &[("Splat", SPLAT_BYTES)];

/// Options of drawing the layers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LayerRules<'a> {
    /// Refine the depth map twice first [Paper, §7].
    pub(crate) depth_refinement: bool,
    /// [`FrameStatistics`] with the noise; `None` if it is not measured.
    pub(crate) noise: Option<&'a wgpu::Buffer>,
}

/// Splats on the device, and the depth map.
#[derive(Debug)]
pub(crate) struct SplatBuffers {
    splats: wgpu::Buffer,
    tree: wgpu::Buffer,
    /// Indices of splats too large for one workgroup.
    large: wgpu::Buffer,
    /// Change of each splat in the last refinement, and the marks of cells with erased depths (`imports/redraw.wgsl`).
    changes: wgpu::Buffer,
    cells: wgpu::Buffer,
    /// Zeros for frames whose noise is not measured.
    no_noise: wgpu::Buffer,
}

impl SplatBuffers {
    /// Buffers for `screen_capacity` splats and a picture of `size`.
    ///
    /// # Errors
    /// [`Error::DeviceLimit`], [`Error::DeviceMemory`] if the device has too little.
    pub(crate) fn new(gpu: &Gpu, screen_capacity: u32, size: [u32; 2]) -> Result<Self, Error> {
        let nodes = 1 + screen_capacity.div_ceil(TOP_SPLATS) as usize * TOP_NODES as usize;
        Ok(Self {
            splats: gpu.storage::<[u8; SPLAT_BYTES]>("splats", screen_capacity as usize)?,
            large: gpu.storage::<u32>("large splats", screen_capacity as usize)?,
            tree: gpu.storage::<[u32; 2]>("tree of splats", nodes)?,
            changes: gpu.storage::<u32>("changes of splats", screen_capacity as usize)?,
            cells: gpu.storage::<u32>("cells of the depth map", cells(size) as usize)?,
            no_noise: gpu.storage::<FrameStatistics>("no noise", 1)?,
        })
    }
}

/// The passes of splatting.
#[derive(Debug)]
pub(crate) struct SplatPasses {
    set_up: Pass,
    boxes: Pass,
    depth: Pass,
    recover_count: Pass,
    recover: Pass,
    refine: Pass,
    erase: Pass,
    redraw: Pass,
    attributes: Pass,
    /// Counts covered pixels, and trims if `trims`.
    trim: Pass,
    /// Linear value of each 8-bit step of a colour.
    linear: wgpu::Buffer,
}

impl SplatPasses {
    /// Compiles the passes for splats that carry `channels`, with or without trimming; `linear` has the linear value of
    /// each 8-bit step of a colour.
    ///
    /// # Errors
    /// [`Error::Device`], [`Error::DeviceMemory`].
    pub(crate) fn new(gpu: &Gpu, channels: Channels, trims: bool, linear: &[f32; 256]) -> Result<Self, Error> {
        let groups = &[drawing_constant(gpu)][..];
        let Channels { color, scalar, measures, backs } = channels;
        let slots = |carried: bool| if carried { f64::from(BATCH) } else { 1.0 };
        let attributes = [
            ("COLOR", color.into()),
            ("SCALAR", scalar.into()),
            ("MEASURES", measures.into()),
            ("BACKS", backs.into()),
            ("COLOR_SLOTS", slots(color)),
            ("SCALAR_SLOTS", slots(scalar)),
            ("MEASURE_SLOTS", slots(measures)),
            ("BACK_SLOTS", slots(backs)),
        ];
        let steps = gpu.uniform::<[f32; 256]>("linear values of colours")?;
        gpu.queue.write_buffer(&steps, 0, bytemuck::cast_slice(linear));
        let [set_up, boxes, depth, recover_count, recover, refine, erase, redraw, attributes, trim] = Pass::all(
            gpu,
            [
                (&SET_UP, &[]),
                (&BOXES, &[]),
                (&DEPTH, groups),
                (&RECOVER_COUNT, &[]),
                (&RECOVER, groups),
                (&REFINE, &[]),
                (&ERASE, groups),
                (&REDRAW, groups),
                (&ATTRIBUTES, &attributes),
                (&TRIM, &[("TRIMS", trims.into())]),
            ],
        )?;
        Ok(Self {
            set_up,
            boxes,
            depth,
            recover_count,
            recover,
            refine,
            erase,
            redraw,
            attributes,
            trim,
            linear: steps,
        })
    }

    /// Visibility pass: draws the surfels of a round into the depth map [Paper, §7].
    pub(crate) fn steps_visibility(
        &self,
        gpu: &Gpu,
        frame: &wgpu::Buffer,
        screen: &ScreenBuffers,
        surfels: &wgpu::Buffer,
        splats: &SplatBuffers,
        round: Round,
    ) -> Vec<Step> {
        let SplatBuffers { splats: list, tree, large, .. } = splats;
        let ScreenBuffers { counters, depth, centers, .. } = screen;
        let set_up = [frame, counters, surfels, list, tree, large, centers];
        vec![
            self.set_up.step(gpu, &set_up, screen.groups(round.work_256())),
            self.depth.step(gpu, &[frame, counters, list, tree, large, depth], screen.groups(round.work_drawn())),
        ]
    }

    /// Refinement: removes splats from the depth map whose point it hides [Paper, §7, Depth Refinement].
    fn steps_refine(
        &self,
        gpu: &Gpu,
        frame: &wgpu::Buffer,
        screen: &ScreenBuffers,
        splats: &SplatBuffers,
    ) -> [Step; 3] {
        let SplatBuffers { splats: list, tree, large, changes, cells: marks, .. } = splats;
        let ScreenBuffers { counters, depth, .. } = screen;
        let drawn = || screen.groups(Work::QueriesDrawn);
        let refine = [frame, counters, list, depth, tree, changes, marks];
        [
            self.refine.step(gpu, &refine, screen.groups(Work::Queries256)),
            self.erase.step(gpu, &[frame, counters, list, tree, changes, large, depth, marks], drawn()),
            self.redraw.step(gpu, &[frame, counters, list, tree, changes, marks, large, depth], drawn()),
        ]
    }

    /// Appends to the queries the passive points that the depth map does not surely hide [Paper, §7, Grid Culling].
    pub(crate) fn steps_recover(&self, gpu: &Gpu, frame: &wgpu::Buffer, screen: &ScreenBuffers) -> [Step; 2] {
        let ScreenBuffers { counters, density, points, passive, block_sums, queries, depth, arguments, .. } = screen;
        let blocks = || screen.groups(Work::PassiveBlocks);
        let count = [frame, points, passive, counters, density, depth, block_sums];
        let recover = [frame, passive, counters, block_sums, queries, &arguments[2]];
        [self.recover_count.step(gpu, &count, blocks()), self.recover.step(gpu, &recover, blocks())]
    }

    /// Draws the attributes of all rounds' surfels, by `rules`, and trims them.
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
        let SplatBuffers { splats: list, tree, no_noise, .. } = splats;
        let ScreenBuffers { counters, values, sixteenths, held, depth, centers, .. } = screen;
        let LayerBuffers { surface, cover, extras, .. } = layers;
        let mut steps = Vec::new();
        for _ in 0..if rules.depth_refinement { 2 } else { 0 } {
            steps.extend(self.steps_refine(gpu, frame, screen, splats));
        }
        steps.push(self.boxes.step(gpu, &[frame, counters, tree], tops(screen)));
        let attributes = [frame, &self.linear, list, tree, surfels, values, depth, surface, cover, extras];
        steps.push(self.attributes.step(gpu, &attributes, patches(screen, PATCH)));
        let noise = rules.noise.unwrap_or(no_noise);
        let trim = [frame, surface, cover, extras, counters, centers, sixteenths, noise, held];
        steps.push(self.trim.step(gpu, &trim, patches(screen, [SQUARE; 2])));
        steps
    }
}

/// The masks of the sides ahead, then those of the sides behind.
fn side_masks() -> [[u32; 2]; 2 * ACROSS.len()] {
    std::array::from_fn(|at| words(SIDES[at % ACROSS.len()][at / ACROSS.len()]))
}

/// The words of a mask.
fn words(mask: u64) -> [u32; 2] {
    [mask as u32, (mask >> 32) as u32]
}

/// Workgroups for the upper levels of the tree; at least one, which stores the number of splats.
fn tops(screen: &ScreenBuffers) -> u32 {
    screen.capacity.div_ceil(TOP_SPLATS).max(1)
}

/// Cells in a picture of this size, with one more column and row.
fn cells([columns, rows]: [u32; 2]) -> u32 {
    ((columns >> CELL_BITS) + 1) * ((rows >> CELL_BITS) + 1)
}

/// Workgroups for rectangles of this many columns and rows.
fn patches(screen: &ScreenBuffers, [columns, rows]: [u32; 2]) -> u32 {
    screen.size[0].div_ceil(columns) * screen.size[1].div_ceil(rows)
}

#[cfg(test)]
mod tests;
