//! Arguments of `view`, the window.

use std::path::PathBuf;

use clap::Args;

use super::{InputArgs, RunArgs, TreeArgs};
use crate::choices::Backend;
use crate::exit::EXIT_CODES;

const VIEW_EXAMPLES: &str = "\
Examples:
  autosplats scan.laz
  autosplats view a.e57 b.e57 --pose b.e57=b.txt
  autosplats view result.ply --watch
  autosplats scene:statue:1M
  autosplats https://example.org/survey.copc.laz
  autosplats drive.mcap --decay 1s
  autosplats 'scans/frame_*.ply' --fps 25
  producer | autosplats view -
  autosplats --state survey.json survey.laz

In the window, the key H lists all keys and mouse actions.";

#[derive(Args, Debug)]
#[command(after_help = VIEW_EXAMPLES, after_long_help = format!("{VIEW_EXAMPLES}\n\n{EXIT_CODES}"))]
pub(crate) struct ViewArgs {
    #[arg(
        value_name = "INPUT",
        help = "\
A point cloud, mesh or depth image (.ply .las .laz .e57 .pcd .ptx .pts .xyz .csv .obj .stl .glb .bin .png …), or a \
generated scene as scene:NAME[:COUNT][@SECONDS]. Also an address (https://, s3:// …). Of large octrees (COPC, EPT, \
Potree 2), what the view needs is read. For points that move: a folder, a quoted file pattern, a recording \
(.mcap .bag), or - for PLY and PCD on standard input. Without an input the window opens empty; drop files on it."
    )]
    pub(crate) inputs: Vec<String>,
    #[command(flatten)]
    pub(crate) input: InputArgs,
    /// Session file with inputs, view and look: restored if it exists, written on exit
    #[arg(long, value_name = "FILE")]
    pub(crate) state: Option<PathBuf>,
    /// Read files again when they change
    #[arg(long)]
    pub(crate) watch: bool,
    /// Device that renders; pictures are the same except for rounding [default: as last time, at first auto]
    #[arg(long, value_enum)]
    pub(crate) backend: Option<Backend>,
    #[command(flatten)]
    pub(crate) tree: TreeArgs,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}
