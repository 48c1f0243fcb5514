//! `autosplats render`: renders inputs to pictures, layers or a film.

mod camera;
mod film;
mod job;
mod live;
mod moving;
mod pictures;
mod report;
mod schedule;

use std::time::Instant;

use autosplats::{Camera, Counts, Error, Frame, Renderer};
use autosplats_cloud::Axes;

pub(crate) use self::camera::scene_camera;
use self::job::Job;
use self::report::Report;
use crate::args::RenderArgs;
use crate::device::Device;
use crate::exit::{Exit, Failure};
use crate::output::{Format, Picture, print_line, write_exr, write_file, write_png};
use crate::progress::Bar;

/// Renders one picture to one or several files, or a picture per frame of moving input.
pub(crate) fn run(args: RenderArgs) -> Result<(), Failure> {
    let (mut job, film) = Job::new(args)?;
    // A missing device fails before anything is read.
    let mut renderer = Renderer::with_backend(job.backend).map_err(render_failure)?;
    renderer.check(&job.settings).map_err(render_failure)?;
    let device = Device::of(&renderer);
    if let Some(film) = film {
        return film::run(&mut job, &film, &mut renderer, &device);
    }

    let started = Instant::now();
    let mut cloud = job.inputs.read(job.quiet)?;
    let degrees = cloud.to_local_metres();
    let read = milliseconds_since(started);

    job.check_color(&cloud)?;
    let fewer = job.fit_neighbors(&cloud)?;
    let (camera, axes) = job.camera.place(&cloud, job.inputs.only_scene(), job.size)?;
    let cloud = cloud.with_axes(axes);

    job.settle_exposure(&cloud);
    job.settle_first_radius(&mut renderer, &cloud, &camera)?;
    let mut notes = Vec::new();
    if degrees {
        notes.push("coordinates in degrees are shown in metres east, north and up of the points' middle".to_owned());
    }
    notes.extend(fewer);
    let placed = Placed { camera, axes, read, notes };
    let bar = Bar::spinner("rendering", job.quiet);
    match job.render(&mut renderer, &cloud, &camera) {
        // A device may lack the memory for supersampling by default; the picture is then rendered without.
        Err(failure) if failure.exit == Exit::Memory && job.supersample > 1 && job.supersample_is_default => {}
        frame => return placed.conclude(&job, &device, bar, frame?),
    }
    job.supersample = 1;
    let frame = job.render(&mut renderer, &cloud, &camera)?;
    placed.conclude(&job, &device, bar, frame)
}

/// Facts known before a picture is rendered.
struct Placed {
    camera: Camera,
    axes: Axes,
    /// Reading time in milliseconds.
    read: f64,
    /// Notes on the points.
    notes: Vec<String>,
}

impl Placed {
    /// Ends the progress bar of rendering, writes the picture and prints the summary.
    fn conclude(self, job: &Job, device: &Device, bar: Bar, frame: Frame<'_>) -> Result<(), Failure> {
        let Self { camera, axes, read, notes } = self;
        drop(bar);
        check_visible(&frame, job)?;
        if !job.quiet {
            notes.iter().for_each(|note| eprintln!("note: {note}"));
        }
        let started = Instant::now();
        let mut written = Vec::new();
        for picture in &job.pictures {
            let _bar = Bar::spinner(&format!("writing {}", picture.path.display()), job.quiet);
            written.push((picture.path.clone(), write_picture(picture, &frame, &camera, job)?));
        }
        if let Some(path) = &job.save_camera {
            written.push((path.clone(), camera::save(path, &camera)?));
        }
        let write = milliseconds_since(started);

        let report = Report::new(job, device, camera, axes, &frame, written, [read, write]);
        if job.json {
            print_line(&report.to_json()?)?;
        }
        if !job.quiet {
            report.summarize();
        }
        Ok(())
    }
}

fn write_picture(picture: &Picture, frame: &Frame<'_>, camera: &Camera, job: &Job) -> Result<u64, Failure> {
    write_file(&picture.path, |writer| match picture.format {
        Format::Png if job.supersample > 1 => {
            write_png(&frame.image.averaged(job.supersample), job.transparent(), writer)
        }
        Format::Png => write_png(frame.image, job.transparent(), writer),
        Format::Exr => write_exr(frame, camera, writer),
    })
}

/// Fails if the picture shows no surface.
fn check_visible(frame: &Frame<'_>, job: &Job) -> Result<(), Failure> {
    if frame.counts.covered > 0 {
        return Ok(());
    }
    let Counts { points, not_finite, behind, outside, visible, .. } = frame.counts;
    let why = if visible > 0 {
        let (which, them) = match visible {
            1 => ("the only visible point has no".to_owned(), "it as a dot"),
            _ => (format!("none of the {visible} visible points has a"), "them as dots"),
        };
        format!("{which} neighbour near enough; --keep-outliers shows {them}")
    } else {
        format!(
            "of {points} points {not_finite} have no finite position, {behind} are behind the eye, {outside} outside the \
             picture; try {}",
            job.camera.remedy()
        )
    };
    Err(Failure::new(Exit::Input, format!("{}: nothing to show: {why}", job.inputs.names())))
}

/// The failure with the exit code of a render error.
pub(crate) fn render_failure(error: Error) -> Failure {
    match error {
        Error::Setting { name, value, range } => {
            let or = if name == "k" { ", or 'auto'" } else { "" };
            Failure::usage(format!("{} {value}: it must be {range}{or}", flag(name)))
        }
        Error::Camera(_) | Error::MissingAttribute { .. } | Error::ImageSize { .. } => Failure::usage(error),
        Error::TooManyPoints(_) | Error::DeviceLimit { .. } | Error::DeviceMemory(_) => {
            Failure::new(Exit::Memory, error)
        }
        Error::Device(_) | Error::DeviceLost(_) | Error::Texture(_) => Failure::new(Exit::Device, error),
        _ => Failure::new(Exit::Input, error),
    }
}

/// Flag of a field of the settings.
fn flag(setting: &str) -> String {
    match setting {
        "k" => "-k".into(),
        "outlier_expansions" => "--e0".into(),
        name => format!("--{}", name.replace('_', "-")),
    }
}

fn milliseconds_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
