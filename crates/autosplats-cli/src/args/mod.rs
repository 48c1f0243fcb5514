//! The command line as it is typed. What the flags mean together is decided in [`render::job`](crate::render).

mod clouds;
mod input;
mod others;
mod picture;
mod render;
mod view;

use clap::{Args, Parser, Subcommand};

pub(crate) use self::clouds::{ConvertArgs, InfoArgs, NormalsArgs, ThinningArgs};
pub(crate) use self::input::{InputArgs, PlayingArgs, ReadingArgs};
pub(crate) use self::others::{CompletionsArgs, DemoArgs, DoctorArgs, ManArgs, TopicsArgs};
pub(crate) use self::picture::{CameraArgs, LookArgs, SurfaceArgs};
pub(crate) use self::render::RenderArgs;
pub(crate) use self::view::ViewArgs;
use crate::bench::args::BenchArgs;
use crate::exit::EXIT_CODES;
use crate::values;

/// Turns raw point clouds into lit surfaces: no normals, no radii, no preprocessing.
#[derive(Debug, Parser)]
#[command(
    name = "autosplats",
    version,
    arg_required_else_help = true,
    args_conflicts_with_subcommands = true,
    override_usage = "autosplats [INPUT]... | autosplats <COMMAND>",
    after_help = EXIT_CODES
)]
pub(crate) struct CommandLine {
    #[command(subcommand)]
    pub(crate) command: Option<Command>,
    /// Files without a command are viewed.
    #[arg(hide = true, trailing_var_arg = true, allow_hyphen_values = true)]
    pub(crate) rest: Vec<String>,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Open a window that shows the surface; the same as no command
    View(Box<ViewArgs>),
    /// Render points to PNG pictures and EXR layers
    Render(Box<RenderArgs>),
    /// Write any input, or several as one, in another format, whole or thinned
    Convert(Box<ConvertArgs>),
    /// Estimate normals, curvature and density of all points into a file
    Normals(Box<NormalsArgs>),
    /// Render every built-in scene and say where the pictures are
    Demo(DemoArgs),
    /// Say what is in files: points, bounds, attributes, units, spacing
    Info(InfoArgs),
    /// List what robots publish over Zenoh, points first (in builds with the feature 'zenoh')
    Topics(TopicsArgs),
    /// Time each stage and pass of a frame
    Bench(BenchArgs),
    /// Say what this machine can do, and whether the program works on it
    Doctor(DoctorArgs),
    /// Print a script that lets a shell complete this program's options
    Completions(CompletionsArgs),
    /// Print the manual page, or write one per command
    Man(ManArgs),
}

#[derive(Args, Debug)]
#[command(next_help_heading = "Running")]
pub(crate) struct RunArgs {
    /// Threads to use; the result does not depend on it [default: one per core]
    #[arg(long, value_name = "COUNT", value_parser = values::threads)]
    pub(crate) threads: Option<u16>,
    /// No progress and no summary on standard error, only errors
    #[arg(long)]
    pub(crate) quiet: bool,
}
