//! Adapt on the GPU: the steps of the CPU form, one pass each.

use super::cells::{MOST_FINEST, MOST_LEVELS, SLABS, least_side_px};
use super::depth::{DepthNoise, DepthRun, FARTHEST_ALONG, GRAZING_COSINE, LONGEST_SHADOW};
use super::noise::{
    CERTAIN_NOISE_SHARES, FULL_K_RADIUS_CONTRAST, GROWTH_POWER_RAMP, LEAST_PAIRS, LEAST_SAMPLE, MAX_STEADY_RATIO,
    MAX_THIN_SHARE_RISE, MIN_BALL_SHARE_DIVISOR, MIN_K_RADIUS_CONTRAST, MOST_SAMPLED, NOISE_QUANTILE,
    NOISE_SAMPLE_COUNT, NOISE_SHARES, ROUNDING_SCATTER_RADII, STEADY_SCALES, STRUCTURE_GROWTH_POWER, THICK_NOISE,
    THIN_SCATTER_RADII, THIN_SHARE, UNEVEN_NOISE_QUANTILE, UNEVEN_NOISE_SHARES,
};
use super::quadric::{
    CELLS_PER_RADIUS, EVEN_WEIGHT, FULL_WEIGHT_SQUARED_RADII, LEAST_CLUSTERS, LEAST_OF_PLANE, LEAST_PIVOT, RIDGE,
};
use super::rows::{
    AREA_HALF_THICKNESS_RADII, BALL_OVER_SIDE_WEIGHT, BEYOND, BEYOND_RADII, MAX_AREA_HEIGHT_RATIO,
    MAX_POINT_HEIGHT_RADII, MAX_SCAN_LINE_TILT_SINE, MAX_SEEN_THROUGH_SHARE, MAX_SEMI_AXIS_RADII, MIN_AREA_RATIO,
    MIN_SCAN_LINE_ANISOTROPY, MIN_SIDE_AREA_RATIO, SEMI_AXIS_LINE_DISTANCES, SIDE_SLACK_RADII, THIN_LINE_ASPECT,
};
use super::rules::{
    AGREE_ERRORS, CROWD_WEIGHT_PER_NEIGHBOR, DOT_OUTLIER_SCORE, DOT_PX, DROPPED_OUTLIER_SCORE, GOOD_NORMAL_ERROR_RAD,
    ISOLATED_SCORE, LEAST_TRACE, MAX_K_RADIUS_FIRST_RADII, MAX_MEAN_DISTANCE_K_RADII, MAX_MOVE_NOISES,
    MAX_NOISE_BALL_RADII, MAX_NOISE_K_RADII, MAX_PLANE_DISTANCE_K_RADII, MAX_RELIABLE_ERROR_RAD,
    MAX_SCATTER_KNOWN_NOISES, MAX_SCATTER_NOISES, MOST_TINY, OUTLIER_OFFSET_KNOWN_NOISES, OUTLIER_OFFSET_NOISES,
    SPARSE_MEDIAN_K_RADII, TINY_PX, TINY_REACH_PX, TINY_SLOPE, WIDER_BALL_K_RADII,
};
use super::sheets::{COVERED, COVERED_REACH, K_RADIUS_PARTS_PER_PX, MAX_SUMMED_K_RADIUS_PX, SHEET_LEVELS, SHEETS};
use super::through::{
    CELLS_TO_COUNT, LEAST_ON, MAX_SURFACE_MEAN_RADII, MAX_SURFACE_VARIATION, MIN_SURFACE_WIDTH_RATIO,
    MIN_TESTED_FIRST_RADII, ON_DISC, ON_DISC_NOISE, SURFACE_BALL_K_RADII,
};
use super::{MIN_BASE_FIRST_RADII, SCALES, STEP, noise};
use crate::Error;
use crate::fit::{LONGEST, SUPPORT, SWEEPS};
use crate::gpu::{Gpu, Groups, Pass, PassSource, Step};
use crate::project::gpu::{Round, ScreenBuffers, few};

#[cfg(test)]
pub(crate) const PASSES: &[PassSource] =
    &[ARRANGE, FILL, MERGE, FORGET, PICK, SAMPLE_PASS, SCATTERS, QUANTILES, NOISE, ASK, FIT_SHEETS, ADAPT, TURN_ROWS];
const ARRANGE: PassSource = PassSource::new("adapt/arrange", include_str!("arrange.wgsl"));
const FILL: PassSource = PassSource::new("adapt/fill", include_str!("fill.wgsl"));
const MERGE: PassSource = PassSource::new("adapt/merge", include_str!("merge.wgsl"));
const PICK: PassSource = PassSource::new("adapt/pick", include_str!("pick.wgsl"));
const SAMPLE_PASS: PassSource = PassSource::new("adapt/sample", include_str!("sample.wgsl"));
const SCATTERS: PassSource = PassSource::new("adapt/scatter", include_str!("scatter.wgsl"));
const QUANTILES: PassSource = PassSource::new("adapt/quantile", include_str!("quantile.wgsl"));
const NOISE: PassSource = PassSource::new("adapt/noise", include_str!("noise.wgsl"));
const FORGET: PassSource = PassSource::new("adapt/forget", include_str!("forget.wgsl"));
const ASK: PassSource = PassSource::new("adapt/ask", include_str!("ask.wgsl"));
const FIT_SHEETS: PassSource = PassSource::new("adapt/fit_sheets", include_str!("fit_sheets.wgsl"));
const ADAPT: PassSource = PassSource::new("adapt/adapt", include_str!("adapt.wgsl"));
const TURN_ROWS: PassSource = PassSource::new("adapt/turn_rows", include_str!("turn_rows.wgsl"));

/// Invocations in a workgroup.
const GROUP: usize = 64;
/// Invocations that sum up a ball together, on hardware and on a software device, which runs eight side by side.
const TOGETHER: [u32; 2] = [32, 8];
/// Quantiles of scatter, per scale: of the sample's densest third, its sparsest third, all, and all by steady shares.
const QUANTILES_TAKEN: usize = 4 * SCALES;
/// Numbers that `noise.wgsl` writes.
pub(crate) const NOISE_FLOATS: usize = 6;
/// Bytes of the arguments of a dispatch.
const WORK_BYTES: u64 = 12;

/// `Level` of `shared/levels.wgsl`: side, columns, rows and first cell.
type Level = [u32; 4];
/// Mean and count.
type Cluster = [f32; 4];
/// `Sheet` of `shared/sheet.wgsl`, padded.
type Sheet = [f32; 16];

/// Buffers that the stage keeps on the device from pass to pass.
#[derive(Debug)]
pub(crate) struct AdaptBuffers {
    levels: wgpu::Buffer,
    /// Workgroups that fill each level, three `u32`, then those that fit sheets.
    arguments: wgpu::Buffer,
    clusters: wgpu::Buffer,
    /// Per cell: number of surfels that ask for sheets, sum of their k-radii, smallest point index.
    asked: wgpu::Buffer,
    sheets: wgpu::Buffer,
    /// Indices of the sampled surfels, then their number. `picked` is unordered, `sampled` is sorted by k-radius.
    picked: wgpu::Buffer,
    sampled: wgpu::Buffer,
    scatters: wgpu::Buffer,
    /// Quantiles, then the steady shares of the first scales.
    quantiles: wgpu::Buffer,
    /// Noise level and power, median k-radius, level of cells with sheets, largest k-radius of growth, certainty.
    measured: wgpu::Buffer,
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
            levels: gpu.storage::<Level>("levels of cells", MOST_LEVELS)?,
            arguments: gpu.buffer(
                "arguments of levels",
                (MOST_LEVELS as u64 + 1) * WORK_BYTES,
                wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::INDIRECT,
            )?,
            clusters: gpu.storage::<[Cluster; SLABS]>("clusters", most_cells(size, most_finest))?,
            asked: gpu.storage::<[u32; 3]>("surfels that ask for sheets", sheet_cells)?,
            sheets: gpu.storage::<[Sheet; SHEETS]>("sheets", sheet_cells)?,
            picked: gpu.storage::<u32>("picked surfels", MOST_SAMPLED + 1)?,
            sampled: gpu.storage::<u32>("sampled surfels", MOST_SAMPLED + 1)?,
            scatters: gpu.storage::<u32>("scatter of balls", SCALES * MOST_SAMPLED)?,
            quantiles: gpu.storage::<[u32; 2]>("quantiles of scatter", QUANTILES_TAKEN + STEADY_SCALES)?,
            measured: gpu.storage::<f32>("noise", NOISE_FLOATS)?,
            depth_noise: known.runs.clone(),
        })
    }

    /// The measured noise, in the layout of `shared/noise.wgsl`.
    pub(crate) fn noise(&self) -> &wgpu::Buffer {
        &self.measured
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

/// The passes of the stage.
#[derive(Debug)]
pub(crate) struct AdaptPasses {
    arrange: Pass,
    fill: Pass,
    merge: Pass,
    /// Uniforms with the level to fill, for each level but the finest.
    which: Vec<wgpu::Buffer>,
    pick: Pass,
    sample: Pass,
    scatter: Pass,
    quantile: Pass,
    noise: Pass,
    forget: Pass,
    fit_sheets: Pass,
    /// One pass per round, as the next two.
    ask: [Pass; 2],
    adapt: [Pass; 2],
    turn_rows: [Pass; 2],
}

impl AdaptPasses {
    /// Compiles the passes.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Error> {
        Self::with_form(gpu, TOGETHER[usize::from(gpu.is_software())])
    }

    fn with_form(gpu: &Gpu, together: u32) -> Result<Self, Error> {
        let together = ("TOGETHER", together.into());
        let few = ("ITEMS_PER_GROUP", few(gpu).into());
        let quadric = [
            ("SWEEPS", SWEEPS as f64),
            ("MOST_LEVELS", MOST_LEVELS as f64),
            ("CELLS_PER_RADIUS", CELLS_PER_RADIUS.into()),
            ("LEAST_CLUSTERS", LEAST_CLUSTERS as f64),
            ("LEAST_OF_PLANE", LEAST_OF_PLANE as f64),
            ("FULL_WEIGHT_SQUARED_RADII", FULL_WEIGHT_SQUARED_RADII.into()),
            ("RIDGE", RIDGE.into()),
            ("LEAST_PIVOT", LEAST_PIVOT.into()),
            ("STEP", STEP.into()),
        ];
        let least_reach = ("MIN_BASE_FIRST_RADII", MIN_BASE_FIRST_RADII.into());
        let calls = [
            ("GOOD_NORMAL_ERROR_RAD", GOOD_NORMAL_ERROR_RAD.into()),
            ("TINY_PX", TINY_PX.into()),
            ("TINY_SLOPE", TINY_SLOPE.into()),
            ("TINY_REACH_PX", TINY_REACH_PX.into()),
            ("MOST_TINY", MOST_TINY.into()),
            ("MIN_SCAN_LINE_ANISOTROPY", MIN_SCAN_LINE_ANISOTROPY.into()),
            ("MAX_SCATTER_NOISES", MAX_SCATTER_NOISES.into()),
            ("MAX_SCATTER_KNOWN_NOISES", MAX_SCATTER_KNOWN_NOISES.into()),
        ];
        let choose = [
            ("MAX_RELIABLE_ERROR_RAD", MAX_RELIABLE_ERROR_RAD.into()),
            ("LEAST_TRACE", LEAST_TRACE.into()),
            ("MAX_NOISE_BALL_RADII", MAX_NOISE_BALL_RADII.into()),
            ("AGREE_ERRORS", AGREE_ERRORS.into()),
            ("MAX_MOVE_NOISES", MAX_MOVE_NOISES.into()),
        ];
        let rows = [
            ("MIN_AREA_RATIO", MIN_AREA_RATIO.into()),
            ("MIN_SIDE_AREA_RATIO", MIN_SIDE_AREA_RATIO.into()),
            ("BEYOND", BEYOND.into()),
            ("LEAST_BEYOND", BEYOND_RADII[0].into()),
            ("MOST_BEYOND", BEYOND_RADII[1].into()),
            ("SIDE_SLACK_RADII", SIDE_SLACK_RADII.into()),
            ("BALL_OVER_SIDE_WEIGHT", BALL_OVER_SIDE_WEIGHT.into()),
            ("MAX_AREA_HEIGHT_RATIO", MAX_AREA_HEIGHT_RATIO.into()),
            ("MAX_SCAN_LINE_TILT_SINE", MAX_SCAN_LINE_TILT_SINE.into()),
            ("AREA_HALF_THICKNESS_RADII", AREA_HALF_THICKNESS_RADII.into()),
            ("MAX_SEEN_THROUGH_SHARE", MAX_SEEN_THROUGH_SHARE.into()),
            ("MAX_POINT_HEIGHT_RADII", MAX_POINT_HEIGHT_RADII.into()),
            ("EVEN_WEIGHT", EVEN_WEIGHT.into()),
            ("SEMI_AXIS_LINE_DISTANCES", SEMI_AXIS_LINE_DISTANCES.into()),
            ("MAX_SEMI_AXIS_RADII", MAX_SEMI_AXIS_RADII.into()),
            ("THIN_LINE_ASPECT", THIN_LINE_ASPECT.into()),
            ("LONGEST", LONGEST.into()),
        ];
        let parts = ("K_RADIUS_PARTS_PER_PX", K_RADIUS_PARTS_PER_PX.into());
        let ask = |round: Round| {
            let own =
                [("ROUND", f64::from(round as u32)), parts, ("MAX_SUMMED_K_RADIUS_PX", MAX_SUMMED_K_RADIUS_PX.into())];
            Pass::new(gpu, &ASK, &[&calls[..], &own].concat())
        };
        let most_sampled = ("MOST_SAMPLED", MOST_SAMPLED as f64);
        let scales = ("SCALES", SCALES as f64);
        let shrink = [
            ("SPARSE_MEDIAN_K_RADII", SPARSE_MEDIAN_K_RADII.into()),
            ("ISOLATED_SCORE", ISOLATED_SCORE.into()),
            ("WIDER_BALL_K_RADII", WIDER_BALL_K_RADII.into()),
            ("MAX_PLANE_DISTANCE_K_RADII", MAX_PLANE_DISTANCE_K_RADII.into()),
            ("MAX_MEAN_DISTANCE_K_RADII", MAX_MEAN_DISTANCE_K_RADII.into()),
            ("CROWD_WEIGHT_PER_NEIGHBOR", CROWD_WEIGHT_PER_NEIGHBOR.into()),
            ("DOT_OUTLIER_SCORE", DOT_OUTLIER_SCORE.into()),
            ("DROPPED_OUTLIER_SCORE", DROPPED_OUTLIER_SCORE.into()),
            ("DOT_PX", DOT_PX.into()),
            ("LEAST_ON", LEAST_ON.into()),
            ("ON_DISC", ON_DISC.into()),
            ("ON_DISC_NOISE", ON_DISC_NOISE.into()),
            ("MIN_TESTED_FIRST_RADII", MIN_TESTED_FIRST_RADII.into()),
            ("SURFACE_BALL_K_RADII", SURFACE_BALL_K_RADII.into()),
            ("MAX_SURFACE_VARIATION", MAX_SURFACE_VARIATION.into()),
            ("MIN_SURFACE_WIDTH_RATIO", MIN_SURFACE_WIDTH_RATIO.into()),
            ("MAX_SURFACE_MEAN_RADII", MAX_SURFACE_MEAN_RADII.into()),
            ("CELLS_TO_COUNT", CELLS_TO_COUNT.into()),
            ("SUPPORT", SUPPORT.into()),
            least_reach,
        ];
        let adapt = |round: Round| {
            let own = [
                ("ROUND", f64::from(round as u32)),
                ("MAX_NOISE_K_RADII", MAX_NOISE_K_RADII.into()),
                ("MAX_K_RADIUS_FIRST_RADII", MAX_K_RADIUS_FIRST_RADII.into()),
                ("OUTLIER_OFFSET_NOISES", OUTLIER_OFFSET_NOISES.into()),
                ("OUTLIER_OFFSET_KNOWN_NOISES", OUTLIER_OFFSET_KNOWN_NOISES.into()),
                ("GRAZING_COSINE", GRAZING_COSINE.into()),
                ("FARTHEST_ALONG", FARTHEST_ALONG.into()),
                ("LONGEST_SHADOW", LONGEST_SHADOW.into()),
            ];
            Pass::new(gpu, &ADAPT, &[&quadric[..], &calls, &choose, &shrink, &own].concat())
        };
        let turn_rows = |round: Round| {
            let own = [("ROUND", f64::from(round as u32)), together, few];
            Pass::new(gpu, &TURN_ROWS, &[&quadric[..], &calls, &shrink, &rows, &own].concat())
        };
        let which = |level: usize| {
            let told = gpu.uniform::<u32>("level")?;
            gpu.queue.write_buffer(&told, 0, bytemuck::bytes_of(&(level as u32)));
            Ok::<_, Error>(told)
        };
        let fine_sheets = ("FINE_SHEETS", SHEET_LEVELS[0] as f64);
        let sheets = [together, parts, few, ("COVERED", COVERED.into()), ("COVERED_REACH", COVERED_REACH.into())];
        let quantile = [
            scales,
            most_sampled,
            ("LEAST_SAMPLE", LEAST_SAMPLE as f64),
            ("MIN_BALL_SHARE_DIVISOR", MIN_BALL_SHARE_DIVISOR as f64),
            ("THIN_SHARE", THIN_SHARE.into()),
            ("MAX_THIN_SHARE_RISE", MAX_THIN_SHARE_RISE.into()),
            ("NOISE_QUANTILE", NOISE_QUANTILE.into()),
            ("MAX_STEADY_RATIO", MAX_STEADY_RATIO.into()),
            ("NOISE_FROM", NOISE_SHARES[0].into()),
            ("NOISE_TO", NOISE_SHARES[1].into()),
            ("DIFFERS_FROM", UNEVEN_NOISE_SHARES[0].into()),
            ("DIFFERS_TO", UNEVEN_NOISE_SHARES[1].into()),
            ("UNEVEN_NOISE_QUANTILE", UNEVEN_NOISE_QUANTILE.into()),
            ("STEADY_SCALES", STEADY_SCALES as f64),
            ("LEAST_PAIRS", LEAST_PAIRS as f64),
        ];
        Ok(Self {
            arrange: Pass::new(
                gpu,
                &ARRANGE,
                &[
                    ("MOST_LEVELS", MOST_LEVELS as f64),
                    ("MOST_FINEST", most_finest(gpu.most_bound()) as f64),
                    most_sampled,
                    fine_sheets,
                    few,
                ],
            )?,
            fill: Pass::new(gpu, &FILL, &[])?,
            merge: Pass::new(gpu, &MERGE, &[])?,
            which: (1..MOST_LEVELS).map(which).collect::<Result<_, _>>()?,
            pick: Pass::new(gpu, &PICK, &[("NOISE_SAMPLE_COUNT", NOISE_SAMPLE_COUNT as f64), most_sampled])?,
            sample: Pass::new(gpu, &SAMPLE_PASS, &[most_sampled])?,
            scatter: Pass::new(
                gpu,
                &SCATTERS,
                &[
                    &quadric[..],
                    &[
                        together,
                        most_sampled,
                        least_reach,
                        ("THIN_SCATTER_RADII", THIN_SCATTER_RADII.into()),
                        ("ROUNDING_SCATTER_RADII", ROUNDING_SCATTER_RADII.into()),
                    ],
                ]
                .concat(),
            )?,
            quantile: Pass::new(gpu, &QUANTILES, &quantile)?,
            noise: Pass::new(
                gpu,
                &NOISE,
                &[
                    scales,
                    most_sampled,
                    ("LEAST_SAMPLE", LEAST_SAMPLE as f64),
                    ("MIN_K_RADIUS_CONTRAST", MIN_K_RADIUS_CONTRAST.into()),
                    ("FULL_K_RADIUS_CONTRAST", FULL_K_RADIUS_CONTRAST.into()),
                    ("STRUCTURE_GROWTH_POWER", STRUCTURE_GROWTH_POWER.into()),
                    ("GROWTH_POWER_RAMP", GROWTH_POWER_RAMP.into()),
                    ("BEYOND", noise::BEYOND as f64),
                    ("THICK_NOISE", THICK_NOISE.into()),
                    fine_sheets,
                    ("COARSE_SHEETS", SHEET_LEVELS[1] as f64),
                    ("SURE_FROM", CERTAIN_NOISE_SHARES[0].into()),
                    ("SURE_TO", CERTAIN_NOISE_SHARES[1].into()),
                    ("STEADY_SCALES", STEADY_SCALES as f64),
                ],
            )?,
            forget: Pass::new(gpu, &FORGET, &[fine_sheets])?,
            fit_sheets: Pass::new(gpu, &FIT_SHEETS, &[&quadric[..], &calls, &choose, &sheets].concat())?,
            ask: [ask(Round::Active)?, ask(Round::Recovered)?],
            adapt: [adapt(Round::Active)?, adapt(Round::Recovered)?],
            turn_rows: [turn_rows(Round::Active)?, turn_rows(Round::Recovered)?],
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
        let AdaptBuffers { levels, arguments, clusters, asked, sheets, picked, .. } = buffers;
        let groups = |level: usize| Groups::Counted(arguments.clone(), level as u64 * WORK_BYTES);
        let mut steps = vec![
            self.arrange.step(gpu, &[frame, counters, levels, arguments, picked], 1),
            self.fill.step(gpu, &[frame, counters, levels, cell_start, points, clusters], groups(0)),
        ];
        let merge = |(level, which)| self.merge.step(gpu, &[frame, levels, clusters, which], groups(level));
        steps.extend((1..).zip(&self.which).map(merge));
        steps.push(self.forget.step(gpu, &[levels, asked, sheets], groups(SHEET_LEVELS[0])));
        steps
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
        let ScreenBuffers { counters, density, .. } = screen;
        let AdaptBuffers { levels, arguments, clusters, asked, sheets, .. } = buffers;
        let AdaptBuffers { picked, sampled, scatters, quantiles, measured, depth_noise, .. } = buffers;
        let mut steps = Vec::new();
        if round == Round::Active {
            let balls = [frame, counters, density, surfels, levels, clusters, sampled, scatters];
            steps.extend([
                self.pick.step(gpu, &[counters, surfels, picked], screen.groups(round.work_64())),
                self.sample.step(gpu, &[surfels, picked, sampled], MOST_SAMPLED.div_ceil(GROUP) as u32),
                self.scatter.step(gpu, &balls, (SCALES * MOST_SAMPLED) as u32),
                self.quantile.step(gpu, &[frame, sampled, scatters, quantiles], QUANTILES_TAKEN as u32),
                self.noise.step(gpu, &[frame, surfels, sampled, quantiles, measured], 1),
            ]);
        }
        let ask = [frame, counters, levels, measured, surfels, depth_noise, asked];
        let fit = [frame, levels, clusters, measured, asked, depth_noise, sheets];
        let adapt = [frame, counters, density, levels, clusters, measured, sheets, depth_noise, surfels];
        let turn_rows = [frame, counters, density, levels, clusters, measured, depth_noise, surfels];
        let round_at = round as usize;
        steps.extend([
            self.ask[round_at].step(gpu, &ask, screen.groups(round.work_64())),
            self.fit_sheets.step(gpu, &fit, Groups::Counted(arguments.clone(), MOST_LEVELS as u64 * WORK_BYTES)),
            self.adapt[round_at].step(gpu, &adapt, screen.groups(round.work_64())),
            self.turn_rows[round_at].step(gpu, &turn_rows, screen.groups(round.work_few())),
        ]);
        steps
    }
}

#[cfg(test)]
pub(crate) mod tests;
