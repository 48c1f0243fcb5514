//! Pictures of frames, as numbered files or as a film.

use std::path::PathBuf;
use std::time::Instant;

use autosplats::{Frame, Renderer};
use autosplats_cloud::Progress as _;
use autosplats_film::{Target, has_ffmpeg, has_number};

use super::job::Job;
use super::moving::Moving;
use super::pictures::{FrameReport, QueuedPicture, Style, Writer};
use super::{camera, live, schedule};
use crate::device::Device;
use crate::exit::Failure;
use crate::input::Playing;
use crate::interrupt;
use crate::output::check_target;
use crate::progress::{Bar, Notes};
use crate::values::FrameRange;

/// Frames to render, and their target.
#[derive(Debug)]
pub(super) struct FilmJob {
    pub(super) target: Target,
    pub(super) frames: FrameRange,
    pub(super) resume: bool,
    pub(super) fps: Option<f64>,
    /// Whether files are read again when they change.
    pub(super) watch: bool,
}

impl FilmJob {
    /// The job of the flags; `None` if they ask for no frames.
    pub(super) fn new(
        outputs: &[PathBuf],
        frames: Option<FrameRange>,
        resume: bool,
        fps: Option<f64>,
        watch: bool,
    ) -> Result<Option<Self>, Failure> {
        let many = |path: &PathBuf| {
            let name = path.to_string_lossy();
            let film = Target::new(path).is_ok_and(|target| matches!(target, Target::Film(_)));
            film || has_number(&name) && Target::new(path).is_ok()
        };
        if frames.is_none() && !resume && !watch && !outputs.iter().any(many) {
            return Ok(None);
        }
        let [output] = outputs else {
            return Err(Failure::usage(
                "--out: frames need one film, or one file name with a number such as f_%05d.png",
            ));
        };
        let all = FrameRange { first: 0, last: None };
        let frames = frames.unwrap_or(all);
        let is_one = frames.last == Some(frames.first) && !watch;
        let target = if is_one { Target::one(output) } else { Target::new(output) }.map_err(Failure::usage)?;
        if matches!(target, Target::Film(_)) {
            if resume {
                return Err(Failure::usage("--resume: a film cannot be resumed; write pictures as f_%05d.png"));
            }
            if !has_ffmpeg() {
                let error = "films need ffmpeg, which is not installed; install it, or write pictures as f_%05d.png";
                return Err(Failure::usage(format!("{}: {error}", output.display())));
            }
        }
        Ok(Some(Self { target, frames, resume, fps, watch }))
    }

    /// The first file that is written.
    pub(super) fn first_file(&self) -> PathBuf {
        self.file(self.frames.first).unwrap_or_else(|| match &self.target {
            Target::Film(path) => path.clone(),
            Target::Frames(names) => names.file(0),
        })
    }

    /// The file of a frame's picture; `None` for a film.
    pub(super) fn file(&self, frame: usize) -> Option<PathBuf> {
        match &self.target {
            Target::Film(_) => None,
            Target::Frames(names) => Some(names.file(frame)),
        }
    }

    /// How to write pictures of a job.
    pub(super) fn style(&self, job: &Job, rate: f64) -> Style {
        let (target, size, alpha, json) = (self.target.clone(), job.size, job.transparent(), job.json);
        Style { target, size, rate, alpha, json, inputs: job.read_files.clone() }
    }
}

/// Renders the requested frames.
pub(super) fn run(job: &mut Job, film: &FilmJob, renderer: &mut Renderer, device: &Device) -> Result<(), Failure> {
    if film.watch {
        job.inputs.check_watched(film.file(0).as_deref())?;
    }
    let playing = job.inputs.play(film.watch, job.quiet)?;
    if playing.iter().any(|input| input.player.stream().timeline().is_none()) {
        return live::run(job, film, playing, renderer, device);
    }
    if !job.quiet {
        for Playing { name, begins, .. } in &playing {
            if let Some(begins) = begins.filter(|begins| !begins.is_zero()) {
                eprintln!(
                    "note: {name}: begins {:.3} s after the first input, by its time stamps",
                    begins.as_secs_f64()
                );
            }
        }
    }
    let mut scene = Moving::new(playing, job.inputs.names());
    let there = scene.times.len();
    let frames = film.frames.first..film.frames.last.map_or(there, |last| last.saturating_add(1)).min(there);
    let has = || {
        let plural = if there == 1 { "" } else { "s" };
        format!("{} has {there} frame{plural}, 0 to {}", job.inputs.names(), there.saturating_sub(1))
    };
    if frames.is_empty() {
        return Err(Failure::usage(format!("--frames: {}", has())));
    }
    if film.frames.last.is_some_and(|last| last >= there) && !job.quiet {
        eprintln!("note: {}", has());
    }
    for file in frames.clone().filter_map(|frame| film.file(frame)) {
        job.read_files.check(&file)?;
        if job.save_camera.as_ref() == Some(&file) {
            return Err(Failure::usage(format!("{}: two outputs have this name", file.display())));
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
        check_target(path, &job.read_files)?;
        camera::save(path, &camera)?;
    }
    let bar = Bar::new(&format!("rendering {} frames", shown.len()), job.quiet);
    let notes = Notes::new(&bar, &job.inputs.names());
    let begun = Instant::now();
    let mut tally = FrameTally::default();
    let writer = Writer::start(film.style(job, rate));
    let mut render_all = || {
        for (number, &(frame, pictures)) in shown.iter().enumerate() {
            if interrupt::requested() {
                return Err(Failure::interrupted());
            }
            let path = film.file(frame);
            if film.resume && path.as_ref().is_some_and(|path| path.exists()) {
                tally.kept += 1;
                continue;
            }
            let started = Instant::now();
            let cloud = scene.frame(frame, &notes)?;
            let read_ms = super::milliseconds_since(started);
            let rendered = job.render(renderer, &cloud, &camera)?;
            tally.count(frame, &rendered);
            let (counts, timings_ms) = (rendered.counts, rendered.timings);
            let seconds = scene.times[frame] as f64 / 1e9;
            let report = FrameReport { frame, seconds, path, pictures, counts, read_ms, timings_ms };
            if !writer.put(QueuedPicture { image: picture(job, &rendered, &writer), report }) {
                // The writer has failed and reports why.
                return Ok(());
            }
            tally.written += pictures.unwrap_or(1);
            bar.report((number + 1) as f32 / shown.len() as f32);
        }
        Ok(())
    };
    let rendered = render_all();
    let written = writer.finish(rendered.is_ok());
    rendered.and(written)?;
    drop(bar);
    if !job.quiet {
        let kept = if tally.kept > 0 { format!(", {} existed", tally.kept) } else { String::new() };
        tally.summarize(film, &kept, begun, device);
    }
    Ok(())
}

/// The picture to write of a rendered frame.
pub(super) fn picture(job: &Job, frame: &Frame<'_>, writer: &Writer) -> autosplats::Image {
    if job.supersample > 1 { frame.image.averaged(job.supersample) } else { writer.copy(frame.image) }
}

/// Counts of rendered and skipped frames.
#[derive(Default)]
pub(super) struct FrameTally {
    pub(super) written: usize,
    pub(super) kept: usize,
    milliseconds: f64,
    /// Number of frames that show nothing, and the first of them.
    empty: Option<(usize, usize)>,
}

impl FrameTally {
    /// Counts a rendered frame.
    pub(super) fn count(&mut self, frame: usize, rendered: &Frame<'_>) {
        self.milliseconds += rendered.timings.frame;
        if rendered.counts.covered == 0 {
            let (count, first) = self.empty.unwrap_or((0, frame));
            self.empty = Some((count + 1, first));
        }
    }

    /// Prints the summary on standard error.
    pub(super) fn summarize(&self, film: &FilmJob, more: &str, begun: Instant, device: &Device) {
        let place = match &film.target {
            Target::Film(path) => path.clone(),
            Target::Frames(names) => names.pattern(),
        };
        match self.empty {
            Some((1, frame)) => eprintln!("note: frame {frame} shows nothing"),
            Some((count, first)) => eprintln!("note: {count} frames show nothing, the first is frame {first}"),
            None => {}
        }
        eprintln!(
            "{}: {} picture{}{more}; {:.1} s, of which {:.1} s rendering on {}",
            place.display(),
            self.written,
            if self.written == 1 { "" } else { "s" },
            begun.elapsed().as_secs_f64(),
            self.milliseconds * 1e-3,
            device.describe()
        );
    }
}
