//! `autosplats convert`: any input, or several as one, to a binary PLY file.

use std::path::Path;

use autosplats_cloud::{Error, write_ply};

use crate::args::ConvertArgs;
use crate::exit::{Exit, Failure};
use crate::input::Inputs;
use crate::output::{check_target, replace_file};
use crate::progress::Bar;
use crate::threads::start_threads;

/// Reads the inputs and writes the file.
pub(crate) fn run(args: &ConvertArgs) -> Result<(), Failure> {
    let ConvertArgs { inputs, output, force, poses, run } = args;
    start_threads(run)?;
    check_name(output)?;
    let inputs = Inputs::new(inputs, poses)?;
    check_target(output, inputs.files())?;
    if !force && output.exists() {
        let shown = output.display();
        return Err(Failure::new(Exit::Output, format!("{shown}: is already there; --force replaces it")));
    }
    let cloud = inputs.read(run.quiet)?;
    let bytes = {
        let bar = Bar::new(&format!("writing {}", output.display()), run.quiet);
        replace_file(output, |temporary| {
            write_ply(&cloud, temporary.path(), &bar).map_err(|error| write_failure(output, error))
        })?
    };
    if !run.quiet {
        eprintln!("{}: {} points, {bytes} bytes", output.display(), cloud.len());
    }
    Ok(())
}

/// Names the file that was asked for, not the temporary one.
fn write_failure(output: &Path, error: Error) -> Failure {
    let what = match error {
        Error::Io { source, .. } => source.to_string(),
        other => other.to_string(),
    };
    Failure::new(Exit::Output, format!("{}: cannot write it: {what}", output.display()))
}

fn check_name(output: &Path) -> Result<(), Failure> {
    if output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("ply")) {
        return Ok(());
    }
    let shown = output.display();
    Err(Failure::usage(format!("{shown}: convert writes PLY; the last name has to be the output and end in .ply")))
}
