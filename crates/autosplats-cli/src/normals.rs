//! `autosplats normals`: estimates the normal, curvature and density of every point and writes them to a file.

use std::borrow::Cow;

use autosplats::cloud::glam::DVec3;
use autosplats::{Error, NormalSettings, Normals, Orientation, Viewpoint, estimate_normals};
use autosplats_cloud::{Axes, FieldValues, PointCloud, Unit, check_memory};

use crate::args::NormalsArgs;
use crate::choices::OrientChoice;
use crate::exit::{Exit, Failure};
use crate::input::{Inputs, read_failure};
use crate::output::{check_cloud_target, write_cloud};
use crate::progress::Bar;
use crate::render::render_failure;
use crate::threads::start_threads;

/// Bytes per point beside the cloud: the search tree and the result.
const BYTES_PER_POINT: u64 = 40;

/// Reads the inputs, estimates, and writes the file.
pub(crate) fn run(args: &NormalsArgs) -> Result<(), Failure> {
    let NormalsArgs { paths, input, force, k, orient, sensor, run } = args;
    start_threads(run)?;
    let (inputs, output) = Inputs::with_output(paths, input)?;
    if output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("pts")) {
        return Err(Failure::usage(format!(
            "{}: PTS cannot hold normals; write .xyz, .ply or another format",
            output.display()
        )));
    }
    check_cloud_target(&output, *force, &inputs.files([]))?;
    let cloud = inputs.read(run.quiet)?;
    check_memory(&format!("the normals of {} points", cloud.len()), cloud.len() as u64 * BYTES_PER_POINT)
        .map_err(read_failure)?;
    let bar = Bar::new("estimating normals", run.quiet);
    // A neighbourhood needs one unit along all axes, so coordinates in degrees are estimated as metres on the ground.
    let mut local = Cow::Borrowed(&cloud);
    if cloud.crs().unit == Some(Unit::Degree) {
        local.to_mut().to_local_metres();
    }
    let (orientation, towards) = orientation(&local, *orient, *sensor)?;
    let normals =
        estimate_normals(&local, &NormalSettings { k: *k, orientation }, &bar).map_err(|error| match error {
            Error::Cancelled => Failure::interrupted(),
            error => render_failure(error),
        })?;
    drop((bar, local));
    let cloud = with_normals(cloud, normals)?;
    let bytes = write_cloud(&cloud, &output, run.quiet)?;
    if !run.quiet {
        eprintln!("{}: normals of {} points, pointing {towards}; {bytes} bytes", output.display(), cloud.len());
    }
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
    fields
        .into_iter()
        .try_fold(cloud, |cloud, (name, values)| cloud.with_field(name, values))
        .map_err(|error| Failure::new(Exit::Input, error))
}

/// Orientation of the normals, and its name for the summary.
fn orientation(
    cloud: &PointCloud,
    choice: OrientChoice,
    sensor: Option<DVec3>,
) -> Result<(Orientation, &'static str), Failure> {
    let all_from = |position| Orientation::Viewpoints(vec![Viewpoint { position, points: 0..cloud.len() }]);
    if let Some(position) = sensor {
        return Ok((all_from(position), "to the given sensor"));
    }
    let known = || {
        let camera = cloud.axes() == Some(Axes::Camera);
        if cloud.scans().is_empty() {
            return camera.then(|| all_from(DVec3::ZERO));
        }
        let viewpoints =
            cloud.scans().iter().map(|scan| Viewpoint { position: scan.position(), points: scan.points.clone() });
        Some(Orientation::Viewpoints(viewpoints.collect()))
    };
    match choice {
        OrientChoice::Auto => Ok(known().map_or_else(
            || if is_terrain(cloud) { UP } else { (Orientation::Outward, "outward") },
            |orientation| (orientation, "to the sensor"),
        )),
        OrientChoice::Sensor => known().map(|orientation| (orientation, "to the sensor")).ok_or_else(|| {
            Failure::usage("--orient sensor: the file states no sensor position; give it with --sensor X,Y,Z")
        }),
        OrientChoice::Up => Ok(UP),
        OrientChoice::Outward => Ok((Orientation::Outward, "outward")),
    }
}

const UP: (Orientation, &str) = (Orientation::Direction(DVec3::Z), "upward");

/// Whether the points are terrain seen from above: much wider than high.
fn is_terrain(cloud: &PointCloud) -> bool {
    let (min, max) = cloud.positions().iter().filter(|point| point.iter().all(|value| value.is_finite())).fold(
        ([f32::MAX; 3], [f32::MIN; 3]),
        |(min, max), point| {
            (
                std::array::from_fn(|axis| min[axis].min(point[axis])),
                std::array::from_fn(|axis| max[axis].max(point[axis])),
            )
        },
    );
    let [x, y, z]: [f32; 3] = std::array::from_fn(|axis| max[axis] - min[axis]);
    cloud.axes() != Some(Axes::YUp) && z < 0.5 * x.min(y)
}
