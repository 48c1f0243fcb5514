//! Ctrl-C ends the program at once. If a file is being written, the end waits until its temporary file is removed. Work
//! without an end of its own [finishes](end_gently) at the first Ctrl-C.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::exit::Exit;

static END_NOW: AtomicBool = AtomicBool::new(false);
static FINISH_FIRST: AtomicBool = AtomicBool::new(false);
static FINISHING: AtomicBool = AtomicBool::new(false);
static WRITE_LOCK: Mutex<()> = Mutex::new(());

/// Installs the handler. Where none can be installed, as in some containers, the system's default ends the program.
pub(crate) fn install() {
    let _ = ctrlc::set_handler(|| {
        if FINISH_FIRST.load(Ordering::SeqCst) && !FINISHING.swap(true, Ordering::SeqCst) {
            return;
        }
        END_NOW.store(true, Ordering::SeqCst);
        // The writing thread sees the request, removes its temporary file and releases the lock; nothing is left
        // behind.
        let _nothing_is_being_written = writing();
        // The line feed leaves the cursor's line, where the terminal shows ^C and perhaps a progress bar.
        eprintln!("\nerror: interrupted");
        std::process::exit(Exit::Interrupted as i32);
    });
}

/// Makes the next Ctrl-C only ask the work to [finish](ending). The one after ends the program.
pub(crate) fn end_gently() {
    FINISH_FIRST.store(true, Ordering::SeqCst);
}

/// Whether the work has been asked to finish.
pub(crate) fn ending() -> bool {
    FINISHING.load(Ordering::SeqCst)
}

/// Whether the program has been asked to end at once.
pub(crate) fn requested() -> bool {
    END_NOW.load(Ordering::SeqCst)
}

/// Lock that is held while a temporary file exists.
pub(crate) fn writing() -> MutexGuard<'static, ()> {
    WRITE_LOCK.lock().unwrap_or_else(PoisonError::into_inner)
}
