//! Requests to end a command early, such as Ctrl-C.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use autosplats_cloud::Progress;

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
    write_lock: Mutex<()>,
}

impl Interrupt {
    /// Asks the command to end. Returns false if the work finishes what it has, and true if it stops.
    pub fn request(&self) -> bool {
        if self.0.finish_first.load(Ordering::SeqCst) && !self.0.finishing.swap(true, Ordering::SeqCst) {
            return false;
        }
        self.0.end_now.store(true, Ordering::SeqCst);
        true
    }

    /// Lock that is held while a temporary file exists. A process that holds it can end and leaves no such file.
    pub fn writing(&self) -> MutexGuard<'_, ()> {
        self.0.write_lock.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Forgets all requests, as a command ends.
    pub(crate) fn clear(&self) {
        let State { end_now, finish_first, finishing, .. } = &*self.0;
        [end_now, finish_first, finishing].into_iter().for_each(|flag| flag.store(false, Ordering::SeqCst));
    }

    /// Makes the next request only ask the work to [finish](Self::ending).
    pub(crate) fn end_gently(&self) {
        self.0.finish_first.store(true, Ordering::SeqCst);
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
