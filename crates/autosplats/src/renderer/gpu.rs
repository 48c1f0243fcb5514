//! Frames on the GPU: the steps of all stages, made when buffers change and replayed for each picture.

mod prepared;
#[cfg(test)]
mod tests;

use std::time::Instant;

use self::prepared::{Passes, Prepared, ResidentBuffers, Shape};
use super::attributes::{ColorSource, SplatAttributes};
use super::checks::{check, check_count};
use super::exposure::Exposure;
use super::rules::{Mode, Rules};
use super::surfels::point_surfels;
use super::texture::Destination;
use super::upward::Upward;
use super::{Counts, Frame, PointSurfel, Settings, Timings};
use crate::Error;
use crate::adapt::DepthNoise;
use crate::adapt::gpu::DepthNoiseBuffer;
use crate::camera::{Camera, View};
use crate::cancel::NEVER;
use crate::fit::Surfel;
use crate::fit::orient::Sensors;
use crate::fit::orient::gpu::{sensor_buffer, write_sensors};
use crate::gpu::{
    AdapterSummary, Clock, FrameUniform, Gpu, PassTime, Readback, Recorder, StageWork, stage_ms, stage_work,
};
use crate::points::Points;
use crate::project::gpu::{Counter, ScreenBuffers};
use crate::project::{DeviceCloud, PointValues, SlotTable, Uploader};
use crate::search::SearchEngine;
use crate::search::gpu::{check_engine, convergence};
use crate::shade::gpu::{ReadPicture, finish};
use crate::shade::{Image, Scene};
use crate::splat::{GBuffer, LayerBuffers};

/// Renders on a device.
#[derive(Debug)]
pub(super) struct GpuRenderer {
    gpu: Gpu,
    /// How frames in memory are timed. Frames in textures are not timed.
    clock: Clock,
    /// Whether each pass of a frame in memory is timed by itself.
    times_passes: bool,
    /// Whether others have turns on the device between the stages of a frame.
    takes_turns: bool,
    uploader: Uploader,
    cloud: DeviceCloud,
    /// Buffer of the sensor positions of the points, and its number of runs of points.
    sensors: Option<(wgpu::Buffer, usize)>,
    depth_noise: DepthNoiseBuffer,
    resident: Resident,
    /// Buffer of [`FrameUniform`].
    frame: wgpu::Buffer,
    passes: Passes,
    prepared: Option<Prepared>,
    upward: Upward,
    exposure: Exposure,
    /// View of the last frame.
    view: Option<View>,
    readback: Readback,
    image: Image,
    layers: GBuffer,
    times: Vec<PassTime>,
}

/// What is on the device, with the generation of the points that it is current with.
#[derive(Debug, Default)]
struct Resident {
    /// Identity of the points.
    points: Option<(u64, u64)>,
    values: Option<(ResidentValues, u64)>,
}

/// Identity of the points that values belong to, and which values these are.
type ResidentValues = (u64, Option<ColorSource>, Option<String>);

impl GpuRenderer {
    /// The device, with the passes that it has compiled.
    pub(super) fn device(&self) -> &Gpu {
        &self.gpu
    }

    /// Creates a renderer on `gpu`.
    ///
    /// # Errors
    /// [`Error::Device`] if the device lacks what every WebGPU device has, [`Error::DeviceMemory`].
    pub(super) fn new(gpu: Gpu) -> Result<Self, Error> {
        Ok(Self {
            clock: Clock::new(&gpu),
            times_passes: false,
            takes_turns: false,
            uploader: Uploader::default(),
            cloud: DeviceCloud::default(),
            sensors: None,
            depth_noise: DepthNoiseBuffer::new(&gpu)?,
            resident: Resident::default(),
            frame: gpu.uniform::<FrameUniform>("frame")?,
            passes: Passes::new(&gpu)?,
            prepared: None,
            upward: Upward::default(),
            exposure: Exposure::default(),
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

    /// See [`Renderer::time_passes`](super::Renderer::time_passes).
    pub(super) fn time_passes(&mut self, each: bool) {
        self.times_passes = each;
    }

    /// See [`Renderer::take_turns`](super::Renderer::take_turns).
    pub(super) fn take_turns(&mut self, take: bool) {
        self.takes_turns = take;
    }

    /// See [`Renderer::stage_work`](super::Renderer::stage_work).
    pub(super) fn stage_work(&self) -> Option<Vec<StageWork>> {
        self.prepared.as_ref().map(|prepared| stage_work(&prepared.steps))
    }

    /// Checks that the device can run the engine.
    ///
    /// # Errors
    /// [`Error::Device`] if it cannot.
    pub(super) fn check_engine(&self, engine: SearchEngine) -> Result<(), Error> {
        check_engine(&self.gpu, engine)
    }

    /// See [`Renderer::upload`](super::Renderer::upload).
    pub(super) fn upload(
        &mut self,
        points: Points<'_>,
        settings: &Settings,
        report: &dyn Fn(f32) -> bool,
    ) -> Result<(), Error> {
        check_count(points)?;
        let wanted = SplatAttributes::new(points, settings)?;
        self.gpu.clone().checked(|| self.make_resident(points, &wanted, report))?
    }

    /// Uploads what is not on the device yet. `report` receives the finished fraction.
    fn make_resident(
        &mut self,
        points: Points<'_>,
        wanted: &SplatAttributes,
        report: &dyn Fn(f32) -> bool,
    ) -> Result<(), Error> {
        self.gpu.check_lost()?;
        let (identity, generation) = (points.identity(), points.generation());
        let values = (identity, wanted.colors, wanted.scalar.clone());
        let has_points = self.resident.points.filter(|(known, _)| *known == identity).map(|(_, current)| current);
        let has_values =
            self.resident.values.as_ref().filter(|(known, _)| *known == values).map(|&(_, current)| current);
        if [has_points, has_values] == [Some(generation); 2] {
            return Ok(());
        }
        let colors = wanted.colors(points);
        let carried = PointValues { colors: colors.as_deref(), scalar: wanted.scalar(points) };
        if !self.cloud.fits(points.room()) || self.cloud.words() != carried.words() {
            // Steps keep the buffers that they bind: the steps go before new buffers come.
            self.prepared = None;
        }
        let part = if carried.words() == 0 { 1.0 } else { 0.5 };
        // Of a failed upload, what was there counts as resident only if it is still wanted.
        if has_points.is_none() {
            self.resident = Resident::default();
            self.cloud.resize(&self.gpu, points)?;
            let scene = points.scene();
            self.upload_sensors(&Sensors::new(scene))?;
            if self.depth_noise.write(&self.gpu, &DepthNoise::new(scene, &NEVER))? {
                self.prepared = None;
            }
        }
        let written = points.written_since(has_points);
        self.uploader.positions(&self.gpu, points.positions(), &written, &self.cloud, &|done| report(part * done))?;
        self.resident.points = Some((identity, generation));
        if has_values.is_none() {
            self.resident.values = None;
            self.cloud.resize_values(&self.gpu, carried.words())?;
        }
        let written = points.written_since(has_values);
        let report = |done| report(1.0 - part + part * done);
        self.uploader.values(&self.gpu, &carried, &written, &self.cloud, &report)?;
        self.resident.values = Some((values, generation));
        Ok(())
    }

    /// Uploads the sensor positions of the points.
    fn upload_sensors(&mut self, sensors: &Sensors) -> Result<(), Error> {
        let len = Some(sensors.len()).filter(|&len| len > 0);
        if self.sensors.as_ref().map(|(_, len)| *len) != len {
            // Steps keep the old buffer.
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
            readback.copy(gpu, recorder.encoder(), &[&prepared.screen.counters, &prepared.surfels])?;
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
            readback.copy(gpu, recorder.encoder(), &[buffer])?;
            recorder.finish();
            readback.read(gpu, |parts| convergence(&bytemuck::pod_collect_to_vec::<u8, u32>(parts[0])))
        })?
    }

    /// See [`Renderer::render_while`](super::Renderer::render_while).
    pub(super) fn render(
        &mut self,
        points: Points<'_>,
        camera: &Camera,
        destination: Destination<'_>,
        settings: &Settings,
        unit: f64,
        go_on: &(dyn Fn() -> bool + Sync),
    ) -> Result<Frame<'_>, Error> {
        let view = check(points, camera, destination.checked_size()?, settings)?;
        // `checked` turns every failure of the device into an error.
        self.gpu.clone().checked(move || self.frame(points, &view, destination, settings, unit, go_on))?
    }

    /// Renders after the checks.
    fn frame(
        &mut self,
        points: Points<'_>,
        view: &View,
        destination: Destination<'_>,
        settings: &Settings,
        unit: f64,
        go_on: &(dyn Fn() -> bool + Sync),
    ) -> Result<Frame<'_>, Error> {
        let wanted = SplatAttributes::new(points, settings)?;
        let started = Instant::now();
        self.make_resident(points, &wanted, &|_| go_on())?;
        let upload = started.elapsed().as_secs_f64() * 1e3;
        let rules = self.prepare(points, view, &wanted, settings)?;
        let screen = &view.with_margin(rules.margin_px);
        let Self {
            gpu,
            clock,
            times_passes,
            takes_turns,
            prepared,
            upward,
            exposure,
            view: last_view,
            readback,
            image,
            layers,
            times,
            frame,
            ..
        } = self;
        let prepared = prepared.as_mut().ok_or_else(|| Error::Device("no frame was prepared".into()))?;
        let scene = scene(points, view, &wanted, unit, settings, (upward, exposure));
        prepared.write_uniforms(gpu, frame, (screen, points, destination.format()), &rules, settings, &scene);

        let waited = Instant::now();
        let mut recorder = Recorder::new(gpu, clock).timing_each(*times_passes).taking_turns(*takes_turns);
        prepared.steps.iter().for_each(|step| recorder.run(step));
        let mut wants = vec![&prepared.screen.counters];
        match destination {
            Destination::Memory(_) => wants.push(&prepared.picture.image),
            Destination::Texture(texture) => prepared.picture.copy_to_texture(recorder.encoder(), texture)?,
        }
        if settings.all_layers {
            let LayerBuffers { surface, cover, extras, .. } = &prepared.layers;
            let linear = matches!(destination, Destination::Memory(_)).then_some(&prepared.picture.linear);
            wants.extend(linear.into_iter().chain([surface, cover, extras]));
        }
        readback.copy(gpu, recorder.encoder(), &wants)?;
        *times = recorder.finish();
        // The submitted frame replaces the surfels of the last one.
        *last_view = Some(*screen);
        prepared.seen = Some((points.placed(*screen), points.identity(), (settings.clone(), destination.format())));
        let (counters, value_range) = readback.read(gpu, |parts| {
            let counters: Vec<u32> = bytemuck::pod_collect_to_vec(parts[0]);
            let range = [Counter::RangeLow, Counter::RangeHigh].map(|end| counters[end as usize]);
            let (picture, read_layers) = parts[1..].split_at(parts.len() - 1 - if settings.all_layers { 3 } else { 0 });
            let read = ReadPicture {
                size: view.picture_size(),
                image: picture.first().copied().unwrap_or_default(),
                linear: picture.get(1).copied().unwrap_or_default(),
                range,
            };
            let value_range = finish(&read, &scene, &settings.shading, image);
            *layers = match read_layers {
                [surface, cover, extras] => prepared.layers.to_host(screen.margin, surface, cover, extras),
                _ => GBuffer::default(),
            };
            layers.scalar_about = scene.values;
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
        Ok(Frame { image, layers, counts: Counts { value_range, ..counts(points, &counters) }, timings, passes: times })
    }

    /// See [`Renderer::render_to_texture`](super::Renderer::render_to_texture).
    pub(super) fn render_to_texture(
        &mut self,
        points: Points<'_>,
        camera: &Camera,
        texture: &wgpu::Texture,
        settings: &Settings,
        unit: f64,
    ) -> Result<(), Error> {
        let view = check(points, camera, Destination::Texture(texture).checked_size()?, settings)?;
        self.gpu.clone().checked(|| self.frame_in_texture(points, &view, texture, settings, unit))?
    }

    /// Renders into a texture after the checks.
    fn frame_in_texture(
        &mut self,
        points: Points<'_>,
        view: &View,
        texture: &wgpu::Texture,
        settings: &Settings,
        unit: f64,
    ) -> Result<(), Error> {
        let wanted = SplatAttributes::new(points, settings)?;
        self.make_resident(points, &wanted, &|_| true)?;
        let rules = self.prepare(points, view, &wanted, settings)?;
        let screen = view.with_margin(rules.margin_px);
        let Self { gpu, prepared, upward, exposure, view: last_view, frame, .. } = self;
        let prepared = prepared.as_mut().ok_or_else(|| Error::Device("no frame was prepared".into()))?;
        let scene = scene(points, view, &wanted, unit, settings, (upward, exposure));
        let format = texture.format();
        prepared.write_uniforms(gpu, frame, (&screen, points, Some(format)), &rules, settings, &scene);
        let mut recorder = Recorder::new(gpu, &Clock::Off);
        prepared.steps.iter().for_each(|step| recorder.run(step));
        prepared.picture.copy_to_texture(recorder.encoder(), texture)?;
        recorder.finish();
        *last_view = Some(screen);
        prepared.seen = Some((points.placed(screen), points.identity(), (settings.clone(), Some(format))));
        gpu.check_lost()
    }

    /// Resolves the rules of a frame, and makes its buffers and steps unless those of the last frame fit.
    fn prepare(
        &mut self,
        points: Points<'_>,
        view: &View,
        wanted: &SplatAttributes,
        settings: &Settings,
    ) -> Result<Rules, Error> {
        if matches!((points, settings.reconstruction.engine), (Points::Pool(_), SearchEngine::KdTree { .. })) {
            return Err(Error::Device(
                "the kd-tree search of [ZHWG08] takes clouds that are read whole; use the screen-grid engine".into(),
            ));
        }
        self.cloud.write_slots(&self.gpu, &SlotTable::new(points, view));
        let size = view.picture_size();
        // A surfel is the largest record per screen point.
        let has_room = |margin: u32, halves| {
            let screen = size.map(|side| side + 2 * margin);
            ScreenBuffers::has_room::<Surfel>(&self.gpu, screen, halves, self.cloud.capacity())
                && LayerBuffers::has_room(&self.gpu, screen, wanted.channels())
        };
        let mode = Mode::of(&settings.reconstruction, points, view);
        let rules = Rules::new(&settings.reconstruction, mode, size, has_room);
        let sensors = self.sensors.as_ref().map(|(_, len)| *len);
        let shape = Shape::new(size, &rules, sensors, wanted, settings);
        if self.prepared.as_ref().is_none_or(|prepared| !prepared.is_for(&shape)) {
            // The old buffers go before the new ones come.
            self.prepared = None;
            let Self { gpu, cloud, sensors, depth_noise, frame, passes, .. } = self;
            let resident =
                ResidentBuffers { cloud, sensors: sensors.as_ref().map(|(buffer, _)| buffer), depth_noise, frame };
            self.prepared = Some(Prepared::new(gpu, shape, passes, resident, &rules, settings)?);
        }
        Ok(rules)
    }
}

/// What shading needs to know of a frame.
fn scene<'a>(
    points: Points<'_>,
    view: &'a View,
    wanted: &SplatAttributes,
    unit: f64,
    settings: &Settings,
    (upward, exposure): (&mut Upward, &mut Exposure),
) -> Scene<'a> {
    let cloud = points.scene();
    Scene {
        view,
        up: upward.of(cloud, &settings.shading.color),
        origin: cloud.origin(),
        unit,
        exposure: exposure.of(cloud, &settings.shading),
        values: wanted.scalar(points).map(|values| values.about()).unwrap_or_default(),
    }
}

/// Counts of a frame, from the device's counters.
fn counts(points: Points<'_>, counters: &[u32]) -> Counts {
    let count = |counter: Counter| counters[counter as usize] as usize;
    let [not_finite, behind, outside] = [Counter::NotFinite, Counter::Behind, Counter::Outside].map(count);
    let visible = count(Counter::NearFirst);
    let passive = count(Counter::Passive) - count(Counter::SilentPoints);
    Counts {
        points: points.len(),
        dropped: not_finite + behind + outside,
        not_finite,
        behind,
        outside,
        visible,
        active: visible - passive,
        passive,
        recovered: count(Counter::Recovered),
        outliers: count(Counter::Outliers),
        clamped: count(Counter::Clamped),
        bounded: count(Counter::Bounded),
        covered: count(Counter::Covered),
        value_range: None,
    }
}
