//! Inputs: how they are placed, read and played.

use std::time::Duration;

use autosplats_cloud::DepthCamera;
use clap::Args;

use crate::values;

pub(super) const INPUT_HELP: &str = "\
A point cloud, mesh or depth image (.ply .las .laz .e57 .pcd .ptx .pts .xyz .csv .obj .stl .glb .bin .png …), or a \
generated scene as scene:NAME[:COUNT], such as scene:statue or scene:herd:2M. What moves is a folder or a quoted pattern of files, \
a recording (.mcap .bag), or - for PLY and PCD files from standard input. Several inputs become one cloud.";

/// How inputs are placed and read.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Input")]
pub(crate) struct InputArgs {
    /// Place an input by a text file: a row-major 4x4 (or 3x4) matrix from its own to world coordinates, or the seven
    /// numbers tx ty tz qx qy qz qw
    #[arg(long = "pose", value_name = "INPUT=FILE")]
    pub(crate) poses: Vec<String>,
    #[command(flatten)]
    pub(crate) reading: ReadingArgs,
    #[command(flatten)]
    pub(crate) playing: PlayingArgs,
}

/// How what moves is played.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Points that move")]
pub(crate) struct PlayingArgs {
    /// Files of a sequence in a second, times a second that a glTF or a scene is looked at, and pictures a second of a film
    /// [default: 10, 30, and for a film the frames' own rate, or 30 where they are not evenly apart]. 'render' takes the frames
    /// of a pipe for that far apart, else as they come
    #[arg(long, value_name = "RATE", value_parser = values::rate)]
    pub(crate) fps: Option<f64>,
    /// Topic of a recording to play; can be given several times [default: all that have points]
    #[arg(long = "topic", value_name = "NAME")]
    pub(crate) topics: Vec<String>,
    /// Coordinate frame that points of a recording or over Zenoh are brought into; live ones that cannot be are refused
    /// [default: the topmost of their sensors]
    #[arg(long, value_name = "FRAME")]
    pub(crate) fixed_frame: Option<String>,
    /// Keep the points of the last so many seconds, such as 2s or 500ms
    #[arg(long, value_name = "TIME", value_parser = values::duration)]
    pub(crate) decay: Option<Duration>,
    /// Keep all points of the past, up to 100 million
    #[arg(long, conflicts_with = "decay")]
    pub(crate) accumulate: bool,
    /// Strew so many points over the surface of each mesh in place of its corners, which move with it
    #[arg(long, value_name = "COUNT", value_parser = values::count)]
    pub(crate) strew: Option<usize>,
    /// Show what so many simulated scanners, 1 to 4, around each mesh or scene would see of it, each noisier than the one before.
    /// 'render --color k-radius --range 0.01..0.03' shows in red where that is too little: points as far apart as the upper end
    /// of the range, or further
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u8).range(1..=4))]
    pub(crate) scan: Option<u8>,
}

/// What files leave open.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Input")]
pub(crate) struct ReadingArgs {
    /// Columns of text and of bare binary records, such as x,y,z,Intensity,red,green,blue; '-' leaves one out
    /// [default: by the header, or guessed and told]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(crate) columns: Option<Vec<String>>,
    /// Camera of depth images in pixels, and their values per metre [default: by a file beside the image]
    #[arg(long, value_name = "FX,FY,CX,CY[,SCALE]", value_parser = values::depth_camera)]
    pub(crate) depth_camera: Option<DepthCamera>,
    /// Keep points at the sensor itself, (0, 0, 0), which scanners write where nothing came back
    #[arg(long)]
    pub(crate) keep_no_returns: bool,
}
