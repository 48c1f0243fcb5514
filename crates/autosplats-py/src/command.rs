//! The command, within the process of Python.

use std::io::{Result, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use autosplats_cli::{Console, Exit, Signals};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::wait::run;

/// Time between two looks at signals.
const STEP: Duration = Duration::from_millis(10);

/// Runs the command with the arguments of the process, on its streams, and returns the exit code. As in the program,
/// signals end the process unless the work finishes what it has.
#[pyfunction]
pub(crate) fn main(py: Python<'_>, arguments: Vec<String>) -> u8 {
    let console = Console::of_process();
    let signals = Signals::end_the_process(&console);
    let work = || signals.finish(autosplats_cli::run(arguments, &console));
    // A thread as any other program's, whatever Python's own has.
    let code = py.detach(|| thread::scope(|scope| scope.spawn(work).join().unwrap_or(101)));
    // Python has heard of the Ctrl-C at which the work has finished.
    let _ = py.check_signals();
    code
}

/// A stream into memory.
#[derive(Clone, Default)]
struct Memory(Arc<Mutex<Vec<u8>>>);

impl Memory {
    fn text(&self) -> String {
        String::from_utf8_lossy(&self.0.lock().unwrap_or_else(PoisonError::into_inner)).into_owned()
    }
}

impl Write for Memory {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<()> {
        Ok(())
    }
}

/// Runs the command with `arguments`. Returns its exit code, what it printed and what it said.
#[pyfunction]
pub(crate) fn command(
    py: Python<'_>,
    arguments: Vec<String>,
    threads: Option<usize>,
) -> PyResult<(u8, String, String)> {
    let (data, messages) = (Memory::default(), Memory::default());
    let console = Console::new(data.clone(), messages.clone());
    let code = run(py, threads, None, |watch| {
        let ended = AtomicBool::new(false);
        thread::scope(|scope| {
            let watching = scope.spawn(|| {
                while !ended.load(Ordering::SeqCst) {
                    if !watch.goes_on() {
                        console.interrupt().request();
                    }
                    thread::park_timeout(STEP);
                }
            });
            let code = autosplats_cli::run(arguments, &console);
            ended.store(true, Ordering::SeqCst);
            watching.thread().unpark();
            Ok(code)
        })
    })?;
    if code == Exit::Interrupted as u8 {
        return Err(PyRuntimeError::new_err("interrupted"));
    }
    Ok((code, data.text(), messages.text()))
}
