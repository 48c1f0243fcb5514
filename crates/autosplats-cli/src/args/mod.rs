//! The command line as typed. Each command turns its part into ready objects.

mod bench;
mod clouds;
mod input;
mod others;
mod picture;
mod render;
mod view;

use clap::{Args, Parser, Subcommand};

pub(crate) use self::bench::{BenchArgs, Evaluation, PaperArgs};
pub(crate) use self::clouds::{ConvertArgs, InfoArgs, NormalsArgs, PartArgs, RoomArgs, ThinningArgs};
pub(crate) use self::input::{InputArgs, PlayingArgs, ReadingArgs, TreeArgs};
pub(crate) use self::others::{CompletionsArgs, DemoArgs, DoctorArgs, ManArgs, TopicsArgs};
pub(crate) use self::picture::{CameraArgs, LookArgs, NeighborArgs, SurfaceArgs};
pub(crate) use self::render::RenderArgs;
pub(crate) use self::view::ViewArgs;
use crate::exit::EXIT_CODES;
use crate::values;

/// Render raw point clouds as lit surfaces, without normals, radii or preprocessing.
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
    /// Arguments without a command, passed to `view`.
    #[arg(hide = true, trailing_var_arg = true, allow_hyphen_values = true)]
    pub(crate) rest: Vec<String>,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Show points as a surface in a window; the default without a command
    View(Box<ViewArgs>),
    /// Render points to PNG pictures, EXR layers or films
    Render(Box<RenderArgs>),
    /// Convert one or several inputs to a file of another format; optionally thin, crop or sample
    Convert(Box<ConvertArgs>),
    /// Estimate normal, curvature and density of every point and write them to a file
    Normals(Box<NormalsArgs>),
    /// Render every built-in scene and print the paths of the pictures
    Demo(DemoArgs),
    /// Describe files: points, bounds, attributes, units, spacing
    Info(InfoArgs),
    /// List the topics that robots publish over Zenoh, point clouds first (needs a build with the feature 'zenoh')
    Topics(TopicsArgs),
    /// Time each stage and pass of a frame
    Bench(BenchArgs),
    /// Report devices, memory and formats of this machine, and test the program on it
    Doctor(DoctorArgs),
    /// Print a script for shell completion
    Completions(CompletionsArgs),
    /// Print the manual page, or write one page per command
    Man(ManArgs),
}

impl Command {
    /// Options about the run; `None` for commands without such.
    pub(crate) fn run(&self) -> Option<&RunArgs> {
        match self {
            Self::View(args) => Some(&args.run),
            Self::Render(args) => Some(&args.run),
            Self::Convert(args) => Some(&args.run),
            Self::Normals(args) => Some(&args.run),
            Self::Demo(args) => Some(&args.run),
            Self::Info(args) => Some(&args.run),
            Self::Topics(args) => Some(&args.run),
            Self::Bench(args) => Some(match &args.evaluation {
                Some(Evaluation::Paper(args)) => &args.run,
                None => &args.run,
            }),
            Self::Doctor(_) | Self::Completions(_) | Self::Man(_) => None,
        }
    }
}

#[derive(Args, Debug)]
#[command(next_help_heading = "Running")]
pub(crate) struct RunArgs {
    /// Number of threads, 1 to 1024; results do not depend on it [default: one per core]
    #[arg(long, value_name = "COUNT", value_parser = values::threads, allow_negative_numbers = true)]
    pub(crate) threads: Option<u16>,
    /// Print only errors and what inputs have lost on standard error, no progress and no summary
    #[arg(long)]
    pub(crate) quiet: bool,
}
