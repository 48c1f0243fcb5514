//! Threads of reading and rendering.

use std::error::Error as _;

use rayon::{ThreadPoolBuildError, ThreadPoolBuilder};

use crate::exit::{Exit, Failure};

/// Runs `work` with `count` threads, or one per core.
///
/// Work without a count that is called in a pool stays there. Else the first call in a process sets the pool that all
/// its threads share. A later call for another number has a pool of its own.
pub(crate) fn with_threads(
    count: Option<u16>,
    work: impl FnOnce() -> Result<(), Failure> + Send,
) -> Result<(), Failure> {
    // Within a caller's pool its threads work, and no other pool is started.
    if count.is_none() && rayon::current_thread_index().is_some() {
        return work();
    }
    let there = start_threads(count)?;
    if there || count.is_none_or(|count| usize::from(count) == rayon::current_num_threads()) {
        return work();
    }
    pool(count).build().map_err(failure)?.install(work)
}

/// Starts the pool that all threads of the process share. Returns whether this was the first call.
pub(crate) fn start_threads(count: Option<u16>) -> Result<bool, Failure> {
    match pool(count).build_global() {
        Ok(()) => Ok(true),
        // Only an error of the system has a cause; else the pool was there already.
        Err(error) if error.source().is_none() => Ok(false),
        Err(error) => Err(failure(error)),
    }
}

fn pool(count: Option<u16>) -> ThreadPoolBuilder {
    // 0 means one per core.
    ThreadPoolBuilder::new().num_threads(count.map_or(0, usize::from))
}

fn failure(error: ThreadPoolBuildError) -> Failure {
    Failure::new(Exit::Memory, format!("cannot start the threads: {error}"))
}
