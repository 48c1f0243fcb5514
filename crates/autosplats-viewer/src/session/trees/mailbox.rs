//! What the window and the thread that loads nodes share.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use autosplats::cloud::Progress;
use eframe::egui;

use super::{ShownNodes, TreeStatus, Wish};

/// Largest number of notes that may wait for the window.
const MOST_NOTES: usize = 20;

/// Time that a status waits, so that numbers that grow do not keep the window busy.
const STATUS_WAIT: Duration = Duration::from_millis(100);

/// Time that a wish has for its first node while newer ones wait.
const PATIENCE: Duration = Duration::from_secs(3);

/// A picture that needs all of its nodes.
pub(super) struct Order {
    pub(super) wish: Wish,
    pub(super) reply: SyncSender<Result<Vec<ShownNodes>, String>>,
}

/// The next work of the thread.
pub(super) enum Work {
    Wish(Arc<Wish>),
    Order(Order),
}

#[derive(Default)]
struct Mailbox {
    /// The newest wish, and its number.
    wish: Option<Arc<Wish>>,
    number: u64,
    /// The last wish whose work has ended.
    ended: u64,
    orders: VecDeque<Order>,
    /// The newest nodes of each layer that the window has not taken.
    nodes: Vec<ShownNodes>,
    /// Notes, and errors.
    told: Vec<Result<String, String>>,
    status: Option<TreeStatus>,
    closed: bool,
}

pub(super) struct Shared {
    post: Mutex<Mailbox>,
    changed: Condvar,
    context: egui::Context,
}

impl Shared {
    pub(super) fn new(context: egui::Context) -> Self {
        Self { post: Mutex::default(), changed: Condvar::new(), context }
    }

    fn lock(&self) -> MutexGuard<'_, Mailbox> {
        self.post.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Replaces the wish.
    pub(super) fn wish(&self, wish: Wish) {
        let mut post = self.lock();
        let known = post.wish.as_deref();
        if known.map_or(wish.trees.is_empty(), |known| *known == wish) {
            return;
        }
        if !wish.trees.iter().any(|tree| tree.visible) {
            post.status = None;
        }
        post.wish = Some(Arc::new(wish));
        post.number += 1;
        drop(post);
        self.changed.notify_one();
    }

    /// Waits for the nodes of a picture.
    pub(super) fn order(&self, wish: Wish) -> Result<Vec<ShownNodes>, String> {
        let (reply, answer) = sync_channel(1);
        self.lock().orders.push_back(Order { wish, reply });
        self.changed.notify_one();
        answer.recv().unwrap_or_else(|_| Err("cancelled".into()))
    }

    /// Waits for work: an order, or another wish than number `seen`, or the same again at some time. `None` once the
    /// window is closed.
    pub(super) fn next(&self, seen: &mut u64, again: Option<Instant>) -> Option<Work> {
        let mut post = self.lock();
        post.ended = *seen;
        loop {
            let is_due = again.is_some_and(|again| Instant::now() >= again);
            if post.closed {
                post.orders.clear();
                return None;
            }
            if let Some(order) = post.orders.pop_front() {
                return Some(Work::Order(order));
            }
            if let Some(wish) = post.wish.clone().filter(|_| post.number != *seen || is_due) {
                *seen = post.number;
                return Some(Work::Wish(wish));
            }
            let left = again.map(|again| again.saturating_duration_since(Instant::now()));
            post = match left {
                Some(left) => self.changed.wait_timeout(post, left).unwrap_or_else(PoisonError::into_inner).0,
                None => self.changed.wait(post).unwrap_or_else(PoisonError::into_inner),
            };
        }
    }

    /// Hands over nodes for layers.
    pub(super) fn show(&self, nodes: Vec<ShownNodes>) {
        let mut post = self.lock();
        post.nodes.retain(|(layer, ..)| nodes.iter().all(|(newer, ..)| newer != layer));
        post.nodes.extend(nodes);
        drop(post);
        self.context.request_repaint();
    }

    pub(super) fn set_status(&self, status: TreeStatus) {
        let mut post = self.lock();
        if post.wish.as_ref().is_some_and(|wish| wish.trees.iter().any(|tree| tree.visible)) {
            let before = post.status.replace(status);
            drop(post);
            if before != Some(status) {
                self.context.request_repaint_after(STATUS_WAIT);
            }
        }
    }

    pub(super) fn status(&self) -> Option<TreeStatus> {
        self.lock().status
    }

    /// Tells a note, or an error.
    pub(super) fn tell(&self, told: Result<String, String>) {
        let mut post = self.lock();
        // A window that is not drawn takes none.
        if post.told.len() < MOST_NOTES && !post.told.contains(&told) {
            post.told.push(told);
        }
        drop(post);
        self.context.request_repaint();
    }

    /// The nodes and what is told since the last call.
    pub(super) fn news(&self) -> (Vec<ShownNodes>, Vec<Result<String, String>>) {
        let mut post = self.lock();
        (std::mem::take(&mut post.nodes), std::mem::take(&mut post.told))
    }

    pub(super) fn close(&self) {
        self.lock().closed = true;
        self.changed.notify_one();
    }

    #[cfg(test)]
    pub(super) fn is_idle(&self) -> bool {
        let post = self.lock();
        let at_rest = post.wish.as_ref().is_none_or(|wish| wish.sight.moving.is_none());
        at_rest && post.ended == post.number && post.nodes.is_empty() && post.orders.is_empty()
    }
}

/// Follows the reading for a wish, and cancels it for a newer one: not before a node has come, so that all wishes
/// together get on, unless nobody answers.
pub(super) struct Follower<'a> {
    shared: &'a Shared,
    started: Instant,
    /// Number of the wish; `None` for an order, which only a closed window cancels.
    number: Option<u64>,
    has_come: AtomicBool,
}

impl<'a> Follower<'a> {
    pub(super) fn new(shared: &'a Shared, number: Option<u64>) -> Self {
        Self { shared, started: Instant::now(), number, has_come: AtomicBool::new(false) }
    }

    /// Notes that something has come.
    pub(super) fn come(&self) {
        self.has_come.store(true, Ordering::Relaxed);
    }
}

impl Progress for Follower<'_> {
    fn report(&self, _fraction: f32) {}

    fn cancelled(&self) -> bool {
        let post = self.shared.lock();
        let is_old = self.number.is_some_and(|number| number != post.number) || !post.orders.is_empty();
        let has_had_time = self.has_come.load(Ordering::Relaxed) || self.started.elapsed() > PATIENCE;
        post.closed || is_old && self.number.is_some() && has_had_time
    }

    fn note(&self, note: &str) {
        self.shared.tell(Ok(note.into()));
    }
}
