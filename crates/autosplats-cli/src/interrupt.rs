//! Ctrl-C ends the program at once. If a file is being written, the end waits until its temporary file is removed. Work
//! without an end of its own [finishes](end_gently) at the first Ctrl-C.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::exit::Exit;

static REQUESTED: AtomicBool = AtomicBool::new(false);
static GENTLY: AtomicBool = AtomicBool::new(false);
static ENDING: AtomicBool = AtomicBool::new(false);
static WRITING: Mutex<()> = Mutex::new(());

/// Installs the handler. Where none can be installed, as in some containers, the system's default ends the program.
pub(crate) fn install() {
    let _ = ctrlc::set_handler(|| {
        if GENTLY.load(Ordering::SeqCst) && !ENDING.swap(true, Ordering::SeqCst) {
            return;
        }
        REQUESTED.store(true, Ordering::SeqCst);
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
    GENTLY.store(true, Ordering::SeqCst);
}

/// Whether the work has been asked to finish.
pub(crate) fn ending() -> bool {
    ENDING.load(Ordering::SeqCst)
}

/// Whether the program has been asked to end at once.
pub(crate) fn requested() -> bool {
    REQUESTED.load(Ordering::SeqCst)
}

/// Lock that is held while a temporary file exists.
pub(crate) fn writing() -> MutexGuard<'static, ()> {
    WRITING.lock().unwrap_or_else(PoisonError::into_inner)
}
