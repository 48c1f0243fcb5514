//! `autosplats normals`: estimates the normal, curvature and density of every point and writes them to a file.

use std::borrow::Cow;
use std::path::Path;

use autosplats::cloud::glam::DVec3;
use autosplats::{
    NormalSettings, NormalsInParts, Orientation, PartsOptions, Viewpoint, estimate_normals, estimate_normals_in_parts,
};
use autosplats_cloud::{
    Axes, Changed, Clouds, Output, PointCloud, Progress, Scan, Thinned, Thinning, Unit, add_scans, check_memory,
};

use crate::args::NormalsArgs;
use crate::choices::OrientChoice;
use crate::console::Console;
use crate::exit::{Exit, Failure};
use crate::input::Inputs;
use crate::output::{check_cloud_target, forced, write_cloud};
use crate::parts::{Need, Parts, WorkError, check_room, parts, sample_of};
use crate::progress::Bar;

/// Bytes per point beside the cloud: the search tree and the result.
const BYTES_PER_POINT: u64 = 40;

/// Bytes per point of a cloud with all its values and digits.
const CLOUD_BYTES: u64 = 100;

/// Bytes per point that wait on the disk beside the points: positions, and results in two orders.
const DISK_BYTES: u64 = 64;

const TO_GIVEN: &str = "to the given sensor";

/// Reads the inputs, estimates, and writes the file.
pub(crate) fn run(args: &NormalsArgs, console: &Console) -> Result<(), Failure> {
    let NormalsArgs { paths, input, output, force, k, orient, sensor, part, room, run: _ } = args;
    let (inputs, output) = Inputs::with_output(paths, output.as_deref(), input, part)?;
    if output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("pts")) {
        return Err(Failure::usage(format!(
            "{}: PTS cannot hold normals; write .xyz, .ply or another format",
            output.display()
        )));
    }
    let output = forced(&output, *force);
    check_cloud_target(output, &inputs.files([]))?;
    check_room(room)?;
    let need = Need { what: "the work", memory: BYTES_PER_POINT + CLOUD_BYTES, disk: DISK_BYTES };
    if let Some(parts) = parts(&inputs, room, part, output.path, &need, console)? {
        return in_parts(args, &parts, output, console);
    }
    inputs.check_memory()?;
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
    let cloud = normals.add_to(cloud)?;
    let bytes = write_cloud(&cloud, output, console)?;
    let shown = output.path.display();
    console.tell(format_args!("{shown}: normals of {} points, pointing {towards}; {bytes} bytes", cloud.len()));
    Ok(())
}

/// Estimates and writes the normals of points that memory does not hold.
fn in_parts(args: &NormalsArgs, parts: &Parts, output: Output<'_>, console: &Console) -> Result<(), Failure> {
    let failed = |error: WorkError| parts.failure(error, output.path);
    let thinning = Thinning { bounds: args.part.bounds, ..Thinning::default() };
    let thinned = Thinned::new(&parts.clouds, thinning, &parts.folder, parts.memory, &());
    let thinned = thinned.map_err(|error| failed(error.into()))?;
    let overview = Overview::of(&thinned).map_err(|error| failed(error.into()))?;
    let (orientation, towards) = overview.orientation(args.orient, args.sensor)?;
    let in_metres = overview.sample.local_metres(None).map(|map| Changed {
        clouds: &thinned,
        change: Box::new(move |cloud: &mut PointCloud| {
            cloud.to_metres_on(&map);
        }),
    });
    let local: &dyn Clouds = in_metres.as_ref().map_or(&thinned, |changed| changed);
    let settings = NormalSettings { k: args.k, orientation };
    let options = PartsOptions { memory: parts.memory, folder: parts.folder.clone() };
    let bar = Bar::new("estimating normals", console);
    let normals = estimate_normals_in_parts(local, &settings, &options, &bar).map_err(|error| failed(error.into()))?;
    drop(bar);
    let (points, tiles, in_doubt) = (normals.len(), normals.tiles(), normals.in_doubt());
    let bytes = parts.write(&WithNormals { clouds: &thinned, normals }, output, console)?;
    if in_doubt > 0 {
        console.note(format_args!(
            "{in_doubt} points may have nearer neighbours than the memory held at once; allow more with --memory"
        ));
    }
    let shown = output.path.display();
    console.tell(format_args!(
        "{shown}: normals of {points} points, pointing {towards}, in {tiles} parts, {in_doubt} in doubt; {bytes} bytes"
    ));
    Ok(())
}

/// What orientation depends on, of points that come in parts.
struct Overview {
    /// Every so many points, and the corners of their box.
    sample: PointCloud,
    corners: PointCloud,
    viewpoints: Vec<Viewpoint>,
    points: u64,
}

impl Overview {
    fn of(clouds: &dyn Clouds) -> Result<Self, autosplats_cloud::Error> {
        let (mut parts, mut scans, mut points) = (Vec::new(), Vec::new(), 0);
        let mut ends: Option<PointCloud> = None;
        clouds.read(&(), &mut |cloud| {
            add_scans(&mut scans, cloud.scans(), points as usize);
            points += cloud.len() as u64;
            let finite = cloud.positions().iter().filter(|place| place.iter().all(|value| value.is_finite()));
            let none = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
            let [low, high] = finite.fold(none, |[low, high], place| {
                let join =
                    |ends: [f32; 3], pick: fn(f32, f32) -> f32| [0, 1, 2].map(|axis| pick(ends[axis], place[axis]));
                [join(low, f32::min), join(high, f32::max)]
            });
            let corners = PointCloud::new(cloud.origin(), vec![low, high]);
            let corners = cloud.axes().map_or(corners.clone(), |axes| corners.with_axes(axes));
            match &mut ends {
                None => ends = Some(corners),
                Some(ends) => ends.append(corners),
            }
            parts.push(sample_of(cloud, clouds));
            Ok(())
        })?;
        let viewpoint = |scan: Scan| Viewpoint { position: scan.position(), points: scan.points };
        let viewpoints = scans.into_iter().map(viewpoint).collect();
        Ok(Self { sample: PointCloud::joined(parts.iter()), corners: ends.unwrap_or_default(), viewpoints, points })
    }

    /// As of a cloud that is in memory.
    fn orientation(&self, choice: OrientChoice, sensor: Option<DVec3>) -> Result<(Orientation, &'static str), Failure> {
        let all =
            |position: DVec3| Orientation::Viewpoints(vec![Viewpoint { position, points: 0..self.points as usize }]);
        if let Some(position) = sensor {
            return Ok((all(position), TO_GIVEN));
        }
        let sensors = match choice {
            OrientChoice::Auto | OrientChoice::Sensor if !self.viewpoints.is_empty() => {
                Some(Orientation::Viewpoints(self.viewpoints.clone()))
            }
            OrientChoice::Auto | OrientChoice::Sensor if self.corners.axes() == Some(Axes::Camera) => {
                Some(all(DVec3::ZERO))
            }
            _ => None,
        };
        match sensors {
            Some(orientation) => Ok((orientation, "to the sensor")),
            None => orientation(&self.corners, choice, None),
        }
    }
}

/// Points with their normals.
struct WithNormals<'a> {
    clouds: &'a dyn Clouds,
    normals: NormalsInParts,
}

impl Clouds for WithNormals<'_> {
    fn name(&self) -> &Path {
        self.clouds.name()
    }

    fn points(&self) -> Option<u64> {
        Some(self.normals.len())
    }

    fn read(
        &self,
        progress: &dyn Progress,
        take: &mut dyn FnMut(&PointCloud) -> Result<(), autosplats_cloud::Error>,
    ) -> Result<(), autosplats_cloud::Error> {
        let mut done = 0;
        self.clouds.read(progress, &mut |cloud| {
            let end = done + cloud.len() as u64;
            let normals = self.normals.read(done..end)?;
            done = end;
            take(&normals.add_to(cloud.clone())?)
        })
    }
}

/// Orientation of the normals, and its name for the summary.
fn orientation(
    cloud: &PointCloud,
    choice: OrientChoice,
    sensor: Option<DVec3>,
) -> Result<(Orientation, &'static str), Failure> {
    if let Some(position) = sensor {
        return Ok((Orientation::towards(position, cloud), TO_GIVEN));
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
