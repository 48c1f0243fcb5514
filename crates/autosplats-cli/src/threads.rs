//! Threads of reading and rendering.

use std::error::Error as _;

use rayon::{ThreadPoolBuildError, ThreadPoolBuilder};

use crate::exit::{Exit, Failure};
use crate::values::MAX_THREADS;

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
    ThreadPoolBuilder::new().num_threads(usize::from(count.or_else(bounded).unwrap_or(0)))
}

/// The most threads, if the environment asks the crate of threads for more. `None` leaves the number to the crate.
fn bounded() -> Option<u16> {
    // As the crate reads it, its older name included.
    let asked = ["RAYON_NUM_THREADS", "RAYON_RS_NUM_CPUS"].iter().find_map(|name| std::env::var(name).ok());
    beyond(&asked?)
}

fn beyond(asked: &str) -> Option<u16> {
    asked.parse::<usize>().ok().filter(|&count| count > usize::from(MAX_THREADS)).map(|_| MAX_THREADS)
}

fn failure(error: ThreadPoolBuildError) -> Failure {
    Failure::new(Exit::Memory, format!("cannot start the threads: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_environment_cannot_ask_for_any_number_of_threads() {
        assert_eq!(beyond("100000"), Some(MAX_THREADS), "too many");
        for plain in ["1024", "2", "0", "", "-1", "many"] {
            assert_eq!(beyond(plain), None, "{plain} is left to the crate");
        }
    }
}
