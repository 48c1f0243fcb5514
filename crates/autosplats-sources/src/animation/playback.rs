//! Plays frames in order, and reads the next frame while the last one is shown.

use std::{
    collections::{BTreeSet, VecDeque},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
        mpsc::{Receiver, RecvTimeoutError, sync_channel},
    },
    time::Duration,
};

use autosplats_cloud::{Error, PointCloud, Progress};

use super::frames::Frames;
use crate::{Next, Statistics, Stream, Timeline, Update};

/// Time between two checks for cancellation.
const CHECK_INTERVAL: Duration = Duration::from_millis(20);

/// An [`Animation`](crate::Animation) that is played. While frames follow each other, the next one is read ahead.
///
/// A frame that cannot be read returns an error once, and then [`Next::Nothing`]. The points before it stay.
pub struct Playback {
    frames: Arc<dyn Frames>,
    /// The frame to read next.
    next: usize,
    /// Updates of the last frame that nobody has taken yet.
    ready: VecDeque<Update>,
    ahead: Option<ReadAhead>,
    /// The frame read last.
    last: Option<usize>,
    failed: BTreeSet<usize>,
    statistics: Statistics,
}

impl Playback {
    pub(super) fn new(frames: Arc<dyn Frames>) -> Self {
        let statistics = Statistics::default();
        Self { frames, next: 0, ready: VecDeque::new(), ahead: None, last: None, failed: BTreeSet::new(), statistics }
    }

    /// Reads a frame, or waits for it if it is already being read ahead.
    fn read(&mut self, frame: usize, progress: &dyn Progress) -> Result<Vec<Arc<PointCloud>>, Error> {
        if let Some(ahead) = self.ahead.take_if(|ahead| ahead.frame == frame)
            && let Some(read) = ahead.wait(progress)
        {
            return read;
        }
        // Notes about one frame hold for all, so only the first frame that can be read passes them on.
        self.frames.read(frame, &FrameProgress { progress, notes: self.statistics.taken == 0 })
    }
}

impl Stream for Playback {
    fn timeline(&self) -> Option<&Timeline> {
        Some(self.frames.timeline())
    }

    fn updates_per_frame(&self) -> usize {
        self.frames.channels()
    }

    fn seek(&mut self, frame: usize) {
        self.next = frame;
        self.ready.clear();
        self.ahead.take_if(|ahead| ahead.frame != frame);
    }

    fn next(&mut self, _patience: Duration, progress: &dyn Progress) -> Result<Next, Error> {
        if self.ready.is_empty() {
            let frame = self.next;
            let Some(&stamp) = self.frames.timeline().stamps().get(frame) else { return Ok(Next::End) };
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            let read = self.read(frame, progress);
            if matches!(read, Err(Error::Cancelled)) {
                return Err(Error::Cancelled);
            }
            let in_a_row = self.last.is_some_and(|last| last + 1 == frame);
            self.next = frame + 1;
            self.last = Some(frame);
            match read {
                Ok(clouds) => {
                    let updates = clouds.into_iter().enumerate();
                    self.ready = updates.map(|(channel, cloud)| Update { channel, stamp, cloud }).collect();
                }
                Err(error) => {
                    self.statistics.refused += 1;
                    self.statistics.last_refusal = Some(error.to_string());
                    return if self.failed.insert(frame) { Err(error) } else { Ok(Next::Nothing) };
                }
            }
            // Neighbouring frames are not read ahead while a caller seeks.
            if in_a_row {
                let following = (frame + 1) % self.frames.timeline().len();
                self.ahead = ReadAhead::start(&self.frames, following);
            }
        }
        let Some(update) = self.ready.pop_front() else { return Ok(Next::Nothing) };
        self.statistics.taken += 1;
        Ok(Next::Update(update))
    }

    fn statistics(&self) -> Statistics {
        self.statistics.clone()
    }
}

/// A frame that a thread reads ahead. Dropping `ReadAhead` cancels the thread.
struct ReadAhead {
    frame: usize,
    read: Receiver<Result<Vec<Arc<PointCloud>>, Error>>,
    given_up: Arc<AtomicBool>,
}

impl ReadAhead {
    /// Returns `None` if no thread can be started.
    fn start(frames: &Arc<dyn Frames>, frame: usize) -> Option<Self> {
        let (sender, read) = sync_channel(1);
        let given_up = Arc::new(AtomicBool::new(false));
        let (frames, stop) = (Arc::clone(frames), ReadAheadProgress(Arc::clone(&given_up)));
        let work = move || {
            let _ = sender.send(frames.read(frame, &stop));
        };
        std::thread::Builder::new().name("read ahead".into()).spawn(work).ok()?;
        Some(Self { frame, read, given_up })
    }

    /// Waits for the frame. Returns `None` if the thread has panicked.
    fn wait(self, progress: &dyn Progress) -> Option<Result<Vec<Arc<PointCloud>>, Error>> {
        loop {
            match self.read.recv_timeout(CHECK_INTERVAL) {
                Ok(read) => return Some(read),
                Err(RecvTimeoutError::Timeout) if progress.cancelled() => return Some(Err(Error::Cancelled)),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return None,
            }
        }
    }
}

impl Drop for ReadAhead {
    fn drop(&mut self) {
        self.given_up.store(true, Ordering::Relaxed);
    }
}

/// Progress of a frame that is read ahead: reports go nowhere.
struct ReadAheadProgress(Arc<AtomicBool>);

impl Progress for ReadAheadProgress {
    fn report(&self, _: f32) {}

    fn cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Passes on reports, and notes if `notes` is set, but no previews: the shown points stay until the frame is complete.
struct FrameProgress<'a> {
    progress: &'a dyn Progress,
    notes: bool,
}

impl Progress for FrameProgress<'_> {
    fn report(&self, fraction: f32) {
        self.progress.report(fraction);
    }

    fn cancelled(&self) -> bool {
        self.progress.cancelled()
    }

    fn note(&self, note: &str) {
        if self.notes {
            self.progress.note(note);
        }
    }

    fn loss(&self, loss: &str) {
        if self.notes {
            self.progress.loss(loss);
        }
    }
}
