//! `autosplats convert`: writes one or several inputs to a file of another format.

mod tree;

use autosplats_cloud::{PointCloud, Unit};

use crate::args::{ConvertArgs, ThinningArgs};
use crate::console::Console;
use crate::exit::{Exit, Failure};
use crate::input::Inputs;
use crate::output::{check_cloud_target, write_cloud};
use crate::progress::Bar;

/// Reads the inputs and writes the file.
pub(crate) fn run(args: &ConvertArgs, console: &Console) -> Result<(), Failure> {
    let ConvertArgs { paths, input, force, part, thinning, .. } = args;
    let (inputs, output) = Inputs::with_output(paths, args.output.as_deref(), input)?;
    check_cloud_target(&output, *force, &inputs.files([]), console)?;
    if tree::is_tree(&output) {
        return tree::run(args, &inputs, &output, console);
    }
    if args.memory.is_some() || args.temp.is_some() {
        return Err(Failure::usage(
            "--memory, --temp: only an octree, a name that ends in .copc.laz, is made in parts",
        ));
    }
    inputs.check_memory()?;
    let (mut cloud, read) = match input.playing.sample {
        Some(count) => {
            let mut cloud = inputs.sample(count, thinning.seed, console)?;
            let sampled = cloud.len() as u64;
            part.bounds.iter().for_each(|&[min, max]| cloud.crop(min, max));
            (cloud, sampled)
        }
        None => inputs.read_part(part, console)?,
    };
    if cloud.crs().unit == Some(Unit::Degree) && (thinning.voxel.is_some() || thinning.noise.is_some()) {
        console.note("the coordinates are in degrees, so --voxel and --noise are too");
    }
    thin(&mut cloud, thinning, console)?;
    if cloud.is_empty() {
        return Err(Failure::new(Exit::Input, format!("none of the {read} points lies inside; widen --bounds")));
    }
    let bytes = write_cloud(&cloud, &output, console)?;
    let of = if (cloud.len() as u64) < read { format!(" of {read}") } else { String::new() };
    console.tell(format_args!("{}: {}{of} points, {bytes} bytes", output.display(), cloud.len()));
    Ok(())
}

fn thin(cloud: &mut PointCloud, thinning: &ThinningArgs, console: &Console) -> Result<(), Failure> {
    if let Some(step) = thinning.every {
        cloud.keep_every(step);
    }
    if let Some(size) = thinning.voxel {
        cloud.thin_by_voxel(size, &Bar::new("thinning", console))?;
    }
    if let Some(sigma) = thinning.noise {
        cloud.add_noise(sigma, thinning.seed, &Bar::new("adding noise", console))?;
    }
    Ok(())
}
