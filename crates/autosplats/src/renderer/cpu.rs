//! Frames on the CPU.

use std::time::Instant;

use autosplats_cloud::PointCloud;
use rayon::prelude::*;

use super::attributes::SplatAttributes;
use super::exposure::Exposure;
use super::rules::{Mode, Rules};
use super::surfels::point_surfels;
use super::upward::Upward;
use super::{Counts, Frame, PointSurfel, Reconstruction, Settings, Timings, check};
use crate::Error;
use crate::adapt::{Adapter, DepthNoise, Noise};
use crate::camera::{Camera, PlacedView, View};
use crate::fit::orient::Sensors;
use crate::fit::{GivenPlanes, Surfels, fit, place};
use crate::project::{Projector, ScreenPoints};
use crate::search::past::Past;
use crate::search::{Neighborhoods, SearchCounts, SearchEngine, screen_grid};
use crate::shade::over_time::LastPicture;
use crate::shade::{Image, Scene, linear_steps, shade};
use crate::splat::{Attributes, OverTime, PointColors, Splatter};

/// Renders on the CPU, in the current rayon thread pool.
#[derive(Debug)]
pub(super) struct CpuRenderer {
    projector: Projector,
    past: Past,
    neighborhoods: Neighborhoods,
    surfels: Surfels,
    adapter: Adapter,
    /// Identity of the cloud that `sensors` and `depth_noise` belong to.
    cloud_identity: Option<u64>,
    sensors: Sensors,
    upward: Upward,
    exposure: Exposure,
    /// Noise of the cloud's depth cameras; `None` until a frame of the cloud is adapted.
    depth_noise: Option<DepthNoise>,
    /// Passive points that the first pass left visible.
    recovered: Vec<u32>,
    splatter: Splatter,
    image: Image,
    linear: [f32; 256],
    /// View of the last frame; `None` if there is none or it was cancelled.
    view: Option<View>,
    over_time: OverTime<Reconstruction>,
    last_picture: LastPicture<Settings>,
}

impl Default for CpuRenderer {
    fn default() -> Self {
        Self {
            projector: Projector::default(),
            past: Past::default(),
            neighborhoods: Neighborhoods::default(),
            surfels: Surfels::default(),
            adapter: Adapter::default(),
            cloud_identity: None,
            sensors: Sensors::default(),
            upward: Upward::default(),
            exposure: Exposure::default(),
            depth_noise: None,
            recovered: Vec::new(),
            splatter: Splatter::default(),
            image: Image::default(),
            linear: linear_steps(),
            view: None,
            over_time: OverTime::default(),
            last_picture: LastPicture::default(),
        }
    }
}

/// Checks that the engine runs on the CPU.
///
/// # Errors
/// [`Error::Device`] if the engine runs on a GPU only.
pub(super) fn check_engine(engine: SearchEngine) -> Result<(), Error> {
    let engine = match engine {
        SearchEngine::ScreenGrid => return Ok(()),
        SearchEngine::SplatCommunication => "the splat-communication search",
        SearchEngine::KdTree { .. } => "the kd-tree search of [ZHWG08]",
    };
    Err(Error::Device(format!("{engine} runs on a GPU only; ask for the GPU backend or the screen-grid engine")))
}

impl CpuRenderer {
    /// See [`Renderer::surfels`](super::Renderer::surfels).
    pub(super) fn surfels(&self) -> Vec<PointSurfel> {
        self.view.as_ref().map_or_else(Vec::new, |view| point_surfels(&self.surfels, view))
    }

    /// See [`Renderer::render_while`](super::Renderer::render_while). The planes in `given` replace search and fit.
    pub(super) fn render(
        &mut self,
        cloud: &PointCloud,
        camera: &Camera,
        size: [u32; 2],
        settings: &Settings,
        given: Option<GivenPlanes<'_>>,
        go_on: &dyn Fn() -> bool,
    ) -> Result<Frame<'_>, Error> {
        let picture = check(cloud, camera, size, settings)?;
        let mode = match given {
            Some(_) => Mode::Given,
            None => Mode::of(&settings.reconstruction, cloud, size),
        };
        let rules = Rules::new(&settings.reconstruction, mode, size, |_, _| true);
        let view = picture.with_margin(rules.margin_px);
        if rules.search.is_some() {
            check_engine(settings.reconstruction.engine)?;
        }
        let wanted = SplatAttributes::new(cloud, settings)?;
        // From here on, only cancelling stops the frame; then there are no surfels.
        self.view = None;
        let colors = wanted.colors(cloud);
        let attributes = Attributes {
            color: colors.as_deref().map(|srgb| PointColors { srgb, linear: &self.linear }),
            scalar: wanted.scalar(cloud),
            measures: wanted.measures,
            backs: wanted.backs,
        };
        let Self {
            projector,
            past,
            neighborhoods,
            surfels,
            adapter,
            cloud_identity,
            sensors,
            upward,
            exposure,
            depth_noise,
            recovered,
            splatter,
            image,
            view: last_view,
            over_time,
            last_picture,
            ..
        } = self;
        let mut clock = Clock::start(go_on);
        if cloud_identity.replace(cloud.identity()) != Some(cloud.identity()) {
            *sensors = Sensors::new(cloud);
            *depth_noise = None;
            clock.lap(|timings| &mut timings.fit)?;
        }

        let screen = projector.project(cloud, &view, &rules.project);
        let k = rules.project.k;
        clock.lap(|timings| &mut timings.project)?;

        if rules.adapt.is_some() {
            depth_noise.get_or_insert_with(|| DepthNoise::new(cloud));
            adapter.begin(screen, &view, k);
            clock.lap(|timings| &mut timings.adapt)?;
        }
        let now = PlacedView { view, origin: cloud.origin() };
        if rules.coherent {
            past.begin(now, k);
        } else {
            past.forget();
        }
        clock.lap(|timings| &mut timings.search)?;
        surfels.clear();
        splatter.begin(&view);
        let nothing = DepthNoise::default();
        let depth_noise = depth_noise.as_ref().unwrap_or(&nothing);
        if let Some(averaged) = rules.averaged {
            over_time.begin(now, cloud.identity(), &settings.reconstruction, averaged);
        } else {
            over_time.forget();
            last_picture.forget();
        }
        let seen = PlacedView { view: picture, origin: cloud.origin() };
        let following = rules.averaged.map(|_| last_picture.begin(seen, cloud.identity(), settings));
        let reconstruct = Reconstruct { screen, view: &view, rules: &rules, past, sensors, depth_noise, given };
        let mut buffers = Buffers { neighborhoods, surfels, adapter, over_time, splatter };
        let mut search_counts = reconstruct.run(&screen.active, &mut buffers, &mut clock)?;
        recovered.clear();
        let hidden = |index: u32| {
            let point = &screen.points[index as usize];
            let radius_px = screen.density.initial_radius_px(point, k);
            buffers.splatter.hides(point.pixel_xy(), point.position_view[2], radius_px, &view)
        };
        let matters = |index: u32| screen.density.matters(&screen.points[index as usize], k, &view);
        recovered.par_extend(screen.passive.par_iter().copied().filter(|&index| matters(index) && !hidden(index)));
        clock.lap(|timings| &mut timings.splat)?;
        if !recovered.is_empty() {
            search_counts = search_counts + reconstruct.run(recovered, &mut buffers, &mut clock)?;
        }

        let Buffers { surfels, adapter, over_time, splatter, .. } = buffers;
        if rules.depth_refinement {
            splatter.refine(surfels, &view);
            splatter.refine(surfels, &view);
        }
        splatter.attributes(surfels, &view, &attributes);
        let noise = if rules.adapt.is_some() { adapter.noise() } else { Noise::NONE };
        let (layers, covered) = match &rules.trim {
            Some(rules) => splatter.trim(&view, &screen.sixteenths, noise, rules),
            None => splatter.whole(),
        };
        if rules.averaged.is_some() {
            over_time.end(now, cloud.identity(), settings.reconstruction.clone(), surfels, screen);
        }
        clock.lap(|timings| &mut timings.splat)?;

        let exposure = exposure.of(cloud, &settings.shading);
        let scene = Scene { view: &picture, up: upward.of(cloud), origin: cloud.origin(), exposure };
        let value_range = shade(layers, &scene, &settings.shading, settings.all_layers, following, image);
        if rules.averaged.is_some() {
            last_picture.end(seen, cloud.identity(), settings.clone());
        }
        clock.lap(|timings| &mut timings.shade)?;
        *last_view = Some(view);
        past.end();

        let dropped = screen.dropped;
        let counts = Counts {
            points: cloud.len(),
            dropped: dropped.not_finite + dropped.behind + dropped.outside,
            not_finite: dropped.not_finite,
            behind: dropped.behind,
            outside: dropped.outside,
            visible: screen.points.len(),
            active: screen.active.len(),
            passive: screen.passive.len(),
            recovered: recovered.len(),
            outliers: surfels.iter().filter(|surfel| surfel.radius == 0.0).count(),
            clamped: search_counts.clamped,
            bounded: search_counts.bounded,
            covered,
            value_range,
        };
        Ok(Frame { image, layers, counts, timings: clock.finish(), passes: &[] })
    }
}

/// Buffers of the stages, kept from frame to frame.
struct Buffers<'a> {
    neighborhoods: &'a mut Neighborhoods,
    surfels: &'a mut Surfels,
    adapter: &'a mut Adapter,
    over_time: &'a mut OverTime<Reconstruction>,
    splatter: &'a mut Splatter,
}

/// Reconstruction of a frame: from screen points to splats in the depth map.
struct Reconstruct<'a> {
    screen: &'a ScreenPoints,
    view: &'a View,
    rules: &'a Rules,
    past: &'a Past,
    sensors: &'a Sensors,
    depth_noise: &'a DepthNoise,
    given: Option<GivenPlanes<'a>>,
}

impl Reconstruct<'_> {
    /// Searches, fits, adapts and draws the depth of `queries`, and appends their surfels to `surfels`.
    fn run(
        &self,
        queries: &[u32],
        Buffers { neighborhoods, surfels, adapter, over_time, splatter }: &mut Buffers<'_>,
        clock: &mut Clock<'_>,
    ) -> Result<SearchCounts, Error> {
        let Self { screen, view, rules, past, sensors, depth_noise, given } = *self;
        let first = surfels.len();
        if let Some(planes) = given {
            place(screen, queries, &planes, view, &rules.fit, surfels);
            clock.lap(|timings| &mut timings.fit)?;
            splatter.add(surfels, first, view);
            clock.lap(|timings| &mut timings.splat)?;
            return Ok(SearchCounts::default());
        }
        if let Some(rules) = &rules.search {
            screen_grid::search(screen, queries, view, rules, past, neighborhoods);
        }
        past.keep(screen, queries, neighborhoods);
        clock.lap(|timings| &mut timings.search)?;

        fit(screen, queries, neighborhoods, view, &rules.fit, surfels);
        clock.lap(|timings| &mut timings.fit)?;

        if let Some(rules) = &rules.adapt {
            adapter.adapt(&mut surfels[first..], &screen.density, view, rules, depth_noise);
            clock.lap(|timings| &mut timings.adapt)?;
        }
        sensors.orient(&mut surfels[first..], view);
        clock.lap(|timings| &mut timings.fit)?;

        if rules.averaged.is_some() {
            over_time.smooth(&mut surfels[first..], screen, splatter.last(), view);
        }
        splatter.add(surfels, first, view);
        clock.lap(|timings| &mut timings.splat)?;
        Ok(neighborhoods.counts)
    }
}

/// Sums up the time of each stage, and asks whether to go on.
struct Clock<'a> {
    go_on: &'a dyn Fn() -> bool,
    begin: Instant,
    last: Instant,
    timings: Timings,
}

impl<'a> Clock<'a> {
    fn start(go_on: &'a dyn Fn() -> bool) -> Self {
        let now = Instant::now();
        Self { go_on, begin: now, last: now, timings: Timings::default() }
    }

    /// Adds the time since the last lap to a stage.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if `go_on` returns false.
    fn lap(&mut self, stage: impl Fn(&mut Timings) -> &mut f64) -> Result<(), Error> {
        let now = Instant::now();
        *stage(&mut self.timings) += (now - self.last).as_secs_f64() * 1e3;
        self.last = now;
        if (self.go_on)() { Ok(()) } else { Err(Error::Cancelled) }
    }

    fn finish(mut self) -> Timings {
        self.timings.frame = (self.last - self.begin).as_secs_f64() * 1e3;
        self.timings
    }
}
