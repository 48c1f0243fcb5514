//! Arguments of the commands that write or describe clouds: `convert`, `normals` and `info`.

use autosplats::NormalSettings;
use autosplats_cloud::glam::DVec3;
use autosplats_formats::written_formats;
use clap::Args;

use super::input::INPUT_HELP;
use super::{InputArgs, ReadingArgs, RunArgs};
use crate::choices::OrientChoice;
use crate::values;

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
    // One list for inputs and output, so that options may stand between the names.
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

/// Point processing of `convert`, in the order of its steps.
#[derive(Args, Debug)]
#[command(next_help_heading = "Point processing, in this order")]
pub(crate) struct ThinningArgs {
    /// Sample COUNT points on the surface of each mesh, evenly by area, instead of taking its corners; such as 250000
    /// or 1.5M
    #[arg(long, value_name = "COUNT", value_parser = values::count)]
    pub(crate) sample: Option<usize>,
    /// Keep the points inside a box of world coordinates, given by its lower and its upper corner
    #[arg(long, value_name = "X0,Y0,Z0,X1,Y1,Z1", value_parser = values::bounds, allow_hyphen_values = true)]
    pub(crate) bounds: Option<[DVec3; 2]>,
    /// Keep the first of every COUNT points
    #[arg(long, value_name = "COUNT", value_parser = values::step)]
    pub(crate) every: Option<usize>,
    /// Keep one point per cube of edge length SIZE, in the input's units: the point nearest to the mean of its cube
    #[arg(long, value_name = "SIZE", value_parser = values::above_zero, allow_negative_numbers = true)]
    pub(crate) voxel: Option<f64>,
    /// Add normally distributed noise of standard deviation SIZE, in the input's units, along each axis
    #[arg(long, value_name = "SIZE", value_parser = values::above_zero, allow_negative_numbers = true)]
    pub(crate) noise: Option<f64>,
    /// Seed of noise and samples; the same seed gives the same points
    #[arg(long, value_name = "NUMBER", default_value_t = 0)]
    pub(crate) seed: u64,
}

/// Help on the names: inputs, and the formats that can be written.
fn paths_help() -> String {
    let formats = written_formats().flat_map(|(_, extensions)| extensions).map(|extension| format!(".{extension}"));
    let formats = formats.collect::<Vec<_>>().join(" ");
    format!("{INPUT_HELP} The last name is the file to write, its extension the format: {formats}")
}

const NORMALS_EXAMPLES: &str = "\
Examples:
  autosplats normals scan.e57 normals.ply
  autosplats normals survey.laz normals.laz -k 20 --orient up
  autosplats normals sweep.bin normals.ply --sensor 0,0,1.8

The file keeps all attributes of the input and adds:
  NormalX NormalY NormalZ  unit normal (nx ny nz in PLY)
  Curvature                surface variation, from 0 (flat) to 1/3 (no direction is special)
  DensityRadius            twice the radius of the circle that each neighbour covers on average, in the input's units";

#[derive(Args, Debug)]
#[command(after_help = NORMALS_EXAMPLES, override_usage = "autosplats normals [OPTIONS] <INPUT>... <OUT>")]
pub(crate) struct NormalsArgs {
    // One list for inputs and output, so that options may stand between the names.
    #[arg(required = true, value_names = ["INPUT", "OUT"], num_args = 1.., help = paths_help())]
    pub(crate) paths: Vec<String>,
    #[command(flatten)]
    pub(crate) input: InputArgs,
    /// Number of neighbours that the plane of each point is fitted to, 3 to 1024; more is smoother
    #[arg(short, value_name = "COUNT", default_value_t = NormalSettings::default().k, allow_negative_numbers = true, help_heading = "Normals")]
    pub(crate) k: u32,
    /// Side that the normals point to
    #[arg(long, value_enum, default_value = "auto", help_heading = "Normals")]
    pub(crate) orient: OrientChoice,
    /// Position of the sensor that saw all points, in world coordinates, if the file does not state it
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, allow_hyphen_values = true, conflicts_with = "orient", help_heading = "Normals")]
    pub(crate) sensor: Option<DVec3>,
    /// Replace an existing file
    #[arg(long, help_heading = "Running")]
    pub(crate) force: bool,
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
A point cloud file, or a generated scene as scene:NAME[:COUNT]. Several inputs are described one by one; those that cannot \
be read are reported."
    )]
    pub(crate) inputs: Vec<String>,
    /// Read all points for values, spacing, density and duplicates, even if the header (LAS, E57) states number, bounds
    /// and attributes
    #[arg(long)]
    pub(crate) scan: bool,
    /// Print one JSON object on standard output, or an array of them for several inputs (fields: below)
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) reading: ReadingArgs,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}
