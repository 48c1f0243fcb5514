//! `autosplats view`: the window.

use crate::args::ViewArgs;
use crate::console::Console;
use crate::exit::Failure;

/// Opens the window and returns when it is closed.
#[cfg(feature = "viewer")]
pub(crate) fn run(args: &ViewArgs, console: &Console) -> Result<(), Failure> {
    use std::sync::mpsc::channel;

    use autosplats_viewer::{Options, TreeOptions};

    use crate::input::Inputs;
    use crate::output::check_target;

    let ViewArgs { inputs, input, state, watch, backend, tree, run: _ } = args;
    let memory = tree.memory;
    let least = TreeOptions::least_memory();
    if memory.is_some_and(|memory| memory < least) {
        let least = least.div_ceil(1 << 20);
        return Err(Failure::usage(format!("--memory: the window needs at least {least}M; allow more")));
    }
    let trees = TreeOptions { detail: tree.detail(), max_points: tree.max_points(), memory };
    let inputs = Inputs::new(inputs, input)?;
    if let Some(path) = state {
        check_target(path, &inputs.files([]))?;
    }
    let (inputs, backend) = (inputs.for_viewer(*watch), backend.map(Into::into));
    // A request to end closes the window, which then writes the session. A second one ends at once.
    let (closer, close) = channel();
    console.interrupt().end_gently_by(closer);
    let options = Options { inputs, state: state.clone(), watch: *watch, backend, trees, close: Some(close) };
    Ok(autosplats_viewer::run(options)?)
}

/// Fails: this build has no window.
#[cfg(not(feature = "viewer"))]
pub(crate) fn run(args: &ViewArgs, _console: &Console) -> Result<(), Failure> {
    let inputs = args.inputs.join(" ");
    Err(Failure::usage(format!("this build has no viewer; make a picture with: autosplats render {inputs} -o out.png")))
}
