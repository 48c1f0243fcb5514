//! Compiled passes, buffers and steps of a frame on a device.

use std::mem::{Discriminant, discriminant};

use rayon::join;

use crate::Error;
use crate::adapt::gpu::{AdaptBuffers, AdaptPasses, DepthNoiseBuffer};
use crate::camera::{PlacedView, Reprojection, View};
use crate::fit::gpu::{FitPass, surfel_buffer};
use crate::fit::orient::gpu::OrientPass;
use crate::gpu::{FrameUniform, Gpu, Step};
use crate::points::Points;
use crate::project::DeviceCloud;
use crate::project::gpu::{Nearest, ProjectPasses, ScreenBuffers};
use crate::renderer::attributes::SplatAttributes;
use crate::renderer::frame::Stage;
use crate::renderer::rules::Rules;
use crate::renderer::{Reconstruction, Settings};
use crate::search::SearchEngine;
use crate::search::engine::{EnginePasses, EngineSteps, SearchBuffers};
use crate::search::gpu::compile;
use crate::search::screen_grid::gpu::neighborhood_buffer;
use crate::shade::gpu::{ShadeBuffers, ShadePasses, ShadeUniform, finds_range};
use crate::shade::over_time::gpu::{LastPictureBuffers, PictureOverTimePasses};
use crate::shade::{ColorMode, Scene, linear_steps};
use crate::splat::gpu::{LayerRules, SplatBuffers, SplatPasses};
use crate::splat::over_time::gpu::{OverTimeBuffers, OverTimePasses};
use crate::splat::{Channels, LayerBuffers};

/// Engine, without its parameters, and k: the search passes are compiled for these.
type SearchKind = (Discriminant<SearchEngine>, u32);

/// Compiled passes. For search and splat, the passes of the last engine, k and channels are kept.
#[derive(Debug)]
pub(super) struct Passes {
    project: ProjectPasses,
    search: Option<(SearchKind, Box<dyn EnginePasses>)>,
    fit: FitPass,
    /// Compiled for the first cloud with sensors.
    orient: Option<OrientPass>,
    /// Compiled for the first adaptive frame.
    adapt: Option<AdaptPasses>,
    /// Compiled for the first smoothed frame.
    over_time: Option<(OverTimePasses, PictureOverTimePasses)>,
    splat: Option<((Channels, bool), SplatPasses)>,
    shade: ShadePasses,
}

impl Passes {
    pub(super) fn new(gpu: &Gpu) -> Result<Self, Error> {
        let (project, others) = join(
            || ProjectPasses::new(gpu, Nearest::best(gpu)),
            || join(|| FitPass::new(gpu), || ShadePasses::new(gpu)),
        );
        let (fit, shade) = others;
        let passes = Self {
            project: project?,
            search: None,
            fit: fit?,
            orient: None,
            adapt: None,
            over_time: None,
            splat: None,
            shade: shade?,
        };
        gpu.store_pipelines();
        Ok(passes)
    }

    /// Compiles the missing passes for frames of a shape.
    fn compile(&mut self, gpu: &Gpu, shape: &Shape, settings: &Settings) -> Result<(), Error> {
        let Reconstruction { engine, k, .. } = settings.reconstruction;
        let searches = self.search.as_ref().is_some_and(|(of, _)| *of == shape.search);
        let splats = self.splat.as_ref().is_some_and(|(of, _)| *of == (shape.channels, shape.trim));
        let adapts = self.adapt.is_some() || !shape.adapt;
        let orients = self.orient.is_some() || shape.sensors.is_none();
        let averages = self.over_time.is_some() || !shape.average;
        if searches && splats && adapts && orients && averages {
            return Ok(());
        }
        let over_time = || Ok((OverTimePasses::new(gpu)?, PictureOverTimePasses::new(gpu)?));
        let ((search, adapt), (splat, (orient, over_time))) = join(
            || join(|| unless(searches, || compile(gpu, engine, k)), || unless(adapts, || AdaptPasses::new(gpu))),
            || {
                join(
                    || unless(splats, || SplatPasses::new(gpu, shape.channels, shape.trim, &linear_steps())),
                    || join(|| unless(orients, || OrientPass::new(gpu)), || unless(averages, over_time)),
                )
            },
        );
        self.search = search?.map(|passes| (shape.search, passes)).or(self.search.take());
        self.adapt = adapt?.or(self.adapt.take());
        self.splat = splat?.map(|passes| ((shape.channels, shape.trim), passes)).or(self.splat.take());
        self.orient = orient?.or(self.orient.take());
        self.over_time = over_time?.or(self.over_time.take());
        gpu.store_pipelines();
        Ok(())
    }
}

/// What `make` returns, unless it is there already.
fn unless<T>(is_there: bool, make: impl FnOnce() -> Result<T, Error>) -> Result<Option<T>, Error> {
    if is_there { Ok(None) } else { make().map(Some) }
}

/// The properties of a frame that its buffers and steps depend on.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Shape {
    /// Width and height of the picture in pixels.
    size: [u32; 2],
    /// Width of the margin around the picture in pixels.
    margin_px: u32,
    halves: bool,
    search: SearchKind,
    coherent: bool,
    average: bool,
    adapt: bool,
    depth_refinement: bool,
    trim: bool,
    channels: Channels,
    /// Number of runs of points by their sensors; `None` without sensors.
    sensors: Option<usize>,
    tone_backs: bool,
    find_range: bool,
    keep_linear: bool,
    color: ColorMode,
}

impl Shape {
    /// Shape of a frame. `size` is the picture's, without the margin; `sensors` is the number of runs of points by
    /// their sensors.
    pub(super) fn new(
        size: [u32; 2],
        rules: &Rules,
        sensors: Option<usize>,
        wanted: &SplatAttributes,
        Settings { reconstruction, shading, all_layers, .. }: &Settings,
    ) -> Self {
        Self {
            size,
            margin_px: rules.margin_px,
            halves: rules.project.halves,
            search: (discriminant(&reconstruction.engine), reconstruction.k),
            coherent: rules.coherent,
            average: rules.averaged.is_some(),
            adapt: rules.adapt.is_some(),
            depth_refinement: rules.depth_refinement,
            trim: rules.trim.is_some(),
            channels: wanted.channels(),
            sensors,
            tone_backs: wanted.backs && shading.tones_backs(),
            find_range: finds_range(shading),
            keep_linear: *all_layers,
            color: shading.color.clone(),
        }
    }
}

/// Device buffers that outlive the steps.
#[derive(Clone, Copy)]
pub(super) struct ResidentBuffers<'a> {
    pub(super) cloud: &'a DeviceCloud,
    pub(super) sensors: Option<&'a wgpu::Buffer>,
    pub(super) depth_noise: &'a DepthNoiseBuffer,
    /// Buffer of [`FrameUniform`].
    pub(super) frame: &'a wgpu::Buffer,
}

/// Settings of a picture, and the format of its texture if it has one.
pub(super) type PictureSettings = (Settings, Option<wgpu::TextureFormat>);

/// A frame ready to be replayed.
#[derive(Debug)]
pub(super) struct Prepared {
    shape: Shape,
    /// The last frame, if there is one: view, identity of its points and how it was made.
    pub(super) seen: Option<(PlacedView, u64, PictureSettings)>,
    /// The half of [`ScreenBuffers::past`] that the last frame read. It wrote the other, which the next frame reads.
    pub(super) past_half: u32,
    pub(super) screen: ScreenBuffers,
    /// [`Surfel`](crate::fit::Surfel) per query.
    pub(super) surfels: wgpu::Buffer,
    pub(super) layers: LayerBuffers,
    pub(super) picture: ShadeBuffers,
    /// Counts per iteration, for engines that iterate.
    pub(super) convergence: Option<wgpu::Buffer>,
    pub(super) steps: Vec<Step>,
}

impl Prepared {
    /// Makes buffers and steps for frames of a shape, which the `rules` have.
    pub(super) fn new(
        gpu: &Gpu,
        shape: Shape,
        passes: &mut Passes,
        ResidentBuffers { cloud, sensors, depth_noise, frame }: ResidentBuffers<'_>,
        rules: &Rules,
        settings: &Settings,
    ) -> Result<Self, Error> {
        passes.compile(gpu, &shape, settings)?;
        let Passes { project, search, fit, orient, adapt, over_time, splat, shade } = passes;
        let (Some((_, search)), Some((_, splat))) = (search, splat) else { unreachable!("they were just compiled") };
        let adapt = adapt.as_ref().filter(|_| shape.adapt);
        let Shape { size: picture_size, margin_px, halves, .. } = shape;
        let size = picture_size.map(|side| side + 2 * margin_px);
        let mut screen = ScreenBuffers::new(gpu, size, halves, cloud.capacity(), cloud.words())?;
        if shape.coherent {
            screen = screen.keeping_past(gpu)?;
        }
        let neighborhoods = neighborhood_buffer(gpu, screen.capacity)?;
        let surfels = surfel_buffer(gpu, screen.capacity)?;
        let adapt = match adapt {
            Some(passes) => Some((passes, AdaptBuffers::new(gpu, size, depth_noise)?)),
            None => None,
        };
        let over_time = over_time.as_ref().filter(|_| shape.average);
        let picture_over_time = over_time.map(|(_, passes)| passes);
        let over_time = match over_time {
            Some((passes, _)) => Some((passes, OverTimeBuffers::new(gpu, screen.capacity, size)?)),
            None => None,
        };
        let splats = SplatBuffers::new(gpu, screen.capacity, size)?;
        let layers = LayerBuffers::new(gpu, size, shape.channels)?;
        let picture = ShadeBuffers::new(gpu, picture_size, shape.keep_linear)?;
        let last_picture = match picture_over_time {
            Some(passes) => Some((passes, LastPictureBuffers::new(gpu, picture_size)?)),
            None => None,
        };
        let (steps, convergence) = gpu.checked(|| {
            let buffers = SearchBuffers { frame, cloud, screen: &screen, neighborhoods: &neighborhoods };
            let EngineSteps { rounds: mut searches, convergence } = search.steps(gpu, buffers)?;
            let mut steps = Vec::new();
            for stage in Stage::list(rules) {
                match stage {
                    Stage::Project => steps.extend(project.steps(gpu, frame, cloud, &screen)),
                    Stage::FillCells => {
                        if let Some((passes, buffers)) = &adapt {
                            steps.extend(passes.steps_cells(gpu, frame, &screen, buffers));
                        }
                    }
                    Stage::Search(round) => steps.append(&mut searches[round as usize]),
                    Stage::Fit(round) => {
                        steps.push(fit.step(gpu, frame, &screen, &neighborhoods, &surfels, round));
                    }
                    Stage::Adapt(round) => {
                        if let Some((passes, buffers)) = &adapt {
                            steps.extend(passes.steps(gpu, frame, &screen, &surfels, buffers, round));
                        }
                    }
                    Stage::Orient(round) => {
                        if let (Some(orient), Some(sensors)) = (&*orient, sensors) {
                            steps.push(orient.step(gpu, frame, &screen, sensors, &surfels, round));
                        }
                    }
                    Stage::Average(round) => {
                        if let Some((passes, buffers)) = &over_time {
                            steps.push(passes.step(gpu, frame, &screen, &surfels, (&layers, buffers), round));
                        }
                    }
                    Stage::Draw(round) => {
                        steps.extend(splat.steps_visibility(gpu, frame, &screen, &surfels, &splats, round));
                    }
                    Stage::Recover => steps.extend(splat.steps_recover(gpu, frame, &screen)),
                    Stage::Keep => {
                        if let Some((passes, buffers)) = &over_time {
                            steps.extend(passes.steps_keep(gpu, frame, &screen, &surfels, buffers));
                        }
                    }
                    Stage::Layers => {
                        let noise = adapt.as_ref().map(|(_, buffers)| buffers.noise());
                        let rules = LayerRules { depth_refinement: shape.depth_refinement, noise };
                        steps.extend(splat.steps_layers(gpu, frame, &screen, &surfels, &splats, &layers, rules));
                    }
                    Stage::Shade => {
                        steps.extend(shade.steps(
                            gpu,
                            frame,
                            &layers,
                            &screen.counters,
                            &picture,
                            &settings.shading,
                        )?);
                        if let Some((passes, last)) = &last_picture {
                            steps.extend(passes.steps(gpu, frame, &layers, &picture, last));
                        }
                    }
                }
            }
            Ok::<_, Error>((steps, convergence))
        })??;
        Ok(Self { shape, seen: None, past_half: 0, screen, surfels, layers, picture, convergence, steps })
    }

    /// Whether the steps fit frames of this shape.
    pub(super) fn is_for(&self, shape: &Shape) -> bool {
        self.shape == *shape
    }

    /// Writes the uniforms of the next frame.
    pub(super) fn write_uniforms(
        &mut self,
        gpu: &Gpu,
        frame: &wgpu::Buffer,
        (view, points, format): (&View, Points<'_>, Option<wgpu::TextureFormat>),
        rules: &Rules,
        settings: &Settings,
        scene: &Scene<'_>,
    ) {
        let Settings { reconstruction, .. } = settings;
        let now = points.placed(*view);
        // The halves take turns even where a frame was given up: then `seen` is empty, and none is read.
        self.past_half = 1 - self.past_half;
        let past_half = self.past_half;
        let frame_uniform = FrameUniform { past_half, ..uniform(view, rules, reconstruction.engine) };
        // New steps have no last frame to look back at. A change of k always makes new steps.
        let past = self.seen.take().filter(|_| self.shape.coherent || self.shape.average);
        let reprojected = past.and_then(|(past, known, made)| Some((Reprojection::new(&now, &past)?, known, made)));
        let frame_uniform = reprojected.map_or(frame_uniform, |(past, known, made)| {
            let same_points = known == points.identity();
            let (before, format_before) = &made;
            let is_alike = before.reconstruction == *reconstruction;
            let [of_same, of_others] = rules.averaged.filter(|_| is_alike).unwrap_or([1; 2]);
            let frames_averaged = if same_points { of_same } else { of_others } as f32;
            let same_picture = self.shape.average && same_points && before == settings && *format_before == format;
            let (same_points, same_picture) = (same_points.into(), same_picture.into());
            FrameUniform { frames_averaged, same_points, same_picture, ..frame_uniform.after(&past) }
        });
        gpu.queue.write_buffer(frame, 0, bytemuck::bytes_of(&frame_uniform));
        let shading = ShadeUniform::new(scene, &settings.shading, &self.layers, settings.all_layers);
        let shading = format.map_or(shading, |format| shading.into_format(format));
        self.picture.write(gpu, &shading, &settings.shading);
    }
}

/// The camera and the rules of a frame, without a last frame.
fn uniform(view: &View, rules: &Rules, engine: SearchEngine) -> FrameUniform {
    let Rules { project, search, fit, .. } = rules;
    let search = search.expect("planes are given on the CPU only");
    FrameUniform {
        halves: project.halves.into(),
        grid_culling: project.grid_culling.into(),
        near_cells: (project.near && view.perspective).into(),
        lenient: search.lenient.into(),
        outlier_growth: search.outlier_radius(1.0),
        gap_growth: search.gap_factor.map_or(f32::INFINITY, f32::sqrt),
        first_radius: if let SearchEngine::KdTree { first_radius } = engine { first_radius } else { 0.0 },
        longest: fit.longest,
        scan_lines: fit.scan_lines.into(),
        keep_outliers: fit.keep_outliers.into(),
        compares_density: fit.compares_density.into(),
        splat_scale: fit.splat_scale,
        dot_px: fit.dot_px.unwrap_or(0.0),
        ..FrameUniform::new(view, project.k)
    }
}
