//! The `autosplats` program: its library, the standard streams and Ctrl-C.

use std::process::ExitCode;

use autosplats_cli::{Console, Exit, run};

fn main() -> ExitCode {
    silence_drivers();
    let console = Console::of_process();
    end_on_interrupt(&console);
    ExitCode::from(run(std::env::args_os().skip(1), &console))
}

/// Makes Ctrl-C end the process at once, unless the work finishes what it has. If a file is being written, the end
/// waits until its temporary file is removed. Where no handler can be installed, as in some containers, the system's
/// default ends the process.
fn end_on_interrupt(console: &Console) {
    let interrupt = console.interrupt().clone();
    let _ = ctrlc::set_handler(move || {
        if interrupt.request() {
            // The writing thread sees the request, removes its temporary file and releases the lock; nothing is left
            // behind.
            let _nothing_is_being_written = interrupt.writing();
            // The line feed leaves the cursor's line, where the terminal shows ^C and perhaps a progress bar.
            eprintln!("\nerror: interrupted");
            std::process::exit(Exit::Interrupted as i32);
        }
    });
}

/// Keeps Mesa's device selection from printing to standard error, where the command's own messages go. Without a
/// session, Mesa cannot ask Wayland for the screen's device and reports that. A choice that the user made stays.
#[allow(unsafe_code, reason = "the environment can be changed in no other way")]
fn silence_drivers() {
    const CHOICE: &str = "NODEVICE_SELECT";
    if cfg!(target_os = "linux") && std::env::var_os("XDG_RUNTIME_DIR").is_none() && std::env::var_os(CHOICE).is_none()
    {
        // SAFETY: this is the first statement of the program, and no other thread exists yet.
        unsafe { std::env::set_var(CHOICE, "1") };
    }
}
