//! The thread that writes pictures, and its queue.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::JoinHandle;

use autosplats::{Counts, Image, Timings};
use autosplats_film::{Error, Film, Frames, Target};
use serde::Serialize;

use crate::exit::{Exit, Failure};
use crate::interrupt;
use crate::output::{ReadFiles, print_line, write_file, write_png};

/// Most pictures in the queue.
const MAX_QUEUED_PICTURES: usize = 2;

/// How and where pictures are written.
#[derive(Debug)]
pub(super) struct Style {
    pub(super) target: Target,
    pub(super) size: [u32; 2],
    /// Pictures per second of a film.
    pub(super) rate: f64,
    pub(super) alpha: bool,
    /// Whether to print a JSON line per picture.
    pub(super) json: bool,
    /// Input files, which must not be replaced.
    pub(super) inputs: ReadFiles,
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
    pub(super) fn start(style: Style) -> Self {
        let (queue, shots) = sync_channel(MAX_QUEUED_PICTURES);
        let (written, spare) = channel();
        let thread = std::thread::spawn(move || match &style.target {
            Target::Frames(names) => write_frames(&style, names, &shots, &written),
            Target::Film(path) => write_film(&style, path, &shots, &written),
        });
        Self { queue, spare, thread }
    }

    /// Copies a picture, into used memory if there is any.
    pub(super) fn copy(&self, image: &Image) -> Image {
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
        write_file(&path, |writer| write_png(&image, style.alpha, writer))?;
        if style.json {
            tell(&report)?;
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
    let mut reports = Vec::new();
    {
        // The lock makes Ctrl-C wait until the partial film is removed.
        let _writing = interrupt::writing();
        let mut film = Film::begin(path, style.size, style.rate).map_err(film_failure)?;
        let mut complete = false;
        for shot in shots {
            let Some(QueuedPicture { image, report }) = shot else {
                complete = true;
                break;
            };
            for _ in 0..report.pictures.unwrap_or(1) {
                film.add(&image).map_err(film_failure)?;
            }
            if style.json {
                reports.push(report);
            }
            let _ = written.send(image);
        }
        if interrupt::requested() {
            return Err(Failure::interrupted());
        }
        if !complete {
            // The sender reports why pictures are missing.
            return Ok(());
        }
        film.finish().map_err(film_failure)?;
    }
    // The film exists only now, so its frames are reported only now.
    reports.iter().try_for_each(tell)
}

fn tell(report: &FrameReport) -> Result<(), Failure> {
    let line = serde_json::to_string(report);
    print_line(&line.map_err(|error| Failure::new(Exit::Output, format!("--json: {error}")))?)
}

fn film_failure(error: Error) -> Failure {
    if interrupt::requested() { Failure::interrupted() } else { Failure::new(Exit::Output, error) }
}
