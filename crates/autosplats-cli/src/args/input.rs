//! Options of inputs: pose, reading and playing.

use std::time::Duration;

use autosplats::Detail;
use autosplats_cloud::PointFilter;
use autosplats_formats::DepthCamera;
use clap::Args;

use crate::values;

pub(super) const INPUT_HELP: &str = "\
A point cloud, mesh or depth image (.ply .las .laz .e57 .pcd .ptx .pts .xyz .csv .obj .stl .glb .bin .png …), or a \
generated scene as scene:NAME[:COUNT][@SECONDS], such as scene:herd:2M. SECONDS is the moment of an animated scene, as in \
scene:figure@1.5. Also an address (https://, s3:// …); of COPC, EPT and Potree 2, only the parts that are needed are read. For points that move: a folder, a quoted file pattern, a recording (.mcap .bag), or - for PLY and PCD \
on standard input. Several inputs are merged.";

/// Pose, reading and playing of inputs.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Input")]
pub(crate) struct InputArgs {
    /// Place INPUT with a pose, from input to world coordinates, from a text FILE. The pose is a row-major 4x4 or 3x4
    /// matrix, or the seven numbers tx ty tz qx qy qz qw
    #[arg(long = "pose", value_name = "INPUT=FILE", allow_hyphen_values = true)]
    pub(crate) poses: Vec<String>,
    #[command(flatten)]
    pub(crate) reading: ReadingArgs,
    #[command(flatten)]
    pub(crate) playing: PlayingArgs,
}

/// Playing of points that move.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Points that move")]
pub(crate) struct PlayingArgs {
    /// Frames per second of a sequence of files, a glTF, a scene or a film; also of a pipe in 'render' [default: 10 for
    /// files, 30 for glTF and scenes; for a film the frames' own rate if even, else 30]
    #[arg(long, value_name = "RATE", value_parser = values::rate, allow_negative_numbers = true)]
    pub(crate) fps: Option<f64>,
    /// Topic of a recording to play, can be repeated [default: all topics with points]
    #[arg(long = "topic", value_name = "NAME", allow_hyphen_values = true)]
    pub(crate) topics: Vec<String>,
    /// Coordinate frame to transform the points of a recording or a zenoh:// stream to. Streamed points that cannot be
    /// transformed are refused [default: topmost frame of the sensors]
    #[arg(long, value_name = "FRAME", allow_hyphen_values = true)]
    pub(crate) fixed_frame: Option<String>,
    /// Also show the points of the last TIME, such as 2s or 500ms
    #[arg(long, value_name = "TIME", value_parser = values::duration, allow_hyphen_values = true)]
    pub(crate) decay: Option<Duration>,
    /// Also show all earlier points, up to 100 million
    #[arg(long, conflicts_with = "decay")]
    pub(crate) accumulate: bool,
    /// Sample COUNT points on the surface of each mesh, evenly by area, instead of taking its corners; such as 250000
    /// or 1.5M. The points move with the mesh
    #[arg(long, value_name = "COUNT", value_parser = values::count, allow_hyphen_values = true)]
    pub(crate) sample: Option<usize>,
    /// Show each mesh or scene as 1 to 4 simulated scanners around it would see it, each noisier than the one before.
    /// With 'render --color k-radius --range 0.01..0.03' red marks sparse sampling: k-radii of the upper end of the
    /// range and more
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u8).range(1..=4), allow_negative_numbers = true)]
    pub(crate) scan: Option<u8>,
}

/// Properties that a file may not state.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Input")]
pub(crate) struct ReadingArgs {
    /// Column names of text and headerless binary files, such as x,y,z,Intensity,red,green,blue; '-' skips a column,
    /// '...' at the end all others of a text [default: from the header, else guessed, with a note]
    #[arg(long, value_name = "NAMES", value_delimiter = ',', allow_hyphen_values = true)]
    pub(crate) columns: Option<Vec<String>>,
    /// Intrinsics of depth images in pixels, and SCALE, pixel values per metre; without it, whole numbers are
    /// millimetres and floats metres [default: from a file beside the image, such as ROS's camera_info.yaml, else
    /// guessed]
    #[arg(long, value_name = "FX,FY,CX,CY[,SCALE]", value_parser = values::depth_camera, allow_hyphen_values = true)]
    pub(crate) depth_camera: Option<DepthCamera>,
    /// Points to keep, by class, flag and return, such as ground,building or 2..6,first. A hyphen leaves out:
    /// -noise,-withheld. One word without a hyphen has to match for classes, one for flags, one for returns. 'all'
    /// keeps all, 'usual' all but noise (classes 7 and 18) and withheld points [default: all, but usual for pictures]
    #[arg(long, value_name = "WORDS", allow_hyphen_values = true)]
    pub(crate) keep: Option<PointFilter>,
    /// Header to send with requests to addresses, such as 'Authorization: Bearer TOKEN', can be repeated
    #[arg(long = "header", value_name = "NAME: VALUE", allow_hyphen_values = true)]
    pub(crate) headers: Vec<String>,
    /// Keep points at (0, 0, 0), the sensor itself, which scanners write for missing returns
    #[arg(long)]
    pub(crate) keep_no_returns: bool,
}

/// Scans that are stored as octrees (COPC, EPT, Potree 2), of any size.
#[derive(Args, Clone, Copy, Debug, Default)]
#[command(next_help_heading = "Scans larger than memory")]
pub(crate) struct TreeArgs {
    /// Largest distance between neighbouring points on the screen, in pixels of the written picture: octrees
    /// are read as far as this needs; 0 reads all points [default: 1; without --points-budget, 0 for files of less
    /// than 20 million points]
    #[arg(long, value_name = "PX", value_parser = values::detail, allow_negative_numbers = true)]
    detail: Option<f64>,
    /// Most points that a picture is made of, such as 5M. If more are needed, the finest are left out everywhere
    /// [default: 10M]
    #[arg(long, value_name = "COUNT", value_parser = values::count)]
    points_budget: Option<usize>,
    /// Memory for the points of octrees and the picture, such as 500M [default: a quarter of what is free, at most 2G]
    #[arg(long, value_name = "BYTES", value_parser = values::bytes, allow_negative_numbers = true)]
    pub(crate) memory: Option<u64>,
}

impl TreeArgs {
    /// The detail that is asked for. Who names a budget wants no file whole.
    pub(crate) fn detail(&self) -> Option<f64> {
        self.detail.or(self.points_budget.map(|_| 1.0))
    }

    pub(crate) fn max_points(&self) -> usize {
        self.points_budget.unwrap_or(Detail::default().max_points)
    }
}
