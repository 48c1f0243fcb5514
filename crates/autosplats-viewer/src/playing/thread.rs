//! Reads what is played, beside the window.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use autosplats::cloud::{Error, PointCloud, Progress, ReadOptions, Statistics, Timeline};
use eframe::egui;

use crate::loading::Input;

/// How long a live stream may keep silent before it is asked whether it is still wanted.
const PATIENCE: Duration = Duration::from_millis(100);

/// Notes that wait to be told.
const MOST_NOTES: usize = 20;

/// What has come since it was asked last.
#[derive(Default)]
pub(crate) struct News {
    /// The newest points; older ones that nobody took are gone.
    pub(crate) cloud: Option<Arc<PointCloud>>,
    /// What is to be told.
    pub(crate) notes: Vec<String>,
    /// That there will be no more, and what went wrong if something did.
    pub(crate) ending: Option<Result<(), String>>,
}

/// What window and thread share.
#[derive(Default)]
struct Post {
    news: News,
    /// Once it is open: when its frames happen, or `None` if it is live.
    timeline: Option<Option<Arc<Timeline>>>,
    statistics: Statistics,
    wanted: usize,
    paused: bool,
    closed: bool,
}

#[derive(Default)]
struct Shared {
    post: Mutex<Post>,
    changed: Condvar,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Post> {
        self.post.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The window's end of what is played.
pub(crate) struct StreamThread {
    shared: Arc<Shared>,
}

impl StreamThread {
    /// Begins to open an input and reads its first frame; `context` is asked to draw again with each piece of news.
    pub(crate) fn start(input: Input, context: egui::Context) -> Self {
        let shared = Arc::new(Shared::default());
        let theirs = Arc::clone(&shared);
        crate::threads::spawn("play", move || {
            let work = std::panic::AssertUnwindSafe(|| run(&input, &theirs, &context));
            let ending = match std::panic::catch_unwind(work) {
                Ok(Ok(())) => Ok(()),
                Ok(Err(Error::Cancelled)) => return,
                Ok(Err(error)) => Err(error.to_string()),
                Err(_) => Err(format!("{}: playing it failed, which is a bug of this program", input.name)),
            };
            theirs.lock().news.ending = Some(ending);
            context.request_repaint();
        });
        Self { shared }
    }

    /// Asks for a frame of the timeline.
    pub(crate) fn want(&self, frame: usize) {
        let mut post = self.shared.lock();
        if post.wanted != frame {
            post.wanted = frame;
            drop(post);
            self.shared.changed.notify_one();
        }
    }

    /// Whether live points that come are passed over for now.
    pub(crate) fn pause(&self, paused: bool) {
        self.shared.lock().paused = paused;
    }

    /// Once it is open: when its frames happen, or `None` if it is live.
    pub(crate) fn timeline(&self) -> Option<Option<Arc<Timeline>>> {
        self.shared.lock().timeline.clone()
    }

    /// What became of the updates so far.
    pub(crate) fn statistics(&self) -> Statistics {
        self.shared.lock().statistics.clone()
    }

    /// What has come since.
    pub(crate) fn news(&self) -> News {
        std::mem::take(&mut self.shared.lock().news)
    }
}

impl Drop for StreamThread {
    fn drop(&mut self) {
        self.shared.lock().closed = true;
        self.shared.changed.notify_one();
    }
}

/// Listens to a reader.
struct Follower<'a>(&'a Shared);

impl Progress for Follower<'_> {
    fn report(&self, _fraction: f32) {}

    fn cancelled(&self) -> bool {
        self.0.lock().closed
    }

    fn note(&self, note: &str) {
        let notes = &mut self.0.lock().news.notes;
        // A window that is not drawn takes none of them.
        if notes.len() < MOST_NOTES && notes.iter().all(|known| known != note) {
            notes.push(note.into());
        }
    }
}

fn run(input: &Input, shared: &Shared, context: &egui::Context) -> Result<(), Error> {
    let follower = Follower(shared);
    let options = ReadOptions { exact: true, ..input.options.clone() };
    let mut player = input.source.play(&input.play, &options, &follower)?;
    let timeline = player.stream().timeline().cloned().map(Arc::new);
    shared.lock().timeline = Some(timeline.clone());
    let mut shown = None;
    let mut any = false;
    loop {
        let wanted = {
            let mut post = shared.lock();
            while !post.closed && timeline.is_some() && shown == Some(post.wanted) {
                post = shared.changed.wait(post).unwrap_or_else(PoisonError::into_inner);
            }
            if post.closed {
                return Ok(());
            }
            post.wanted
        };
        let cloud = if timeline.is_some() {
            shown = Some(wanted);
            Some(player.frame(wanted, &follower)?)
        } else {
            match player.next(PATIENCE, &follower) {
                Err(Error::NoFrames { .. }) if any => return Ok(()),
                next => next?,
            }
        };
        let mut post = shared.lock();
        let news = cloud.filter(|_| timeline.is_some() || !post.paused);
        let statistics = player.stream().statistics();
        let changed = news.is_some() || statistics != post.statistics;
        post.statistics = statistics;
        if news.is_some() {
            any = true;
            post.news.cloud = news;
        }
        drop(post);
        if changed {
            context.request_repaint();
        }
    }
}
