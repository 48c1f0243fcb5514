//! What `autosplats bench` can be told.

use std::path::PathBuf;

use autosplats::Reconstruction;
use clap::{Args, Subcommand};

use crate::args::RunArgs;
use crate::choices::{Backend, Engine};
use crate::first_radius::FirstRadius;
use crate::values::{self, Neighbors};

const BENCH_EXAMPLES: &str = "\
Examples:
  autosplats bench
  autosplats bench --scene cathedral:10M --backend cpu,gpu
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
    /// How neighbours are found
    #[arg(long, value_enum, default_value = "screen-grid")]
    pub(crate) engine: Engine,
    /// Radius within which the kd-tree looks for a point's neighbours, in the input's units; 'best' tries several and takes
    /// the fastest that finds 99.9 % of the visible points' neighbourhoods
    #[arg(long, value_name = "RADIUS|best", default_value = "best", allow_negative_numbers = true)]
    pub(crate) first_radius: FirstRadius,
    /// What renders; several, with commas, are measured one after the other
    #[arg(long = "backend", value_enum, value_delimiter = ',', default_value = "auto")]
    pub(crate) backends: Vec<Backend>,
    /// Neighbours of each point, 1 to 64, or 'auto': 10, and more where points scatter
    #[arg(short, value_name = "COUNT|auto", default_value = "auto", allow_negative_numbers = true)]
    pub(crate) k: Neighbors,
    /// Points that a pixel keeps, 1 or 2
    #[arg(
        long,
        value_name = "COUNT",
        default_value_t = Reconstruction::default().points_per_pixel,
        allow_negative_numbers = true
    )]
    pub(crate) points_per_pixel: u32,
    /// Leave splats whole at silhouettes: with '-k 10 --points-per-pixel 1' the paper's settings
    #[arg(long)]
    pub(crate) no_trim: bool,
    /// Shake the points by normally distributed noise with this standard deviation along each axis, in the scene's units
    #[arg(long, value_name = "SIZE", value_parser = values::above_zero, allow_negative_numbers = true)]
    pub(crate) noise: Option<f64>,
    /// Width and height of the picture in pixels
    #[arg(long, value_name = "WxH", default_value = "1760x900", value_parser = values::size)]
    pub(crate) size: [u32; 2],
    /// Frames to measure, 1 to 100000, after three that are not
    #[arg(long, value_name = "COUNT", default_value = "20", value_parser = values::frames)]
    pub(crate) frames: usize,
    /// Take the points for new ones in each frame, as a live scanner's are: a GPU has to upload them again
    #[arg(long)]
    pub(crate) stream: bool,
    /// One JSON object on standard output: scene, device, counts, milliseconds per stage and pass
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
    /// Scenes of the paper's to take, with commas
    #[arg(long, value_name = "NAMES", value_delimiter = ',', default_values = ["bunny", "imperia", "horses", "cathedral"])]
    pub(crate) scenes: Vec<String>,
    /// The Stanford bunny [default: a generated figure stands in]
    #[arg(long, value_name = "FILE")]
    pub(crate) bunny: Option<PathBuf>,
    /// Folder of meshes of a galloping horse, the first with the triangles of all [default: a generated herd stands in]
    #[arg(long, value_name = "FOLDER")]
    pub(crate) gallop: Option<PathBuf>,
    /// Folder for RESULTS.md and results/, which has pictures, charts and the measurements; for RESULTS-quick.md and
    /// results-quick/ with --quick
    #[arg(long, value_name = "FOLDER", default_value = "docs")]
    pub(crate) out: PathBuf,
    /// Small scenes and pictures and few ks: minutes even without a graphics card
    #[arg(long)]
    pub(crate) quick: bool,
    /// Measure everything anew instead of going on where the last run in this folder stopped
    #[arg(long)]
    pub(crate) fresh: bool,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}
