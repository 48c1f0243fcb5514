//! A picture for each frame of what moves, as numbered files or as a film.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Instant;

use autosplats::{Camera, ColorMode, Counts, Image, Renderer, Timings};
use autosplats_cloud::glam::DMat4;
use autosplats_cloud::{Axes, LocalMetres, Player, PointCloud, Progress};
use autosplats_film::{Error, Film, Frames, Target, has_ffmpeg, has_number};
use serde::Serialize;

use super::job::Job;
use super::{camera, render_failure, shrink};
use crate::device::Device;
use crate::exit::{Exit, Failure};
use crate::input::read_failure;
use crate::interrupt;
use crate::output::{print_line, write_file, write_png};
use crate::progress::Bar;
use crate::values::FrameRange;

/// Frames that the camera is placed by.
const PLACED_BY: usize = 5;
/// Pictures that wait to be written.
const QUEUE: usize = 2;
/// Pictures a second of a film of what has no rate.
const USUAL_RATE: f64 = 30.0;

/// Frames to render, and where to.
#[derive(Debug)]
pub(super) struct FilmJob {
    target: Target,
    frames: FrameRange,
    resume: bool,
    fps: Option<f64>,
}

impl FilmJob {
    /// What the flags ask for, if they ask for frames.
    pub(super) fn new(
        outputs: &[PathBuf],
        frames: Option<FrameRange>,
        resume: bool,
        fps: Option<f64>,
    ) -> Result<Option<Self>, Failure> {
        let many = |path: &PathBuf| {
            let name = path.to_string_lossy();
            let film = Target::new(path).is_ok_and(|target| matches!(target, Target::Film(_)));
            film || has_number(&name) && Target::new(path).is_ok()
        };
        if frames.is_none() && !resume && !outputs.iter().any(many) {
            return Ok(None);
        }
        let [output] = outputs else {
            return Err(Failure::usage(
                "--out: frames go to one film, or to one name with a number such as f_%05d.png",
            ));
        };
        let target = Target::new(output).map_err(Failure::usage)?;
        if matches!(target, Target::Film(_)) {
            if resume {
                return Err(Failure::usage("--resume: a film is made in one go; have pictures written as f_%05d.png"));
            }
            if !has_ffmpeg() {
                let error =
                    "ffmpeg is not there, which makes films; install it, or have pictures written as f_%05d.png";
                return Err(Failure::usage(format!("{}: {error}", output.display())));
            }
        }
        let all = FrameRange { first: 0, last: None };
        Ok(Some(Self { target, frames: frames.unwrap_or(all), resume, fps }))
    }

    /// A file that is going to be written.
    pub(super) fn first_file(&self) -> Option<PathBuf> {
        match &self.target {
            Target::Film(path) => Some(path.clone()),
            Target::Frames(frames) => Some(frames.file(self.frames.first)),
        }
    }
}

/// One line of `--json`.
#[derive(Serialize)]
struct FrameReport {
    frame: usize,
    /// Since the first frame.
    seconds: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    path: Option<PathBuf>,
    counts: Counts,
    read_ms: f64,
    timings_ms: Timings,
}

/// Renders the frames that are asked for.
pub(super) fn run(job: &mut Job, renderer: &mut Renderer, device: &Device) -> Result<(), Failure> {
    let Some(film) = job.film.take() else { return Ok(()) };
    let mut scene = Moving::new(job)?;
    let frames = film.frames.first..film.frames.last.map_or(scene.times.len(), |last| last + 1);
    if frames.end > scene.times.len() || frames.is_empty() {
        let there = scene.times.len();
        return Err(Failure::usage(format!(
            "--frames: {} has {there} frame{}, 0 to {}",
            job.inputs.names(),
            if there == 1 { "" } else { "s" },
            there.saturating_sub(1)
        )));
    }

    let (camera, axes) = scene.place(job, &frames)?;
    if let Some(path) = &job.save_camera {
        camera::save(path, &camera)?;
    }
    scene.settle_range(job, renderer, &camera, axes, frames.start)?;
    let rate = film.fps.unwrap_or_else(|| scene.rate());
    let bar = Bar::on_input(&format!("rendering {} frames", frames.len()), &scene.names, job.quiet);
    let begun = Instant::now();
    let (mut written, mut kept, mut milliseconds) = (0, 0, 0.0);
    let (sender, queue) = sync_channel(QUEUE);
    let (size, alpha) = (job.size, job.transparent());
    let target = film.target.clone();
    std::thread::scope(|scope| {
        let count = frames.len();
        let writer = scope.spawn(move || write(&queue, &target, count, size, rate, alpha));
        let rendered = (|sender: SyncSender<(usize, Image)>| {
            for frame in frames.clone() {
                if interrupt::requested() {
                    return Err(Failure::interrupted());
                }
                let path = match &film.target {
                    Target::Frames(names) => Some(names.file(frame)),
                    Target::Film(_) => None,
                };
                if film.resume && path.as_ref().is_some_and(|path| path.exists()) {
                    kept += 1;
                    continue;
                }
                let started = Instant::now();
                let cloud = scene.frame(frame, axes, &Notes(&bar))?;
                let read_ms = super::milliseconds_since(started);
                let shot = scene.draw(job, renderer, &cloud, &camera)?;
                milliseconds += shot.timings.frame;
                let report = FrameReport {
                    frame,
                    seconds: scene.times[frame] as f64 * 1e-9,
                    path,
                    counts: shot.counts,
                    read_ms,
                    timings_ms: shot.timings,
                };
                if sender.send((frame, shot.image)).is_err() {
                    // The writer has given up and says why.
                    return Ok(());
                }
                if job.json {
                    let line = serde_json::to_string(&report);
                    print_line(&line.map_err(|error| Failure::new(Exit::Output, format!("--json: {error}")))?)?;
                }
                written += 1;
                bar.report((frame + 1 - frames.start) as f32 / frames.len() as f32);
            }
            Ok(())
        })(sender);
        let ended = writer.join().unwrap_or_else(|_| Err(Failure::new(Exit::Output, "writing the pictures failed")));
        rendered.and(ended)
    })?;
    drop(bar);
    if !job.quiet {
        let place = match &film.target {
            Target::Film(path) => path.clone(),
            Target::Frames(names) => names.pattern(),
        };
        let kept = if kept > 0 { format!(", {kept} were there") } else { String::new() };
        eprintln!(
            "{}: {written} pictures{kept}; {:.1} s, of which {:.1} s rendering on {}",
            place.display(),
            begun.elapsed().as_secs_f64(),
            milliseconds * 1e-3,
            device.describe()
        );
    }
    Ok(())
}

/// Tells what frames have to say; how far each is counts for nothing in all of them.
struct Notes<'a>(&'a Bar);

impl Progress for Notes<'_> {
    fn report(&self, _fraction: f32) {}

    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }

    fn note(&self, note: &str) {
        self.0.note(note);
    }
}

/// A picture and what is known of it.
struct Shot {
    image: Image,
    counts: Counts,
    timings: Timings,
}

/// The inputs as they are at each frame.
struct Moving {
    players: Vec<(Player, DMat4)>,
    /// Nanoseconds since the first of each input at which something changes.
    times: Vec<i64>,
    /// The map of what is in degrees, once there are points.
    metres: Option<LocalMetres>,
    /// Names of the inputs, for messages.
    names: String,
}

impl Moving {
    fn new(job: &Job) -> Result<Self, Failure> {
        let players = job.inputs.play(job.quiet)?;
        let since_first = |player: &Player| {
            let stamps = player.stream().timeline().map_or(&[][..], |timeline| timeline.stamps());
            let first = stamps.first().copied().unwrap_or_default();
            stamps.iter().map(|stamp| stamp.saturating_sub(first)).collect::<Vec<_>>()
        };
        let times = match players.as_slice() {
            [(only, _)] => since_first(only),
            several => {
                let mut times: Vec<i64> = several.iter().flat_map(|(player, _)| since_first(player)).collect();
                times.sort_unstable();
                times.dedup();
                times
            }
        };
        Ok(Self { players, times, metres: None, names: job.inputs.names() })
    }

    /// Frames a second, in the mean.
    fn rate(&self) -> f64 {
        match (self.times.first(), self.times.last()) {
            (Some(first), Some(last)) if last > first => {
                ((self.times.len() - 1) as f64 * 1e9 / (last - first) as f64).clamp(1.0, 240.0)
            }
            _ => USUAL_RATE,
        }
    }

    /// The points at a frame.
    fn points(&mut self, frame: usize, progress: &dyn Progress) -> Result<PointCloud, Failure> {
        let time = self.times[frame];
        let single = self.players.len() == 1;
        let mut parts: Vec<(Arc<PointCloud>, DMat4)> = Vec::new();
        for (player, pose) in &mut self.players {
            let at = |timeline: &autosplats_cloud::Timeline| {
                timeline.frame_at(std::time::Duration::from_nanos(u64::try_from(time).unwrap_or_default()))
            };
            // Frames of one input may be of the same time.
            let own = if single { frame } else { player.stream().timeline().map_or(0, at) };
            parts.push((player.frame(own, progress).map_err(read_failure)?, *pose));
        }
        let mut cloud = match parts.pop() {
            Some((only, pose)) if parts.is_empty() && pose == DMat4::IDENTITY => Arc::unwrap_or_clone(only),
            Some(last) => {
                parts.push(last);
                let parts: Vec<_> = parts.iter().map(|(cloud, pose)| (&**cloud, *pose)).collect();
                PointCloud::merged(&parts)
            }
            None => PointCloud::default(),
        };
        if self.metres.is_none() && !cloud.is_empty() {
            self.metres = cloud.local_metres(None);
        }
        if let Some(metres) = &self.metres {
            cloud.to_metres_on(metres);
        }
        Ok(cloud)
    }

    /// The points at a frame, with what is known to be up.
    fn frame(&mut self, frame: usize, axes: Axes, progress: &dyn Progress) -> Result<PointCloud, Failure> {
        Ok(self.points(frame, progress)?.with_axes(axes))
    }

    /// Places the camera so that it sees what there is from the first frame to the last, and settles what follows from the
    /// points.
    fn place(&mut self, job: &mut Job, frames: &std::ops::Range<usize>) -> Result<(Camera, Axes), Failure> {
        let bar = Bar::on_input("placing the camera", &self.names, job.quiet);
        let last = frames.len() - 1;
        let count = frames.len().min(PLACED_BY);
        let mut looks: Vec<usize> = (0..count).map(|look| frames.start + last * look / (count - 1).max(1)).collect();
        looks.dedup();
        let mut clouds = Vec::new();
        for (number, frame) in looks.iter().enumerate() {
            clouds.push(self.points(*frame, &bar)?);
            bar.report((number + 1) as f32 / looks.len() as f32);
        }
        let parts: Vec<_> = clouds.iter().map(|cloud| (cloud, DMat4::IDENTITY)).collect();
        let all = PointCloud::merged(&parts);
        if all.len() < 2 {
            return Err(Failure::new(Exit::Input, format!("{}: there are no points in these frames", self.names)));
        }
        job.check_color(&all)?;
        job.camera.place(&all, job.inputs.only_scene(), job.size)
    }

    /// Takes the range of a colour map from the first frame, so that colours mean the same in all.
    fn settle_range(
        &mut self,
        job: &mut Job,
        renderer: &mut Renderer,
        camera: &Camera,
        axes: Axes,
        first: usize,
    ) -> Result<(), Failure> {
        let plain = matches!(job.settings.shading.color, ColorMode::Plain | ColorMode::Rgb | ColorMode::Normal);
        if job.settings.shading.range.is_none() && !plain {
            let cloud = self.frame(first, axes, &())?;
            let range = self.draw(job, renderer, &cloud, camera)?.counts.value_range;
            job.settings.shading.range = range.map(|ends| ends.map(|end| end as f32));
        }
        Ok(())
    }

    /// Renders a frame.
    fn draw(&self, job: &Job, renderer: &mut Renderer, cloud: &PointCloud, camera: &Camera) -> Result<Shot, Failure> {
        let mut settings = job.settings.clone();
        if cloud.is_empty() {
            // No points have no colours either, and show the background.
            settings.shading.color = ColorMode::Plain;
        }
        settings.reconstruction.k = settings.reconstruction.k.min(cloud.len().saturating_sub(1).max(1) as u32);
        let frame = renderer.render(cloud, camera, job.rendered_size(), &settings).map_err(render_failure)?;
        let image = if job.supersample > 1 {
            shrink(frame.image, job.supersample)
        } else {
            let Image { width, height, ref pixels, .. } = *frame.image;
            Image { width, height, pixels: pixels.clone(), linear: Vec::new() }
        };
        Ok(Shot { image, counts: frame.counts, timings: frame.timings })
    }
}

/// Writes pictures as they come, until there are no more.
fn write(
    queue: &Receiver<(usize, Image)>,
    target: &Target,
    count: usize,
    size: [u32; 2],
    rate: f64,
    alpha: bool,
) -> Result<(), Failure> {
    match target {
        Target::Frames(names) => queue.iter().try_for_each(|(frame, image)| write_frame(names, frame, &image, alpha)),
        Target::Film(path) => {
            // What is there of the film is gone before Ctrl-C ends the program.
            let _writing = interrupt::writing();
            let mut film = Film::begin(path, size, rate).map_err(film_failure)?;
            let mut added = 0;
            for (_, image) in queue {
                film.add(&image).map_err(film_failure)?;
                added += 1;
            }
            if interrupt::requested() {
                return Err(Failure::interrupted());
            }
            // Whoever sent too few says why.
            if added == count { film.finish().map_err(film_failure) } else { Ok(()) }
        }
    }
}

fn write_frame(names: &Frames, frame: usize, image: &Image, alpha: bool) -> Result<(), Failure> {
    write_file(&names.file(frame), |writer| write_png(image, alpha, writer)).map(|_| ())
}

fn film_failure(error: Error) -> Failure {
    if interrupt::requested() { Failure::interrupted() } else { Failure::new(Exit::Output, error) }
}
