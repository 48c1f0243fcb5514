//! Threads: a pool per process and number of threads.
//!
//! A process that was forked has the memory of its parent but not its threads, so a pool of the parent would wait for
//! ever. Pools are found by process id without a lock, which a fork could leave locked. They are never dropped: threads
//! of a pool that was inherited cannot be joined.

use std::sync::atomic::{AtomicPtr, AtomicUsize, Ordering};
use std::thread::available_parallelism;

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::errors::{self, Class};

/// Most threads that can be asked for.
const MAX_THREADS: usize = 1024;
/// Variables that state the number of threads, the first before the others.
const VARIABLES: [&str; 3] = ["AUTOSPLATS_NUM_THREADS", "RAYON_NUM_THREADS", "OMP_NUM_THREADS"];

/// A pool, and those made before it.
struct Node {
    process: u32,
    threads: usize,
    pool: ThreadPool,
    before: *const Self,
}

/// The pool made last.
static LAST: AtomicPtr<Node> = AtomicPtr::new(std::ptr::null_mut());
/// What [`set_num_threads`] was given; 0 for nothing.
static CHOSEN: AtomicUsize = AtomicUsize::new(0);

/// The pool of this process with `threads` threads, by default [as many as are meant](num_threads).
pub(crate) fn pool(threads: Option<usize>) -> PyResult<&'static ThreadPool> {
    let threads = match threads {
        Some(threads) => checked("num_threads", threads)?,
        None => num_threads()?,
    };
    let process = std::process::id();
    let mut at = LAST.load(Ordering::Acquire);
    #[allow(unsafe_code, reason = "nodes are leaked before they are stored, and nothing changes them")]
    // SAFETY: a pointer in the list is null or from `Box::leak`, whose value lives as long as the process.
    while let Some(node) = unsafe { at.as_ref::<'static>() } {
        if node.process == process && node.threads == threads {
            return Ok(&node.pool);
        }
        at = node.before.cast_mut();
    }
    // Found once, behind a lock, which another thread's fork must not find locked: here the interpreter is held.
    autosplats_cloud::available_memory();
    let built = ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(|number| format!("autosplats-{number}"))
        .build()
        .map_err(|error| errors::raise(Class::Memory, format!("cannot start {threads} threads: {error}")))?;
    let node = Box::leak(Box::new(Node { process, threads, pool: built, before: LAST.load(Ordering::Acquire) }));
    // Of two threads that make a pool at once both succeed; the list then has both.
    while let Err(before) = LAST.compare_exchange(node.before.cast_mut(), node, Ordering::AcqRel, Ordering::Acquire) {
        node.before = before;
    }
    Ok(&node.pool)
}

fn checked(name: &str, threads: usize) -> PyResult<usize> {
    if (1..=MAX_THREADS).contains(&threads) {
        return Ok(threads);
    }
    Err(errors::raise(Class::Argument, format!("{name} is {threads}, must be within 1 to {MAX_THREADS}")))
}

/// Sets the number of threads of calls that name none; None means that variables and the system tell.
#[pyfunction]
pub(crate) fn set_num_threads(threads: Option<usize>) -> PyResult<()> {
    let threads = threads.map_or(Ok(0), |threads| checked("num_threads", threads))?;
    CHOSEN.store(threads, Ordering::Relaxed);
    Ok(())
}

/// The number of threads of calls that name none: what was set, else what the first of the variables states, else the
/// cores that this process may use by its affinity and its control group.
#[pyfunction]
pub(crate) fn num_threads() -> PyResult<usize> {
    let chosen = CHOSEN.load(Ordering::Relaxed);
    if chosen > 0 {
        return Ok(chosen);
    }
    for name in VARIABLES {
        let Ok(text) = std::env::var(name) else { continue };
        // OpenMP has a number per level of nesting.
        let first = text.split(',').next().unwrap_or_default().trim();
        match first.parse::<usize>() {
            Ok(threads) if (1..=MAX_THREADS).contains(&threads) => return Ok(threads),
            // Other programs' variables may mean something else to them; rayon takes 0 for all cores.
            _ if name != VARIABLES[0] || text.is_empty() => {}
            _ => {
                let what = format!("the variable {name} is '{text}', must be a number within 1 to {MAX_THREADS}");
                return Err(errors::raise(Class::Argument, what));
            }
        }
    }
    Ok(available_parallelism().map_or(1, usize::from).min(MAX_THREADS))
}
