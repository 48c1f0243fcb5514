//! Pictures that wait to be written, and the thread that writes them.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::JoinHandle;

use autosplats::{Counts, Image, Timings};
use autosplats_film::{Error, Film, Frames, Target};
use serde::Serialize;

use crate::exit::{Exit, Failure};
use crate::interrupt;
use crate::output::{ReadFiles, print_line, write_file, write_png};

/// Pictures that wait.
const QUEUE: usize = 2;

/// How and where pictures are written.
#[derive(Debug)]
pub(super) struct Style {
    pub(super) target: Target,
    pub(super) size: [u32; 2],
    /// Pictures a second of a film.
    pub(super) rate: f64,
    pub(super) alpha: bool,
    /// Whether a line is told of each.
    pub(super) json: bool,
    /// None of them is replaced.
    pub(super) inputs: ReadFiles,
}

/// A picture, and what is told of it once it is in place.
#[derive(Debug)]
pub(super) struct Shot {
    pub(super) image: Image,
    pub(super) report: FrameReport,
}

/// One line of `--json`.
#[derive(Debug, Serialize)]
pub(super) struct FrameReport {
    pub(super) frame: usize,
    /// Since the first frame.
    pub(super) seconds: f64,
    /// Of a picture that is a file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) path: Option<PathBuf>,
    /// How many pictures of a film show it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) pictures: Option<usize>,
    pub(super) counts: Counts,
    /// Of what is live, waiting for it as well.
    pub(super) read_ms: f64,
    pub(super) timings_ms: Timings,
}

/// The thread that writes pictures, in the order they are handed over.
pub(super) struct Writer {
    /// `None` says that all have come.
    queue: SyncSender<Option<Shot>>,
    /// What was written and is of use again: memory that is new each time costs a millisecond a picture.
    spare: Receiver<Image>,
    thread: JoinHandle<Result<(), Failure>>,
}

impl Writer {
    pub(super) fn start(style: Style) -> Self {
        let (queue, shots) = sync_channel(QUEUE);
        let (written, spare) = channel();
        let thread = std::thread::spawn(move || match &style.target {
            Target::Frames(names) => write_frames(&style, names, &shots, &written),
            Target::Film(path) => write_film(&style, path, &shots, &written),
        });
        Self { queue, spare, thread }
    }

    /// A copy of a picture, in memory that was used before if there is any.
    pub(super) fn copy(&self, image: &Image) -> Image {
        let mut copy = self.spare.try_recv().unwrap_or_default();
        (copy.width, copy.height) = (image.width, image.height);
        copy.pixels.clear();
        copy.pixels.extend_from_slice(&image.pixels);
        copy
    }

    /// Hands over a picture; says whether it will be written. If not, [`finish`](Self::finish) says why.
    pub(super) fn put(&self, shot: Shot) -> bool {
        self.queue.send(Some(shot)).is_ok()
    }

    /// Waits until all is in place. A film that is not `complete` is not.
    pub(super) fn finish(self, complete: bool) -> Result<(), Failure> {
        if complete {
            // Whoever does not hear it has failed.
            let _ = self.queue.send(None);
        }
        drop(self.queue);
        self.thread.join().unwrap_or_else(|_| Err(Failure::new(Exit::Output, "writing the pictures failed")))
    }
}

fn write_frames(
    style: &Style,
    names: &Frames,
    shots: &Receiver<Option<Shot>>,
    written: &Sender<Image>,
) -> Result<(), Failure> {
    for Shot { image, report } in shots.iter().flatten() {
        let path = names.file(report.frame);
        style.inputs.check(&path)?;
        write_file(&path, |writer| write_png(&image, style.alpha, writer))?;
        if style.json {
            tell(&report)?;
        }
        // Nobody may want it any more.
        let _ = written.send(image);
    }
    Ok(())
}

fn write_film(
    style: &Style,
    path: &std::path::Path,
    shots: &Receiver<Option<Shot>>,
    written: &Sender<Image>,
) -> Result<(), Failure> {
    let mut reports = Vec::new();
    {
        // What is there of the film is gone before Ctrl-C ends the program.
        let _writing = interrupt::writing();
        let mut film = Film::begin(path, style.size, style.rate).map_err(film_failure)?;
        let mut complete = false;
        for shot in shots {
            let Some(Shot { image, report }) = shot else {
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
            // Whoever has sent too few says why.
            return Ok(());
        }
        film.finish().map_err(film_failure)?;
    }
    // Only now is there something to tell of.
    reports.iter().try_for_each(tell)
}

fn tell(report: &FrameReport) -> Result<(), Failure> {
    let line = serde_json::to_string(report);
    print_line(&line.map_err(|error| Failure::new(Exit::Output, format!("--json: {error}")))?)
}

fn film_failure(error: Error) -> Failure {
    if interrupt::requested() { Failure::interrupted() } else { Failure::new(Exit::Output, error) }
}
