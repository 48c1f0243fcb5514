//! The raster form of splat communication: textures and steps.

use wgpu::TextureFormat::{Depth32Float, Rgba32Float};

use super::gpu::{self as shared, CONSTANTS, ITERATIONS, Progress, ProgressPasses, at};
use crate::Error;
use crate::gpu::{
    DepthMask, Draw, Gpu, Library, Load, Pass, PassSource, RasterPass, Step, Target, Targets, files, passes,
};
use crate::project::gpu::{Counter, Round};
use crate::search::engine::{EnginePasses, EngineSteps, IMPORTS, SearchBuffers};

/// Imports and constants of the passes.
const LIBRARY: Library = Library {
    files: &[IMPORTS, shared::IMPORTS, files!["answer", "splat_box"]],
    constants: &[Counter::CONSTANTS, CONSTANTS],
};

passes! {
    "search/splat_communication", LIBRARY;
    MASK = "raster/mask" needs wgpu::Features::FLOAT32_BLENDABLE,
    ASK = "raster/ask" needs wgpu::Features::FLOAT32_BLENDABLE,
    CLEAR = "raster/clear" needs wgpu::Features::FLOAT32_BLENDABLE,
    DISTRIBUTE = "raster/distribute" needs wgpu::Features::FLOAT32_BLENDABLE,
    GATHER = "raster/gather" needs wgpu::Features::FLOAT32_BLENDABLE,
    MEAN = "raster/mean" needs wgpu::Features::FLOAT32_BLENDABLE,
    COVARIANCE = "raster/covariance" needs wgpu::Features::FLOAT32_BLENDABLE,
    COUNT = "raster/count",
    KEEP_MEAN = "raster/keep_mean",
    KEEP_COVARIANCE = "raster/keep_covariance",
}

/// The two textures that a gathering pass writes.
const GATHERED: [Target; 2] = [Target::Add, Target::AddAndMax];
pub(super) const GATHERED_BYTES: u32 = 32;

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
    progress: ProgressPasses,
    ask: RasterPass,
    count: Pass,
    keep_mean: Pass,
    keep_covariance: Pass,
}

impl CommunicationPasses {
    /// # Errors
    /// [`Error::Device`] if the device lacks a feature that drawing needs.
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Error> {
        check(gpu)?;
        let raster = |source: &PassSource, constants: &[(&str, f64)], targets: &[Target]| {
            RasterPass::new(gpu, source, constants, targets, DepthMask::Greater)
        };
        let distribute = |last: bool| raster(&DISTRIBUTE, &[("IS_LAST", last.into())], &[Target::AddAndMax]);
        let pass = |source| Pass::new(gpu, source, &[]);
        Ok(Self {
            mask: RasterPass::new(gpu, &MASK, &[], &[Target::Replace], DepthMask::Write)?,
            clear_feedback: raster(&CLEAR, &[], &[Target::Replace])?,
            clear_radii: raster(&CLEAR, &[], &[Target::Replace; 2])?,
            distribute: distribute(false)?,
            distribute_last: distribute(true)?,
            gather: raster(&GATHER, &[], &GATHERED)?,
            mean: raster(&MEAN, &[], &GATHERED)?,
            covariance: raster(&COVARIANCE, &[], &GATHERED)?,
            progress: ProgressPasses::new(gpu)?,
            ask: raster(&ASK, &[], &[Target::Replace])?,
            count: pass(&COUNT)?,
            keep_mean: pass(&KEEP_MEAN)?,
            keep_covariance: pass(&KEEP_COVARIANCE)?,
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
            "the splat-communication-raster search needs {what}; use its form in compute shaders (--engine \
             splat-communication)"
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
pub(super) struct Textures {
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
    pub(super) fn new(gpu: &Gpu, size: [u32; 2]) -> Result<Self, Error> {
        let most = gpu.device.limits().max_texture_dimension_2d;
        if let Some(side) = size.into_iter().find(|&side| side > most) {
            return Err(Error::Device(format!(
                "the splat-communication-raster search draws into textures of the size of the picture, and {side} \
                 pixels are more than the {most} that the device allows; use a smaller picture or its form in compute \
                 shaders"
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
        let progress = Progress::new(gpu)?;
        let bound = BoundPasses { passes: self, gpu, buffers, textures: &textures, progress: &progress };
        let rounds = [Round::Active, Round::Recovered].map(|round| bound.steps(round));
        Ok(EngineSteps { rounds, convergence: Some(progress.convergence) })
    }
}

/// The passes with their resources.
struct BoundPasses<'a> {
    passes: &'a CommunicationPasses,
    gpu: &'a Gpu,
    buffers: SearchBuffers<'a>,
    textures: &'a Textures,
    progress: &'a Progress,
}

impl BoundPasses<'_> {
    fn steps(&self, round: Round) -> Vec<Step> {
        let progress = &self.passes.progress;
        let mut steps = vec![progress.begin(self.gpu, self.buffers, self.progress)];
        if round == Round::Active {
            // Both rounds share the points.
            steps.push(self.mask());
        }
        steps.push(self.ask());
        for _ in 0..ITERATIONS {
            steps.push(self.distribute(false));
            steps.push(self.gather(&self.passes.gather, at!(clear), at!(boxes)));
            steps.push(self.count());
            steps.push(progress.decide(self.gpu, self.buffers, self.progress));
        }
        steps.push(self.distribute(true));
        steps.push(self.gather(&self.passes.mean, at!(last_clear), at!(last_boxes)));
        steps.push(self.keep_mean(round));
        steps.push(self.gather(&self.passes.covariance, at!(last_clear), at!(last_boxes)));
        steps.push(self.keep_covariance(round));
        steps
    }

    fn mask(&self) -> Step {
        let screen = self.buffers.screen;
        let resources = buffers([self.buffers.frame, &screen.points, &screen.density, &screen.counters]);
        let Textures { positions, depth, .. } = self.textures;
        let colors = vec![(positions.clone(), Load::Cleared([0.0; 4]))];
        let targets = Targets { colors, depth: depth.clone(), clear_depth: Some(1.0) };
        Step::draw(targets, vec![self.draw(&self.passes.mask, &resources, at!(points))])
    }

    fn ask(&self) -> Step {
        let screen = self.buffers.screen;
        let resources = buffers([self.buffers.frame, &screen.points, &screen.queries, &screen.counters]);
        let pass = &self.passes.ask;
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

    fn count(&self) -> Step {
        let SearchBuffers { frame, screen, .. } = self.buffers;
        let Textures { positions, counts, radii, .. } = self.textures;
        let Progress { arguments, convergence } = self.progress;
        let mut resources = buffers([frame, &screen.points, &screen.queries, &screen.counters, arguments, convergence]);
        resources.extend(textures([positions, counts, radii]));
        let count = &self.passes.count;
        count.step_with(self.gpu, &resources, self.progress.queries_groups())
    }

    fn keep_mean(&self, round: Round) -> Step {
        let Textures { feedback, counts, radii, .. } = self.textures;
        self.keep(&self.passes.keep_mean, round, &[feedback, counts, radii])
    }

    fn keep_covariance(&self, round: Round) -> Step {
        let Textures { counts, radii, .. } = self.textures;
        self.keep(&self.passes.keep_covariance, round, &[counts, radii])
    }

    fn keep(&self, pass: &Pass, round: Round, kept: &[&wgpu::TextureView]) -> Step {
        let SearchBuffers { frame, screen, neighborhoods, .. } = self.buffers;
        let mut resources = buffers([frame, &screen.points, &screen.queries, &screen.counters, neighborhoods]);
        resources.extend(kept.iter().map(|view| wgpu::BindingResource::TextureView(view)));
        pass.step_with(self.gpu, &resources, screen.groups(round.work_256()))
    }

    fn draw(&self, pass: &RasterPass, resources: &[wgpu::BindingResource<'_>], at: u64) -> Draw {
        pass.draw(self.gpu, resources, &self.progress.arguments, at)
    }
}

fn buffers<'a, const N: usize>(buffers: [&'a wgpu::Buffer; N]) -> Vec<wgpu::BindingResource<'a>> {
    buffers.iter().map(|buffer| buffer.as_entire_binding()).collect()
}

fn textures<const N: usize>(views: [&wgpu::TextureView; N]) -> [wgpu::BindingResource<'_>; N] {
    views.map(wgpu::BindingResource::TextureView)
}
