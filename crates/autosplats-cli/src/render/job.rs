//! The job of `render`: its flags combined and checked before any work.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use autosplats::{
    BYTES_PER_PIXEL, Backend, Background, Camera, ColorMap, ColorMode, Frame, MAX_SIDE, Points, Reconstruction,
    Renderer, Settings, Shading, still_supersample, usual_exposure,
};
use autosplats_cloud::{PointCloud, check_memory};
use autosplats_output::PictureFormat;

use super::camera::{self, CameraJob};
use super::film::FilmJob;
use super::path::CameraPath;
use crate::args::{LookArgs, RenderArgs, SurfaceArgs, TreeArgs};
use crate::choices::Map;
use crate::console::Console;
use crate::exit::{Exit, Failure, suggest};
use crate::first_radius::settle_first_radius;
use crate::input::Inputs;
use crate::output::{Format, Picture, ReadFiles, check_target, true_path};
use crate::values::FirstRadius;

/// A picture to render: everything except the points.
pub(super) struct Job {
    pub(super) inputs: Inputs,
    /// How much of octrees is read.
    pub(super) tree: TreeArgs,
    pub(super) pictures: Vec<Picture>,
    pub(super) save_camera: Option<PathBuf>,
    /// Input files, which must not be overwritten.
    pub(super) read_files: ReadFiles,
    /// Size of the written pictures in pixels.
    pub(super) size: [u32; 2],
    /// Factor on both sides of the rendered picture, which is then averaged down.
    pub(super) supersample: u32,
    /// Whether the factor is the default.
    pub(super) supersample_is_default: bool,
    pub(super) camera: CameraJob,
    /// Views to fly through.
    pub(super) path: Option<CameraPath>,
    pub(super) settings: Settings,
    pub(super) backend: Backend,
    /// A graphics device in place of the backend's own choice.
    pub(super) device: Option<String>,
    pub(super) first_radius: FirstRadius,
    pub(super) json: bool,
    pub(super) console: Console,
}

impl Job {
    /// Checks flags, inputs and output paths. A film job, if frames are requested, replaces the single pictures.
    pub(super) fn new(args: RenderArgs, console: &Console) -> Result<(Self, Option<FilmJob>), Failure> {
        let RenderArgs {
            inputs,
            input,
            outputs,
            size,
            supersample,
            frames,
            resume,
            watch,
            tree,
            camera,
            camera_path,
            duration,
            surface,
            look,
            run: _,
            json,
        } = args;
        let fps = input.playing.fps;
        let film = FilmJob::new(&outputs, frames, resume, fps, watch)?;
        let pictures = match &film {
            Some(_) => Vec::new(),
            None => outputs.into_iter().map(Picture::new).collect::<Result<Vec<_>, _>>()?,
        };
        let needs_layers = pictures.iter().any(|picture| picture.format == Format::Exr);
        let is_still = film.is_none() && !needs_layers;
        let supersample_is_default = supersample.is_none();
        let supersample = supersample.unwrap_or(if is_still { still_supersample(size) } else { 1 });
        if needs_layers && supersample > 1 {
            return Err(Failure::usage(
                "--supersample: .exr layers cannot be averaged; render them by a separate command",
            ));
        }
        if resume && surface.frames_averaged > 1 {
            return Err(Failure::usage(
                "--resume: with --frames-averaged a frame depends on earlier ones; render all frames again",
            ));
        }
        let jpeg = |path: &Path| PictureFormat::of(path) == Some(PictureFormat::Jpeg);
        let named = film.as_ref().map(FilmJob::first_file);
        if look.background == Some(Background::Transparent)
            && let Some(opaque) = pictures.iter().map(|picture| &picture.path).chain(&named).find(|path| jpeg(path))
        {
            return Err(Failure::usage(format!(
                "--background transparent: {} cannot be transparent; write a .png",
                opaque.display()
            )));
        }
        let mut settings = settings(&surface, look, needs_layers);
        // A single picture leaves nothing to a next one.
        settings.reconstruction.coherent = film.is_some() || !camera_path.is_empty();
        settings.check()?;

        let save_camera = camera.save_camera.clone();
        let inputs = Inputs::new(&inputs, &input)?.for_pictures();
        let camera = CameraJob::new(&camera, console)?;
        let path = CameraPath::new(&camera_path, duration, console)?;
        let read_files = inputs.files(camera.file().into_iter().chain(camera_path.iter().map(PathBuf::as_path)));
        let pictured = pictures.iter().map(|picture| &picture.path).chain(&named);
        let mut seen = HashSet::new();
        for target in pictured.clone().chain(&save_camera) {
            if !seen.insert(true_path(target)) {
                return Err(Failure::usage(format!("{}: two outputs are this file", target.display())));
            }
            if json && target.to_str().is_none() {
                let why = "--json cannot tell this name, which is not UTF-8; choose another one";
                return Err(Failure::usage(format!("{}: {why}", target.display())));
            }
        }
        pictured.into_iter().try_for_each(|target| check_target(target, &read_files))?;
        if let Some(path) = &save_camera {
            camera::output(path, &read_files)?;
        }
        let [width, height] = size.map(|side| u64::from(side) * u64::from(supersample));
        if width.max(height) > u64::from(MAX_SIDE) {
            return Err(Failure::usage(format!(
                "--supersample {supersample}: {width}x{height} pixels are too many, each side may have {MAX_SIDE}"
            )));
        }
        check_memory(&format!("a picture of {width}x{height}"), width * height * BYTES_PER_PIXEL)?;
        let (backend, first_radius) = (surface.backend.into(), surface.neighbors.first_radius);
        if backend == Backend::Cpu && surface.device.is_some() {
            return Err(Failure::usage("--device: the backend 'cpu' has no devices; leave out one of the two"));
        }
        let shading = &settings.shading;
        let is_scaled = shading.legend || shading.range.is_some();
        if is_scaled && shading.color.usual_map().is_none() {
            console.note("--legend and --range are ignored; they need colours of a value, such as --color height");
        }
        let job = Self {
            inputs,
            tree,
            pictures,
            save_camera,
            read_files,
            size,
            supersample,
            supersample_is_default,
            camera,
            path,
            settings,
            backend,
            device: surface.device,
            first_radius,
            json,
            console: console.clone(),
        };
        Ok((job, film))
    }

    /// Size of the rendered picture in pixels, before averaging.
    pub(super) fn rendered_size(&self) -> [u32; 2] {
        self.size.map(|side| side * self.supersample)
    }

    /// Finds the best first radius of the kd-tree search by trials, if it was asked for.
    pub(super) fn settle_first_radius(
        &mut self,
        renderer: &mut Renderer,
        cloud: &PointCloud,
        camera: &Camera,
    ) -> Result<(), Failure> {
        let mut settings = self.settings.for_points(cloud);
        let size = self.rendered_size();
        settle_first_radius(&mut settings, self.first_radius, renderer, cloud, camera, size, &self.console)?;
        self.settings.reconstruction.engine = settings.reconstruction.engine;
        Ok(())
    }

    /// Renders any number of points, also none.
    pub(super) fn render<'a, 'p>(
        &self,
        renderer: &'a mut Renderer,
        points: impl Into<Points<'p>>,
        camera: &Camera,
    ) -> Result<Frame<'a>, Failure> {
        let points = points.into();
        let (size, settings) = (self.rendered_size(), self.settings.for_points(points));
        Ok(renderer.render_while(points, camera, size, &settings, &self.console.goes_on())?)
    }

    /// Fixes what all pictures share, by the first of them.
    pub(super) fn settle<'p>(
        &mut self,
        renderer: &mut Renderer,
        points: impl Into<Points<'p>>,
        camera: &Camera,
    ) -> Result<(), Failure> {
        let points = points.into();
        let mut settings = self.settings.for_points(points);
        renderer.settle(&mut settings, points, camera, self.rendered_size(), &self.console.goes_on())?;
        self.settings.shading = settings.shading;
        Ok(())
    }

    /// Whether the background is transparent.
    pub(super) fn transparent(&self) -> bool {
        self.settings.shading.background == Background::Transparent
    }

    /// Fails for a single point. With `auto`, small clouds are dots.
    pub(super) fn check_count(&self, cloud: &PointCloud) -> Result<(), Failure> {
        if cloud.len() > usize::from(!self.settings.reconstruction.adaptive) {
            return Ok(());
        }
        Err(Failure::new(Exit::Input, format!("{}: one point makes no surface", self.inputs.names())))
    }

    /// A note if a cloud has too few points for the asked number of neighbours. With `auto`, such clouds are dots.
    pub(super) fn fewer_neighbors(&self, cloud: &PointCloud) -> Option<String> {
        let Reconstruction { k: wanted, adaptive, .. } = self.settings.reconstruction;
        let k = self.settings.for_points(cloud).reconstruction.k;
        (k < wanted && !adaptive && !cloud.is_empty())
            .then(|| format!("{} points cannot have {wanted} neighbours each; using {k}", cloud.len()))
    }

    /// Sets the exposure from these points if no flag states it, with a note if colours get brighter.
    pub(super) fn settle_exposure(&mut self, cloud: &PointCloud) {
        let shading = &mut self.settings.shading;
        if shading.exposure.is_some() {
            return;
        }
        let exposure = usual_exposure(cloud);
        shading.exposure = Some(exposure);
        let shown = shading.lighting && matches!(shading.color, ColorMode::Auto | ColorMode::Rgb);
        // Smaller factors are invisible.
        if shown && exposure >= 1.05 {
            let note =
                format_args!("dark colours are shown {exposure:.1} times as bright; --exposure 1 keeps them dark");
            self.console.note(note);
        }
    }

    /// Fails if the points lack the colours or the field of the colour mode.
    pub(super) fn check_color(&self, cloud: &PointCloud) -> Result<(), Failure> {
        let fields = || cloud.fields().iter().map(|field| field.name.as_str());
        let missing = match &self.settings.shading.color {
            ColorMode::Rgb if cloud.colors().is_none() => {
                return Err(Failure::usage("--color rgb: the points have no colours; try --color height"));
            }
            ColorMode::Classification => "Classification",
            ColorMode::Field(name) => name,
            _ => return Ok(()),
        };
        if cloud.field(missing).is_some() {
            return Ok(());
        }
        let is_channel = ["red", "green", "blue"].contains(&&*missing.to_lowercase());
        if is_channel && cloud.colors().is_some() {
            return Err(Failure::usage(format!(
                "--color {missing}: colour channels are shown together; use --color rgb"
            )));
        }
        let modes = ColorMode::NAMES.into_iter().filter(|mode| *mode != missing.to_lowercase());
        let hint = suggest(missing, modes.chain(fields()));
        Err(Failure::usage(format!("--color: the points have no field {missing}; {hint}")))
    }
}

fn settings(surface: &SurfaceArgs, look: LookArgs, all_layers: bool) -> Settings {
    let mut reconstruction = Reconstruction {
        outlier_expansions: (!surface.keep_outliers).then_some(surface.e0),
        gap_factor: (!surface.bridge_gaps).then_some(surface.gap_factor),
        splat_scale: surface.splat_scale,
        ellipses: surface.ellipses,
        grid_culling: !surface.no_grid_culling,
        depth_refinement: !surface.no_depth_refinement,
        trim: !surface.no_trim,
        frames_averaged: surface.frames_averaged,
        ..Reconstruction::default()
    };
    surface.neighbors.set(&mut reconstruction);
    let shading = Shading {
        color: look.color,
        range: look.range,
        color_map: look.color_map.map(|map| match map {
            Map::Viridis => ColorMap::Viridis,
            Map::Inferno => ColorMap::Inferno,
            Map::Turbo => ColorMap::Turbo,
            Map::Gray => ColorMap::Gray,
            Map::Reds => ColorMap::Reds,
        }),
        legend: look.legend,
        lighting: !look.no_lighting,
        exposure: look.exposure,
        occlusion: look.occlusion,
        backs: look.backs.into(),
        background: look.background.unwrap_or(Shading::default().background),
    };
    Settings { reconstruction, shading, all_layers }
}
