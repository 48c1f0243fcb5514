//! Threads of the program.

use crate::args::RunArgs;
use crate::exit::{Exit, Failure};

/// Starts the thread pool of reading and rendering.
pub(crate) fn start_threads(run: &RunArgs) -> Result<(), Failure> {
    rayon::ThreadPoolBuilder::new()
        // 0 means one per core.
        .num_threads(run.threads.map_or(0, usize::from))
        .build_global()
        .map_err(|error| Failure::new(Exit::Memory, format!("cannot start the threads: {error}")))
}
