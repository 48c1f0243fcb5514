//! Signals that end the process, and the end of a process without memory.
//!
//! # How it works
//!
//! A thread of its own receives the signals. SIGINT, SIGTERM and SIGHUP make it ask the command to end. If the command
//! does not finish what it has, the thread ends the process: it ends ffmpeg, removes the files in the making, prints
//! the one line, and exits. Nothing of that can hold the end up: another thread does it, within a limit. From then on
//! the next signal ends the process in the handler. All other signals whose default is to end the process remove the
//! files in the making first. Signals that are ignored when the program starts, as by nohup, stay ignored.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use autosplats_cloud::abandon_drafts;
use autosplats_output::abandon_films;

use crate::console::Console;
use crate::exit::Exit;

/// Longest time from a request to end until the process has ended.
const END_WITHIN: Duration = Duration::from_secs(1);

/// Signals that end the process of a command.
///
/// # Examples
///
/// ```no_run
/// use autosplats_cli::{Console, Signals, run};
///
/// let console = Console::of_process();
/// let signals = Signals::end_the_process(&console);
/// let code = signals.finish(run(["info", "scene:figure:1K"], &console));
/// ```
#[derive(Debug)]
pub struct Signals {
    /// Whether a signal ends the process.
    end_it: Arc<AtomicBool>,
}

impl Signals {
    /// From now on signals end the process, unless the work finishes what it has. Where they cannot be received, as in
    /// some containers, the system's default ends the process.
    pub fn end_the_process(console: &Console) -> Self {
        let signals = Self { end_it: Arc::default() };
        system::receive(console.clone(), Arc::clone(&signals.end_it));
        signals
    }

    /// Returns the code to exit with, unless a signal ends the process.
    #[must_use]
    pub fn finish(&self, code: u8) -> u8 {
        let begun = Instant::now();
        // The signal's thread ends the process, with the signal's code.
        while self.end_it.load(Ordering::SeqCst) && begun.elapsed() < 2 * END_WITHIN {
            std::thread::sleep(Duration::from_millis(1));
        }
        code
    }
}

/// Asks the command to end, or ends the process. `now` says that the next signal has to end it at once.
fn end(exit: Exit, console: &Console, end_it: &AtomicBool, now: &AtomicBool) {
    // Before the command hears of the request, so that it does not end the process.
    end_it.store(true, Ordering::SeqCst);
    let is_first = console.interrupt().end();
    end_it.store(is_first == Some(true), Ordering::SeqCst);
    let Some(is_first) = is_first else { return };
    now.store(true, Ordering::SeqCst);
    if !is_first {
        // The command has failed and says why. The process ends by itself, unless nobody listens.
        std::thread::sleep(END_WITHIN);
    }
    leave_nothing(console, is_first.then_some(exit));
    system::exit(exit);
}

/// Ends what the process has begun, and says so. Returns after a second at most.
fn leave_nothing(console: &Console, exit: Option<Exit>) {
    let (done, ended) = channel::<()>();
    let console = console.clone();
    let work = move || {
        abandon_films();
        abandon_drafts();
        if let Some(exit) = exit {
            console.ended(exit);
        }
        drop(done);
    };
    if std::thread::Builder::new().spawn(work).is_ok() {
        // It ends as the sender is dropped.
        let _ = ended.recv_timeout(END_WITHIN);
    } else {
        // Without another thread nothing is printed, which might block.
        abandon_films();
        abandon_drafts();
    }
}

/// Ends the process as an allocation of so many bytes has failed: with one line and the exit code 6, and without the
/// files in the making. Allocates nothing.
#[cold]
pub fn out_of_memory(bytes: usize) -> ! {
    end_for_lack(format_args!("not enough memory: {bytes} more bytes cannot be had; free some, or ask for less"))
}

/// Like [`out_of_memory`], as no thread can be started.
#[cold]
pub fn out_of_threads() -> ! {
    end_for_lack(format_args!("no more threads can be started; allow more memory or processes, or set --threads 1"))
}

fn end_for_lack(what: std::fmt::Arguments<'_>) -> ! {
    use std::io::Write as _;
    abandon_films();
    abandon_drafts();
    let mut line = [0; 160];
    let mut rest = &mut line[..];
    let _ = writeln!(rest, "error: {what}");
    let left = rest.len();
    let len = line.len() - left;
    system::print(&line[..len]);
    system::exit(Exit::Memory)
}

#[cfg(unix)]
mod system {
    use std::sync::Arc;
    use std::sync::atomic::AtomicBool;
    use std::sync::mpsc::channel;

    use autosplats_cloud::abandon_drafts;
    use autosplats_output::abandon_films;
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    use signal_hook::consts::{
        SIGABRT, SIGALRM, SIGHUP, SIGINT, SIGPROF, SIGQUIT, SIGTERM, SIGUSR1, SIGUSR2, SIGVTALRM, SIGXCPU, SIGXFSZ,
    };
    use signal_hook::flag::{register, register_conditional_shutdown};
    use signal_hook::iterator::Signals;
    use signal_hook::low_level::{emulate_default_handler, exit as exit_now};

    use crate::console::Console;
    use crate::exit::Exit;

    /// Signals that ask the process to end, and its exit codes.
    const REQUESTS: [(i32, Exit); 3] =
        [(SIGHUP, Exit::HungUp), (SIGINT, Exit::Interrupted), (SIGTERM, Exit::Terminated)];

    /// Signals that end the process as it stands.
    const KILLS: [i32; 8] = [SIGABRT, SIGALRM, SIGPROF, SIGQUIT, SIGUSR1, SIGUSR2, SIGVTALRM, SIGXCPU];

    /// Starts the thread that receives the signals.
    pub(super) fn receive(console: Console, end_it: Arc<AtomicBool>) {
        let (ready, is_ready) = channel::<()>();
        let work = move || {
            let now = Arc::new(AtomicBool::new(false));
            let requests = REQUESTS.into_iter().filter(|(signal, _)| !is_ignored(*signal));
            // Handlers run in the order of their registration.
            for (signal, exit) in requests.clone() {
                let _ = register_conditional_shutdown(signal, exit as i32, Arc::clone(&now));
            }
            // With any handler, writing beyond the limit of a file's size is an error of that write.
            let _ = register(SIGXFSZ, Arc::default());
            let kills = KILLS.into_iter().filter(|&signal| !is_ignored(signal));
            let Ok(mut signals) = Signals::new(requests.map(|(signal, _)| signal).chain(kills)) else { return };
            drop(ready);
            for received in signals.forever() {
                match REQUESTS.iter().find(|(signal, _)| *signal == received) {
                    Some(&(_, exit)) => super::end(exit, &console, &end_it, &now),
                    None => {
                        abandon_films();
                        abandon_drafts();
                        let _ = emulate_default_handler(received);
                    }
                }
            }
        };
        // Without a thread the system's defaults stay.
        if std::thread::Builder::new().name("signals".into()).spawn(work).is_ok() {
            // It ends as the sender is dropped.
            let _ = is_ready.recv();
        }
    }

    /// Whether the process ignores a signal.
    #[allow(unsafe_code, reason = "the system tells it in no other way")]
    fn is_ignored(signal: i32) -> bool {
        let mut action = std::mem::MaybeUninit::<libc::sigaction>::zeroed();
        // SAFETY: no new action is given, so the system only fills in the old one, which is read only if it did.
        unsafe {
            libc::sigaction(signal, std::ptr::null(), action.as_mut_ptr()) == 0
                && action.assume_init().sa_sigaction == libc::SIG_IGN
        }
    }

    /// Ends the process without a look at what its threads do.
    pub(super) fn exit(exit: Exit) -> ! {
        exit_now(exit as i32)
    }

    /// Prints on standard error if that takes it at once, without memory.
    pub(super) fn print(line: &[u8]) {
        let stderr = rustix::stdio::stderr();
        let mut ask = [PollFd::new(&stderr, PollFlags::OUT)];
        let moment = Timespec { tv_sec: 0, tv_nsec: 100_000_000 };
        if poll(&mut ask, Some(&moment)).is_ok_and(|ready| ready > 0) {
            let _ = rustix::io::write(stderr, line);
        }
    }
}

#[cfg(not(unix))]
mod system {
    use std::io::Write as _;
    use std::sync::Arc;
    use std::sync::atomic::AtomicBool;

    use crate::console::Console;
    use crate::exit::Exit;

    pub(super) fn receive(console: Console, end_it: Arc<AtomicBool>) {
        let now = AtomicBool::new(false);
        let _ = ctrlc::set_handler(move || super::end(Exit::Interrupted, &console, &end_it, &now));
    }

    pub(super) fn exit(exit: Exit) -> ! {
        std::process::exit(exit as i32)
    }

    pub(super) fn print(line: &[u8]) {
        let _ = std::io::stderr().write_all(line);
    }
}
