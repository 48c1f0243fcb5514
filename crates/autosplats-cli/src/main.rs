//! The `autosplats` program: its library, the standard streams, signals and memory.

#![warn(clippy::print_stderr, clippy::print_stdout, reason = "they panic where the stream cannot be written")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::process::ExitCode;

use autosplats_cli::{Console, Signals, out_of_memory, out_of_threads, run};
use autosplats_cloud::may_fail;

/// The system's memory. An allocation that fails, and whose caller cannot go on without it, ends the process as an
/// error does.
struct Memory;

#[global_allocator]
static MEMORY: Memory = Memory;

fn main() -> ExitCode {
    silence_drivers();
    end_without_threads();
    let console = Console::of_process();
    let signals = Signals::end_the_process(&console);
    ExitCode::from(signals.finish(run(std::env::args_os().skip(1), &console)))
}

impl Memory {
    /// The memory, if there is some, or if the caller can go on without.
    fn checked(memory: *mut u8, bytes: usize) -> *mut u8 {
        if memory.is_null() && !may_fail() {
            out_of_memory(bytes);
        }
        memory
    }
}

#[allow(unsafe_code, reason = "memory is had in no other way")]
// SAFETY: all calls go to the system's allocator, which keeps the contract.
unsafe impl GlobalAlloc for Memory {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller keeps the contract.
        Self::checked(unsafe { System.alloc(layout) }, layout.size())
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller keeps the contract.
        Self::checked(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: the caller keeps the contract.
        Self::checked(unsafe { System.realloc(memory, layout, size) }, size)
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps the contract.
        unsafe { System.dealloc(memory, layout) }
    }
}

/// Makes the lack of threads an error. The standard library panics where one cannot be started.
fn end_without_threads() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if panic.payload_as_str().is_some_and(|said| said.starts_with("failed to spawn thread")) {
            out_of_threads();
        }
        usual(panic);
    }));
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
