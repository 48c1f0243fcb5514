//! Arguments of `autosplats bench`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::{NeighborArgs, RunArgs};
use crate::choices::Backend;
use crate::values;

const BENCH_EXAMPLES: &str = "\
Examples:
  autosplats bench
  autosplats bench --scene cathedral:10M --backend cpu,gpu
  autosplats bench --scene statue:1M --backend gpu --passes
  autosplats bench --scene statue:1M --noise 0.005
  autosplats bench --scene statue:1M -k 20 --size 1280x720 --frames 100 --json
  autosplats bench --scene cathedral:10M --backend gpu --stream
  autosplats bench paper --quick --out /tmp/paper";

#[derive(Args, Debug)]
#[command(after_help = BENCH_EXAMPLES, args_conflicts_with_subcommands = true, disable_help_subcommand = true)]
pub(crate) struct BenchArgs {
    #[command(subcommand)]
    pub(crate) evaluation: Option<Evaluation>,
    /// Generated scene to render, with its number of points
    #[arg(long, value_name = "NAME[:COUNT]", default_value = "statue:1M")]
    pub(crate) scene: String,
    #[command(flatten)]
    pub(crate) neighbors: NeighborArgs,
    /// Devices that render, separated by commas; measured one after the other
    #[arg(long = "backend", value_enum, value_delimiter = ',', default_value = "auto")]
    pub(crate) backends: Vec<Backend>,
    /// Do not trim splats at silhouettes; with '-k 10 --points-per-pixel 1' the paper's settings
    #[arg(long)]
    pub(crate) no_trim: bool,
    /// Add normally distributed noise of standard deviation SIZE, in the scene's units, along each axis
    #[arg(long, value_name = "SIZE", value_parser = values::above_zero, allow_negative_numbers = true)]
    pub(crate) noise: Option<f64>,
    /// Width and height of the picture in pixels, each 1 to 16384
    #[arg(long, value_name = "WxH", default_value = "1760x900", value_parser = values::size, allow_hyphen_values = true)]
    pub(crate) size: [u32; 2],
    /// Number of frames to measure, 1 to 100000, after a second of frames that are not measured
    #[arg(long, value_name = "COUNT", default_value = "20", value_parser = values::frames, allow_negative_numbers = true)]
    pub(crate) frames: usize,
    /// Treat the points as new in each frame, like a live scanner's; a GPU has to upload them every time
    #[arg(long)]
    pub(crate) stream: bool,
    /// Time each pass of a GPU by itself, and what lies between them; frames then take longer
    #[arg(long)]
    pub(crate) passes: bool,
    /// Print one JSON object on standard output: scene, device, counts, milliseconds per stage and pass, and what each
    /// stage asks of a GPU
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Evaluation {
    /// Repeat the evaluation of the Auto Splats paper and write a page about it
    Paper(PaperArgs),
}

const PAPER_EXAMPLES: &str = "\
Examples:
  autosplats bench paper
  autosplats bench paper --quick --out /tmp/paper
  autosplats bench paper --scenes bunny,imperia --bunny bunny.ply
  autosplats bench paper --gallop horse_gallop/ --fresh";

#[derive(Args, Debug)]
#[command(after_help = PAPER_EXAMPLES)]
pub(crate) struct PaperArgs {
    /// Scenes of the paper to measure, separated by commas
    #[arg(long, value_name = "NAMES", value_delimiter = ',', default_values = ["bunny", "imperia", "horses", "cathedral"])]
    pub(crate) scenes: Vec<String>,
    /// File of the Stanford bunny [default: a generated figure instead]
    #[arg(long, value_name = "FILE")]
    pub(crate) bunny: Option<PathBuf>,
    /// Folder of meshes of a galloping horse; the first has the triangles of all [default: a generated herd instead]
    #[arg(long, value_name = "FOLDER")]
    pub(crate) gallop: Option<PathBuf>,
    /// Folder to write RESULTS.md and results/ (pictures, charts, measurements) to; with --quick, RESULTS-quick.md and
    /// results-quick/
    #[arg(long, value_name = "FOLDER", default_value = "docs")]
    pub(crate) out: PathBuf,
    /// Use small scenes, small pictures and few values of k; takes minutes even without a graphics card
    #[arg(long)]
    pub(crate) quick: bool,
    /// Measure everything again instead of resuming the last run in this folder
    #[arg(long)]
    pub(crate) fresh: bool,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}
