//! Arguments of `render`.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

use super::input::INPUT_HELP;
use super::{CameraArgs, InputArgs, LookArgs, RunArgs, SurfaceArgs, TreeArgs};
use crate::exit::EXIT_CODES;
use crate::values::{self, FrameRange};

const RENDER_EXAMPLES: &str = "\
Examples:
  autosplats render scan.laz -o scan.png
  autosplats render scan.laz -o scan.png --view top --color height --legend
  autosplats render scan.laz -o print.png --size 6000x4000 --supersample 2
  autosplats render scan.laz -o paper.jpg --background white
  autosplats render bunny.ply -o bunny.png -o bunny.exr --size 800x600 --background transparent
  autosplats render a.ply b.ply --pose b.ply=b.txt -o both.png
  autosplats render drive.mcap --decay 1s --frames 0..99 -o drive_%05d.png
  autosplats render 'scans/frame_*.ply' --fps 25 -o scans.mp4
  producer | autosplats render - -o live_%05d.png
  autosplats render scene:figure --scan 4 --color k-radius --range 0.01..0.03 --legend -o scanned_%03d.png
  autosplats render scene:cathedral:10M -o cathedral.png --occlusion 2 --json
  autosplats render survey.copc.laz -o survey.png --detail 2 --memory 1G
  autosplats render survey.copc.laz -o walk.mp4 --camera-path a.json,b.json,c.json --duration 20s
  autosplats render https://example.org/survey.copc.laz -o survey.png
  autosplats render scan.laz -o a.png --save-camera cam.json; autosplats render new.laz -o b.png --camera cam.json

Layers of an .exr file, 32-bit floats except the whole-number index:
  R G B A Z N.X N.Y N.Z radius kradius curvature index
Live input (a pipe, --watch, zenoh://) gives a picture per update, until it ends or Ctrl-C is pressed.";

#[derive(Args, Debug)]
#[command(after_help = RENDER_EXAMPLES, after_long_help = format!("{RENDER_EXAMPLES}\n\n{EXIT_CODES}"))]
pub(crate) struct RenderArgs {
    #[arg(required = true, value_name = "INPUT", help = INPUT_HELP)]
    pub(crate) inputs: Vec<String>,
    #[command(flatten)]
    pub(crate) input: InputArgs,
    /// File to write, can be repeated; an existing file is replaced: .png, .jpg (8 bit) or .exr (layers). A name
    /// with a number, such as f_%05d.png, gives a picture per frame; .mp4, .mkv, .webm or .mov a film at its own speed
    /// (needs ffmpeg)
    #[arg(short, long = "out", value_name = "FILE", required = true)]
    pub(crate) outputs: Vec<PathBuf>,
    /// Width and height of the picture in pixels, each 1 to 16384
    #[arg(long, value_name = "WxH", default_value = "1760x900", value_parser = values::size, allow_hyphen_values = true)]
    pub(crate) size: [u32; 2],
    /// Render FACTOR times as wide and high and average down, 1 to 8. This makes pictures smoother and finer
    /// [default: 2 for stills of up to 1920x1080 pixels; 1 for larger ones, frames and .exr layers]
    #[arg(long, value_name = "FACTOR", value_parser = clap::value_parser!(u32).range(1..=8), allow_negative_numbers = true)]
    pub(crate) supersample: Option<u32>,
    /// Frames to render, counted from 0, both ends included: 0..99, 50.., ..9 or 7; of live input, updates as they
    /// come. Several frames go to numbered files [default: all for a numbered name or a film, else the first]
    #[arg(long, value_name = "A..B", value_parser = values::frame_range, allow_hyphen_values = true, help_heading = "Points that move")]
    pub(crate) frames: Option<FrameRange>,
    /// Skip frames whose picture exists
    #[arg(long, help_heading = "Points that move")]
    pub(crate) resume: bool,
    /// Render a file, or the newest file of a folder, again whenever it changes, until Ctrl-C; each picture gets a
    /// number
    #[arg(long, help_heading = "Points that move")]
    pub(crate) watch: bool,
    #[command(flatten)]
    pub(crate) tree: TreeArgs,
    #[command(flatten)]
    pub(crate) camera: CameraArgs,
    /// Fly through the views of these files, which --save-camera wrote, and render a film or numbered pictures
    #[arg(long, value_name = "FILE,FILE,...", value_delimiter = ',', num_args = 1, conflicts_with_all = ["view", "eye", "fov", "ortho", "camera", "save_camera", "watch"], help_heading = "Camera")]
    pub(crate) camera_path: Vec<PathBuf>,
    /// Time of the flight of --camera-path [default: 3 s from view to view]
    #[arg(long, value_name = "TIME", value_parser = values::duration, requires = "camera_path", help_heading = "Camera")]
    pub(crate) duration: Option<Duration>,
    #[command(flatten)]
    pub(crate) surface: SurfaceArgs,
    #[command(flatten)]
    pub(crate) look: LookArgs,
    #[command(flatten)]
    pub(crate) run: RunArgs,
    /// Print counts, device, camera, outputs and milliseconds per stage as one JSON object on standard output; for
    /// frames, one line per finished picture
    #[arg(long, help_heading = "Running")]
    pub(crate) json: bool,
}
