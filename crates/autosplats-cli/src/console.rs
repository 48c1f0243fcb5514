//! What a command prints to, and what ends it early.

use std::fmt::Display;
use std::io::{ErrorKind, IsTerminal as _, Write, stderr, stdout};
use std::sync::{Arc, Mutex, PoisonError};

use serde::Serialize;

use crate::exit::{Exit, Failure};
use crate::interrupt::Interrupt;

/// What a command prints to, and what ends it early. Clones share both.
///
/// # Examples
///
/// ```
/// use autosplats_cli::{Console, run};
///
/// let console = Console::new(std::io::sink(), std::io::sink());
/// assert_eq!(run(["info", "scene:figure:1K"], &console), 0);
/// assert_eq!(run(["info", "none.ply"], &console), 3);
/// ```
#[derive(Clone)]
pub struct Console {
    streams: Arc<Streams>,
    interrupt: Interrupt,
    /// Whether only errors and losses are printed on the stream for messages.
    quiet: bool,
}

struct Streams {
    data: Mutex<Box<dyn Write + Send>>,
    messages: Mutex<Box<dyn Write + Send>>,
    /// Whether data goes to a terminal, so that text may be styled.
    data_to_terminal: bool,
    /// Whether messages go to the terminal of the process, so that progress can be drawn there.
    messages_to_terminal: bool,
}

impl Console {
    /// A console that prints data and messages for people to these streams.
    pub fn new(data: impl Write + Send + 'static, messages: impl Write + Send + 'static) -> Self {
        let (data, messages) = (Mutex::new(Box::new(data) as _), Mutex::new(Box::new(messages) as _));
        let streams = Streams { data, messages, data_to_terminal: false, messages_to_terminal: false };
        Self { streams: Arc::new(streams), interrupt: Interrupt::default(), quiet: false }
    }

    /// The standard streams of the process. On a terminal, progress is drawn.
    #[must_use]
    pub fn of_process() -> Self {
        let streams = Streams {
            data: Mutex::new(Box::new(stdout())),
            messages: Mutex::new(Box::new(stderr())),
            data_to_terminal: stdout().is_terminal(),
            messages_to_terminal: stderr().is_terminal(),
        };
        Self { streams: Arc::new(streams), interrupt: Interrupt::default(), quiet: false }
    }

    /// The request that ends commands of this console.
    #[must_use]
    pub fn interrupt(&self) -> &Interrupt {
        &self.interrupt
    }

    /// Whether work goes on: the command has not been asked to end.
    pub(crate) fn goes_on(&self) -> impl Fn() -> bool + Sync {
        || !self.interrupt.requested()
    }

    /// The same console; `quiet` leaves out all messages but errors and losses.
    pub(crate) fn quiet(&self, quiet: bool) -> Self {
        Self { quiet: self.quiet || quiet, ..self.clone() }
    }

    pub(crate) fn is_quiet(&self) -> bool {
        self.quiet
    }

    pub(crate) fn data_to_terminal(&self) -> bool {
        self.streams.data_to_terminal
    }

    pub(crate) fn messages_to_terminal(&self) -> bool {
        self.streams.messages_to_terminal
    }

    /// Prints a line of data. A closed pipe is no error.
    pub(crate) fn print_line(&self, line: impl Display) -> Result<(), Failure> {
        self.print(format!("{line}\n"))
    }

    /// Prints one line of JSON.
    pub(crate) fn print_json(&self, value: &impl Serialize) -> Result<(), Failure> {
        self.print_line(json(value)?)
    }

    /// Prints data. A closed pipe is no error.
    pub(crate) fn print(&self, data: impl AsRef<[u8]>) -> Result<(), Failure> {
        match self.streams.data.lock().unwrap_or_else(PoisonError::into_inner).write_all(data.as_ref()) {
            Err(error) if error.kind() != ErrorKind::BrokenPipe => {
                Err(Failure::new(Exit::Output, format!("standard output: {error}")))
            }
            _ => Ok(()),
        }
    }

    /// Writes out what the streams still hold.
    pub(crate) fn flush(&self) {
        for stream in [&self.streams.data, &self.streams.messages] {
            // The command has ended, and nobody is left to tell.
            let _ = stream.lock().unwrap_or_else(PoisonError::into_inner).flush();
        }
    }

    /// Tells people something, unless quiet.
    pub(crate) fn tell(&self, message: impl Display) {
        if !self.quiet {
            self.message(message);
        }
    }

    /// Tells people what they may not expect, unless quiet.
    pub(crate) fn note(&self, note: impl Display) {
        self.tell(format_args!("note: {note}"));
    }

    /// Tells people what their input has lost, also if quiet.
    pub(crate) fn warn(&self, loss: impl Display) {
        self.message(format_args!("warning: {loss}"));
    }

    /// Tells people an error.
    pub(crate) fn error(&self, error: impl Display) {
        self.message(format_args!("error: {error}"));
    }

    /// Tells people why the command ends, unless somebody else does or there is nothing to say.
    pub(crate) fn last_error(&self, error: &str) {
        if self.interrupt.tell_end() && !error.is_empty() {
            self.put(&format!("error: {error}"));
        }
    }

    /// Tells people that a signal ends the process.
    pub(crate) fn ended(&self, exit: Exit) {
        // The line feed leaves the cursor's line, where the terminal shows ^C and perhaps a progress bar.
        let begin = if self.messages_to_terminal() { "\n" } else { "" };
        let what = match exit {
            Exit::HungUp => "hung up",
            Exit::Terminated => "terminated",
            _ => "interrupted",
        };
        self.put(&format!("{begin}error: {what}"));
    }

    /// Tells people something, unless the last message has been printed.
    pub(crate) fn message(&self, message: impl Display) {
        if !self.interrupt.is_told() {
            self.put(&message.to_string());
        }
    }

    fn put(&self, lines: &str) {
        let lines: String = lines.split('\n').map(|line| shown(line) + "\n").collect();
        // A message that cannot be printed cannot be complained about either.
        let _ = self.streams.messages.lock().unwrap_or_else(PoisonError::into_inner).write_all(lines.as_bytes());
    }
}

/// Longest line of a message, in characters. Messages quote names and files, which may be of any length.
const MAX_LINE: usize = 4096;

/// A line for a terminal: characters that act on it, or that cannot be seen, are escaped.
pub(crate) fn shown(line: &str) -> String {
    let mut shown = String::with_capacity(line.len().min(MAX_LINE));
    for (at, c) in line.chars().enumerate() {
        match c {
            _ if at == MAX_LINE => {
                shown.push('…');
                break;
            }
            '\\' | '\'' | '"' => shown.push(c),
            _ => shown.extend(c.escape_debug()),
        }
    }
    shown
}

/// A value in one line of JSON.
pub(crate) fn json(value: &impl Serialize) -> Result<String, Failure> {
    // Only a path that is not UTF-8 can fail here.
    serde_json::to_string(value).map_err(|error| Failure::new(Exit::Output, format!("--json: {error}")))
}
