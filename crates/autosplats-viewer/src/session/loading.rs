//! Reads inputs on threads of their own: points are shown as they arrive, and changed files are read again.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use autosplats::cloud::glam::DMat4;
use autosplats::cloud::{Error, LeftOut, PointCloud, PointFilter, Progress};
use autosplats_formats::{ReadOptions, read_marked};
use autosplats_sources::Source;
use eframe::egui;

use crate::session::document::{Bits, LayerTree};
use crate::session::trees::TreeOpener;
use crate::session::{FirstLook, Input, SharedViewFrame, TreeOptions, ViewFrame};
use crate::threads::spawn;

/// Largest number of points shown before a file is read to its end.
const PREVIEW_POINTS: usize = 4_000_000;
/// Time between two checks of a watched file. The file is read again when two successive checks see the same change.
const WATCH_INTERVAL: Duration = Duration::from_millis(400);

/// Identifies a reading job.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct JobId(u64);

/// What happened to a job.
pub(crate) enum JobNews {
    /// Part of the points, shown until all have arrived.
    Preview(Arc<PointCloud>, FirstLook),
    /// All points, the reader's notes, and the points to hide.
    Read(Arc<PointCloud>, FirstLook, Vec<String>, Bits),
    /// An octree, of which the coarsest points are read, and the reader's notes.
    Opened(LayerTree, Arc<PointCloud>, FirstLook, Vec<String>),
    /// Why reading failed.
    Failed(String),
    /// The job was cancelled.
    Cancelled,
}

/// A job that reads an input.
pub(crate) struct Job {
    pub(crate) id: JobId,
    pub(crate) input: Input,
    state: Arc<State>,
}

/// State shared by the reader and the window.
#[derive(Default)]
struct State {
    /// Progress, 0 to 1, as the bits of an `f32`.
    done: AtomicU32,
    cancelled: AtomicBool,
}

impl Job {
    /// Progress, 0 to 1.
    pub(crate) fn fraction(&self) -> f32 {
        f32::from_bits(self.state.done.load(Ordering::Relaxed))
    }

    /// Cancels the job; the reader stops at its next check.
    pub(crate) fn cancel(&self) {
        self.state.cancelled.store(true, Ordering::Relaxed);
    }
}

/// Reads inputs one after the other, since each is read by all cores.
pub(crate) struct Loader {
    context: egui::Context,
    /// The shape and the up axis of the window's picture.
    pub(crate) frame: SharedViewFrame,
    orders: Sender<Order>,
    receiver: Receiver<(JobId, JobNews)>,
    changes: (Sender<PathBuf>, Receiver<PathBuf>),
    jobs: Vec<Job>,
    next: u64,
}

struct Order {
    id: JobId,
    input: Input,
    state: Arc<State>,
}

impl Loader {
    /// Starts the reading thread. `context` is asked for a repaint with each piece of news.
    pub(crate) fn start(trees: &TreeOptions, context: egui::Context) -> Self {
        let mut opener = TreeOpener::new(trees);
        let (orders, queue) = channel::<Order>();
        let (sender, receiver) = channel();
        let asked = context.clone();
        let frame = SharedViewFrame::new(ViewFrame { aspect: 1.5, up: None });
        let known = frame.clone();
        spawn("read", move || {
            for order in queue {
                let work = std::panic::AssertUnwindSafe(|| read(&order, &mut opener, &known, &sender, &asked));
                let read = std::panic::catch_unwind(work);
                // A panic in one file must not stop the following files.
                let news = read.unwrap_or_else(|_| {
                    JobNews::Failed(format!("{}: reading failed, which is a bug in this program", order.input.name))
                });
                let _ = sender.send((order.id, news));
                asked.request_repaint();
            }
        });
        Self { context, frame, orders, receiver, changes: channel(), jobs: Vec::new(), next: 0 }
    }

    pub(crate) fn context(&self) -> &egui::Context {
        &self.context
    }

    /// Queues an input and returns the number of its job.
    pub(crate) fn read(&mut self, input: Input) -> JobId {
        self.next += 1;
        let id = JobId(self.next);
        let state = Arc::new(State::default());
        self.jobs.push(Job { id, input: input.clone(), state: Arc::clone(&state) });
        let _ = self.orders.send(Order { id, input, state });
        id
    }

    /// Jobs in progress and waiting, in order.
    pub(crate) fn jobs(&self) -> &[Job] {
        &self.jobs
    }

    pub(crate) fn cancel(&self, id: JobId) {
        self.jobs.iter().filter(|job| job.id == id).for_each(Job::cancel);
    }

    pub(crate) fn cancel_all(&self) {
        self.jobs.iter().for_each(Job::cancel);
    }

    /// The news since the last call. Jobs that have ended are dropped, so each one's last news is returned once.
    pub(crate) fn news(&mut self) -> Vec<(Input, JobId, JobNews)> {
        let news: Vec<_> = self.receiver.try_iter().collect();
        let mut told = Vec::new();
        for (id, news) in news {
            let Some(at) = self.jobs.iter().position(|job| job.id == id) else { continue };
            let input = self.jobs[at].input.clone();
            let cancelled = self.jobs[at].state.cancelled.load(Ordering::Relaxed);
            if !matches!(news, JobNews::Preview(..)) {
                self.jobs.remove(at);
            }
            // A job that finished before the reader saw the cancellation counts as cancelled.
            match news {
                JobNews::Preview(..) if cancelled => {}
                JobNews::Read(..) | JobNews::Opened(..) if cancelled => told.push((input, id, JobNews::Cancelled)),
                news => told.push((input, id, news)),
            }
        }
        told
    }

    /// Watches a file for changes until the returned value is dropped.
    pub(crate) fn watch(&self, path: PathBuf) -> Watch {
        let alive = Arc::new(());
        let watched = Arc::downgrade(&alive);
        let (sender, context) = (self.changes.0.clone(), self.context.clone());
        spawn("watch", move || {
            let stamp = || std::fs::metadata(&path).ok().map(|data| (data.modified().ok(), data.len()));
            let mut known = stamp();
            let mut pending = None;
            while watched.upgrade().is_some() {
                std::thread::sleep(WATCH_INTERVAL);
                let now = stamp();
                if now == known || now.is_none() {
                    pending = None;
                } else if pending != Some(now) {
                    // The file may still be written; the next check decides.
                    pending = Some(now);
                } else {
                    known = now;
                    pending = None;
                    let _ = sender.send(path.clone());
                    context.request_repaint();
                }
            }
        });
        Watch { _alive: alive }
    }

    /// Files that have changed since the last call.
    pub(crate) fn changed(&self) -> impl Iterator<Item = PathBuf> + '_ {
        self.changes.1.try_iter()
    }
}

/// Keeps a file watched while alive.
pub(crate) struct Watch {
    _alive: Arc<()>,
}

/// How the window reads an input: with all digits, for export, and without noise unless the user has said otherwise.
pub(crate) fn read_options(input: &Input) -> ReadOptions {
    let keep = input.options.keep.clone().or_else(|| Some(PointFilter::usual()));
    ReadOptions { exact: true, keep, ..input.options.clone() }
}

fn read(
    order: &Order,
    opener: &mut TreeOpener,
    frame: &SharedViewFrame,
    sender: &Sender<(JobId, JobNews)>,
    context: &egui::Context,
) -> JobNews {
    if order.state.cancelled.load(Ordering::Relaxed) {
        return JobNews::Cancelled;
    }
    let follower = Follower { order, frame, sender, context, notes: Mutex::default(), preview: Mutex::default() };
    let options = read_options(&order.input);
    match opener.open(&order.input, &options, &follower) {
        Ok(None) => {}
        Ok(Some(open)) => {
            let notes = follower.notes.into_inner().unwrap_or_else(PoisonError::into_inner);
            let glance = FirstLook::of(&order.input, &open.sample, &Bits::default(), frame.get());
            let (tree, cloud) = open.coarsest();
            return JobNews::Opened(tree, cloud, glance, notes);
        }
        Err(None) => return JobNews::Cancelled,
        Err(Some(why)) => return JobNews::Failed(why),
    }
    let read = match &order.input.source {
        // What is left out is hidden, so that an export of the whole file still has it.
        Source::File(path) => read_marked(path, &options, &follower),
        source => source.read(&options, &follower).map(|cloud| (cloud, LeftOut::default())),
    };
    match read {
        Ok((cloud, _)) if cloud.is_empty() => {
            JobNews::Failed(format!("{}: there are no points in it", order.input.name))
        }
        Ok((cloud, left)) => {
            let hidden = if left.count() == 0 { Bits::default() } else { Bits::from_fn(cloud.len(), |i| left.has(i)) };
            let notes = follower.notes.into_inner().unwrap_or_else(PoisonError::into_inner);
            let cloud = Arc::new(cloud);
            let glance = FirstLook::of(&order.input, &cloud, &hidden, frame.get());
            JobNews::Read(cloud, glance, notes, hidden)
        }
        Err(Error::Cancelled) => JobNews::Cancelled,
        Err(error) => JobNews::Failed(error.to_string()),
    }
}

/// Whether a progress bar 100 pixels long moves: it needs 100 repaints.
pub(super) fn moves_bar(before: f32, now: f32) -> bool {
    (100.0 * before) as u32 != (100.0 * now) as u32
}

/// Receives progress, notes and points from a reader.
struct Follower<'a> {
    order: &'a Order,
    frame: &'a SharedViewFrame,
    sender: &'a Sender<(JobId, JobNews)>,
    context: &'a egui::Context,
    notes: Mutex<Vec<String>>,
    preview: Mutex<Preview>,
}

/// The points read so far.
#[derive(Default)]
struct Preview {
    parts: Vec<PointCloud>,
    /// Number of points in `parts`.
    points: usize,
    /// Number of points shown last.
    shown: usize,
    /// Keeps one of `step` points.
    step: usize,
}

impl Preview {
    /// Adds points. Returns all points so far once there are 1.5 times as many as shown last, so that merging costs no
    /// more than reading.
    fn add(&mut self, mut points: PointCloud) -> Option<PointCloud> {
        self.step = self.step.max(1);
        let step = self.step;
        points.retain(|index| index % step == 0);
        self.points += points.len();
        self.parts.push(points);
        if self.points > PREVIEW_POINTS {
            self.step *= 2;
            self.parts.iter_mut().for_each(|part| part.retain(|index| index % 2 == 0));
            self.points = self.parts.iter().map(PointCloud::len).sum();
            self.shown /= 2;
        }
        if self.points * 2 < self.shown * 3 {
            return None;
        }
        self.shown = self.points;
        let whole = PointCloud::merge(
            std::mem::take(&mut self.parts).into_iter().map(|part| (part, DMat4::IDENTITY)).collect(),
        );
        self.parts.push(whole.clone());
        Some(whole)
    }
}

impl Progress for Follower<'_> {
    fn report(&self, fraction: f32) {
        let done = fraction.clamp(0.0, 1.0);
        let before = f32::from_bits(self.order.state.done.swap(done.to_bits(), Ordering::Relaxed));
        if moves_bar(before, done) {
            self.context.request_repaint();
        }
    }

    fn cancelled(&self) -> bool {
        self.order.state.cancelled.load(Ordering::Relaxed)
    }

    fn note(&self, note: &str) {
        self.notes.lock().unwrap_or_else(PoisonError::into_inner).push(note.into());
    }

    fn wants_chunks(&self) -> bool {
        true
    }

    fn chunk(&self, points: PointCloud) {
        let mut preview = self.preview.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(cloud) = preview.add(points) {
            let cloud = Arc::new(cloud);
            let glance = FirstLook::of(&self.order.input, &cloud, &Bits::default(), self.frame.get());
            let _ = self.sender.send((self.order.id, JobNews::Preview(cloud, glance)));
            self.context.request_repaint();
        }
    }
}

#[cfg(test)]
mod tests;
