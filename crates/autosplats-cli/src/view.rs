//! `autosplats view`: the window.

use crate::args::ViewArgs;
use crate::exit::Failure;

/// Opens the window and returns when it is closed.
#[cfg(feature = "viewer")]
pub(crate) fn run(args: &ViewArgs) -> Result<(), Failure> {
    use autosplats_viewer::Options;

    use crate::input::Inputs;

    let ViewArgs { inputs, input, state, watch, backend, run: _ } = args;
    let inputs = Inputs::new(inputs, input)?.for_viewer(*watch);
    let options = Options { inputs, state: state.clone(), watch: *watch, backend: backend.map(Into::into) };
    Ok(autosplats_viewer::run(options)?)
}

/// Fails: this build has no window.
#[cfg(not(feature = "viewer"))]
pub(crate) fn run(args: &ViewArgs) -> Result<(), Failure> {
    let inputs = args.inputs.join(" ");
    Err(Failure::usage(format!("this build has no viewer; make a picture with: autosplats render {inputs} -o out.png")))
}
