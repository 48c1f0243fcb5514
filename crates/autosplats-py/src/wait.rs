//! Waiting for work without holding the interpreter.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Condvar, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use autosplats_cloud::{Progress, lock};
use pyo3::prelude::*;

use crate::errors::{self, Class, Failure};
use crate::pool::pool;

/// Time between two looks at signals and progress.
const STEP: Duration = Duration::from_millis(20);

/// What the work and the thread that waits for it tell each other.
#[derive(Default)]
pub(crate) struct Watch {
    cancelled: AtomicBool,
    /// Bits of the finished fraction.
    fraction: AtomicU32,
    /// Notes, and whether they are of losses.
    notes: Mutex<Vec<(String, bool)>>,
    ended: Mutex<bool>,
    end: Condvar,
}

impl Progress for Watch {
    fn report(&self, fraction: f32) {
        // Fractions are not negative, so their bits are in their order.
        self.fraction.fetch_max(fraction.clamp(0.0, 1.0).to_bits(), Ordering::Relaxed);
    }

    fn cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    fn note(&self, note: &str) {
        lock(&self.notes).push((note.to_owned(), false));
    }

    fn loss(&self, loss: &str) {
        lock(&self.notes).push((loss.to_owned(), true));
    }
}

impl Watch {
    /// Whether the work goes on.
    pub(crate) fn goes_on(&self) -> bool {
        !self.cancelled()
    }

    /// Waits a step, or until the work has ended. Returns whether it has.
    fn wait(&self) -> bool {
        let ended = self.ended.lock().unwrap_or_else(PoisonError::into_inner);
        if *ended {
            return true;
        }
        *self.end.wait_timeout(ended, STEP).unwrap_or_else(PoisonError::into_inner).0
    }

    fn end(&self) {
        *self.ended.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.end.notify_all();
    }
}

/// Performs `work` in a pool of threads. Meanwhile other threads of Python run, signals are heard, and `progress` is
/// called with the finished fraction. An exception of either cancels the work and comes out; otherwise notes of the
/// work go to Python's logging.
///
/// # Errors
/// The exception of the work, of a signal or of `progress`.
pub(crate) fn run<T: Send>(
    py: Python<'_>,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Watch) -> Result<T, Failure> + Send,
) -> PyResult<T> {
    let pool = pool(threads)?;
    let watch = Watch::default();
    let mut raised = None;
    let outcome = thread::scope(|scope| {
        let perform = || {
            let outcome = catch_unwind(AssertUnwindSafe(|| pool.install(|| work(&watch))));
            watch.end();
            outcome
        };
        let worker = match thread::Builder::new().name("autosplats".into()).spawn_scoped(scope, perform) {
            Ok(worker) => worker,
            Err(error) => {
                return Err(errors::raise(Class::Memory, format!("cannot start a thread: {error}")));
            }
        };
        let mut told = 0.0;
        while !py.detach(|| watch.wait()) {
            if raised.is_some() {
                continue;
            }
            let heard = py.check_signals().and_then(|()| tell(&watch, progress, &mut told));
            if let Err(error) = heard {
                watch.cancelled.store(true, Ordering::Relaxed);
                raised = Some(error);
            }
        }
        Ok(worker.join().unwrap_or_else(Err))
    })?;
    if let Some(error) = raised {
        return Err(error);
    }
    match outcome {
        Ok(Ok(done)) => {
            if let Some(progress) = progress {
                progress.call1((1.0,))?;
            }
            log(py, &watch)?;
            Ok(done)
        }
        Ok(Err(failure)) => Err(failure.raise()),
        Err(panic) => Err(Failure::Fault(said(&*panic)).raise()),
    }
}

/// Tells `progress` what is new.
fn tell(watch: &Watch, progress: Option<&Bound<'_, PyAny>>, told: &mut f32) -> PyResult<()> {
    let fraction = f32::from_bits(watch.fraction.load(Ordering::Relaxed));
    // The end is told once, when the work has ended.
    if let Some(progress) = progress
        && fraction > *told
        && fraction < 1.0
    {
        *told = fraction;
        progress.call1((fraction,))?;
    }
    Ok(())
}

fn log(py: Python<'_>, watch: &Watch) -> PyResult<()> {
    let notes = std::mem::take(&mut *lock(&watch.notes));
    if notes.is_empty() {
        return Ok(());
    }
    let logger = py.import("logging")?.call_method1("getLogger", ("autosplats",))?;
    notes.into_iter().try_for_each(|(note, is_loss)| {
        let level = if is_loss { "warning" } else { "info" };
        logger.call_method1(level, ("%s", note)).map(drop)
    })
}

/// What a panic said.
fn said(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied().or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    text.unwrap_or("no message").to_owned()
}
