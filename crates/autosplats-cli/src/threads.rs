//! How many threads share the work.

use crate::args::RunArgs;
use crate::exit::{Exit, Failure};

/// Starts the threads that reading and rendering share.
pub(crate) fn start_threads(run: &RunArgs) -> Result<(), Failure> {
    rayon::ThreadPoolBuilder::new()
        // 0 is one per core.
        .num_threads(run.threads.map_or(0, usize::from))
        .build_global()
        .map_err(|error| Failure::new(Exit::Memory, format!("cannot start the threads: {error}")))
}
