//! Ctrl-C: ends the program at once, unless a file is being written; then as soon as its temporary file is gone. What goes on
//! until somebody ends it [ends gently](end_gently) the first time.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::exit::Exit;

static REQUESTED: AtomicBool = AtomicBool::new(false);
static GENTLY: AtomicBool = AtomicBool::new(false);
static ENDING: AtomicBool = AtomicBool::new(false);
static WRITING: Mutex<()> = Mutex::new(());

/// Installs the handler. Without one (some containers forbid it) Ctrl-C ends the program the system's way.
pub(crate) fn install() {
    let _ = ctrlc::set_handler(|| {
        if GENTLY.load(Ordering::SeqCst) && !ENDING.swap(true, Ordering::SeqCst) {
            return;
        }
        REQUESTED.store(true, Ordering::SeqCst);
        // Whoever writes sees the request, removes its file and lets go; then nothing is left behind.
        let _nothing_is_being_written = writing();
        // A line feed, as the terminal shows ^C and perhaps a progress bar on the cursor's line.
        eprintln!("\nerror: interrupted");
        std::process::exit(Exit::Interrupted as i32);
    });
}

/// From now on the first Ctrl-C only asks the work to come to an [end](ending), and the second ends the program.
pub(crate) fn end_gently() {
    GENTLY.store(true, Ordering::SeqCst);
}

/// Whether the work is to come to its end.
pub(crate) fn ending() -> bool {
    ENDING.load(Ordering::SeqCst)
}

/// Whether the program is to end at once.
pub(crate) fn requested() -> bool {
    REQUESTED.load(Ordering::SeqCst)
}

/// Held while a temporary file exists.
pub(crate) fn writing() -> MutexGuard<'static, ()> {
    WRITING.lock().unwrap_or_else(PoisonError::into_inner)
}
