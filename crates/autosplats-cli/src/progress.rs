//! Progress on standard error: only on a terminal, and only for tasks of more than half a second.

use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use autosplats_cloud::{Progress, lock};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::console::{Console, shown};

const SHOW_AFTER: Duration = Duration::from_millis(500);
const REDRAW_INTERVAL: Duration = Duration::from_millis(100);
const PROGRESS_STEPS: u64 = 1000;

/// Most notes on one input that plays. A stream of malformed data has no end.
const MAX_NOTES: u64 = 50;

/// A progress bar on the terminal. It disappears when dropped.
pub(crate) struct Bar {
    bar: ProgressBar,
    /// Input that [notes](Progress::note) are about.
    subject: String,
    console: Console,
    /// Sender that ends the drawing thread when dropped.
    done: Option<Sender<()>>,
    drawing: Option<JoinHandle<()>>,
}

impl Bar {
    /// Starts a task that [reports](Progress::report) its progress.
    pub(crate) fn new(task: &str, console: &Console) -> Self {
        Self::start(task, console, "{msg:30!} [{bar:40}] {percent:>3} % {eta:>4}", "=> ")
    }

    /// Starts a task on a file, which its notes then name.
    pub(crate) fn on_file(task: &str, file: &Path, console: &Console) -> Self {
        let name = file.file_name().unwrap_or(file.as_os_str()).to_string_lossy();
        let mut bar = Self::new(&format!("{task} {name}"), console);
        bar.subject = file.display().to_string();
        bar
    }

    /// Starts a task whose notes name `input`.
    pub(crate) fn on_input(task: &str, input: &str, console: &Console) -> Self {
        let mut bar = Self::new(task, console);
        bar.subject = input.into();
        bar
    }

    fn tell(&self, subject: &str, note: &Note) {
        self.bar.suspend(|| match note {
            Note::Note(note) => self.console.note(format_args!("{subject}: {note}")),
            Note::Loss(loss) => self.console.warn(format_args!("{subject}: {loss}")),
        });
    }

    /// Returns one of `parts` equal parts of this task, which reports on an input.
    pub(crate) fn part(&self, parts: usize, subject: &str) -> InputProgress<'_> {
        InputProgress { bar: self, parts, subject: subject.into(), done: AtomicU64::new(0), notes: Mutex::default() }
    }

    /// Starts a task of unknown progress.
    pub(crate) fn spinner(task: &str, console: &Console) -> Self {
        Self::start(task, console, "{msg:30!} {spinner} {elapsed}", "-\\|/ ")
    }

    fn start(task: &str, console: &Console, template: &str, characters: &str) -> Self {
        let bar =
            ProgressBar::with_draw_target(Some(PROGRESS_STEPS), ProgressDrawTarget::hidden()).with_message(shown(task));
        let (subject, console) = (String::new(), console.clone());
        if console.is_quiet() || !console.messages_to_terminal() {
            return Self { bar, subject, console, done: None, drawing: None };
        }
        if let Ok(style) = ProgressStyle::with_template(template) {
            let spinning = template.contains("spinner");
            bar.set_style(if spinning { style.tick_chars(characters) } else { style.progress_chars(characters) });
        }
        let (done, ended) = channel::<()>();
        let shown = bar.clone();
        let drawing = std::thread::spawn(move || {
            let mut wait = SHOW_AFTER;
            while ended.recv_timeout(wait) == Err(RecvTimeoutError::Timeout) {
                if wait == SHOW_AFTER {
                    shown.set_draw_target(ProgressDrawTarget::stderr());
                    wait = REDRAW_INTERVAL;
                }
                shown.tick();
            }
            shown.finish_and_clear();
        });
        Self { bar, subject, console, done: Some(done), drawing: Some(drawing) }
    }
}

impl Progress for Bar {
    fn report(&self, fraction: f32) {
        self.bar.set_position((fraction.clamp(0.0, 1.0) * PROGRESS_STEPS as f32) as u64);
    }

    fn cancelled(&self) -> bool {
        self.console.interrupt().requested()
    }

    fn note(&self, note: &str) {
        self.tell(&self.subject, &Note::Note(note.into()));
    }

    fn loss(&self, loss: &str) {
        self.tell(&self.subject, &Note::Loss(loss.into()));
    }
}

/// What people are told about an input.
enum Note {
    Note(String),
    /// What is lost, which is told in any case.
    Loss(String),
}

/// Notes of a part of a task on one input. The part's progress is ignored.
pub(crate) struct Notes<'a> {
    bar: &'a Bar,
    subject: String,
    told: AtomicU64,
}

impl<'a> Notes<'a> {
    /// Creates the notes on `input`. Only the first `MAX_NOTES` are printed.
    pub(crate) fn new(bar: &'a Bar, input: &str) -> Self {
        Self { bar, subject: input.into(), told: AtomicU64::new(0) }
    }

    /// Prints a note.
    pub(crate) fn tell(&self, note: &str) {
        self.print(Note::Note(note.into()));
    }

    fn print(&self, note: Note) {
        match self.told.fetch_add(1, Ordering::Relaxed) {
            told if told < MAX_NOTES => self.bar.tell(&self.subject, &note),
            MAX_NOTES => {
                self.bar.tell(&self.subject, &Note::Note("further notes on this input are omitted".into()));
            }
            _ => {}
        }
    }
}

impl Progress for Notes<'_> {
    fn report(&self, _fraction: f32) {}

    fn cancelled(&self) -> bool {
        self.bar.cancelled()
    }

    fn note(&self, note: &str) {
        self.tell(note);
    }

    fn loss(&self, loss: &str) {
        self.print(Note::Loss(loss.into()));
    }
}

/// Progress of one of several parallel parts of a task, on one bar.
pub(crate) struct InputProgress<'a> {
    bar: &'a Bar,
    parts: usize,
    subject: String,
    /// Steps of the bar that this part has added.
    done: AtomicU64,
    /// Notes of this part, printed at its end so that the notes of several parts do not mix.
    notes: Mutex<Vec<Note>>,
}

impl Progress for InputProgress<'_> {
    fn report(&self, fraction: f32) {
        let done = (fraction.clamp(0.0, 1.0) * PROGRESS_STEPS as f32) as u64 / self.parts as u64;
        let before = self.done.fetch_max(done, Ordering::Relaxed);
        self.bar.bar.inc(done.saturating_sub(before));
    }

    fn cancelled(&self) -> bool {
        self.bar.cancelled()
    }

    fn note(&self, note: &str) {
        lock(&self.notes).push(Note::Note(note.into()));
    }

    fn loss(&self, loss: &str) {
        lock(&self.notes).push(Note::Loss(loss.into()));
    }
}

impl Drop for InputProgress<'_> {
    fn drop(&mut self) {
        for note in lock(&self.notes).iter() {
            self.bar.tell(&self.subject, note);
        }
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.done = None;
        if let Some(drawing) = self.drawing.take() {
            let _ = drawing.join();
        }
    }
}
