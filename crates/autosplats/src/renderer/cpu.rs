//! The frame on the CPU.

use std::time::Instant;

use autosplats_cloud::PointCloud;

use super::{Counts, MAX_SIDE, Settings, Timings};
use crate::Error;
use crate::camera::{Camera, View, guess_axes, up};
use crate::fit::{FitRules, Surfels, fit};
use crate::project::{Projector, ScreenPoints};
use crate::search::{Neighborhoods, SearchEngine, SearchRules, screen_grid};
use crate::shade::{ColorMode, Image, Scene, class_colors, linear_steps, shade};
use crate::splat::{Attributes, GBuffer, PointColors, Splatter};

/// Turns clouds into pictures; keeps its buffers, so that a frame after the first allocates next to nothing.
#[derive(Debug)]
pub struct Renderer {
    projector: Projector,
    neighborhoods: Neighborhoods,
    surfels: Surfels,
    /// Passive points to be reconstructed after all.
    recovered: Vec<u32>,
    splatter: Splatter,
    image: Image,
    linear: [f32; 256],
}

/// One picture and what is known about it.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// The picture.
    pub image: &'a Image,
    /// The visible surface it was shaded from.
    pub layers: &'a GBuffer,
    /// What became of the points.
    pub counts: Counts,
    /// Time per stage.
    pub timings: Timings,
}

impl Default for Renderer {
    fn default() -> Self {
        Self::new()
    }
}

impl Renderer {
    /// A renderer that runs on the CPU, in the current rayon thread pool.
    pub fn new() -> Self {
        Self {
            projector: Projector::default(),
            neighborhoods: Neighborhoods::default(),
            surfels: Surfels::default(),
            recovered: Vec::new(),
            splatter: Splatter::default(),
            image: Image::default(),
            linear: linear_steps(),
        }
    }

    /// Renders `cloud` into a picture of `size` (width, height) pixels.
    ///
    /// # Errors
    /// [`Error::ImageSize`], [`Error::Setting`] and [`Error::Camera`] for what lies outside its range,
    /// [`Error::TooManyPoints`], [`Error::MissingAttribute`] if the colour mode needs one that the cloud lacks.
    pub fn render(
        &mut self,
        cloud: &PointCloud,
        camera: &Camera,
        size: [u32; 2],
        settings: &Settings,
    ) -> Result<Frame<'_>, Error> {
        let view = check(cloud, camera, size, settings)?;
        let class_colors = match settings.shading.color {
            ColorMode::Classification => Some(class_colors(&field(cloud, "Classification")?.values)),
            _ => None,
        };
        let attributes = attributes(cloud, settings, class_colors.as_deref(), &self.linear)?;
        let settings_splat = &settings.reconstruction;
        let Self { projector, neighborhoods, surfels, recovered, splatter, image, .. } = self;
        let mut clock = Clock::start();

        let screen = projector.project(cloud, &view, settings_splat.k, settings_splat.grid_culling);
        clock.lap(|timings| &mut timings.project);

        surfels.clear();
        splatter.begin(&view);
        let reconstruct = Reconstruct { screen, view: &view, settings };
        let mut search_counts = reconstruct.run(&screen.active, neighborhoods, surfels, splatter, &mut clock);
        recovered.clear();
        let hidden = |&index: &u32| {
            let point = &screen.points[index as usize];
            splatter.hides(point.pixel_xy(), point.position_view[2], &view)
        };
        recovered.extend(screen.passive.iter().filter(|index| !hidden(index)));
        clock.lap(|timings| &mut timings.splat);
        if !recovered.is_empty() {
            search_counts = search_counts + reconstruct.run(recovered, neighborhoods, surfels, splatter, &mut clock);
        }

        if settings_splat.depth_refinement {
            splatter.refine(surfels, &view);
            splatter.refine(surfels, &view);
        }
        splatter.attributes(surfels, &view, &attributes);
        let layers = splatter.trim(&view);
        clock.lap(|timings| &mut timings.splat);

        let scene = Scene { view: &view, up: up(guess_axes(cloud)), origin: cloud.origin() };
        shade(layers, &scene, &settings.shading, settings.all_layers, image);
        clock.lap(|timings| &mut timings.shade);

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
        };
        Ok(Frame { image, layers, counts, timings: clock.finish() })
    }
}

/// Checks what was asked for and makes the camera ready.
fn check(cloud: &PointCloud, camera: &Camera, [width, height]: [u32; 2], settings: &Settings) -> Result<View, Error> {
    settings.check()?;
    let sides = 1..=MAX_SIDE;
    if !sides.contains(&width) || !sides.contains(&height) {
        return Err(Error::ImageSize { width, height });
    }
    // The last index marks empty pixels.
    if cloud.len() >= u32::MAX as usize {
        return Err(Error::TooManyPoints(cloud.len()));
    }
    camera.view(cloud.origin(), [width, height])
}

/// What the splats have to carry for these settings.
fn attributes<'a>(
    cloud: &'a PointCloud,
    settings: &Settings,
    class_colors: Option<&'a [[u8; 3]]>,
    linear: &'a [f32; 256],
) -> Result<Attributes<'a>, Error> {
    let mode = &settings.shading.color;
    let srgb = match mode {
        ColorMode::Classification => class_colors,
        ColorMode::Rgb => Some(cloud.colors().ok_or_else(|| missing(cloud, "colours"))?),
        ColorMode::Auto => cloud.colors(),
        _ if settings.all_layers => cloud.colors(),
        _ => None,
    };
    let scalar = match mode {
        ColorMode::Field(name) => Some(&field(cloud, name)?.values),
        _ => None,
    };
    let measured = matches!(mode, ColorMode::Curvature | ColorMode::Radius | ColorMode::KRadius);
    Ok(Attributes {
        color: srgb.map(|srgb| PointColors { srgb, linear }),
        scalar,
        measures: settings.all_layers || measured,
    })
}

fn field<'a>(cloud: &'a PointCloud, name: &str) -> Result<&'a autosplats_cloud::Field, Error> {
    cloud.field(name).ok_or_else(|| missing(cloud, &format!("field {name}")))
}

fn missing(cloud: &PointCloud, name: &str) -> Error {
    let mut has: Vec<&str> = cloud.fields().iter().map(|field| field.name.as_str()).collect();
    if cloud.colors().is_some() {
        has.insert(0, "colours");
    }
    let has = if has.is_empty() { "positions only".into() } else { has.join(", ") };
    Error::MissingAttribute { name: name.into(), has }
}

/// From screen points to splats in the depth map.
struct Reconstruct<'a> {
    screen: &'a ScreenPoints,
    view: &'a View,
    settings: &'a Settings,
}

impl Reconstruct<'_> {
    /// Searches, fits and draws the depth of `queries`, adding their surfels to `surfels`.
    fn run(
        &self,
        queries: &[u32],
        neighborhoods: &mut Neighborhoods,
        surfels: &mut Surfels,
        splatter: &mut Splatter,
        clock: &mut Clock,
    ) -> crate::search::SearchCounts {
        let Self { screen, view, settings } = *self;
        let settings = &settings.reconstruction;
        let rules = SearchRules {
            k: settings.k,
            outlier_expansions: settings.outlier_expansions,
            gap_factor: settings.gap_factor,
        };
        match settings.engine {
            SearchEngine::ScreenGrid => screen_grid::search(screen, queries, view, &rules, neighborhoods),
        }
        clock.lap(|timings| &mut timings.search);

        let rules = FitRules {
            k: settings.k,
            splat_scale: settings.splat_scale,
            ellipses: settings.ellipses,
            keep_outliers: settings.outlier_expansions.is_none(),
        };
        let first = surfels.len();
        fit(screen, queries, neighborhoods, view, &rules, surfels);
        clock.lap(|timings| &mut timings.fit);

        splatter.add(surfels, first, view);
        clock.lap(|timings| &mut timings.splat);
        neighborhoods.counts
    }
}

/// Adds up the time of each stage.
struct Clock {
    begin: Instant,
    last: Instant,
    timings: Timings,
}

impl Clock {
    fn start() -> Self {
        let now = Instant::now();
        Self { begin: now, last: now, timings: Timings::default() }
    }

    /// Adds the time since the last lap to a stage.
    fn lap(&mut self, stage: impl Fn(&mut Timings) -> &mut f64) {
        let now = Instant::now();
        *stage(&mut self.timings) += (now - self.last).as_secs_f64() * 1e3;
        self.last = now;
    }

    fn finish(mut self) -> Timings {
        self.timings.frame = (self.last - self.begin).as_secs_f64() * 1e3;
        self.timings
    }
}
