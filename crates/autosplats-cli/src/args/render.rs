//! `render`: pictures.

use std::path::PathBuf;

use clap::Args;

use super::input::INPUT_HELP;
use super::{CameraArgs, InputArgs, LookArgs, RunArgs, SurfaceArgs};
use crate::exit::EXIT_CODES;
use crate::values::{self, FrameRange};

const RENDER_EXAMPLES: &str = "\
Examples:
  autosplats render scan.laz -o scan.png
  autosplats render scan.laz -o scan.png --view top --color height --legend
  autosplats render scan.laz -o print.png --size 6000x4000 --supersample 2
  autosplats render bunny.ply -o bunny.png -o bunny.exr --size 800x600 --background transparent
  autosplats render a.ply b.ply --pose b.ply=b.txt -o both.png
  autosplats render drive.mcap --decay 1s --frames 0..99 -o drive_%05d.png
  autosplats render 'scans/frame_*.ply' --fps 25 -o scans.mp4
  producer | autosplats render - -o live_%05d.png
  autosplats render scene:figure --scan 4 --color k-radius --range 0.01..0.03 --legend -o scanned_%03d.png
  autosplats render scene:cathedral:10M -o cathedral.png --occlusion 2 --json
  autosplats render scan.laz -o a.png --save-camera cam.json; autosplats render new.laz -o b.png --camera cam.json";

#[derive(Args, Debug)]
#[command(after_help = RENDER_EXAMPLES, after_long_help = format!("{RENDER_EXAMPLES}\n\n{EXIT_CODES}"))]
pub(crate) struct RenderArgs {
    #[arg(required = true, value_name = "INPUT", help = INPUT_HELP)]
    pub(crate) inputs: Vec<String>,
    #[command(flatten)]
    pub(crate) input: InputArgs,
    /// Picture to write: .png (8 bit) or .exr (32-bit float: R G B A Z N.X N.Y N.Z radius kradius curvature index).
    /// Can be given several times; an existing file is replaced. One name with a number, such as f_%05d.png, writes a picture
    /// for each frame of what moves, or of what is live for each update as it comes, until it ends or Ctrl-C is pressed; and
    /// .mp4, .mkv, .webm or .mov a film, if ffmpeg is there, in which all plays at its own speed
    #[arg(short, long = "out", value_name = "FILE", required = true)]
    pub(crate) outputs: Vec<PathBuf>,
    /// Width and height of the picture in pixels
    #[arg(long, value_name = "WxH", default_value = "1760x900", value_parser = values::size)]
    pub(crate) size: [u32; 2],
    /// Render so many times as wide and high and average down, 1 to 8: smoother and finer, for .png pictures [default: 2 for
    /// one picture of up to 1920x1080 pixels, 1 for larger ones, for layers and for frames of what moves]
    #[arg(long, value_name = "FACTOR", value_parser = clap::value_parser!(u32).range(1..=8))]
    pub(crate) supersample: Option<u32>,
    /// Frames of what moves to render, from 0, both ends included: 0..99, 50.., ..9 or 7, as far as there are; of what is live,
    /// updates in the order they come. Several go to numbered files, f_00007.png where --out says f.png [default: all with a
    /// numbered name or a film, else the first]
    #[arg(long, value_name = "A..B", value_parser = values::frame_range, help_heading = "Points that move")]
    pub(crate) frames: Option<FrameRange>,
    /// Leave out frames whose picture is there already
    #[arg(long, help_heading = "Points that move")]
    pub(crate) resume: bool,
    /// Render files, or the newest file of a folder, again each time they change, until Ctrl-C; each picture gets a number
    #[arg(long, help_heading = "Points that move")]
    pub(crate) watch: bool,
    #[command(flatten)]
    pub(crate) camera: CameraArgs,
    #[command(flatten)]
    pub(crate) surface: SurfaceArgs,
    #[command(flatten)]
    pub(crate) look: LookArgs,
    #[command(flatten)]
    pub(crate) run: RunArgs,
    /// Print counts, device, camera, outputs and milliseconds per stage as one JSON object on standard output; of frames, one
    /// a line for each as soon as it is in place
    #[arg(long, help_heading = "Running")]
    pub(crate) json: bool,
}
