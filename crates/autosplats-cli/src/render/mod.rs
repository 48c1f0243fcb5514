//! `autosplats render`: renders inputs to pictures, layers or a film.

mod camera;
mod film;
mod flight;
mod job;
mod live;
mod moving;
mod path;
mod pictures;
mod placement;
mod report;
mod scan;
mod schedule;

use std::time::Instant;

use autosplats::{Camera, Counts, Frame, Points, Renderer};
use autosplats_cloud::Axes;
use autosplats_output::write_exr;

pub(crate) use self::camera::scene_camera;
use self::film::FilmJob;
use self::job::Job;
use self::report::{Report, TreeReport};
use crate::args::RenderArgs;
use crate::console::Console;
use crate::device::Device;
use crate::exit::{Exit, Failure};
use crate::output::{Format, Picture, write_file};
use crate::progress::Bar;

/// Renders one picture to one or several files, or a picture per frame of moving input.
pub(crate) fn run(args: RenderArgs, console: &Console) -> Result<(), Failure> {
    let (mut job, film) = Job::new(args, console)?;
    // A missing device fails before anything is read.
    let mut renderer = match &job.device {
        Some(device) => Renderer::with_adapter(device)?,
        None => Renderer::with_backend(job.backend)?,
    };
    renderer.check(&job.settings)?;
    let device = Device::of(&renderer);
    if job.path.is_some() {
        return flight::run(job, film, &mut renderer, &device);
    }
    if let Some(film) = film {
        return render_frames(&mut job, &film, &mut renderer, &device);
    }

    if let Some(trees) = scan::trees(&job)? {
        return scan::run(job, trees, &mut renderer, &device);
    }
    let started = Instant::now();
    let mut cloud = job.inputs.read(console)?;
    let degrees = cloud.to_local_metres();
    let read = milliseconds_since(started);

    job.check_color(&cloud)?;
    job.check_count(&cloud)?;
    let (camera, axes) = job.camera.place(&cloud, job.inputs.only_scene(), job.size)?;
    let cloud = cloud.with_axes(axes);

    job.settle_exposure(&cloud);
    job.settle_first_radius(&mut renderer, &cloud, &camera)?;
    let mut notes = Vec::new();
    if degrees {
        notes.push("coordinates in degrees are shown in metres east, north and up of the points' middle".to_owned());
    }
    notes.extend(job.fewer_neighbors(&cloud));
    Placed { camera, axes, read, notes, tree: None }.picture(job, &mut renderer, &device, (&cloud).into())
}

/// Renders a picture per frame of the inputs.
fn render_frames(job: &mut Job, film: &FilmJob, renderer: &mut Renderer, device: &Device) -> Result<(), Failure> {
    if film.watch {
        job.inputs.check_watched(film.file(0).as_deref())?;
    }
    let playing = job.inputs.play(film.watch, &job.console)?;
    if playing.iter().any(|input| input.player.stream().timeline().is_none()) {
        live::run(job, film, playing, renderer, device)
    } else {
        moving::run(job, film, playing, renderer, device)
    }
}

/// Facts known before a picture is rendered.
struct Placed {
    camera: Camera,
    axes: Axes,
    /// Reading time in milliseconds.
    read: f64,
    /// Notes on the points.
    notes: Vec<String>,
    /// What was read of octrees.
    tree: Option<TreeReport>,
}

impl Placed {
    /// Renders a picture, writes it and prints the summary.
    fn picture(
        self,
        mut job: Job,
        renderer: &mut Renderer,
        device: &Device,
        points: Points<'_>,
    ) -> Result<(), Failure> {
        let bar = Bar::spinner("rendering", &job.console);
        match job.render(renderer, points, &self.camera) {
            // A device may lack the memory for supersampling by default; the picture is then rendered without.
            Err(failure) if failure.exit == Exit::Memory && job.supersample > 1 && job.supersample_is_default => {}
            frame => return self.conclude(&job, device, bar, frame?),
        }
        job.supersample = 1;
        let frame = job.render(renderer, points, &self.camera)?;
        self.conclude(&job, device, bar, frame)
    }

    /// Ends the progress bar of rendering, writes the picture and prints the summary.
    fn conclude(self, job: &Job, device: &Device, bar: Bar, frame: Frame<'_>) -> Result<(), Failure> {
        let Self { camera, axes, read, notes, tree } = self;
        drop(bar);
        check_visible(&frame, job)?;
        notes.iter().for_each(|note| job.console.note(note));
        let started = Instant::now();
        let mut written = Vec::new();
        for picture in &job.pictures {
            let _bar = Bar::spinner(&format!("writing {}", picture.path.display()), &job.console);
            written.push((picture.path.clone(), write_picture(picture, &frame, &camera, job)?));
        }
        if let Some(path) = &job.save_camera {
            written.push((path.clone(), camera::save(path, &camera, &job.read_files, &job.console)?));
        }
        let write = milliseconds_since(started);

        let report = Report::new(job, device, camera, axes, &frame, written, [read, write]).with_tree(tree);
        if job.json {
            job.console.print_json(&report)?;
        }
        job.console.tell(report.summary());
        Ok(())
    }
}

fn write_picture(picture: &Picture, frame: &Frame<'_>, camera: &Camera, job: &Job) -> Result<u64, Failure> {
    write_file(&picture.path, &job.console, |writer| match picture.format {
        Format::Picture(format) if job.supersample > 1 => {
            autosplats_output::write_picture(&frame.image.averaged(job.supersample), format, job.transparent(), writer)
        }
        Format::Picture(format) => autosplats_output::write_picture(frame.image, format, job.transparent(), writer),
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

fn milliseconds_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
