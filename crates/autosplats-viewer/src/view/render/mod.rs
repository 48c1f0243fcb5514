//! The thread that renders pictures, so that the window never waits for one.
//!
//! # How it works
//! The window posts what it wants to see. Only the newest wish is kept: a slow picture is followed by the latest wish,
//! never by a queue. [Tasks](Task) that must be done, such as finding the point under the cursor, run in order before
//! the next picture. Results arrive as [`Answer`]s, each with a request to repaint the window.
//!
//! Where the device of the window renders the pictures too, they stay on it (`window_device`).
//!
//! While the view moves, pictures are rendered smaller, and of fewer points if need be, to meet their time limit
//! (`pace`). A whole picture in work is given up when the view moves. Once nothing more is requested, the picture at
//! rest is rendered again, supersampled.

mod chosen;
mod depths;
mod exposure;
mod pace;
mod task;
mod thread;
mod window_device;

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;

use autosplats::cloud::Axes;
use autosplats::{AdapterSummary, Backend, Camera, Counts, Settings, Timings};
use eframe::egui;

pub(crate) use self::depths::Depths;
pub(crate) use self::task::{Goal, Outcome, PickHit, Purpose, Task};
pub(crate) use self::window_device::{Pixels, WindowDevice};
use crate::session::{Document, ShownCloud, TreeHandle};

/// A request for a picture.
#[derive(Clone)]
pub(crate) struct RenderRequest {
    pub(crate) document: Document,
    pub(crate) camera: Camera,
    /// Size of the window's picture, pixels.
    pub(crate) size: [u32; 2],
    pub(crate) settings: Settings,
    /// Width of dots to draw instead of splats, pixels; `None` draws splats.
    pub(crate) dots: Option<u32>,
    pub(crate) backend: Backend,
    /// Up axis for heights; `None` guesses it from the points.
    pub(crate) axes: Option<Axes>,
    /// Time limit of the picture, milliseconds; `None` has no limit.
    pub(crate) budget_ms: Option<f64>,
    /// Time limit of pictures while the view moves, milliseconds.
    pub(crate) moving_ms: f64,
}

/// A rendered picture and its data.
pub(crate) struct Picture {
    pub(crate) pixels: Pixels,
    pub(crate) camera: Camera,
    /// Size of the window's picture, pixels; `pixels` may be fewer.
    pub(crate) size: [u32; 2],
    /// Whether the picture has full size and all points.
    pub(crate) whole: bool,
    /// Whether the picture shows dots, which are enlarged without blending.
    pub(crate) dots: bool,
    pub(crate) counts: Counts,
    pub(crate) timings: Timings,
    /// Which setting could not be applied to these points or on this device.
    pub(crate) remark: Option<String>,
    /// Milliseconds from the request to the finished picture.
    pub(crate) milliseconds: f64,
    /// Number of points that a picture can have while the view moves, as far as known.
    pub(crate) most_points: Option<usize>,
    /// Coarse depths. A GPU's pictures have them only at rest.
    pub(crate) depths: Depths,
    pub(crate) shown: Arc<ShownCloud>,
}

/// A message from the thread.
pub(crate) enum Answer {
    Picture(Box<Picture>),
    /// The last picture again, supersampled.
    Finer(Pixels),
    /// There is nothing to show.
    Empty,
    /// The device that renders, once known; `None` is the CPU.
    Device(Option<AdapterSummary>),
    /// Why the requested picture could not be rendered.
    Failed(String),
    /// Result of a task.
    Done(Outcome),
}

/// State shared by the window and the thread.
#[derive(Default)]
struct Mailbox {
    wish: Option<RenderRequest>,
    tasks: VecDeque<Task>,
    /// Whether the thread is working on something.
    working: bool,
    closed: bool,
}

struct Shared {
    post: Mutex<Mailbox>,
    news: Condvar,
    /// The device of the window, once it is known.
    window: OnceLock<WindowDevice>,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Mailbox> {
        self.post.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether the picture in work, requested by `wish`, should be given up: the window has closed, or a picture at
    /// rest is in work and the view moves again. A picture with a time limit is always finished, or none would appear
    /// while the view moves.
    fn should_give_up(&self, wish: &RenderRequest) -> bool {
        let post = self.lock();
        let moves = || post.wish.as_ref().is_some_and(|newer| newer.budget_ms.is_some());
        post.closed || wish.budget_ms.is_none() && moves()
    }

    /// Whether anything is requested, so that a supersampled picture has to wait.
    fn has_news(&self) -> bool {
        let post = self.lock();
        post.closed || post.wish.is_some() || !post.tasks.is_empty()
    }
}

/// The window's side of the render thread.
pub(crate) struct RenderThread {
    shared: Arc<Shared>,
    answers: Receiver<Answer>,
}

impl RenderThread {
    /// Starts the thread. `context` is asked for a repaint with each answer.
    pub(crate) fn start(trees: TreeHandle, context: egui::Context) -> Self {
        let shared = Arc::new(Shared { post: Mutex::default(), news: Condvar::new(), window: OnceLock::new() });
        let (sender, answers) = channel();
        let outbox = Outbox { sender, context };
        let theirs = Arc::clone(&shared);
        crate::threads::spawn("render", move || thread::run(&theirs, &trees, &outbox));
        Self { shared, answers }
    }

    /// Tells the device of the window, before the first request.
    pub(crate) fn share(&self, window: WindowDevice) {
        // A second window would draw pictures from memory.
        let _ = self.shared.window.set(window);
    }

    /// Replaces the request for a picture.
    pub(crate) fn wish(&self, wish: RenderRequest) {
        self.shared.lock().wish = Some(wish);
        self.shared.news.notify_one();
    }

    /// Queues a task.
    pub(crate) fn task(&self, task: Task) {
        self.shared.lock().tasks.push_back(task);
        self.shared.news.notify_one();
    }

    /// Whether everything requested is done. Its answers may still be on their way.
    #[cfg(test)]
    pub(crate) fn is_idle(&self) -> bool {
        let post = self.shared.lock();
        post.wish.is_none() && post.tasks.is_empty() && !post.working
    }

    /// The next answer, if it arrives within `time`.
    pub(crate) fn answer_within(&self, time: Duration) -> Option<Answer> {
        self.answers.recv_timeout(time).ok()
    }

    /// The answers since the last call.
    pub(crate) fn answers(&self) -> impl Iterator<Item = Answer> + '_ {
        self.answers.try_iter()
    }
}

impl Drop for RenderThread {
    fn drop(&mut self) {
        // The picture in work is not awaited, so that the window closes at once.
        self.shared.lock().closed = true;
        self.shared.news.notify_one();
    }
}

/// The thread's side of the channel.
struct Outbox {
    sender: Sender<Answer>,
    context: egui::Context,
}

impl Outbox {
    fn send(&self, answer: Answer) {
        // The receiver is gone once the window is closed.
        let _ = self.sender.send(answer);
        self.context.request_repaint();
    }
}
