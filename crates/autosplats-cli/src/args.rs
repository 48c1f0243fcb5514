//! The command line as it is typed. What the flags mean together is decided in [`render::job`](crate::render).

use std::path::PathBuf;
use std::time::Duration;

use autosplats::{Background, ColorMode, NormalSettings, Reconstruction, Shading};
use autosplats_cloud::glam::DVec3;
use autosplats_cloud::{DepthCamera, written_formats};
use clap::{Args, Parser, Subcommand};

use crate::bench::args::BenchArgs;
use crate::choices::{AxesChoice, Backend, BacksChoice, Engine, Map, OrientChoice, Side};
use crate::exit::EXIT_CODES;
use crate::first_radius::FirstRadius;
use crate::values::{self, FrameRange, Neighbors, Ortho};

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

const INPUT_HELP: &str = "\
A point cloud, mesh or depth image (.ply .las .laz .e57 .pcd .ptx .pts .xyz .csv .obj .stl .glb .bin .png …), or a \
generated scene as scene:NAME[:COUNT], such as scene:statue or scene:herd:2M. What moves is a folder or a quoted pattern of files, \
a recording (.mcap .bag), or - for PLY and PCD files from standard input. Several inputs become one cloud.";

const VIEW_EXAMPLES: &str = "\
Examples:
  autosplats scan.laz
  autosplats view a.e57 b.e57 --pose b.e57=b.txt
  autosplats view result.ply --watch
  autosplats scene:statue:1M
  autosplats drive.mcap --decay 1s
  autosplats 'scans/frame_*.ply' --fps 25
  producer | autosplats view -
  autosplats --state survey.json survey.laz

In the window H shows what keys and mouse do.";

#[derive(Args, Debug)]
#[command(after_help = VIEW_EXAMPLES, after_long_help = format!("{VIEW_EXAMPLES}\n\n{EXIT_CODES}"))]
pub(crate) struct ViewArgs {
    #[arg(
        value_name = "INPUT",
        help = "\
A point cloud, mesh or depth image (.ply .las .laz .e57 .pcd .ptx .pts .xyz .csv .obj .stl .glb .bin .png …), or a \
generated scene as scene:NAME[:COUNT]. What moves is a folder or a quoted pattern of files, a recording (.mcap .bag), or - for PLY \
and PCD files from standard input. None opens an empty window to drop files on."
    )]
    pub(crate) inputs: Vec<String>,
    #[command(flatten)]
    pub(crate) input: InputArgs,
    /// File that keeps the session, what is open and how it is seen: had again if it is there, written at the end
    #[arg(long, value_name = "FILE")]
    pub(crate) state: Option<PathBuf>,
    /// Read files again when they change
    #[arg(long)]
    pub(crate) watch: bool,
    /// What renders; the picture is the same [default: as last time, at first auto]
    #[arg(long, value_enum)]
    pub(crate) backend: Option<Backend>,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}

const RENDER_EXAMPLES: &str = "\
Examples:
  autosplats render scan.laz -o scan.png
  autosplats render scan.laz -o scan.png --view top --color height --legend
  autosplats render scan.laz -o print.png --supersample 2
  autosplats render bunny.ply -o bunny.png -o bunny.exr --size 800x600 --background transparent
  autosplats render a.ply b.ply --pose b.ply=b.txt -o both.png
  autosplats render drive.mcap --decay 1s --frames 0..99 -o drive_%05d.png
  autosplats render 'scans/frame_*.ply' --fps 25 -o scans.mp4
  autosplats render scene:figure --scan 4 --color k-radius --frames 0..47 -o scanned_%03d.png
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
    /// for each frame of what moves, and .mp4, .mkv, .webm or .mov a film, if ffmpeg is there
    #[arg(short, long = "out", value_name = "FILE", required = true)]
    pub(crate) outputs: Vec<PathBuf>,
    /// Width and height of the picture in pixels
    #[arg(long, value_name = "WxH", default_value = "1760x900", value_parser = values::size)]
    pub(crate) size: [u32; 2],
    /// Render so many times as wide and high and average down, 1 to 8: smoother and finer, for .png pictures
    #[arg(long, value_name = "FACTOR", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=8))]
    pub(crate) supersample: u32,
    /// Frames of what moves to render, from 0, both ends included: 0..99, 50.., ..9 or 7 [default: all with a numbered name or
    /// a film, else the first]
    #[arg(long, value_name = "A..B", value_parser = values::frame_range, help_heading = "Points that move")]
    pub(crate) frames: Option<FrameRange>,
    /// Leave out frames whose picture is there already
    #[arg(long, help_heading = "Points that move")]
    pub(crate) resume: bool,
    #[command(flatten)]
    pub(crate) camera: CameraArgs,
    #[command(flatten)]
    pub(crate) surface: SurfaceArgs,
    #[command(flatten)]
    pub(crate) look: LookArgs,
    #[command(flatten)]
    pub(crate) run: RunArgs,
    /// Print counts, device, camera, outputs and milliseconds per stage as one JSON object on standard output; of frames, one
    /// a line for each
    #[arg(long, help_heading = "Running")]
    pub(crate) json: bool,
}

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
    /// Files of a sequence in a second, or times a second that a glTF or a scene is looked at [default: 10 or 30]
    #[arg(long, value_name = "RATE", value_parser = values::rate)]
    pub(crate) fps: Option<f64>,
    /// Topic of a recording to play; can be given several times [default: all that have points]
    #[arg(long = "topic", value_name = "NAME")]
    pub(crate) topics: Vec<String>,
    /// Coordinate frame that points of a recording or over Zenoh are brought into [default: the topmost of their sensors]
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
    /// Put so many simulated scanners, 1 to 4, around each mesh or scene, each noisier than the one before, and take what they see
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

#[derive(Args, Debug)]
#[command(next_help_heading = "Camera")]
pub(crate) struct CameraArgs {
    /// Direction to look from, at a distance that shows everything but far outliers [default: iso, or the sensor's
    /// own view where the points are in a camera's frame]
    #[arg(long, value_enum, conflicts_with_all = ["eye", "camera"])]
    pub(crate) view: Option<Side>,
    /// Position of the eye in world coordinates
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, allow_hyphen_values = true, conflicts_with = "camera")]
    pub(crate) eye: Option<DVec3>,
    /// Point in the middle of the picture [default: the middle of the cloud]
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, allow_hyphen_values = true, requires = "eye")]
    pub(crate) look_at: Option<DVec3>,
    /// Direction that is upward in the picture [default: by --axes]
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, allow_hyphen_values = true, requires = "eye")]
    pub(crate) up: Option<DVec3>,
    /// Vertical field of view in degrees [default: 40]
    #[arg(long, value_name = "DEGREES", value_parser = values::fov, allow_negative_numbers = true, conflicts_with_all = ["ortho", "camera"])]
    pub(crate) fov: Option<f64>,
    /// Orthographic picture, so many world units high; 'fit' shows everything
    #[arg(long, value_name = "HEIGHT", value_parser = values::ortho, allow_negative_numbers = true, conflicts_with = "camera")]
    pub(crate) ortho: Option<Ortho>,
    /// Take the camera from a file that --save-camera wrote
    #[arg(long, value_name = "FILE")]
    pub(crate) camera: Option<PathBuf>,
    /// Write the camera of this picture as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) save_camera: Option<PathBuf>,
    /// Which way is up in the input; 'auto' goes by the file and its shape
    #[arg(long, value_enum, default_value = "auto")]
    pub(crate) axes: AxesChoice,
}

#[derive(Args, Debug)]
#[command(next_help_heading = "Surface")]
pub(crate) struct SurfaceArgs {
    /// Neighbours of each point that its splat is made from, 1 to 64; more is smoother. 'auto' takes 10, and more, up to
    /// thousands, where points scatter about the surface, and shows points on no surface as dots or not at all
    #[arg(short, value_name = "COUNT|auto", default_value = "auto", allow_negative_numbers = true)]
    pub(crate) k: Neighbors,
    /// Points that a pixel keeps, 1 or 2: 2 show outlines, thin parts and dense scans more truly. The engine
    /// splat-communication and graphics devices with little room keep 1
    #[arg(
        long,
        value_name = "COUNT",
        default_value_t = Reconstruction::default().points_per_pixel,
        allow_negative_numbers = true
    )]
    pub(crate) points_per_pixel: u32,
    /// How the neighbours are found
    #[arg(long, value_enum, default_value = "screen-grid")]
    pub(crate) engine: Engine,
    /// Radius within which the kd-tree looks for a point's neighbours, in the input's units; 'best' tries several and takes
    /// the fastest that finds 99.9 % of the visible points' neighbourhoods
    #[arg(long, value_name = "RADIUS|best", default_value = "best", allow_negative_numbers = true)]
    pub(crate) first_radius: FirstRadius,
    /// What renders; the picture is the same
    #[arg(long, value_enum, default_value = "auto")]
    pub(crate) backend: Backend,
    /// Expansions of its first search radius after which a point without a neighbour is dropped as an outlier, 0 to 8
    #[arg(
        long,
        value_name = "COUNT",
        default_value_t = Reconstruction::default().outlier_expansions.unwrap_or_default(),
        allow_negative_numbers = true,
        conflicts_with = "keep_outliers"
    )]
    pub(crate) e0: u32,
    /// Keep points that have no neighbour, or are far from all of them
    #[arg(long)]
    pub(crate) keep_outliers: bool,
    /// How much emptier the surroundings have to become for a group of points to end there, above 1
    #[arg(
        long,
        value_name = "FACTOR",
        default_value_t = Reconstruction::default().gap_factor.unwrap_or_default(),
        allow_negative_numbers = true,
        conflicts_with = "bridge_gaps"
    )]
    pub(crate) gap_factor: f32,
    /// Look for all k neighbours across any gap
    #[arg(long)]
    pub(crate) bridge_gaps: bool,
    /// Factor on the size of every splat, 0.01 to 10
    #[arg(long, value_name = "FACTOR", default_value_t = Reconstruction::default().splat_scale, allow_negative_numbers = true)]
    pub(crate) splat_scale: f32,
    /// Draw ellipses that follow the spread of the neighbours, instead of circles; with '-k auto' rows of points are
    /// ellipses in any case, and what is fitted to noise is circles
    #[arg(long)]
    pub(crate) ellipses: bool,
    /// Reconstruct hidden points too
    #[arg(long)]
    pub(crate) no_grid_culling: bool,
    /// Let the splats of hidden points take part in the depth of the visible surface
    #[arg(long)]
    pub(crate) no_depth_refinement: bool,
}

#[derive(Args, Debug)]
#[command(next_help_heading = "Look")]
pub(crate) struct LookArgs {
    /// auto, rgb, plain, height, intensity, classification, normal, curvature, radius, k-radius, depth, or the name
    /// of a field of the file (field:NAME if it is called like one of these)
    #[arg(long, value_name = "MODE", default_value = "auto", value_parser = values::color)]
    pub(crate) color: ColorMode,
    /// Values at the two ends of the colour map [default: 1st and 99th percentile of the picture]
    #[arg(long, value_name = "A..B", value_parser = values::range, allow_hyphen_values = true)]
    pub(crate) range: Option<[f32; 2]>,
    /// Colours of scalar values [default: reds for radii, gray for intensity, viridis for the rest]
    #[arg(long, value_enum)]
    pub(crate) color_map: Option<Map>,
    /// Draw the colour map and its range into the picture
    #[arg(long)]
    pub(crate) legend: bool,
    /// Show colours as they are, without light
    #[arg(long)]
    pub(crate) no_lighting: bool,
    /// Strength of occlusion, the darkening of creases and of what lies behind something, 0 (off) to 10
    #[arg(long, alias = "eye-dome", value_name = "STRENGTH", default_value_t = Shading::default().occlusion, allow_negative_numbers = true)]
    pub(crate) occlusion: f32,
    /// How the side of a surface is shown that its sensor did not see, where the file says where that stood
    #[arg(long, value_enum, default_value_t = BacksChoice::Toned)]
    pub(crate) backs: BacksChoice,
    /// '#rrggbb', '#top,#bottom' or transparent [default: dark grey gradient]
    #[arg(long, value_name = "COLOR", value_parser = values::background)]
    pub(crate) background: Option<Background>,
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

const CONVERT_EXAMPLES: &str = "\
Examples:
  autosplats convert scan.laz scan.ply
  autosplats convert scan.e57 thin.laz --voxel 0.05
  autosplats convert survey.laz house.ply --bounds 512030,5403600,290,512080,5403640,320
  autosplats convert statue.glb points.ply --sample 1M --noise 0.001
  autosplats convert scene:herd:10M herd.ply
  autosplats convert bun000.ply bun045.ply all.ply --pose bun045.ply=bun045.txt";

#[derive(Args, Debug)]
#[command(after_help = CONVERT_EXAMPLES, override_usage = "autosplats convert [OPTIONS] <INPUT>... <OUT>")]
pub(crate) struct ConvertArgs {
    // One list, so that options may stand anywhere between the names.
    #[arg(required = true, value_names = ["INPUT", "OUT"], num_args = 1.., help = paths_help())]
    pub(crate) paths: Vec<String>,
    #[command(flatten)]
    pub(crate) input: InputArgs,
    /// Replace an existing file
    #[arg(long, help_heading = "Running")]
    pub(crate) force: bool,
    #[command(flatten)]
    pub(crate) thinning: ThinningArgs,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}

/// What is done to the points, in this order.
#[derive(Args, Debug)]
#[command(next_help_heading = "Points, in this order")]
pub(crate) struct ThinningArgs {
    /// Strew so many points over the surface of each mesh, evenly by area, instead of taking its corners
    #[arg(long, value_name = "COUNT", value_parser = values::count)]
    pub(crate) sample: Option<usize>,
    /// Keep the points in a box of world coordinates
    #[arg(long, value_name = "X0,Y0,Z0,X1,Y1,Z1", value_parser = values::bounds, allow_hyphen_values = true)]
    pub(crate) bounds: Option<[DVec3; 2]>,
    /// Keep the first of every so many points
    #[arg(long, value_name = "COUNT", value_parser = values::step)]
    pub(crate) every: Option<usize>,
    /// Keep one point for each cube of this size: the one nearest to the mean
    #[arg(long, value_name = "SIZE", value_parser = values::above_zero, allow_negative_numbers = true)]
    pub(crate) voxel: Option<f64>,
    /// Shake the points by normally distributed noise with this standard deviation along each axis
    #[arg(long, value_name = "SIZE", value_parser = values::above_zero, allow_negative_numbers = true)]
    pub(crate) noise: Option<f64>,
    /// Another seed makes other noise and other samples
    #[arg(long, value_name = "NUMBER", default_value_t = 0)]
    pub(crate) seed: u64,
}

/// What the names are, and what can be written.
fn paths_help() -> String {
    let formats = written_formats().flat_map(|(_, extensions)| extensions).map(|extension| format!(".{extension}"));
    let formats = formats.collect::<Vec<_>>().join(" ");
    format!("{INPUT_HELP} The last name is the file to write; it tells the format: {formats}")
}

const NORMALS_EXAMPLES: &str = "\
Examples:
  autosplats normals scan.e57 normals.ply
  autosplats normals survey.laz normals.laz -k 20 --orient up
  autosplats normals sweep.bin normals.ply --sensor 0,0,1.8

The file gets all that the input has, and:
  NormalX NormalY NormalZ  unit normal (nx ny nz in PLY)
  Curvature                0 where flat, 1/3 where there is no surface
  DensityRadius            twice the radius of the circle that each neighbour covers on average";

#[derive(Args, Debug)]
#[command(after_help = NORMALS_EXAMPLES, override_usage = "autosplats normals [OPTIONS] <INPUT>... <OUT>")]
pub(crate) struct NormalsArgs {
    // One list, so that options may stand anywhere between the names.
    #[arg(required = true, value_names = ["INPUT", "OUT"], num_args = 1.., help = paths_help())]
    pub(crate) paths: Vec<String>,
    #[command(flatten)]
    pub(crate) input: InputArgs,
    /// Neighbours of each point that a plane is fitted to, 3 to 1024; more is smoother
    #[arg(short, value_name = "COUNT", default_value_t = NormalSettings::default().k, allow_negative_numbers = true, help_heading = "Normals")]
    pub(crate) k: u32,
    /// Which of its two sides a normal points to
    #[arg(long, value_enum, default_value = "auto", help_heading = "Normals")]
    pub(crate) orient: OrientChoice,
    /// World coordinates of the one sensor that saw all points, if the file does not say
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, allow_hyphen_values = true, conflicts_with = "orient", help_heading = "Normals")]
    pub(crate) sensor: Option<DVec3>,
    /// Replace an existing file
    #[arg(long, help_heading = "Running")]
    pub(crate) force: bool,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}

#[derive(Args, Debug)]
pub(crate) struct DemoArgs {
    /// Folder for the pictures; made if it is not there
    #[arg(short, long, value_name = "DIR", default_value = "autosplats-demo")]
    pub(crate) out: PathBuf,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}

const INFO_EXAMPLES: &str = "\
Examples:
  autosplats info scan.laz
  autosplats info scan.laz --scan
  autosplats info *.ply *.e57 --json
  autosplats info points.txt --columns x,y,z,Intensity,-,red,green,blue";

#[derive(Args, Debug)]
#[command(after_help = INFO_EXAMPLES, after_long_help = format!("{INFO_EXAMPLES}\n\n{}", crate::info::SCHEMA))]
pub(crate) struct InfoArgs {
    #[arg(
        required = true,
        value_name = "INPUT",
        help = "\
A point cloud file, or a generated scene as scene:NAME[:COUNT]. Of several, those that cannot be read are named and the \
others shown."
    )]
    pub(crate) inputs: Vec<String>,
    /// Read all points even where the header tells number, bounds and attributes (LAS, E57): values, spacing, density,
    /// duplicates
    #[arg(long)]
    pub(crate) scan: bool,
    /// One JSON object on standard output, for several inputs an array of them (--help has its fields)
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) reading: ReadingArgs,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}

const TOPICS_EXAMPLES: &str = "\
Examples:
  autosplats topics zenoh://192.168.1.20
  autosplats topics 'zenoh:///?domain=3' --json
  autosplats zenoh://192.168.1.20/lidar/points --decay 1s";

#[derive(Args, Debug)]
#[command(after_help = TOPICS_EXAMPLES)]
pub(crate) struct TopicsArgs {
    /// Where a router or a node listens: zenoh://HOST[:PORT][/?domain=N]; zenoh:/// looks around on this network
    pub(crate) address: String,
    /// How long to listen at most
    #[arg(long, value_name = "TIME", default_value = "5s", value_parser = values::duration)]
    pub(crate) wait: Duration,
    /// One JSON object a line for each topic on standard output
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}

#[derive(Args, Debug)]
pub(crate) struct DoctorArgs {
    /// One JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

const COMPLETIONS_HELP: &str = "\
To install:
  bash        autosplats completions bash > ~/.local/share/bash-completion/completions/autosplats
  zsh         autosplats completions zsh > a folder of $fpath, as _autosplats; then start a new shell
  fish        autosplats completions fish > ~/.config/fish/completions/autosplats.fish
  powershell  autosplats completions powershell | Out-String | Invoke-Expression, in the file that $PROFILE names
  elvish      eval (autosplats completions elvish | slurp), in ~/.config/elvish/rc.elv";

#[derive(Args, Debug)]
#[command(after_help = COMPLETIONS_HELP)]
pub(crate) struct CompletionsArgs {
    /// Shell to write for
    #[arg(value_enum)]
    pub(crate) shell: clap_complete::Shell,
}

#[derive(Args, Debug)]
#[command(after_help = "\
To read one page:      autosplats man | man -l -
To install them all:   autosplats man --out ~/.local/share/man/man1")]
pub(crate) struct ManArgs {
    /// Folder for one page per command, made if it is not there; without it the main page goes to standard output
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Replace existing pages
    #[arg(long, requires = "out")]
    pub(crate) force: bool,
}
