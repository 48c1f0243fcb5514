//! Arguments of the commands that write or describe clouds: `convert`, `normals` and `info`.

use std::path::PathBuf;

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
  autosplats convert https://example.org/survey.copc.laz part.laz --bounds 512030,5403600,290,512080,5403640,320
  autosplats convert survey.copc.laz overview.laz --spacing 0.5
  autosplats convert scene:herd:10M herd.ply
  autosplats convert bun000.ply bun045.ply all.ply --pose bun045.ply=bun045.txt
  autosplats convert tiles/*.laz -o city.copc.laz --memory 4G --temp /scratch
  autosplats convert city.copc.laz thin.laz --voxel 0.1 --memory 1G

A name that ends in .copc.laz makes an octree. About as much disk as the uncompressed points take is used for a while.
LAS, LAZ, COPC, PLY, PCD, E57, text and scenes may be larger than memory: they are worked on in parts. Meshes,
compressed PCD, what gzip compressed and other formats are read whole.";

#[derive(Args, Debug)]
#[command(after_help = CONVERT_EXAMPLES, override_usage = "autosplats convert [OPTIONS] <INPUT>... <OUT>")]
pub(crate) struct ConvertArgs {
    // One list for inputs and output, so that options may stand between the names.
    #[arg(required = true, value_names = ["INPUT", "OUT"], num_args = 1.., help = paths_help())]
    pub(crate) paths: Vec<String>,
    #[command(flatten)]
    pub(crate) input: InputArgs,
    /// File to write, instead of the last name; then all names are inputs
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: Option<PathBuf>,
    /// Replace an existing file
    #[arg(long, help_heading = "Running")]
    pub(crate) force: bool,
    #[command(flatten)]
    pub(crate) room: RoomArgs,
    #[command(flatten)]
    pub(crate) part: PartArgs,
    #[command(flatten)]
    pub(crate) thinning: ThinningArgs,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}

/// Memory and disk for points that are worked on in parts.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Running")]
pub(crate) struct RoomArgs {
    /// Memory for points, such as 500M. More points are worked on in parts. Inputs other than LAS, LAZ, COPC, PLY, PCD,
    /// E57, text and scenes are read whole [default: three quarters of what is free; for octrees one quarter, at
    /// most 2G]
    #[arg(long, value_name = "BYTES", value_parser = values::bytes, allow_negative_numbers = true)]
    pub(crate) memory: Option<u64>,
    /// Folder for temporary files of work in parts [default: that of the output, or the system's]
    #[arg(long, value_name = "FOLDER")]
    pub(crate) temp: Option<PathBuf>,
}

/// The part of the inputs that is read.
#[derive(Args, Clone, Copy, Debug, Default)]
#[command(next_help_heading = "Part of the input")]
pub(crate) struct PartArgs {
    /// Keep the points inside a box of world coordinates, given by its lower and its upper corner. Of octrees
    /// only what the box needs is read
    #[arg(long, value_name = "X0,Y0,Z0,X1,Y1,Z1", value_parser = values::bounds, allow_hyphen_values = true)]
    pub(crate) bounds: Option<[DVec3; 2]>,
    /// Read octrees only as far as neighbouring points are SIZE apart, in the input's units
    #[arg(long, value_name = "SIZE", value_parser = values::above_zero, allow_negative_numbers = true)]
    pub(crate) spacing: Option<f64>,
    /// Take what is left of inputs that are cut off or damaged, instead of failing
    #[arg(long)]
    pub(crate) salvage: bool,
}

/// Point processing of `convert`, in the order of its steps.
#[derive(Args, Debug)]
#[command(next_help_heading = "Point processing, in this order")]
pub(crate) struct ThinningArgs {
    /// Keep the first of every COUNT points
    #[arg(long, value_name = "COUNT", value_parser = values::step, allow_negative_numbers = true)]
    pub(crate) every: Option<usize>,
    /// Keep one point per cube of edge length SIZE, in the input's units: the point nearest to the mean of its cube
    #[arg(long, value_name = "SIZE", value_parser = values::above_zero, allow_negative_numbers = true)]
    pub(crate) voxel: Option<f64>,
    /// Add normally distributed noise of standard deviation SIZE, in the input's units, along each axis
    #[arg(long, value_name = "SIZE", value_parser = values::above_zero, allow_negative_numbers = true)]
    pub(crate) noise: Option<f64>,
    /// Seed of noise and samples; the same seed gives the same points
    #[arg(long, value_name = "NUMBER", default_value_t = 0, allow_negative_numbers = true)]
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
  autosplats normals huge.laz normals.laz --memory 2G --temp /scratch

The file keeps all attributes of the input and adds:
  NormalX NormalY NormalZ  unit normal (nx ny nz in PLY)
  Curvature                surface variation, from 0 (flat) to 1/3 (no direction is special)
  DensityRadius            twice the radius of the circle that each neighbour covers on average, in the input's units

LAS, LAZ, COPC, PLY, PCD, E57, text and scenes may be larger than memory: they are worked on in parts. Other inputs are
read whole.";

#[derive(Args, Debug)]
#[command(after_help = NORMALS_EXAMPLES, override_usage = "autosplats normals [OPTIONS] <INPUT>... <OUT>")]
pub(crate) struct NormalsArgs {
    // One list for inputs and output, so that options may stand between the names.
    #[arg(required = true, value_names = ["INPUT", "OUT"], num_args = 1.., help = paths_help())]
    pub(crate) paths: Vec<String>,
    #[command(flatten)]
    pub(crate) input: InputArgs,
    /// File to write, instead of the last name; then all names are inputs
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: Option<PathBuf>,
    /// Number of neighbours that the plane of each point is fitted to, 3 to 1024; more is smoother
    #[arg(short, value_name = "COUNT", value_parser = values::normal_neighbors, default_value_t = NormalSettings::default().k, allow_negative_numbers = true, help_heading = "Normals")]
    pub(crate) k: u32,
    /// Side that the normals point to
    #[arg(long, value_enum, default_value = "auto", help_heading = "Normals")]
    pub(crate) orient: OrientChoice,
    /// Position of the sensor that saw all points, in world coordinates, if the file does not state it
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, allow_hyphen_values = true, conflicts_with = "orient", help_heading = "Normals")]
    pub(crate) sensor: Option<DVec3>,
    #[command(flatten)]
    pub(crate) part: PartArgs,
    /// Replace an existing file
    #[arg(long, help_heading = "Running")]
    pub(crate) force: bool,
    #[command(flatten)]
    pub(crate) room: RoomArgs,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}

const INFO_EXAMPLES: &str = "\
Examples:
  autosplats info scan.laz
  autosplats info scan.laz --scan
  autosplats info *.ply *.e57 --json
  autosplats info points.txt --columns x,y,z,Intensity,-,red,green,blue";

/// Description of the JSON, shown by `info --help` and in docs/FORMATS.md. `Report` has these fields.
const INFO_SCHEMA: &str = "\
Fields of the JSON object. Unknown values are null, unknown lists empty; NaN and infinity do not
occur. Later versions may add fields.
  input             the name as typed
  error             why the input could not be read, in one line
  format            format, version and encoding, for people
  file_bytes        size of the file in bytes
  scanned           whether all points were read; if not, all facts are from the header
  points            number of points; if scanned, without points at (0, 0, 0), where nothing
                    was measured
  points_in_header  number of points that the header states
  faces             number of faces of a mesh
  bounds            smallest and largest coordinates: {min: [x, y, z], max: [...], size: [...]}
  axes              {name: such as z-up, y-down or camera, guessed: true if from the shape}
  crs               {name, epsg, wkt, unit, vertical_unit, metres_per_unit}, as the file states
  resolution        step that coordinates are multiples of: [x, y, z]
  spacing           distance to the nearest other point, at up to 10,000 points spread over
                    the file: {median, p5, p95, mean, samples}; p5 and p95 are percentiles
  density           points per square unit of surface at the same points: {median, neighbors,
                    samples}; n / (pi r^2), with r the distance to the n-th nearest
  duplicates        points at exactly the position of an earlier one
  not_finite        points with an infinite or NaN coordinate
  attributes        values per point, including coordinates: {name, stored, min, max, mean,
                    not_finite, distinct, values, histogram}
    stored          type in the file
    distinct        number of distinct values, if all are whole and near each other
    values          [{value, count, name}] of up to 32 distinct values, or of all classes;
                    name is the ASPRS class
    histogram       {edges, counts}: up to 32 equal bins, with whole edges if all values are
  scans             sensor poses: {name, position, world_from_sensor, points}; a row-major
                    matrix, and [first, end] of the points that the sensor saw
  details           further facts from the header: [{name, value}]
  warnings          what was lost, guessed, dropped, scaled or contradictory";

#[derive(Args, Debug)]
#[command(after_help = INFO_EXAMPLES, after_long_help = format!("{INFO_EXAMPLES}\n\n{INFO_SCHEMA}"))]
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
    pub(crate) room: RoomArgs,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}
