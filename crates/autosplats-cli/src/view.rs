//! `autosplats view`: the window.

use crate::args::ViewArgs;
use crate::exit::Failure;

/// Opens the window and returns when it is closed.
#[cfg(feature = "viewer")]
pub(crate) fn run(args: &ViewArgs) -> Result<(), Failure> {
    use autosplats_viewer::{Options, TreeOptions};

    use crate::input::Inputs;

    let ViewArgs { inputs, input, state, watch, backend, tree, run: _ } = args;
    let memory = tree.memory;
    let least = TreeOptions::least_memory();
    if memory.is_some_and(|memory| memory < least) {
        let least = least.div_ceil(1 << 20);
        return Err(Failure::usage(format!("--memory: the window needs at least {least}M; allow more")));
    }
    let trees = TreeOptions { detail: tree.detail(), max_points: tree.max_points(), memory };
    let (inputs, backend) = (Inputs::new(inputs, input)?.for_viewer(*watch), backend.map(Into::into));
    let options = Options { inputs, state: state.clone(), watch: *watch, backend, trees };
    Ok(autosplats_viewer::run(options)?)
}

/// Fails: this build has no window.
#[cfg(not(feature = "viewer"))]
pub(crate) fn run(args: &ViewArgs) -> Result<(), Failure> {
    let inputs = args.inputs.join(" ");
    Err(Failure::usage(format!("this build has no viewer; make a picture with: autosplats render {inputs} -o out.png")))
}
