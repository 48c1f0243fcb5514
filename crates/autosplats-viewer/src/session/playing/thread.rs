//! Reads a playing input on a thread of its own.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use autosplats::cloud::{Error, PointCloud, Progress};
use autosplats_sources::{Statistics, Timeline};
use eframe::egui;

use crate::session::document::Bits;
use crate::session::loading::moves_bar;
use crate::session::{FirstLook, Input, SharedViewFrame, read_options};

/// Longest silence of a live stream before the thread checks whether the stream is still wanted.
const SILENCE_LIMIT: Duration = Duration::from_millis(100);

/// Largest number of notes that may wait for the window.
const MOST_NOTES: usize = 20;

/// The news since the last call.
#[derive(Default)]
pub(crate) struct StreamNews {
    /// The newest points, and their frame if there is a timeline. Older points that nobody took are dropped.
    pub(crate) cloud: Option<(Option<usize>, Arc<PointCloud>)>,
    /// The first look at the first points.
    pub(crate) glance: Option<FirstLook>,
    /// Notes for the user.
    pub(crate) notes: Vec<String>,
    /// The end of the stream, with an error if it failed.
    pub(crate) ending: Option<Result<(), String>>,
}

/// State shared by the window and the thread.
#[derive(Default)]
struct Mailbox {
    news: StreamNews,
    /// `None` until the input is open; then its timeline, or `Some(None)` if it is live.
    timeline: Option<Option<Arc<Timeline>>>,
    statistics: Statistics,
    /// Progress of reading before the first points, 0 to 1.
    read: f32,
    /// Whether there have been points.
    begun: bool,
    /// The frame that the window wants.
    wanted: Option<usize>,
    paused: bool,
    closed: bool,
}

struct Shared {
    post: Mutex<Mailbox>,
    changed: Condvar,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Mailbox> {
        self.post.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The window's side of a playing input.
pub(crate) struct StreamThread {
    shared: Arc<Shared>,
}

impl StreamThread {
    /// Starts to open an input. `context` is asked for a repaint with each piece of news.
    pub(crate) fn start(input: Input, view: SharedViewFrame, context: egui::Context) -> Self {
        Self::begin(input, None, view, Mailbox::default(), context)
    }

    /// Starts to open an input whose points are shown already, as those of `frame` if there is a timeline. The points
    /// stay until another frame is wanted.
    pub(crate) fn go_on(input: Input, frame: Option<usize>, view: SharedViewFrame, context: egui::Context) -> Self {
        Self::begin(input, frame, view, Mailbox { begun: true, ..Mailbox::default() }, context)
    }

    fn begin(input: Input, shown: Option<usize>, view: SharedViewFrame, post: Mailbox, context: egui::Context) -> Self {
        let shared = Arc::new(Shared { post: Mutex::new(post), changed: Condvar::new() });
        let theirs = Arc::clone(&shared);
        crate::threads::spawn("play", move || {
            let work = std::panic::AssertUnwindSafe(|| run(&input, shown, &view, &theirs, &context));
            let ending = match std::panic::catch_unwind(work) {
                Ok(Ok(())) => Ok(()),
                Ok(Err(Error::Cancelled)) => return,
                Ok(Err(error)) => Err(error.to_string()),
                Err(_) => Err(format!("{}: playing failed, which is a bug in this program", input.name)),
            };
            theirs.lock().news.ending = Some(ending);
            context.request_repaint();
        });
        Self { shared }
    }

    /// Requests a frame of the timeline.
    pub(crate) fn want(&self, frame: usize) {
        let mut post = self.shared.lock();
        if post.wanted != Some(frame) {
            post.wanted = Some(frame);
            drop(post);
            self.shared.changed.notify_one();
        }
    }

    /// Sets whether live points are dropped. The first ones are always kept.
    pub(crate) fn pause(&self, paused: bool) {
        self.shared.lock().paused = paused;
    }

    /// `None` until the input is open; then its timeline, or `Some(None)` if it is live.
    pub(crate) fn timeline(&self) -> Option<Option<Arc<Timeline>>> {
        self.shared.lock().timeline.clone()
    }

    /// Progress of reading before the first points, 0 to 1, as far as known.
    pub(crate) fn read(&self) -> f32 {
        self.shared.lock().read
    }

    /// Statistics of the updates so far.
    pub(crate) fn statistics(&self) -> Statistics {
        self.shared.lock().statistics.clone()
    }

    /// The news since the last call.
    pub(crate) fn news(&self) -> StreamNews {
        std::mem::take(&mut self.shared.lock().news)
    }
}

impl Drop for StreamThread {
    fn drop(&mut self) {
        self.shared.lock().closed = true;
        self.shared.changed.notify_one();
    }
}

/// Receives progress and notes from a reader.
struct Follower<'a> {
    shared: &'a Shared,
    context: &'a egui::Context,
}

impl Progress for Follower<'_> {
    fn report(&self, fraction: f32) {
        let mut post = self.shared.lock();
        // Progress is shown only until the first points.
        if post.begun {
            return;
        }
        let fraction = fraction.clamp(0.0, 1.0);
        let before = std::mem::replace(&mut post.read, fraction);
        drop(post);
        if moves_bar(before, fraction) {
            self.context.request_repaint();
        }
    }

    fn cancelled(&self) -> bool {
        self.shared.lock().closed
    }

    fn note(&self, note: &str) {
        let notes = &mut self.shared.lock().news.notes;
        // The number of notes is limited, as a window that is not drawn takes none.
        if notes.len() < MOST_NOTES && notes.iter().all(|known| known != note) {
            notes.push(note.into());
        }
    }
}

fn run(
    input: &Input,
    mut shown: Option<usize>,
    view: &SharedViewFrame,
    shared: &Shared,
    context: &egui::Context,
) -> Result<(), Error> {
    let follower = Follower { shared, context };
    let mut player = input.source.play(&input.play, &read_options(input), &follower)?;
    let timeline = player.stream().timeline().cloned().map(Arc::new);
    {
        let mut post = shared.lock();
        post.timeline = Some(timeline.clone());
        post.read = 0.0;
    }
    // The window requests a frame once it knows the timeline.
    context.request_repaint();
    loop {
        let wanted = {
            let mut post = shared.lock();
            while !post.closed && timeline.is_some() && (post.wanted.is_none() || post.wanted == shown) {
                post = shared.changed.wait(post).unwrap_or_else(PoisonError::into_inner);
            }
            if post.closed {
                return Ok(());
            }
            post.wanted.filter(|_| timeline.is_some())
        };
        let cloud = match wanted {
            Some(frame) => {
                shown = wanted;
                Some(player.frame(frame, &follower)?)
            }
            None => match player.next(SILENCE_LIMIT, &follower) {
                Err(Error::NoFrames { .. }) if shared.lock().begun => return Ok(()),
                next => next?,
            },
        };
        let first = cloud.as_ref().filter(|cloud| cloud.has_finite(1) && !shared.lock().begun);
        let glance = first.map(|cloud| FirstLook::of(input, cloud, &Bits::default(), view.get()));
        let mut post = shared.lock();
        let news = cloud.filter(|_| wanted.is_some() || !post.paused || !post.begun);
        let statistics = player.stream().statistics();
        let changed = news.is_some() || statistics != post.statistics;
        post.statistics = statistics;
        if let Some(cloud) = news {
            post.begun |= cloud.has_finite(1);
            if glance.is_some() {
                post.news.glance = glance;
            }
            post.news.cloud = Some((wanted, cloud));
        }
        drop(post);
        if changed {
            context.request_repaint();
        }
    }
}
