//! Splat communication on the GPU: buffers, textures and steps.

use bytemuck::{Pod, Zeroable};
use wgpu::TextureFormat::{Depth32Float, Rgba32Float};

use crate::Error;
use crate::gpu::{
    DepthMask, Draw, Gpu, Groups, Library, Load, Pass, PassSource, RasterPass, Step, Target, Targets, constants, files,
    passes,
};
use crate::project::gpu::{Counter, Round};
use crate::search::MARGIN_PX;
use crate::search::engine::{EnginePasses, EngineSteps, IMPORTS, SearchBuffers};

/// Imports and constants of the passes.
const LIBRARY: Library = Library {
    files: &[IMPORTS, files!["answer", "communication", "radius_search", "splat_box"]],
    constants: &[Counter::CONSTANTS, constants![MARGIN_PX, UNCONVERGED = UNCONVERGED as f32]],
};

passes! {
    "search/splat_communication", LIBRARY;
    MASK = "mask" needs wgpu::Features::FLOAT32_BLENDABLE,
    ASK = "ask" needs wgpu::Features::FLOAT32_BLENDABLE,
    CLEAR = "clear" needs wgpu::Features::FLOAT32_BLENDABLE,
    DISTRIBUTE = "distribute" needs wgpu::Features::FLOAT32_BLENDABLE,
    GATHER = "gather" needs wgpu::Features::FLOAT32_BLENDABLE,
    MEAN = "mean" needs wgpu::Features::FLOAT32_BLENDABLE,
    COVARIANCE = "covariance" needs wgpu::Features::FLOAT32_BLENDABLE,
    BEGIN = "begin",
    COUNT = "count",
    DECIDE = "decide",
    KEEP_MEAN = "keep_mean",
    KEEP_COVARIANCE = "keep_covariance",
}

/// Most iterations. A bracket between equal distances takes about fourteen to shrink to the precision of floats.
pub(crate) const ITERATIONS: usize = 16;
/// Fraction of the points that need not converge: 1 - t_conv [Paper, §5.2].
pub(crate) const UNCONVERGED: f64 = 0.001;

/// The two textures that a gathering pass writes.
const GATHERED: [Target; 2] = [Target::Add, Target::AddAndMax];
const GATHERED_BYTES: u32 = 32;

/// Arguments of an indirect draw.
type DrawArguments = [u32; 4];

/// Arguments of all draws, laid out as in `imports/communication.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Arguments {
    pub(crate) points: DrawArguments,
    pub(crate) queries: DrawArguments,
    pub(crate) clear: DrawArguments,
    pub(crate) boxes: DrawArguments,
    pub(crate) last_clear: DrawArguments,
    pub(crate) last_boxes: DrawArguments,
    pub(crate) count: [u32; 3],
    pub(crate) iterations: u32,
}

/// Byte offset of a draw's arguments.
macro_rules! at {
    ($field:ident) => {
        std::mem::offset_of!(Arguments, $field) as u64
    };
}

/// The compiled passes.
#[derive(Debug)]
pub(crate) struct CommunicationPasses {
    mask: RasterPass,
    clear_feedback: RasterPass,
    clear_radii: RasterPass,
    distribute: RasterPass,
    distribute_last: RasterPass,
    gather: RasterPass,
    mean: RasterPass,
    covariance: RasterPass,
    rounds: [RoundPasses; 2],
}

/// The passes that differ from round to round.
#[derive(Debug)]
struct RoundPasses {
    begin: Pass,
    ask: RasterPass,
    count: Pass,
    decide: Pass,
    keep_mean: Pass,
    keep_covariance: Pass,
}

impl CommunicationPasses {
    /// # Errors
    /// [`Error::Device`] if the device lacks a feature that the paper's method needs.
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Error> {
        check(gpu)?;
        let raster = |source: &PassSource, constants: &[(&str, f64)], targets: &[Target]| {
            RasterPass::new(gpu, source, constants, targets, DepthMask::Greater)
        };
        let distribute = |last: bool| raster(&DISTRIBUTE, &[("IS_LAST", last.into())], &[Target::AddAndMax]);
        let round = |round: Round| {
            let round = round.constant();
            Ok::<_, Error>(RoundPasses {
                begin: Pass::new(gpu, &BEGIN, &[round])?,
                ask: raster(&ASK, &[round], &[Target::Replace])?,
                count: Pass::new(gpu, &COUNT, &[round])?,
                decide: Pass::new(gpu, &DECIDE, &[round])?,
                keep_mean: Pass::new(gpu, &KEEP_MEAN, &[round])?,
                keep_covariance: Pass::new(gpu, &KEEP_COVARIANCE, &[round])?,
            })
        };
        Ok(Self {
            mask: RasterPass::new(gpu, &MASK, &[], &[Target::Replace], DepthMask::Write)?,
            clear_feedback: raster(&CLEAR, &[], &[Target::Replace])?,
            clear_radii: raster(&CLEAR, &[], &[Target::Replace; 2])?,
            distribute: distribute(false)?,
            distribute_last: distribute(true)?,
            gather: raster(&GATHER, &[], &GATHERED)?,
            mean: raster(&MEAN, &[], &GATHERED)?,
            covariance: raster(&COVARIANCE, &[], &GATHERED)?,
            rounds: [round(Round::Active)?, round(Round::Recovered)?],
        })
    }
}

/// Refuses devices on which a pass cannot run, with the reason.
///
/// # Errors
/// [`Error::Device`].
pub(crate) fn check(gpu: &Gpu) -> Result<(), Error> {
    let refuse = |what: String| {
        Err(Error::Device(format!(
            "the splat-communication search needs {what}; use the screen-grid engine (--engine screen-grid)"
        )))
    };
    if !gpu.device.features().contains(wgpu::Features::FLOAT32_BLENDABLE) {
        return refuse(
            "blending in 32-bit float textures (FLOAT32_BLENDABLE), which the device was made without".into(),
        );
    }
    let bytes = gpu.device.limits().max_color_attachment_bytes_per_sample;
    if bytes < GATHERED_BYTES {
        return refuse(format!("{GATHERED_BYTES} bytes per pixel to draw into, the device allows {bytes}"));
    }
    Ok(())
}

/// Textures of one size of picture.
struct Textures {
    depth: wgpu::TextureView,
    /// Positions in view space, and in alpha the first search radius.
    positions: wgpu::TextureView,
    /// T_F: bounds, and in alpha the feedback radius.
    feedback: wgpu::TextureView,
    /// T_R1: counters.
    counts: wgpu::TextureView,
    /// T_R2: bounds, and in alpha the distance to the furthest neighbour.
    radii: wgpu::TextureView,
}

impl Textures {
    fn new(gpu: &Gpu, size: [u32; 2]) -> Result<Self, Error> {
        let most = gpu.device.limits().max_texture_dimension_2d;
        if let Some(side) = size.into_iter().find(|&side| side > most) {
            return Err(Error::Device(format!(
                "the splat-communication search draws into textures of the size of the picture, and {side} pixels are more \
                 than the {most} that the device allows; use a smaller picture or the screen-grid engine"
            )));
        }
        let target = |label, format| gpu.target(label, size, format);
        Ok(Self {
            depth: target("autosplats.communication.depth", Depth32Float)?,
            positions: target("autosplats.communication.positions", Rgba32Float)?,
            feedback: target("autosplats.communication.feedback", Rgba32Float)?,
            counts: target("autosplats.communication.counts", Rgba32Float)?,
            radii: target("autosplats.communication.radii", Rgba32Float)?,
        })
    }

    /// Targets for drawing into textures behind the depth mask.
    fn into(&self, colors: &[&wgpu::TextureView]) -> Targets {
        let colors = colors.iter().map(|&view| (view.clone(), Load::Kept)).collect();
        Targets { colors, depth: self.depth.clone(), clear_depth: None }
    }
}

impl EnginePasses for CommunicationPasses {
    fn steps(&self, gpu: &Gpu, buffers: SearchBuffers<'_>) -> Result<EngineSteps, Error> {
        let textures = Textures::new(gpu, buffers.screen.size)?;
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::INDIRECT;
        let arguments = gpu.buffer("arguments of splats", size_of::<Arguments>() as u64, usage)?;
        let convergence = gpu.storage::<u32>("convergence", 2 * (ITERATIONS + 1))?;
        let bound = BoundPasses {
            passes: self,
            gpu,
            buffers,
            textures: &textures,
            arguments: &arguments,
            convergence: &convergence,
        };
        let rounds = [Round::Active, Round::Recovered].map(|round| bound.steps(round));
        Ok(EngineSteps { rounds, convergence: Some(convergence) })
    }
}

/// The passes with their resources.
struct BoundPasses<'a> {
    passes: &'a CommunicationPasses,
    gpu: &'a Gpu,
    buffers: SearchBuffers<'a>,
    textures: &'a Textures,
    arguments: &'a wgpu::Buffer,
    convergence: &'a wgpu::Buffer,
}

impl BoundPasses<'_> {
    fn steps(&self, round: Round) -> Vec<Step> {
        let mut steps = vec![self.begin(round)];
        if round == Round::Active {
            // Both rounds share the points.
            steps.push(self.mask());
        }
        steps.push(self.ask(round));
        for _ in 0..ITERATIONS {
            steps.push(self.distribute(false));
            steps.push(self.gather(&self.passes.gather, at!(clear), at!(boxes)));
            steps.push(self.count(round));
            steps.push(self.decide(round));
        }
        steps.push(self.distribute(true));
        steps.push(self.gather(&self.passes.mean, at!(last_clear), at!(last_boxes)));
        steps.push(self.keep_mean(round));
        steps.push(self.gather(&self.passes.covariance, at!(last_clear), at!(last_boxes)));
        steps.push(self.keep_covariance(round));
        steps
    }

    fn begin(&self, round: Round) -> Step {
        let buffers = [self.buffers.frame, &self.buffers.screen.counters, self.arguments, self.convergence];
        self.passes.rounds[round as usize].begin.step(self.gpu, &buffers, 1)
    }

    fn mask(&self) -> Step {
        let screen = self.buffers.screen;
        let resources = buffers([self.buffers.frame, &screen.points, &screen.density, &screen.counters]);
        let Textures { positions, depth, .. } = self.textures;
        let colors = vec![(positions.clone(), Load::Cleared([0.0; 4]))];
        let targets = Targets { colors, depth: depth.clone(), clear_depth: Some(1.0) };
        Step::draw(targets, vec![self.draw(&self.passes.mask, &resources, at!(points))])
    }

    fn ask(&self, round: Round) -> Step {
        let screen = self.buffers.screen;
        let resources = buffers([self.buffers.frame, &screen.points, &screen.queries, &screen.counters]);
        let pass = &self.passes.rounds[round as usize].ask;
        let Textures { radii, depth, .. } = self.textures;
        let colors = vec![(radii.clone(), Load::Cleared([0.0; 4]))];
        let targets = Targets { colors, depth: depth.clone(), clear_depth: None };
        Step::draw(targets, vec![self.draw(pass, &resources, at!(queries))])
    }

    fn distribute(&self, last: bool) -> Step {
        let screen = self.buffers.screen;
        let Textures { positions, feedback, counts, radii, .. } = self.textures;
        let mut resources = buffers([self.buffers.frame, &screen.points, &screen.counters]);
        resources.extend(textures([positions, counts, radii]));
        let (pass, clear, boxes) = if last {
            (&self.passes.distribute_last, at!(last_clear), at!(last_boxes))
        } else {
            (&self.passes.distribute, at!(clear), at!(boxes))
        };
        let draws = vec![self.draw(&self.passes.clear_feedback, &[], clear), self.draw(pass, &resources, boxes)];
        Step::draw(self.textures.into(&[feedback]), draws)
    }

    fn gather(&self, pass: &RasterPass, clear: u64, boxes: u64) -> Step {
        let Textures { positions, feedback, counts, radii, .. } = self.textures;
        let mut resources = buffers([self.buffers.frame, &self.buffers.screen.points]);
        resources.extend(textures([positions, feedback]));
        let draws = vec![self.draw(&self.passes.clear_radii, &[], clear), self.draw(pass, &resources, boxes)];
        Step::draw(self.textures.into(&[counts, radii]), draws)
    }

    fn count(&self, round: Round) -> Step {
        let SearchBuffers { frame, screen, .. } = self.buffers;
        let Textures { positions, counts, radii, .. } = self.textures;
        let mut resources =
            buffers([frame, &screen.points, &screen.queries, &screen.counters, self.arguments, self.convergence]);
        resources.extend(textures([positions, counts, radii]));
        let groups = Groups::Counted(self.arguments.clone(), at!(count));
        self.passes.rounds[round as usize].count.step_with(self.gpu, &resources, groups)
    }

    fn decide(&self, round: Round) -> Step {
        let buffers = [self.buffers.frame, &self.buffers.screen.counters, self.arguments, self.convergence];
        self.passes.rounds[round as usize].decide.step(self.gpu, &buffers, 1)
    }

    fn keep_mean(&self, round: Round) -> Step {
        let Textures { feedback, counts, radii, .. } = self.textures;
        self.keep(&self.passes.rounds[round as usize].keep_mean, round, &[feedback, counts, radii])
    }

    fn keep_covariance(&self, round: Round) -> Step {
        let Textures { counts, radii, .. } = self.textures;
        self.keep(&self.passes.rounds[round as usize].keep_covariance, round, &[counts, radii])
    }

    fn keep(&self, pass: &Pass, round: Round, kept: &[&wgpu::TextureView]) -> Step {
        let SearchBuffers { frame, screen, neighborhoods, .. } = self.buffers;
        let mut resources = buffers([frame, &screen.points, &screen.queries, &screen.counters, neighborhoods]);
        resources.extend(kept.iter().map(|view| wgpu::BindingResource::TextureView(view)));
        pass.step_with(self.gpu, &resources, screen.groups(round.work_256()))
    }

    fn draw(&self, pass: &RasterPass, resources: &[wgpu::BindingResource<'_>], at: u64) -> Draw {
        pass.draw(self.gpu, resources, self.arguments, at)
    }
}

fn buffers<'a, const N: usize>(buffers: [&'a wgpu::Buffer; N]) -> Vec<wgpu::BindingResource<'a>> {
    buffers.iter().map(|buffer| buffer.as_entire_binding()).collect()
}

fn textures<const N: usize>(views: [&wgpu::TextureView; N]) -> [wgpu::BindingResource<'_>; N] {
    views.map(wgpu::BindingResource::TextureView)
}

#[cfg(test)]
mod tests;
