//! Pictures along a camera path through points that do not move.

use std::time::Instant;

use autosplats::{Camera, PlacedTree, Points, Renderer, TreeScene};
use autosplats_cloud::{PointCloud, Progress};
use autosplats_output::Target;

use super::film::FilmJob;
use super::job::Job;
use super::pictures::{FrameReport, FrameTally, QueuedPicture, Writer};
use super::report::{MemoryReport, TreeReport};
use super::{milliseconds_since, scan, schedule};
use crate::device::Device;
use crate::exit::{Exit, Failure};
use crate::output::is_written;
use crate::progress::{Bar, Notes};

/// Points that do not move.
enum Still {
    Whole(Box<PointCloud>),
    Trees(Box<TreeScene>),
}

impl Still {
    fn open(job: &Job, trees: Option<Vec<PlacedTree>>, bar: &Bar, notes: &Notes<'_>) -> Result<Self, Failure> {
        match trees {
            Some(trees) => Ok(Self::Trees(Box::new(scan::open(job, trees, bar)?))),
            None => {
                let mut cloud = job.inputs.read(&job.console)?;
                if cloud.to_local_metres() {
                    notes.note("coordinates in degrees are shown in metres east, north and up of the points' middle");
                }
                job.check_color(&cloud)?;
                job.check_count(&cloud)?;
                Ok(Self::Whole(Box::new(cloud)))
            }
        }
    }

    /// Points that stand for all.
    fn sample(&self) -> &PointCloud {
        match self {
            Self::Whole(cloud) => cloud,
            Self::Trees(scene) => scene.sample(),
        }
    }

    fn with_axes(self, axes: autosplats_cloud::Axes) -> Self {
        match self {
            Self::Whole(cloud) => Self::Whole(Box::new(cloud.with_axes(axes))),
            Self::Trees(scene) => Self::Trees(Box::new(scene.with_axes(axes))),
        }
    }

    /// Loads what a picture needs. If it `tells`, notes say what the picture lacks.
    fn show(
        &mut self,
        job: &Job,
        camera: &Camera,
        notes: &Notes<'_>,
        tells: bool,
    ) -> Result<Option<TreeReport>, Failure> {
        let Self::Trees(scene) = self else { return Ok(None) };
        let started = Instant::now();
        let shown = scene.show(camera, job.size, &scan::detail(job), notes)?;
        scan::check(scene, &shown, notes)?;
        if tells {
            scan::tell(job, scene, &shown, notes);
        }
        Ok(Some(scan::report(scene, &shown, milliseconds_since(started))))
    }

    fn points(&self) -> Points<'_> {
        match self {
            Self::Whole(cloud) => (&**cloud).into(),
            Self::Trees(scene) => scene.points().into(),
        }
    }
}

/// Renders the pictures of the job's path.
pub(super) fn run(
    mut job: Job,
    film: Option<FilmJob>,
    renderer: &mut Renderer,
    device: &Device,
) -> Result<(), Failure> {
    let (Some(film), Some(path)) = (film, job.path.take()) else {
        return Err(Failure::usage("--camera-path: the output must be a film, or have a number such as f_%05d.png"));
    };
    if let Some(name) = job.inputs.moving() {
        return Err(Failure::usage(format!("--camera-path: {name} moves by itself; name one of its frames")));
    }
    let rate = film.fps.unwrap_or(schedule::DEFAULT_FPS);
    let there = ((path.duration.as_secs_f64() * rate).round() as usize + 1).max(2);
    let frames = film.frames.first..film.frames.last.map_or(there, |last| last.saturating_add(1)).min(there);
    if frames.is_empty() {
        return Err(Failure::usage(format!("--frames: the path has {there} frames, 0 to {}", there - 1)));
    }
    for file in frames.clone().filter_map(|frame| film.file(frame)) {
        job.read_files.check(&file)?;
    }
    let camera = |frame: usize| path.at(frame as f64 / (there - 1) as f64);

    let bar = Bar::new(&format!("rendering {} frames", frames.len()), &job.console);
    let names = job.inputs.names();
    let notes = Notes::new(&bar, &names);
    let still = Still::open(&job, scan::trees(&job)?, &bar, &notes)?;
    let (_, axes) = job.camera.place(still.sample(), None, job.size)?;
    let mut still = still.with_axes(axes);
    job.settle_exposure(still.sample());
    job.settle_first_radius(renderer, still.sample(), &camera(0))?;
    // The first picture tells the range of colours, whichever frames are rendered.
    still.show(&job, &camera(0), &notes, true)?;
    job.settle(renderer, still.points(), &camera(0))?;

    let begun = Instant::now();
    let mut tally = FrameTally::default();
    let writer = Writer::start(&job, &film, rate);
    let mut render_all = || {
        for (number, frame) in frames.clone().enumerate() {
            bar.tick(number as f32 / frames.len() as f32)?;
            let picture = film.file(frame);
            if film.resume && picture.as_deref().is_some_and(is_written) {
                tally.kept += 1;
                continue;
            }
            let started = Instant::now();
            let tree = still.show(&job, &camera(frame), &notes, false)?;
            let read_ms = milliseconds_since(started);
            let rendered = job.render(renderer, still.points(), &camera(frame))?;
            tally.count(frame, &rendered);
            let (counts, timings_ms) = (rendered.counts, rendered.timings);
            let pictures = matches!(film.target, Target::Film(_)).then_some(1);
            let seconds = frame as f64 / rate;
            let memory = MemoryReport::now();
            let report =
                FrameReport { frame, seconds, path: picture, pictures, counts, tree, memory, read_ms, timings_ms };
            if !writer.put(QueuedPicture { image: writer.picture(&job, &rendered), report }) {
                // The writer has failed and reports why.
                return Ok(());
            }
            tally.written += 1;
        }
        Ok::<_, Failure>(())
    };
    let rendered = render_all();
    let written = writer.finish(rendered.is_ok());
    rendered.and(written)?;
    drop(bar);
    if tally.written > 0 && tally.shows_nothing() {
        return Err(Failure::new(Exit::Input, format!("{names}: no view of the path shows a surface")));
    }
    let kept = if tally.kept > 0 { format!(", {} existed", tally.kept) } else { String::new() };
    tally.summarize(&film, &kept, begun, device, &job.console);
    Ok(())
}
