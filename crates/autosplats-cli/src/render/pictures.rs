//! The thread that writes pictures, and its queue.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::JoinHandle;
use std::time::Instant;

use autosplats::{Counts, Frame, Image, Timings};
use autosplats_output::{Film, Frames, Target, write_picture};
use serde::Serialize;

use super::film::FilmJob;
use super::job::Job;
use super::report::{MemoryReport, TreeReport};
use crate::console::Console;
use crate::device::Device;
use crate::exit::{Exit, Failure};
use crate::output::{ReadFiles, write_file};

/// Most pictures in the queue.
const MAX_QUEUED_PICTURES: usize = 2;

/// How and where pictures are written.
struct Style {
    size: [u32; 2],
    /// Pictures per second of a film.
    rate: f64,
    alpha: bool,
    /// Whether to print a JSON line per picture.
    json: bool,
    /// Input files, which must not be replaced.
    inputs: ReadFiles,
    console: Console,
}

/// A picture, and the report that is printed once it is written.
#[derive(Debug)]
pub(super) struct QueuedPicture {
    pub(super) image: Image,
    pub(super) report: FrameReport,
}

/// One line of `--json`.
#[derive(Debug, Serialize)]
pub(super) struct FrameReport {
    pub(super) frame: usize,
    /// Seconds since the first frame.
    pub(super) seconds: f64,
    /// File of the picture; none for a film.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) path: Option<PathBuf>,
    /// Number of a film's pictures that show this frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) pictures: Option<usize>,
    pub(super) counts: Counts,
    /// What was read of octrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) tree: Option<TreeReport>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) memory: Option<MemoryReport>,
    /// Reading time in milliseconds, including the wait for live input.
    pub(super) read_ms: f64,
    pub(super) timings_ms: Timings,
}

/// Thread that writes pictures in the order of their arrival.
pub(super) struct Writer {
    /// Pictures to write; `None` marks the end.
    queue: SyncSender<Option<QueuedPicture>>,
    /// Written images, whose memory is used again: fresh memory is slow.
    spare: Receiver<Image>,
    thread: JoinHandle<Result<(), Failure>>,
}

impl Writer {
    /// Starts the thread. A film has `rate` pictures per second.
    pub(super) fn start(job: &Job, film: &FilmJob, rate: f64) -> Self {
        let Job { size, json, console, read_files, .. } = job;
        let (inputs, console) = (read_files.clone(), console.clone());
        let style = Style { size: *size, rate, alpha: job.transparent(), json: *json, inputs, console };
        let target = film.target.clone();
        let (queue, shots) = sync_channel(MAX_QUEUED_PICTURES);
        let (written, spare) = channel();
        let thread = std::thread::spawn(move || match &target {
            Target::Frames(names) => write_frames(&style, names, &shots, &written),
            Target::Film(path) => write_film(&style, path, &shots, &written),
        });
        Self { queue, spare, thread }
    }

    /// The picture to write of a rendered frame, in used memory if there is any.
    pub(super) fn picture(&self, job: &Job, frame: &Frame<'_>) -> Image {
        let image = frame.image;
        if job.supersample > 1 {
            return image.averaged(job.supersample);
        }
        let mut copy = self.spare.try_recv().unwrap_or_default();
        (copy.width, copy.height) = (image.width, image.height);
        copy.pixels.clear();
        copy.pixels.extend_from_slice(&image.pixels);
        copy
    }

    /// Queues a picture and returns whether it will be written. If not, [`finish`](Self::finish) returns the reason.
    pub(super) fn put(&self, shot: QueuedPicture) -> bool {
        self.queue.send(Some(shot)).is_ok()
    }

    /// Waits until everything is written. A film that is not `complete` is discarded.
    pub(super) fn finish(self, complete: bool) -> Result<(), Failure> {
        if complete {
            // A closed queue means that the thread has failed; joining it returns the reason.
            let _ = self.queue.send(None);
        }
        drop(self.queue);
        self.thread.join().unwrap_or_else(|_| Err(Failure::new(Exit::Output, "writing the pictures failed")))
    }
}

fn write_frames(
    style: &Style,
    names: &Frames,
    shots: &Receiver<Option<QueuedPicture>>,
    written: &Sender<Image>,
) -> Result<(), Failure> {
    for QueuedPicture { image, report } in shots.iter().flatten() {
        let path = names.file(report.frame);
        style.inputs.check(&path)?;
        write_file(&path, &style.console, |writer| write_picture(&image, names.format(), style.alpha, writer))?;
        if style.json {
            style.console.print_json(&report)?;
        }
        // The renderer may have ended already.
        let _ = written.send(image);
    }
    Ok(())
}

fn write_film(
    style: &Style,
    path: &std::path::Path,
    shots: &Receiver<Option<QueuedPicture>>,
    written: &Sender<Image>,
) -> Result<(), Failure> {
    let interrupt = style.console.interrupt();
    let failure = |error| Failure::new(Exit::Output, error);
    let mut reports = Vec::new();
    let mut film = Film::begin(path, style.size, style.rate).map_err(failure)?;
    let mut complete = false;
    for shot in shots {
        let Some(QueuedPicture { image, report }) = shot else {
            complete = true;
            break;
        };
        for _ in 0..report.pictures.unwrap_or(1) {
            film.add(&image).map_err(failure)?;
        }
        if style.json {
            reports.push(report);
        }
        let _ = written.send(image);
    }
    if interrupt.requested() {
        return Err(Failure::interrupted());
    }
    if !complete {
        // The sender reports why pictures are missing.
        return Ok(());
    }
    film.finish().map_err(failure)?;
    // The film exists only now, so its frames are reported only now.
    reports.iter().try_for_each(|report| style.console.print_json(report))
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

    /// Whether no rendered frame shows a surface.
    pub(super) fn shows_nothing(&self) -> bool {
        self.empty.is_some_and(|(count, _)| count >= self.written)
    }

    /// Tells the summary.
    pub(super) fn summarize(&self, film: &FilmJob, more: &str, begun: Instant, device: &Device, console: &Console) {
        let place = match &film.target {
            Target::Film(path) => path.clone(),
            Target::Frames(names) => names.pattern(),
        };
        match self.empty {
            Some((1, frame)) => console.note(format_args!("frame {frame} shows nothing")),
            Some((count, first)) => {
                console.note(format_args!("{count} frames show nothing, the first is frame {first}"));
            }
            None => {}
        }
        console.tell(format_args!(
            "{}: {} picture{}{more}; {:.1} s, of which {:.1} s rendering on {}",
            place.display(),
            self.written,
            if self.written == 1 { "" } else { "s" },
            begun.elapsed().as_secs_f64(),
            self.milliseconds * 1e-3,
            device.describe()
        ));
    }
}
