//! Frames on the CPU.

use std::time::Instant;

use rayon::prelude::*;

use super::attributes::SplatAttributes;
use super::checks::check;
use super::exposure::Exposure;
use super::frame::Stage;
use super::rules::{Mode, Rules};
use super::surfels::point_surfels;
use super::upward::Upward;
use super::{Counts, Frame, PointSurfel, Reconstruction, Settings, Timings};
use crate::Error;
use crate::adapt::{Adapter, DepthNoise, Noise};
use crate::camera::{Camera, View};
use crate::cancel::Cancel;
use crate::fit::orient::Sensors;
use crate::fit::{GivenPlanes, Surfels, fit, place};
use crate::points::Points;
use crate::project::{Projector, Round, ScreenPoints};
use crate::search::past::Past;
use crate::search::{Neighborhoods, SearchCounts, SearchEngine, screen_grid};
use crate::shade::over_time::LastPicture;
use crate::shade::{Image, Scene, linear_steps, shade};
use crate::splat::{Attributes, OverTime, PointColors, Splatter};

/// Renders on the CPU, in the current rayon thread pool. Keeps its buffers from frame to frame.
#[derive(Debug, Default)]
pub(super) struct CpuRenderer {
    projector: Projector,
    past: Past,
    neighborhoods: Neighborhoods,
    surfels: Surfels,
    adapter: Adapter,
    /// Identity of the points that `sensors` and `depth_noise` belong to.
    identity: Option<u64>,
    /// `None` until surfels of the cloud are oriented.
    sensors: Option<Sensors>,
    /// Noise of the cloud's depth cameras; `None` until a frame of the cloud is adapted.
    depth_noise: Option<DepthNoise>,
    upward: Upward,
    exposure: Exposure,
    /// Passive points that the first round left visible.
    recovered: Vec<u32>,
    splatter: Splatter,
    image: Image,
    /// View of the last frame; `None` if there is none or it was cancelled.
    view: Option<View>,
    over_time: OverTime<Reconstruction>,
    last_picture: LastPicture<Settings>,
}

/// Checks that the engine runs on the CPU.
///
/// # Errors
/// [`Error::Device`] if the engine runs on a GPU only.
pub(super) fn check_engine(engine: SearchEngine) -> Result<(), Error> {
    let engine = match engine {
        SearchEngine::ScreenGrid => return Ok(()),
        SearchEngine::SplatCommunication | SearchEngine::SplatCommunicationRaster => "the splat-communication search",
        SearchEngine::KdTree { .. } => "the kd-tree search of [ZHWG08]",
    };
    Err(Error::Device(format!("{engine} runs on a GPU only; ask for the GPU backend or the screen-grid engine")))
}

impl CpuRenderer {
    /// See [`Renderer::surfels`](super::Renderer::surfels).
    pub(super) fn surfels(&self) -> Vec<PointSurfel> {
        self.view.as_ref().map_or_else(Vec::new, |view| point_surfels(&self.surfels, view))
    }

    /// See [`Renderer::render_while`](super::Renderer::render_while). The planes in `given` replace search and fit. The
    /// points come with the length of their unit in world units.
    pub(super) fn render(
        &mut self,
        (points, unit): (Points<'_>, f64),
        camera: &Camera,
        size: [u32; 2],
        settings: &Settings,
        given: Option<GivenPlanes<'_>>,
        go_on: &(dyn Fn() -> bool + Sync),
    ) -> Result<Frame<'_>, Error> {
        let picture = check(points, camera, size, settings)?;
        let mode = match given {
            Some(_) => Mode::Given,
            None => {
                check_engine(settings.reconstruction.engine)?;
                Mode::of(&settings.reconstruction, points, &picture)
            }
        };
        let rules = Rules::new(&settings.reconstruction, mode, size, |_, _| true);
        let wanted = SplatAttributes::new(points, settings)?;
        let (colors, linear) = (wanted.colors(points), linear_steps());
        let attributes = Attributes {
            color: colors.as_deref().map(|srgb| PointColors { srgb, linear: &linear }),
            scalar: wanted.scalar(points),
            measures: wanted.measures,
            backs: wanted.backs,
        };
        let cancel = Cancel::new(go_on);
        let mut frame = CpuFrame {
            renderer: self,
            points,
            settings,
            rules: &rules,
            given,
            attributes,
            cancel: &cancel,
            unit,
            picture,
            view: picture.with_margin(rules.margin_px),
            search_counts: SearchCounts::default(),
            covered: 0,
            value_range: None,
        };
        let begin = Instant::now();
        let mut timings = Timings::default();
        frame.begin();
        timings.splat = milliseconds_since(begin);
        for stage in Stage::list(&rules) {
            let start = Instant::now();
            frame.run(stage);
            *stage.time(&mut timings) += milliseconds_since(start);
            cancel.check()?;
        }
        timings.frame = milliseconds_since(begin);
        let counts = frame.end();
        Ok(Frame { image: &self.image, layers: self.splatter.last(), counts, timings, passes: &[] })
    }
}

/// A frame in progress.
struct CpuFrame<'a> {
    /// The renderer, whose buffers the stages fill.
    renderer: &'a mut CpuRenderer,
    points: Points<'a>,
    settings: &'a Settings,
    rules: &'a Rules,
    given: Option<GivenPlanes<'a>>,
    attributes: Attributes<'a>,
    cancel: &'a Cancel<'a>,
    /// World units per unit of the points.
    unit: f64,
    /// View of the picture, without the margin.
    picture: View,
    /// View of the screen.
    view: View,
    search_counts: SearchCounts,
    /// Pixels that show a surface.
    covered: usize,
    value_range: Option<[f64; 2]>,
}

impl CpuFrame<'_> {
    /// Takes leave of the last frame. From here on, only cancelling stops the frame; then there are no surfels.
    fn begin(&mut self) {
        let [now, picture] = [self.view, self.picture].map(|view| self.points.placed(view));
        let Self { renderer, settings, rules, .. } = self;
        let identity = self.points.identity();
        renderer.view = None;
        if renderer.identity.replace(identity) != Some(identity) {
            renderer.sensors = None;
            renderer.depth_noise = None;
        }
        renderer.surfels.clear();
        renderer.splatter.begin(&now.view);
        if rules.coherent {
            renderer.past.begin(now, rules.project.k);
        } else {
            renderer.past.forget();
        }
        if let Some(averaged) = rules.averaged {
            renderer.over_time.begin(now, identity, &settings.reconstruction, averaged);
            renderer.last_picture.begin(picture, identity, settings);
        } else {
            renderer.over_time.forget();
            renderer.last_picture.forget();
        }
    }

    fn run(&mut self, stage: Stage) {
        match stage {
            Stage::Project => self.project(),
            Stage::FillCells => self.fill_cells(),
            Stage::Search(round) => self.search(round),
            Stage::Fit(round) => self.fit(round),
            Stage::Adapt(round) => self.adapt(round),
            Stage::Orient(round) => self.orient(round),
            Stage::Average(round) => self.average(round),
            Stage::Draw(round) => self.draw(round),
            Stage::Recover => self.recover(),
            Stage::Keep => self.keep(),
            Stage::Layers => self.layers(),
            Stage::Shade => self.shade(),
        }
    }

    fn project(&mut self) {
        self.renderer.projector.project(self.points, &self.view, &self.rules.project, self.cancel);
    }

    fn fill_cells(&mut self) {
        let CpuRenderer { projector, adapter, depth_noise, .. } = &mut *self.renderer;
        if depth_noise.is_none() {
            let found = DepthNoise::new(self.points.scene(), self.cancel);
            *depth_noise = (!self.cancel.is_given_up()).then_some(found);
        }
        adapter.begin(projector.screen(), &self.view, self.rules.project.k, self.cancel);
    }

    fn search(&mut self, round: Round) {
        let CpuRenderer { projector, past, neighborhoods, recovered, .. } = &mut *self.renderer;
        let screen = projector.screen();
        let queries = queries(screen, recovered, round);
        if let Some(rules) = &self.rules.search {
            screen_grid::search(screen, queries, &self.view, rules, past, neighborhoods, self.cancel);
            self.search_counts = self.search_counts + neighborhoods.counts;
            past.keep(screen, queries, neighborhoods);
        }
    }

    fn fit(&mut self, round: Round) {
        let CpuRenderer { projector, neighborhoods, recovered, surfels, .. } = &mut *self.renderer;
        let screen = projector.screen();
        let queries = queries(screen, recovered, round);
        match &self.given {
            Some(planes) => place(screen, queries, planes, &self.view, &self.rules.fit, surfels),
            None => fit(screen, queries, neighborhoods, &self.view, &self.rules.fit, surfels, self.cancel),
        }
    }

    fn adapt(&mut self, round: Round) {
        let CpuRenderer { projector, adapter, depth_noise, surfels, .. } = &mut *self.renderer;
        let screen = projector.screen();
        if let (Some(rules), Some(known)) = (&self.rules.adapt, depth_noise) {
            let surfels = &mut surfels[first(screen, round)..];
            adapter.adapt(surfels, &screen.density, &self.view, rules, known, self.cancel);
        }
    }

    fn orient(&mut self, round: Round) {
        let CpuRenderer { projector, sensors, surfels, .. } = &mut *self.renderer;
        let sensors = sensors.get_or_insert_with(|| Sensors::new(self.points.scene()));
        sensors.orient(&mut surfels[first(projector.screen(), round)..], &self.view, self.cancel);
    }

    fn average(&mut self, round: Round) {
        let CpuRenderer { projector, over_time, splatter, surfels, .. } = &mut *self.renderer;
        let screen = projector.screen();
        over_time.smooth(&mut surfels[first(screen, round)..], screen, splatter.last(), &self.view, self.cancel);
    }

    fn draw(&mut self, round: Round) {
        let CpuRenderer { projector, splatter, surfels, .. } = &mut *self.renderer;
        splatter.add(surfels, first(projector.screen(), round), &self.view, self.cancel);
    }

    fn recover(&mut self) {
        let CpuRenderer { projector, splatter, recovered, .. } = &mut *self.renderer;
        let (screen, view, k) = (projector.screen(), &self.view, self.rules.project.k);
        let is_recovered = |&index: &u32| {
            let point = &screen.points[index as usize];
            let radius_px = screen.density.initial_radius_px(point, k);
            screen.density.matters(point, k, view)
                && !splatter.hides(point.pixel_xy(), point.position_view[2], radius_px, view)
        };
        recovered.clear();
        recovered.par_extend(screen.passive.par_iter().copied().filter(is_recovered));
    }

    /// Keeps surfels for the next frame. The k-radii are kept as each round's search ends.
    fn keep(&mut self) {
        let CpuRenderer { projector, over_time, surfels, .. } = &mut *self.renderer;
        if self.rules.averaged.is_some() {
            over_time.keep(surfels, projector.screen(), &self.view, self.cancel);
        }
    }

    fn layers(&mut self) {
        let CpuRenderer { projector, adapter, splatter, surfels, .. } = &mut *self.renderer;
        let Self { rules, view, .. } = self;
        if rules.depth_refinement {
            splatter.refine(surfels, view, self.cancel);
            splatter.refine(surfels, view, self.cancel);
        }
        splatter.attributes(surfels, view, &self.attributes, self.cancel);
        self.covered = match &rules.trim {
            Some(trim) => {
                let noise = if rules.adapt.is_some() { adapter.noise() } else { Noise::NONE };
                splatter.trim(view, &projector.screen().sixteenths, noise, trim, self.cancel)
            }
            None => splatter.covered(),
        };
    }

    fn shade(&mut self) {
        let CpuRenderer { upward, exposure, splatter, image, last_picture, .. } = &mut *self.renderer;
        let Self { points, settings: Settings { shading, all_layers, .. }, .. } = self;
        let cloud = points.scene();
        let exposure = exposure.of(cloud, shading);
        let layers = splatter.last();
        let values = layers.scalar_about;
        let scene = Scene {
            view: &self.picture,
            up: upward.of(cloud, &shading.color),
            origin: cloud.origin(),
            unit: self.unit,
            exposure,
            values,
        };
        let mut following = self.rules.averaged.map(|_| last_picture.following(self.picture));
        let cancel = self.cancel;
        let mut average =
            following.as_mut().map(|following| |image: &mut Image| following.average(layers, image, cancel));
        let average = average.as_mut().map(|average| average as &mut dyn FnMut(&mut Image));
        self.value_range = shade(layers, &scene, shading, *all_layers, average, image, cancel);
    }

    /// Makes the frame the last one.
    fn end(self) -> Counts {
        let [now, picture] = [self.view, self.picture].map(|view| self.points.placed(view));
        let Self { renderer, points, settings, rules, search_counts, covered, value_range, .. } = self;
        renderer.view = Some(now.view);
        renderer.past.end();
        if rules.averaged.is_some() {
            renderer.over_time.end(now, points.identity(), settings.reconstruction.clone());
            renderer.last_picture.end(picture, points.identity(), settings.clone());
        }
        let screen = renderer.projector.screen();
        let dropped = screen.dropped;
        let passive = screen.passive.iter().filter(|&&index| !screen.points[index as usize].is_silent()).count();
        Counts {
            points: points.len(),
            dropped: dropped.not_finite + dropped.behind + dropped.outside,
            not_finite: dropped.not_finite,
            behind: dropped.behind,
            outside: dropped.outside,
            visible: screen.near_first,
            active: screen.near_first - passive,
            passive,
            recovered: renderer.recovered.len(),
            outliers: renderer.surfels.iter().filter(|surfel| surfel.is_dropped()).count(),
            clamped: search_counts.clamped,
            bounded: search_counts.bounded,
            covered,
            value_range,
        }
    }
}

/// The screen points of a round.
fn queries<'a>(screen: &'a ScreenPoints, recovered: &'a [u32], round: Round) -> &'a [u32] {
    match round {
        Round::Active => &screen.active,
        Round::Recovered => recovered,
    }
}

/// Index of the first surfel of a round; those of the active points come first.
fn first(screen: &ScreenPoints, round: Round) -> usize {
    match round {
        Round::Active => 0,
        Round::Recovered => screen.active.len(),
    }
}

fn milliseconds_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
