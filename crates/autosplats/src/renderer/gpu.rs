//! The frame on the GPU: the steps of all stages, made when buffers change and replayed for each picture.

use std::mem::{Discriminant, discriminant};
use std::time::Instant;

use autosplats_cloud::PointCloud;

use super::attributes::{ColorSource, Wanted};
use super::surfels::point_surfels;
use super::upward::Upward;
use super::{Counts, Frame, PointSurfel, Reconstruction, Settings, Timings, check, check_count};
use crate::Error;
use crate::adapt::DepthNoise;
use crate::adapt::gpu::{AdaptBuffers, AdaptPasses, DepthNoiseBuffer};
use crate::camera::{Camera, Reprojection, Seen, View};
use crate::fit::Surfel;
use crate::fit::gpu::{FitPasses, surfel_buffer};
use crate::fit::orient::Sensors;
use crate::fit::orient::gpu::{OrientPasses, sensor_buffer, write_sensors};
use crate::gpu::{AdapterSummary, Clock, FrameUniform, Gpu, PassTime, Readback, Recorder, Step, stage_ms};
use crate::project::gpu::{Counter, ProjectPasses, Round, ScreenBuffers};
use crate::project::{DeviceCloud, PointValues, Uploader};
use crate::search::gpu::{EnginePasses, EngineSteps, SearchBuffers, check_engine, compile, convergence};
use crate::search::past::gpu::{PastPasses, past_buffer};
use crate::search::screen_grid::gpu::neighborhood_buffer;
use crate::search::{SearchEngine, SearchRules};
use crate::shade::gpu::{ReadPicture, ShadeBuffers, ShadePasses, ShadeUniform, check_texture, finds_range, finish};
use crate::shade::{ColorMode, Image, Scene, linear_steps};
use crate::splat::gpu::{SplatBuffers, SplatPasses};
use crate::splat::{Channels, GBuffer, LayerBuffers};

/// Renders on a device.
#[derive(Debug)]
pub(super) struct GpuRenderer {
    gpu: Gpu,
    /// How pictures in memory are timed; those in textures are not.
    clock: Clock,
    uploader: Uploader,
    cloud: DeviceCloud,
    /// Where the sensors of its points stood, and the number of runs of points.
    sensors: Option<(wgpu::Buffer, usize)>,
    depth_noise: DepthNoiseBuffer,
    resident: Resident,
    /// [`FrameUniform`].
    frame: wgpu::Buffer,
    passes: Passes,
    prepared: Option<Prepared>,
    upward: Upward,
    /// Of the last frame.
    view: Option<View>,
    readback: Readback,
    image: Image,
    layers: GBuffer,
    times: Vec<PassTime>,
}

/// What of which cloud is on the device, by its identity.
#[derive(Debug, Default)]
struct Resident {
    points: Option<u64>,
    values: Option<(u64, Option<ColorSource>, Option<String>)>,
}

/// Which engine, whatever its parameters, and k: what search passes are compiled for.
type SearchKind = (Discriminant<SearchEngine>, u32);

/// Compiled passes: those of the last engine, k and channels are kept.
#[derive(Debug)]
struct Passes {
    project: ProjectPasses,
    search: Option<(SearchKind, Box<dyn EnginePasses>)>,
    past: PastPasses,
    fit: FitPasses,
    /// Once there was a cloud with sensors.
    orient: Option<OrientPasses>,
    /// Compiled when first asked for.
    adapt: Option<AdaptPasses>,
    splat: Option<(Channels, SplatPasses)>,
    shade: ShadePasses,
}

/// What a frame's buffers and steps were made for.
#[derive(Clone, Debug, PartialEq)]
struct Shape {
    size: [u32; 2],
    halves: bool,
    search: SearchKind,
    coherent: bool,
    smooth: bool,
    adaptive: bool,
    depth_refinement: bool,
    channels: Channels,
    /// Runs of points by their sensors.
    sensors: Option<usize>,
    tone_backs: bool,
    find_range: bool,
    keep_linear: bool,
    color: ColorMode,
}

/// A frame ready to be replayed.
#[derive(Debug)]
struct Prepared {
    shape: Shape,
    /// How the last frame was seen, if there was one.
    seen: Option<Seen>,
    screen: ScreenBuffers,
    /// [`Surfel`] per query.
    surfels: wgpu::Buffer,
    layers: LayerBuffers,
    picture: ShadeBuffers,
    /// Of an engine that iterates.
    convergence: Option<wgpu::Buffer>,
    steps: Vec<Step>,
}

impl GpuRenderer {
    /// # Errors
    /// [`Error::Device`] if the device lacks what every WebGPU device has, [`Error::DeviceMemory`].
    pub(super) fn new(gpu: Gpu) -> Result<Self, Error> {
        Ok(Self {
            clock: Clock::new(&gpu),
            uploader: Uploader::new(),
            cloud: DeviceCloud::default(),
            sensors: None,
            depth_noise: DepthNoiseBuffer::new(&gpu)?,
            resident: Resident::default(),
            frame: gpu.uniform::<FrameUniform>("frame")?,
            passes: Passes {
                project: ProjectPasses::new(&gpu, gpu.int64_atomics())?,
                search: None,
                past: PastPasses::new(&gpu)?,
                fit: FitPasses::new(&gpu)?,
                orient: None,
                adapt: None,
                splat: None,
                shade: ShadePasses::new(&gpu)?,
            },
            prepared: None,
            upward: Upward::default(),
            view: None,
            readback: Readback::default(),
            image: Image::default(),
            layers: GBuffer::default(),
            times: Vec::new(),
            gpu,
        })
    }

    pub(super) fn adapter(&self) -> AdapterSummary {
        self.gpu.summary()
    }

    /// # Errors
    /// [`Error::Device`] if the device cannot run the engine.
    pub(super) fn check_engine(&self, engine: SearchEngine) -> Result<(), Error> {
        check_engine(&self.gpu, engine)
    }

    /// See [`Renderer::upload`](super::Renderer::upload).
    pub(super) fn upload(
        &mut self,
        cloud: &PointCloud,
        settings: &Settings,
        report: &dyn Fn(f32) -> bool,
    ) -> Result<(), Error> {
        check_count(cloud)?;
        let wanted = Wanted::new(cloud, settings)?;
        self.gpu.clone().checked(|| self.make_resident(cloud, &wanted, report))?
    }

    /// Uploads what is not there yet. `report` is told how much of it is done.
    fn make_resident(
        &mut self,
        cloud: &PointCloud,
        wanted: &Wanted,
        report: &dyn Fn(f32) -> bool,
    ) -> Result<(), Error> {
        self.gpu.check_lost()?;
        let points = Some(cloud.identity());
        let values = Some((cloud.identity(), wanted.colors, wanted.scalar.clone()));
        let [new_points, new_values] = [self.resident.points != points, self.resident.values != values];
        if !new_points && !new_values {
            return Ok(());
        }
        let colors = wanted.colors(cloud);
        let carried = PointValues { colors: colors.as_deref(), scalar: wanted.scalar(cloud) };
        if !self.cloud.fits(cloud.len()) || self.cloud.words() != carried.words() {
            // Steps hold on to the buffers that they are bound to: these go before the new ones come.
            self.prepared = None;
        }
        // What fails is not there.
        self.resident.values = None;
        let part = if carried.words() == 0 { 1.0 } else { 0.5 };
        if new_points {
            self.resident.points = None;
            self.cloud.resize(&self.gpu, cloud.len())?;
            self.uploader.positions(&self.gpu, cloud, &self.cloud, &|done| report(part * done))?;
            self.upload_sensors(&Sensors::new(cloud))?;
            if self.depth_noise.write(&self.gpu, &DepthNoise::new(cloud))? {
                self.prepared = None;
            }
            self.resident.points = points;
        }
        self.cloud.resize_values(&self.gpu, carried.words())?;
        self.uploader.values(&self.gpu, &carried, &self.cloud, &|done| report(1.0 - part + part * done))?;
        self.resident.values = values;
        Ok(())
    }

    /// Tells the device where the sensors of its points stood.
    fn upload_sensors(&mut self, sensors: &Sensors) -> Result<(), Error> {
        let len = Some(sensors.len()).filter(|&len| len > 0);
        if self.sensors.as_ref().map(|(_, len)| *len) != len {
            // Steps hold on to the buffer before.
            self.prepared = None;
            self.sensors = None;
            self.sensors = len.map(|len| Ok::<_, Error>((sensor_buffer(&self.gpu, len)?, len))).transpose()?;
        }
        if let Some((buffer, _)) = &self.sensors {
            write_sensors(&self.gpu, sensors, buffer);
        }
        Ok(())
    }

    /// See [`Renderer::surfels`](super::Renderer::surfels).
    pub(super) fn surfels(&mut self) -> Result<Vec<PointSurfel>, Error> {
        let Self { gpu, prepared, view, readback, .. } = self;
        let (Some(prepared), Some(view)) = (prepared, view) else { return Ok(Vec::new()) };
        gpu.checked(|| {
            let mut recorder = Recorder::new(gpu, &Clock::Off);
            readback.copy(gpu, &mut recorder.encoder, &[&prepared.screen.counters, &prepared.surfels])?;
            recorder.finish();
            readback.read(gpu, |parts| {
                let counters: Vec<u32> = bytemuck::pod_collect_to_vec(parts[0]);
                let len: u32 =
                    [Counter::Active, Counter::Recovered].map(|counter| counters[counter as usize]).iter().sum();
                let surfels: Vec<Surfel> =
                    bytemuck::pod_collect_to_vec(&parts[1][..len as usize * size_of::<Surfel>()]);
                point_surfels(&surfels, view)
            })
        })?
    }

    /// See [`Renderer::convergence`](super::Renderer::convergence).
    pub(super) fn convergence(&mut self) -> Result<Vec<u32>, Error> {
        let Self { gpu, prepared, readback, .. } = self;
        let Some(Prepared { convergence: Some(buffer), .. }) = prepared else { return Ok(Vec::new()) };
        gpu.checked(|| {
            let mut recorder = Recorder::new(gpu, &Clock::Off);
            readback.copy(gpu, &mut recorder.encoder, &[buffer])?;
            recorder.finish();
            readback.read(gpu, |parts| convergence(&bytemuck::pod_collect_to_vec::<u8, u32>(parts[0])))
        })?
    }

    /// See [`Renderer::render_while`](super::Renderer::render_while).
    pub(super) fn render(
        &mut self,
        cloud: &PointCloud,
        camera: &Camera,
        size: [u32; 2],
        settings: &Settings,
        go_on: &dyn Fn() -> bool,
    ) -> Result<Frame<'_>, Error> {
        let view = check(cloud, camera, size, settings)?;
        // What a device that fails refuses arrives as an error, whatever it is asked for.
        self.gpu.clone().checked(move || self.frame(cloud, &view, size, settings, go_on))?
    }

    /// Renders what was checked.
    fn frame(
        &mut self,
        cloud: &PointCloud,
        view: &View,
        size: [u32; 2],
        settings: &Settings,
        go_on: &dyn Fn() -> bool,
    ) -> Result<Frame<'_>, Error> {
        let wanted = Wanted::new(cloud, settings)?;
        let started = Instant::now();
        self.make_resident(cloud, &wanted, &|_| go_on())?;
        let upload = started.elapsed().as_secs_f64() * 1e3;
        self.prepare(size, &wanted, settings)?;
        let Self { gpu, clock, prepared, upward, view: last_view, readback, image, layers, times, frame, .. } = self;
        let prepared = prepared.as_mut().ok_or_else(|| Error::Device("no frame was prepared".into()))?;
        let scene = Scene { view, up: upward.of(cloud), origin: cloud.origin() };
        let uniform = ShadeUniform::new(&scene, &settings.shading, &prepared.layers, settings.all_layers);
        prepared.tell(gpu, frame, Seen { view: *view, origin: cloud.origin() }, settings, &uniform);

        let waited = Instant::now();
        let mut recorder = Recorder::new(gpu, clock);
        prepared.steps.iter().for_each(|step| recorder.run(step));
        let mut wants = vec![&prepared.screen.counters, &prepared.picture.image];
        if settings.all_layers {
            let LayerBuffers { surface, cover, extras, .. } = &prepared.layers;
            wants.extend([&prepared.picture.linear, surface, cover, extras]);
        }
        readback.copy(gpu, &mut recorder.encoder, &wants)?;
        *times = recorder.finish();
        // What was not submitted left the surfels as they were.
        *last_view = Some(*view);
        prepared.seen = Some(Seen { view: *view, origin: cloud.origin() });
        let (counters, value_range) = readback.read(gpu, |parts| {
            let counters: Vec<u32> = bytemuck::pod_collect_to_vec(parts[0]);
            let range = [Counter::RangeLow, Counter::RangeHigh].map(|end| counters[end as usize]);
            let linear = if settings.all_layers { parts[2] } else { &[] };
            let read = ReadPicture { size, image: parts[1], linear, range };
            let value_range = finish(&read, &scene, &settings.shading, image);
            *layers = match parts {
                [_, _, _, surface, cover, extras] => prepared.layers.to_host(surface, cover, extras),
                _ => GBuffer::default(),
            };
            (counters, value_range)
        })?;
        let waited_ms = waited.elapsed().as_secs_f64() * 1e3;
        let spans = clock.read(gpu, times)?;
        let frame_ms = match clock {
            Clock::Off => waited_ms,
            _ => spans.last().map_or(0.0, |[_, end]| *end),
        };
        let stage = |name: &str| stage_ms(name, times, &spans);
        let timings = Timings {
            upload,
            project: stage("project"),
            search: stage("search"),
            fit: stage("fit"),
            adapt: stage("adapt"),
            splat: stage("splat"),
            shade: stage("shade"),
            frame: frame_ms,
        };
        Ok(Frame { image, layers, counts: Counts { value_range, ..counts(cloud, &counters) }, timings, passes: times })
    }

    /// See [`Renderer::render_to_texture`](super::Renderer::render_to_texture).
    pub(super) fn render_to_texture(
        &mut self,
        cloud: &PointCloud,
        camera: &Camera,
        texture: &wgpu::Texture,
        settings: &Settings,
    ) -> Result<(), Error> {
        let size = [texture.width(), texture.height()];
        check_texture(texture, size)?;
        let view = check(cloud, camera, size, settings)?;
        self.gpu.clone().checked(|| self.frame_in_texture(cloud, &view, texture, settings))?
    }

    /// Renders what was checked into a texture.
    fn frame_in_texture(
        &mut self,
        cloud: &PointCloud,
        view: &View,
        texture: &wgpu::Texture,
        settings: &Settings,
    ) -> Result<(), Error> {
        let wanted = Wanted::new(cloud, settings)?;
        self.make_resident(cloud, &wanted, &|_| true)?;
        self.prepare([texture.width(), texture.height()], &wanted, settings)?;
        let Self { gpu, prepared, upward, view: last_view, frame, .. } = self;
        let prepared = prepared.as_mut().ok_or_else(|| Error::Device("no frame was prepared".into()))?;
        let scene = Scene { view, up: upward.of(cloud), origin: cloud.origin() };
        let uniform = ShadeUniform::new(&scene, &settings.shading, &prepared.layers, settings.all_layers);
        let now = Seen { view: *view, origin: cloud.origin() };
        prepared.tell(gpu, frame, now, settings, &uniform.into_format(texture.format()));
        let mut recorder = Recorder::new(gpu, &Clock::Off);
        prepared.steps.iter().for_each(|step| recorder.run(step));
        prepared.picture.copy_to_texture(&mut recorder.encoder, texture)?;
        recorder.finish();
        *last_view = Some(*view);
        prepared.seen = Some(now);
        gpu.check_lost()
    }

    /// Makes buffers and steps for a frame unless the last frame's will do.
    fn prepare(&mut self, size: [u32; 2], wanted: &Wanted, settings: &Settings) -> Result<(), Error> {
        // A screen point has nothing larger than its surfel.
        let halves = settings.reconstruction.halves()
            && ScreenBuffers::has_room_for_halves::<Surfel>(&self.gpu, size, self.cloud.capacity());
        let shape = Shape {
            size,
            halves,
            search: (discriminant(&settings.reconstruction.engine), settings.reconstruction.k),
            coherent: settings.reconstruction.remembers(),
            smooth: settings.reconstruction.smoothing() > 0.0,
            adaptive: settings.reconstruction.adaptive,
            depth_refinement: settings.reconstruction.depth_refinement,
            channels: Channels {
                color: wanted.colors.is_some(),
                scalar: wanted.scalar.is_some(),
                measures: wanted.measures,
                backs: wanted.backs,
            },
            sensors: self.sensors.as_ref().map(|(_, len)| *len),
            tone_backs: wanted.backs && settings.shading.tones_backs(),
            find_range: finds_range(&settings.shading),
            keep_linear: settings.all_layers,
            color: settings.shading.color.clone(),
        };
        if self.prepared.as_ref().is_some_and(|prepared| prepared.shape == shape) {
            return Ok(());
        }
        // The old buffers go before the new ones come.
        self.prepared = None;
        let Self { gpu, cloud, sensors, depth_noise, frame, passes, .. } = self;
        let Passes { project, search, past, fit, orient, adapt, splat, shade } = passes;
        if sensors.is_some() && orient.is_none() {
            *orient = Some(OrientPasses::new(gpu)?);
        }
        if search.as_ref().is_none_or(|(of, _)| *of != shape.search) {
            let Reconstruction { engine, k, .. } = settings.reconstruction;
            *search = Some((shape.search, compile(gpu, engine, k)?));
        }
        if shape.adaptive && adapt.is_none() {
            *adapt = Some(AdaptPasses::new(gpu)?);
        }
        let adapt = adapt.as_ref().filter(|_| shape.adaptive);
        if splat.as_ref().is_none_or(|(channels, _)| *channels != shape.channels) {
            *splat = Some((shape.channels, SplatPasses::new(gpu, shape.channels, &linear_steps())?));
        }
        let (Some((_, search)), Some((_, splat))) = (search, splat) else { return Ok(()) };
        let screen = ScreenBuffers::new(gpu, size, halves, cloud.capacity(), cloud.words())?;
        let neighborhoods = neighborhood_buffer(gpu, screen.capacity)?;
        let past_radii = past_buffer(gpu, shape.coherent.then_some(size))?;
        let surfels = surfel_buffer(gpu, screen.capacity)?;
        let adapt = match adapt {
            Some(passes) => Some((passes, AdaptBuffers::new(gpu, size, depth_noise)?)),
            None => None,
        };
        let splats = SplatBuffers::new(gpu, screen.capacity, size)?;
        let layers = LayerBuffers::new(gpu, size, shape.channels)?;
        let picture = ShadeBuffers::new(gpu, size, shape.keep_linear)?;
        let (steps, convergence) = gpu.checked(|| {
            let mut steps = project.steps(gpu, frame, cloud, &screen);
            if let Some((passes, buffers)) = &adapt {
                steps.extend(passes.steps_cells(gpu, frame, &screen, buffers));
            }
            let buffers =
                SearchBuffers { frame, cloud, screen: &screen, neighborhoods: &neighborhoods, past: &past_radii };
            let EngineSteps { rounds, convergence } = search.steps(gpu, buffers)?;
            for (round, search) in [Round::Active, Round::Recovered].into_iter().zip(rounds) {
                if round == Round::Recovered {
                    steps.extend(splat.steps_recover(gpu, frame, &screen, &splats));
                }
                steps.extend(search);
                steps.extend(fit.steps(gpu, frame, &screen, &neighborhoods, &surfels, round));
                if let Some((passes, buffers)) = &adapt {
                    steps.extend(passes.steps(gpu, frame, &screen, &surfels, buffers, round));
                }
                if let (Some(orient), Some((sensors, _))) = (&*orient, &*sensors) {
                    steps.push(orient.step(gpu, frame, &screen, sensors, &surfels, round));
                }
                if shape.smooth {
                    steps.push(splat.step_over_time(gpu, frame, &screen, &surfels, &layers, round));
                }
                steps.extend(splat.steps_visibility(gpu, frame, &screen, &surfels, &splats, round));
            }
            if shape.coherent {
                steps.extend(past.steps(gpu, frame, &screen, &neighborhoods, &past_radii));
            }
            let refine = shape.depth_refinement;
            steps.extend(splat.steps_layers(gpu, frame, &screen, &surfels, &splats, &layers, refine));
            steps.extend(shade.steps(gpu, frame, &layers, &screen.counters, &picture, &settings.shading)?);
            Ok::<_, Error>((steps, convergence))
        })??;
        self.prepared = Some(Prepared { shape, seen: None, screen, surfels, layers, picture, convergence, steps });
        Ok(())
    }
}

impl Prepared {
    /// Tells the passes what the next frame is to be.
    fn tell(&mut self, gpu: &Gpu, frame: &wgpu::Buffer, now: Seen, settings: &Settings, shading: &ShadeUniform) {
        let Settings { reconstruction, .. } = settings;
        let rules = SearchRules {
            k: reconstruction.k,
            outlier_expansions: reconstruction.outlier_expansions,
            gap_factor: reconstruction.gap_factor,
        };
        let told = FrameUniform {
            halves: self.shape.halves.into(),
            grid_culling: reconstruction.grid_culling.into(),
            adaptive: reconstruction.adaptive.into(),
            longest: reconstruction.longest(),
            keep_outliers: reconstruction.outlier_expansions.is_none().into(),
            splat_scale: reconstruction.splat_scale,
            smoothing: reconstruction.smoothing(),
            outlier_growth: rules.outlier_radius(1.0),
            gap_growth: rules.gap_factor.map_or(f32::INFINITY, f32::sqrt),
            first_radius: match reconstruction.engine {
                SearchEngine::KdTree { first_radius } => first_radius,
                _ => 0.0,
            },
            ..FrameUniform::new(&now.view, reconstruction.k)
        };
        // Steps that are made anew leave nothing to look back at, and those of another k are.
        let past = self.seen.take().filter(|_| self.shape.coherent || self.shape.smooth);
        let told = past.map_or(told, |past| told.after(&Reprojection::new(&now, &past)));
        gpu.queue.write_buffer(frame, 0, bytemuck::bytes_of(&told));
        self.picture.write(gpu, shading, &settings.shading);
    }
}

/// What became of the points, by the device's counters.
fn counts(cloud: &PointCloud, counters: &[u32]) -> Counts {
    let count = |counter: Counter| counters[counter as usize] as usize;
    let [not_finite, behind, outside] = [Counter::NotFinite, Counter::Behind, Counter::Outside].map(count);
    Counts {
        points: cloud.len(),
        dropped: not_finite + behind + outside,
        not_finite,
        behind,
        outside,
        visible: count(Counter::Visible),
        active: count(Counter::Active),
        passive: count(Counter::Passive),
        recovered: count(Counter::Recovered),
        outliers: count(Counter::Outliers),
        clamped: count(Counter::Clamped),
        bounded: count(Counter::Bounded),
        covered: count(Counter::Covered),
        value_range: None,
    }
}

#[cfg(test)]
mod tests;
