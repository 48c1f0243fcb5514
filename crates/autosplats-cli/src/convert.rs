//! `autosplats convert`: writes one or several inputs to a file of another format.

use autosplats_cloud::{Error, PointCloud, Unit};

use crate::args::{ConvertArgs, ThinningArgs};
use crate::exit::{Exit, Failure};
use crate::input::Inputs;
use crate::output::{check_cloud_target, write_cloud};
use crate::progress::Bar;
use crate::threads::start_threads;

/// Reads the inputs and writes the file.
pub(crate) fn run(args: &ConvertArgs) -> Result<(), Failure> {
    let ConvertArgs { paths, input, force, thinning, run } = args;
    start_threads(run)?;
    let (inputs, output) = Inputs::with_output(paths, input)?;
    check_cloud_target(&output, *force, &inputs.files([]))?;
    let mut cloud = match thinning.sample {
        Some(count) => inputs.sample(count, thinning.seed, run.quiet)?,
        None => inputs.read(run.quiet)?,
    };
    let read = cloud.len();
    if cloud.crs().unit == Some(Unit::Degree) && (thinning.voxel.is_some() || thinning.noise.is_some()) && !run.quiet {
        eprintln!("note: the coordinates are in degrees, so --voxel and --noise are too");
    }
    thin(&mut cloud, thinning, run.quiet)?;
    if cloud.is_empty() {
        return Err(Failure::new(Exit::Input, format!("none of the {read} points lies inside; widen --bounds")));
    }
    let bytes = write_cloud(&cloud, &output, run.quiet)?;
    if !run.quiet {
        let of = if cloud.len() < read { format!(" of {read}") } else { String::new() };
        eprintln!("{}: {}{of} points, {bytes} bytes", output.display(), cloud.len());
    }
    Ok(())
}

fn thin(cloud: &mut PointCloud, thinning: &ThinningArgs, quiet: bool) -> Result<(), Failure> {
    if let Some([min, max]) = thinning.bounds {
        cloud.crop(min, max);
    }
    if let Some(step) = thinning.every {
        cloud.keep_every(step);
    }
    if let Some(size) = thinning.voxel {
        let bar = Bar::new("thinning", quiet);
        cloud.thin_by_voxel(size, &bar).map_err(edit_failure)?;
    }
    if let Some(sigma) = thinning.noise {
        let bar = Bar::new("adding noise", quiet);
        cloud.add_noise(sigma, thinning.seed, &bar).map_err(edit_failure)?;
    }
    Ok(())
}

pub(crate) fn edit_failure(error: Error) -> Failure {
    match error {
        Error::Cancelled => Failure::interrupted(),
        error => Failure::usage(error),
    }
}
