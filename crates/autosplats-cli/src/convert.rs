//! `autosplats convert`: any input, or several as one, to a file of another kind.

use crate::args::ConvertArgs;
use crate::exit::Failure;
use crate::input::Inputs;
use crate::output::{check_cloud_target, write_cloud};
use crate::threads::start_threads;

/// Reads the inputs and writes the file.
pub(crate) fn run(args: &ConvertArgs) -> Result<(), Failure> {
    let ConvertArgs { inputs, output, force, poses, run } = args;
    start_threads(run)?;
    let inputs = Inputs::new(inputs, poses)?;
    check_cloud_target(output, *force, inputs.files())?;
    let cloud = inputs.read(run.quiet)?;
    let bytes = write_cloud(&cloud, output, run.quiet)?;
    if !run.quiet {
        eprintln!("{}: {} points, {bytes} bytes", output.display(), cloud.len());
    }
    Ok(())
}
