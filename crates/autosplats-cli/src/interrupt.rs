//! Requests to end a command early, such as Ctrl-C.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex};

use autosplats_cloud::{Progress, lock};

/// A request to end a command. Clones are the same request.
///
/// A request holds until the command that runs ends, or the next one if none runs. The command stops at the next chance
/// and removes its temporary files. Work without an end of its own, such as pictures of live input, finishes what it
/// has at the first request, and stops at the second.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<State>);

#[derive(Debug, Default)]
struct State {
    end_now: AtomicBool,
    finish_first: AtomicBool,
    finishing: AtomicBool,
    /// Whether somebody says why the command ends, which nobody else may add to.
    is_told: AtomicBool,
    /// Gets a message when the work is asked to finish.
    to_wake: Mutex<Option<Sender<()>>>,
}

impl Interrupt {
    /// Asks the command to end. Returns false if the work finishes what it has, and true if it stops.
    pub fn request(&self) -> bool {
        if self.finishes() {
            return false;
        }
        self.0.end_now.store(true, Ordering::SeqCst);
        true
    }

    /// Asks the command to end, and to leave the last message to the caller. `None` if the work finishes what it has,
    /// false if the command has failed and prints why.
    pub(crate) fn end(&self) -> Option<bool> {
        if self.finishes() {
            return None;
        }
        // In this order, so that the command does not tell of the request.
        let is_first = self.tell_end();
        self.0.end_now.store(true, Ordering::SeqCst);
        Some(is_first)
    }

    /// Asks the work to finish what it has. False if it cannot, or has been asked.
    fn finishes(&self) -> bool {
        if !self.0.finish_first.load(Ordering::SeqCst) || self.0.finishing.swap(true, Ordering::SeqCst) {
            return false;
        }
        if let Some(sender) = lock(&self.0.to_wake).take() {
            // The work may have ended.
            let _ = sender.send(());
        }
        true
    }

    /// Whether the caller is the first who says why the command ends. Nobody else prints anything from then on.
    pub(crate) fn tell_end(&self) -> bool {
        !self.0.is_told.swap(true, Ordering::SeqCst)
    }

    /// Whether the last message has been printed, or is about to be.
    pub(crate) fn is_told(&self) -> bool {
        self.0.is_told.load(Ordering::SeqCst)
    }

    /// Forgets all requests, as a command ends.
    pub(crate) fn clear(&self) {
        let State { end_now, finish_first, finishing, is_told, to_wake } = &*self.0;
        [end_now, finish_first, finishing, is_told].into_iter().for_each(|flag| flag.store(false, Ordering::SeqCst));
        *lock(to_wake) = None;
    }

    /// Makes the next request only ask the work to [finish](Self::ending).
    pub(crate) fn end_gently(&self) {
        self.0.finish_first.store(true, Ordering::SeqCst);
    }

    /// Like [`end_gently`](Self::end_gently), of work that waits for a message.
    #[cfg(feature = "viewer")]
    pub(crate) fn end_gently_by(&self, sender: Sender<()>) {
        *lock(&self.0.to_wake) = Some(sender);
        self.end_gently();
    }

    /// Whether the work has been asked to finish.
    pub(crate) fn ending(&self) -> bool {
        self.0.finishing.load(Ordering::SeqCst)
    }

    /// Whether the command has been asked to end at once.
    pub(crate) fn requested(&self) -> bool {
        self.0.end_now.load(Ordering::SeqCst)
    }
}

/// Of work that shows no progress.
impl Progress for Interrupt {
    fn report(&self, _fraction: f32) {}

    fn cancelled(&self) -> bool {
        self.requested()
    }
}
