//! Frames on the CPU.

use std::borrow::Cow;
use std::time::Instant;

use autosplats_cloud::PointCloud;
use rayon::prelude::*;

use super::attributes::SplatAttributes;
use super::exposure::Exposure;
use super::surfels::point_surfels;
use super::upward::Upward;
use super::{Counts, Frame, PointSurfel, Reconstruction, Settings, Timings, check};
use crate::Error;
use crate::adapt::{AdaptRules, Adapter, DepthNoise, Noise};
use crate::camera::{Camera, PlacedView, View};
use crate::fit::orient::Sensors;
use crate::fit::{FitRules, GivenPlanes, Surfels, fit, place};
use crate::project::{ProjectRules, Projector, ScreenPoints};
use crate::search::past::Past;
use crate::search::{Neighborhoods, SearchCounts, SearchEngine, SearchRules, screen_grid};
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
        let (settings, dot_px) = match given {
            Some(_) => (Cow::Borrowed(settings), 0.0),
            None => settings.for_cloud(cloud, size),
        };
        let settings = &*settings;
        let margin = if given.is_none() { settings.reconstruction.margin(size) } else { 0 };
        let view = picture.with_margin(margin);
        if given.is_none() {
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
        let settings_splat = &settings.reconstruction;
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

        let rules = ProjectRules {
            k: settings_splat.k,
            halves: settings_splat.halves(),
            grid_culling: settings_splat.grid_culling,
        };
        let screen = projector.project(cloud, &view, &rules);
        clock.lap(|timings| &mut timings.project)?;

        if settings_splat.adaptive && given.is_none() {
            depth_noise.get_or_insert_with(|| DepthNoise::new(cloud));
            adapter.begin(screen, &view, settings_splat.k);
            clock.lap(|timings| &mut timings.adapt)?;
        }
        let now = PlacedView { view, origin: cloud.origin() };
        if settings_splat.starts_from_past() && given.is_none() {
            past.begin(now, settings_splat.k);
        } else {
            past.forget();
        }
        clock.lap(|timings| &mut timings.search)?;
        surfels.clear();
        splatter.begin(&view);
        let nothing = DepthNoise::default();
        let depth_noise = depth_noise.as_ref().unwrap_or(&nothing);
        let smooths = settings_splat.smooths() && given.is_none();
        if smooths {
            over_time.begin(now, cloud.identity(), settings_splat, settings_splat.averaged());
        } else {
            over_time.forget();
            last_picture.forget();
        }
        let seen = PlacedView { view: picture, origin: cloud.origin() };
        let following = smooths.then(|| last_picture.begin(seen, cloud.identity(), settings));
        let reconstruct = Reconstruct { screen, view: &view, dot_px, settings, past, sensors, depth_noise, given };
        let mut buffers = Buffers { neighborhoods, surfels, adapter, over_time, splatter };
        let mut search_counts = reconstruct.run(&screen.active, &mut buffers, &mut clock)?;
        recovered.clear();
        let hidden = |index: u32| {
            let point = &screen.points[index as usize];
            let radius_px = screen.density.initial_radius_px(point, settings_splat.k);
            buffers.splatter.hides(point.pixel_xy(), point.position_view[2], radius_px, &view)
        };
        let matters = |index: u32| screen.density.matters(&screen.points[index as usize], settings_splat.k, &view);
        recovered.par_extend(screen.passive.par_iter().copied().filter(|&index| matters(index) && !hidden(index)));
        clock.lap(|timings| &mut timings.splat)?;
        if !recovered.is_empty() {
            search_counts = search_counts + reconstruct.run(recovered, &mut buffers, &mut clock)?;
        }

        let Buffers { surfels, adapter, over_time, splatter, .. } = buffers;
        if settings_splat.depth_refinement {
            splatter.refine(surfels, &view);
            splatter.refine(surfels, &view);
        }
        splatter.attributes(surfels, &view, &attributes);
        let adapts = settings_splat.adaptive && given.is_none();
        let noise = if adapts { adapter.noise() } else { Noise::NONE };
        let (layers, covered) = if settings_splat.trim {
            splatter.trim(&view, &screen.sixteenths, (noise, settings_splat.k_radius_per_radius()))
        } else {
            splatter.whole()
        };
        if smooths {
            over_time.end(now, cloud.identity(), settings_splat.clone(), surfels, screen);
        }
        clock.lap(|timings| &mut timings.splat)?;

        let exposure = exposure.of(cloud, &settings.shading);
        let scene = Scene { view: &picture, up: upward.of(cloud), origin: cloud.origin(), exposure };
        let value_range = shade(layers, &scene, &settings.shading, settings.all_layers, following, image);
        if smooths {
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
    /// Radius in pixels of the dots that all points are; 0 if they are drawn as a surface.
    dot_px: f32,
    settings: &'a Settings,
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
        let Self { screen, view, dot_px, settings, past, sensors, depth_noise, given } = *self;
        let settings = &settings.reconstruction;
        let first = surfels.len();
        if let Some(planes) = given {
            place(screen, queries, &planes, view, settings.k, settings.splat_scale, surfels);
            clock.lap(|timings| &mut timings.fit)?;
            splatter.add(surfels, first, view);
            clock.lap(|timings| &mut timings.splat)?;
            return Ok(SearchCounts::default());
        }
        let rules = SearchRules {
            k: settings.k,
            outlier_expansions: settings.outlier_expansions,
            gap_factor: settings.gap_factor,
            adaptive: settings.adaptive,
        };
        match settings.engine {
            SearchEngine::ScreenGrid => screen_grid::search(screen, queries, view, &rules, past, neighborhoods),
            SearchEngine::SplatCommunication | SearchEngine::KdTree { .. } => {
                unreachable!("refused before the frame begins")
            }
        }
        past.keep(screen, queries, neighborhoods);
        clock.lap(|timings| &mut timings.search)?;

        let rules = FitRules {
            k: settings.k,
            splat_scale: settings.splat_scale,
            // The adapt stage depends on the shape of ellipses.
            longest: settings.longest(),
            adaptive: settings.adaptive,
            keep_outliers: settings.outlier_expansions.is_none(),
            dot_px,
        };
        fit(screen, queries, neighborhoods, view, &rules, surfels);
        clock.lap(|timings| &mut timings.fit)?;

        if settings.adaptive {
            let rules = AdaptRules { k: settings.k, longest: settings.longest(), keep_outliers: rules.keep_outliers };
            adapter.adapt(&mut surfels[first..], &screen.density, view, &rules, depth_noise);
            clock.lap(|timings| &mut timings.adapt)?;
        }
        sensors.orient(&mut surfels[first..], view);
        clock.lap(|timings| &mut timings.fit)?;

        if settings.smooths() {
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
