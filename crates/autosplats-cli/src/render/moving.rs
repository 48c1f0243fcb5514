//! Pictures of inputs with timelines: the requested frames, each with the points of its time.

use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

use autosplats::{Camera, Renderer};
use autosplats_cloud::glam::DMat4;
use autosplats_cloud::{PointCloud, Progress};
use autosplats_output::Target;
use autosplats_sources::Timeline;

use super::film::FilmJob;
use super::job::Job;
use super::pictures::{FrameReport, FrameTally, QueuedPicture, Writer};
use super::placement::{MIN_POINTS, SharedPlacement};
use super::report::MemoryReport;
use super::{camera, schedule};
use crate::device::Device;
use crate::exit::{Exit, Failure};
use crate::input::Playing;
use crate::output::{is_written, true_path};
use crate::progress::{Bar, Notes};

/// Most frames that the camera is placed by.
const MAX_CAMERA_FRAMES: usize = 5;

/// Renders the requested frames.
pub(super) fn run(
    job: &mut Job,
    film: &FilmJob,
    playing: Vec<Playing>,
    renderer: &mut Renderer,
    device: &Device,
) -> Result<(), Failure> {
    for Playing { name, begins, .. } in &playing {
        if let Some(begins) = begins.filter(|begins| !begins.is_zero()) {
            let seconds = begins.as_secs_f64();
            job.console.note(format_args!("{name}: begins {seconds:.3} s after the first input, by its time stamps"));
        }
    }
    let mut scene = Moving::new(playing, job.inputs.names());
    let there = scene.times.len();
    let frames = film.frames.first..film.frames.last.map_or(there, |last| last.saturating_add(1)).min(there);
    let has = || {
        let plural = if there == 1 { "" } else { "s" };
        format!("{} has {there} frame{plural}, 0 to {}", job.inputs.names(), there.saturating_sub(1))
    };
    if there == 0 {
        return Err(Failure::new(Exit::Input, format!("{}: there are no points in it", job.inputs.names())));
    }
    if frames.is_empty() {
        return Err(Failure::usage(format!("--frames: {}", has())));
    }
    if film.frames.last.is_some_and(|last| last >= there) {
        job.console.note(has());
    }
    let camera_file = job.save_camera.as_deref().map(true_path);
    for file in frames.clone().filter_map(|frame| film.file(frame)) {
        job.read_files.check(&file)?;
        if camera_file.is_some() && camera_file == Some(true_path(&file)) {
            return Err(Failure::usage(format!("{}: two outputs are this file", file.display())));
        }
    }
    let times = &scene.times[frames.clone()];
    let rate = film.fps.unwrap_or_else(|| schedule::rate(times));
    let shown: Vec<(usize, Option<usize>)> = match &film.target {
        Target::Frames(_) => frames.clone().map(|frame| (frame, None)).collect(),
        Target::Film(_) => {
            let shown = schedule::resample(times, rate, &job.inputs.names())?;
            shown.into_iter().map(|(frame, pictures)| (frames.start + frame, Some(pictures))).collect()
        }
    };

    let camera = scene.settle(job, renderer, &frames)?;
    if let Some(path) = &job.save_camera {
        camera::save(path, &camera, &job.read_files, &job.console)?;
    }
    let bar = Bar::new(&format!("rendering {} frames", shown.len()), &job.console);
    let notes = Notes::new(&bar, &job.inputs.names());
    let begun = Instant::now();
    let mut tally = FrameTally::default();
    let writer = Writer::start(job, film, rate);
    let mut render_all = || {
        for (number, &(frame, pictures)) in shown.iter().enumerate() {
            bar.tick(number as f32 / shown.len() as f32)?;
            let path = film.file(frame);
            if film.resume && path.as_deref().is_some_and(is_written) {
                tally.kept += 1;
                continue;
            }
            let started = Instant::now();
            let cloud = scene.frame(frame, &notes)?;
            let read_ms = super::milliseconds_since(started);
            job.fewer_neighbors(&cloud).iter().for_each(|note| notes.tell(note));
            let rendered = job.render(renderer, &cloud, &camera)?;
            tally.count(frame, &rendered);
            let (counts, timings_ms) = (rendered.counts, rendered.timings);
            let seconds = scene.times[frame] as f64 / 1e9;
            let memory = MemoryReport::now();
            let report =
                FrameReport { frame, seconds, path, pictures, counts, tree: None, memory, read_ms, timings_ms };
            if !writer.put(QueuedPicture { image: writer.picture(job, &rendered), report }) {
                // The writer has failed and reports why.
                return Ok(());
            }
            tally.written += pictures.unwrap_or(1);
        }
        Ok(())
    };
    let rendered = render_all();
    let written = writer.finish(rendered.is_ok());
    rendered.and(written)?;
    drop(bar);
    let kept = if tally.kept > 0 { format!(", {} existed", tally.kept) } else { String::new() };
    tally.summarize(film, &kept, begun, device, &job.console);
    Ok(())
}

/// Inputs with timelines, played together.
struct Moving {
    playing: Vec<Playing>,
    /// Times at which something changes, in nanoseconds since the common start.
    times: Vec<i64>,
    place: SharedPlacement,
    /// Names of the inputs, for messages.
    names: String,
}

impl Moving {
    fn new(playing: Vec<Playing>, names: String) -> Self {
        let times_of = |input: &Playing| {
            let stamps = input.player.stream().timeline().map_or(&[][..], Timeline::stamps);
            let first = stamps.first().copied().unwrap_or_default();
            let begins = i64::try_from(input.begins.unwrap_or_default().as_nanos()).unwrap_or(i64::MAX);
            stamps.iter().map(|stamp| stamp.saturating_sub(first).saturating_add(begins)).collect::<Vec<_>>()
        };
        let times = match playing.as_slice() {
            [only] => times_of(only),
            several => {
                let mut times: Vec<i64> = several.iter().flat_map(times_of).collect();
                times.sort_unstable();
                times.dedup();
                times
            }
        };
        Self { playing, times, place: SharedPlacement::default(), names }
    }

    /// The points at a frame.
    fn points(&mut self, frame: usize, progress: &dyn Progress) -> Result<Arc<PointCloud>, Failure> {
        let time = Duration::from_nanos(u64::try_from(self.times[frame]).unwrap_or_default());
        let single = self.playing.len() == 1;
        let mut parts: Vec<(Arc<PointCloud>, DMat4)> = Vec::new();
        for Playing { player, begins, world_from_input, .. } in &mut self.playing {
            let at = |timeline: &Timeline| timeline.frame_at(time.saturating_sub(begins.unwrap_or_default()));
            // Frames of a single input may share a time, so its frames are taken by number.
            let own = if single { frame } else { player.stream().timeline().map_or(0, at) };
            parts.push((player.frame(own, progress)?, *world_from_input));
        }
        Ok(self.place.merge(parts))
    }

    /// Places the camera so that it sees all frames, and fixes the settings that depend on the points.
    fn settle(&mut self, job: &mut Job, renderer: &mut Renderer, frames: &Range<usize>) -> Result<Camera, Failure> {
        let bar = Bar::on_input("placing the camera", &self.names, &job.console);
        // The first frame that has points is among them.
        let mut start = frames.start;
        for frame in frames.clone() {
            if self.points(frame, &bar)?.has_finite(MIN_POINTS) {
                start = frame;
                break;
            }
        }
        let last = frames.end - 1 - start;
        let count = (last + 1).min(MAX_CAMERA_FRAMES);
        let mut looks: Vec<usize> = (0..count).map(|look| start + last * look / (count - 1).max(1)).collect();
        looks.dedup();
        let mut clouds = Vec::new();
        for (number, frame) in looks.iter().enumerate() {
            clouds.push(self.points(*frame, &bar)?);
            bar.report((number + 1) as f32 / looks.len() as f32);
        }
        drop(bar);
        let parts: Vec<_> = clouds.iter().map(|cloud| (&**cloud, DMat4::IDENTITY)).collect();
        let all = PointCloud::merged(&parts);
        if !all.has_finite(MIN_POINTS) {
            return Err(Failure::new(Exit::Input, format!("{}: there are no points in these frames", self.names)));
        }
        let first =
            clouds.into_iter().find(|cloud| cloud.has_finite(MIN_POINTS)).unwrap_or_else(|| Arc::new(all.clone()));
        self.place.settle(job, renderer, &all, first)
    }

    /// The points at a frame, ready for rendering.
    fn frame(&mut self, frame: usize, progress: &dyn Progress) -> Result<Arc<PointCloud>, Failure> {
        let cloud = self.points(frame, progress)?;
        Ok(self.place.upright(cloud))
    }
}
