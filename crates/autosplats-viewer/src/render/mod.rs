//! The thread that makes pictures, so that the window never waits for one.
//!
//! # How it works
//! The window posts what it wants to see; only the newest wish is kept, so a slow picture is followed by the one that is
//! wanted then, never by a queue. [Tasks](Task) that have to be done, such as finding the point under the cursor, are done in
//! their order before the next picture. Whatever comes of it arrives as [`Answer`]s, each with a request to draw the window
//! again. While the eye moves, pictures are made smaller, of fewer points if need be, to come in time (`pace`), and a
//! whole one in work is given up. Once nothing more is asked for, the picture at rest is made again, supersampled.

mod depths;
mod pace;
mod task;
mod thread;

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use autosplats::cloud::Axes;
use autosplats::{AdapterSummary, Backend, Camera, Counts, Image, Settings, Timings};
use eframe::egui;

pub(crate) use self::depths::Depths;
pub(crate) use self::task::{Outcome, Purpose, Seen, Task};
use crate::document::{Document, Shown};

/// What the window wants to see.
#[derive(Clone)]
pub(crate) struct Wish {
    pub(crate) document: Document,
    pub(crate) camera: Camera,
    /// Pixels of the window's picture.
    pub(crate) size: [u32; 2],
    pub(crate) settings: Settings,
    /// Dots so many pixels wide in place of splats.
    pub(crate) dots: Option<u32>,
    pub(crate) backend: Backend,
    /// Which way is up, for heights, if it is not to be guessed.
    pub(crate) axes: Option<Axes>,
    /// Milliseconds that a picture may take, as the next one is waited for; `None` takes the time that it takes.
    pub(crate) budget_ms: Option<f64>,
}

/// A picture and what is known of it.
pub(crate) struct Picture {
    pub(crate) image: Arc<Image>,
    pub(crate) camera: Camera,
    /// Pixels of the window's picture, which this one may be smaller than.
    pub(crate) size: [u32; 2],
    /// Whether it is whole: in full size, of all points.
    pub(crate) whole: bool,
    /// Dots are enlarged without blending.
    pub(crate) dots: bool,
    pub(crate) counts: Counts,
    pub(crate) timings: Timings,
    /// What of the look these points or this device cannot have.
    pub(crate) remark: Option<String>,
    /// Milliseconds from the wish to the finished picture.
    pub(crate) milliseconds: f64,
    /// How far away what is seen is; of a GPU's pictures only those at rest have it.
    pub(crate) depths: Depths,
    pub(crate) shown: Arc<Shown>,
}

/// What comes back from the thread.
pub(crate) enum Answer {
    Picture(Box<Picture>),
    /// The last picture once more, finer.
    Finer(Arc<Image>),
    /// There is nothing to show.
    Empty,
    /// The device that pictures are made on, once it is known; `None` is the CPU.
    Device(Option<AdapterSummary>),
    /// Why the picture that was wanted could not be made.
    Failed(String),
    /// What came of a task.
    Done(Outcome),
}

/// What the window and the thread share.
#[derive(Default)]
struct Post {
    wish: Option<Wish>,
    tasks: VecDeque<Task>,
    /// Whether the thread has something in work.
    working: bool,
    closed: bool,
}

struct Shared {
    post: Mutex<Post>,
    news: Condvar,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Post> {
        self.post.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether the picture in work, which is of `wish`, is not worth finishing: the window has closed, or what was at rest
    /// moves again. A picture made on the way is finished, or there would be none as long as the view moves.
    fn is_in_haste(&self, wish: &Wish) -> bool {
        let post = self.lock();
        let moves = || post.wish.as_ref().is_some_and(|newer| newer.budget_ms.is_some());
        post.closed || wish.budget_ms.is_none() && moves()
    }

    /// Whether anything is asked for: a picture that is there already is not worth making finer now.
    fn has_news(&self) -> bool {
        let post = self.lock();
        post.closed || post.wish.is_some() || !post.tasks.is_empty()
    }
}

/// The window's end.
pub(crate) struct RenderThread {
    shared: Arc<Shared>,
    answers: Receiver<Answer>,
}

impl RenderThread {
    /// Starts the thread; `context` is asked to draw again with each answer.
    pub(crate) fn start(context: egui::Context) -> Self {
        let shared = Arc::new(Shared { post: Mutex::default(), news: Condvar::new() });
        let (sender, answers) = channel();
        let outbox = Outbox { sender, context };
        let theirs = Arc::clone(&shared);
        crate::threads::spawn("render", move || thread::run(&theirs, &outbox));
        Self { shared, answers }
    }

    /// Wants to see something else than before.
    pub(crate) fn wish(&self, wish: Wish) {
        self.shared.lock().wish = Some(wish);
        self.shared.news.notify_one();
    }

    /// Has something done.
    pub(crate) fn task(&self, task: Task) {
        self.shared.lock().tasks.push_back(task);
        self.shared.news.notify_one();
    }

    /// Whether everything asked for has been done, whose answers may still be on their way.
    #[cfg(test)]
    pub(crate) fn is_idle(&self) -> bool {
        let post = self.shared.lock();
        post.wish.is_none() && post.tasks.is_empty() && !post.working
    }

    /// The next that comes, if it comes in time.
    pub(crate) fn answer_within(&self, time: Duration) -> Option<Answer> {
        self.answers.recv_timeout(time).ok()
    }

    /// What has come since.
    pub(crate) fn answers(&self) -> impl Iterator<Item = Answer> + '_ {
        self.answers.try_iter()
    }
}

impl Drop for RenderThread {
    fn drop(&mut self) {
        // Nobody waits for the picture in work: closing the window is instant.
        self.shared.lock().closed = true;
        self.shared.news.notify_one();
    }
}

/// The thread's end.
struct Outbox {
    sender: Sender<Answer>,
    context: egui::Context,
}

impl Outbox {
    fn send(&self, answer: Answer) {
        // Nobody listens any more once the window is closed.
        let _ = self.sender.send(answer);
        self.context.request_repaint();
    }
}
