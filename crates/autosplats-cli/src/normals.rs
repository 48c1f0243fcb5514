//! `autosplats normals`: estimates the normal, curvature and density of every point and writes them to a file.

use std::borrow::Cow;

use autosplats::cloud::glam::DVec3;
use autosplats::{NormalSettings, Normals, Orientation, estimate_normals};
use autosplats_cloud::{FieldValues, PointCloud, Unit, check_memory};

use crate::args::NormalsArgs;
use crate::choices::OrientChoice;
use crate::console::Console;
use crate::exit::{Exit, Failure};
use crate::input::Inputs;
use crate::output::{check_cloud_target, write_cloud};
use crate::progress::Bar;

/// Bytes per point beside the cloud: the search tree and the result.
const BYTES_PER_POINT: u64 = 40;

/// Reads the inputs, estimates, and writes the file.
pub(crate) fn run(args: &NormalsArgs, console: &Console) -> Result<(), Failure> {
    let NormalsArgs { paths, input, force, k, orient, sensor, part, run: _ } = args;
    let (inputs, output) = Inputs::with_output(paths, None, input)?;
    inputs.check_memory()?;
    if output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("pts")) {
        return Err(Failure::usage(format!(
            "{}: PTS cannot hold normals; write .xyz, .ply or another format",
            output.display()
        )));
    }
    check_cloud_target(&output, *force, &inputs.files([]), console)?;
    let (cloud, read) = inputs.read_part(part, console)?;
    if cloud.is_empty() {
        return Err(Failure::new(Exit::Input, format!("none of the {read} points lies inside; widen --bounds")));
    }
    check_memory(&format!("the normals of {} points", cloud.len()), cloud.len() as u64 * BYTES_PER_POINT)?;
    let bar = Bar::new("estimating normals", console);
    // A neighbourhood needs one unit along all axes, so coordinates in degrees are estimated as metres on the ground.
    let mut local = Cow::Borrowed(&cloud);
    if cloud.crs().unit == Some(Unit::Degree) {
        local.to_mut().to_local_metres();
    }
    let (orientation, towards) = orientation(&local, *orient, *sensor)?;
    let normals = estimate_normals(&local, &NormalSettings { k: *k, orientation }, &bar)?;
    drop((bar, local));
    let cloud = with_normals(cloud, normals)?;
    let bytes = write_cloud(&cloud, &output, console)?;
    let shown = output.display();
    console.tell(format_args!("{shown}: normals of {} points, pointing {towards}; {bytes} bytes", cloud.len()));
    Ok(())
}

/// Adds the result as fields, replacing existing ones.
fn with_normals(cloud: PointCloud, normals: Normals) -> Result<PointCloud, Failure> {
    let Normals { normals, curvature, radius } = normals;
    let axis = |axis: usize| FieldValues::F32(normals.iter().map(|normal| normal[axis]).collect());
    let fields = [("NormalX", axis(0)), ("NormalY", axis(1)), ("NormalZ", axis(2))];
    let fields = fields
        .into_iter()
        .chain([("Curvature", FieldValues::F32(curvature)), ("DensityRadius", FieldValues::F32(radius))]);
    Ok(fields.into_iter().try_fold(cloud, |cloud, (name, values)| cloud.with_field(name, values))?)
}

/// Orientation of the normals, and its name for the summary.
fn orientation(
    cloud: &PointCloud,
    choice: OrientChoice,
    sensor: Option<DVec3>,
) -> Result<(Orientation, &'static str), Failure> {
    if let Some(position) = sensor {
        return Ok((Orientation::towards(position, cloud), "to the given sensor"));
    }
    let orientation = match choice {
        OrientChoice::Auto => Orientation::usual(cloud),
        OrientChoice::Sensor => Orientation::towards_sensors(cloud).ok_or_else(|| {
            Failure::usage("--orient sensor: the file states no sensor position; give it with --sensor X,Y,Z")
        })?,
        OrientChoice::Up => Orientation::Direction(DVec3::Z),
        OrientChoice::Outward => Orientation::Outward,
    };
    let towards = match orientation {
        Orientation::Viewpoints(_) => "to the sensor",
        Orientation::Direction(_) => "upward",
        _ => "outward",
    };
    Ok((orientation, towards))
}
