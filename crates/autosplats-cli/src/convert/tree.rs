//! Writing one octree of all inputs, in bounded memory.

use autosplats_cloud::{Output, usual_memory};
use autosplats_formats::{TreeOptions, write_tree};

use crate::args::ConvertArgs;
use crate::console::Console;
use crate::exit::Failure;
use crate::input::Inputs;
use crate::output::{TREE_ENDING, folder_of};
use crate::parts::failure;
use crate::progress::Bar;

/// Fails for options that need all points in memory at once.
fn check(args: &ConvertArgs) -> Result<(), Failure> {
    let ConvertArgs { input, part, thinning, .. } = args;
    let refused = [
        ("--spacing", part.spacing.is_some()),
        ("--every", thinning.every.is_some()),
        ("--voxel", thinning.voxel.is_some()),
        ("--noise", thinning.noise.is_some()),
        ("--sample", input.playing.sample.is_some()),
    ];
    match refused.into_iter().find(|(_, is_given)| *is_given) {
        Some((option, _)) => Err(Failure::usage(format!(
            "{option}: points go straight into an octree; convert to a plain .laz with {option} first, and that to {TREE_ENDING}"
        ))),
        None => Ok(()),
    }
}

/// Reads the inputs and writes the tree.
pub(super) fn run(args: &ConvertArgs, inputs: &Inputs, output: Output<'_>, console: &Console) -> Result<(), Failure> {
    check(args)?;
    let options = TreeOptions {
        memory: args.room.memory.unwrap_or_else(usual_memory),
        temp: args.room.temp.clone(),
        bounds: args.part.bounds,
        keep: args.input.reading.keep.clone(),
        keep_no_returns: args.input.reading.keep_no_returns,
        whole: !args.part.salvage,
    };
    let bar = Bar::on_file("building", output.path, console);
    let temp = options.temp.as_deref().unwrap_or(folder_of(output.path));
    let summary =
        write_tree(inputs.streamed(), output, &options, &bar).map_err(|error| failure(error, output.path, temp))?;
    drop(bar);
    console.tell(format_args!(
        "{}: {} points in {} nodes, {} bytes; {} bytes of disk for temporary records",
        output.path.display(),
        summary.points,
        summary.nodes,
        summary.bytes,
        summary.temporary
    ));
    Ok(())
}
