//! `autosplats convert`: writes one or several inputs to a file of another format.

mod tree;

use std::path::Path;

use autosplats_cloud::{Crs, Output, PointCloud, Thinned, Thinning, Unit};

use crate::args::{ConvertArgs, ThinningArgs};
use crate::console::Console;
use crate::exit::{Exit, Failure};
use crate::input::Inputs;
use crate::output::{check_cloud_target, forced, is_tree, write_cloud};
use crate::parts::{Need, Parts, check_room, parts, points_in};
use crate::progress::Bar;

/// Bytes per point that all points at once need: all their values, with all digits, and what writing takes.
const BYTES_PER_POINT: u64 = 100;

/// Bytes per point that wait on the disk while points of cubes are chosen.
const VOXEL_BYTES: u64 = 32;

/// Reads the inputs and writes the file.
pub(crate) fn run(args: &ConvertArgs, console: &Console) -> Result<(), Failure> {
    let ConvertArgs { paths, input, force, part, thinning, .. } = args;
    let (inputs, output) = Inputs::with_output(paths, args.output.as_deref(), input, part)?;
    let output = forced(&output, *force);
    check_cloud_target(output, &inputs.files([]))?;
    check_room(&args.room)?;
    if is_tree(output.path) {
        return tree::run(args, &inputs, output, console);
    }
    let need = Need { what: "the work", memory: BYTES_PER_POINT, disk: thinning.voxel.map_or(0, |_| VOXEL_BYTES) };
    if let Some(parts) = parts(&inputs, &args.room, part, output.path, &need, console)? {
        return in_parts(args, &parts, output, console);
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
    note_degrees(cloud.crs(), thinning, console);
    thin(&mut cloud, thinning, console)?;
    if cloud.is_empty() {
        return Err(Failure::new(Exit::Input, format!("none of the {read} points lies inside; widen --bounds")));
    }
    let bytes = write_cloud(&cloud, output, console)?;
    tell(output.path, cloud.len() as u64, read, bytes, console);
    Ok(())
}

fn tell(output: &Path, kept: u64, read: u64, bytes: u64, console: &Console) {
    let kept = points_in(output, kept);
    let of = if kept < read { format!(" of {read}") } else { String::new() };
    console.tell(format_args!("{}: {kept}{of} points, {bytes} bytes", output.display()));
}

fn note_degrees(crs: &Crs, thinning: &ThinningArgs, console: &Console) {
    if crs.unit == Some(Unit::Degree) && (thinning.voxel.is_some() || thinning.noise.is_some()) {
        console.note("the coordinates are in degrees, so --voxel and --noise are too");
    }
}

/// Thins and writes points that memory does not hold.
fn in_parts(args: &ConvertArgs, parts: &Parts, output: Output<'_>, console: &Console) -> Result<(), Failure> {
    let ThinningArgs { every, voxel, noise, seed } = args.thinning;
    note_degrees(parts.clouds.crs(), &args.thinning, console);
    let thinning = Thinning { bounds: args.part.bounds, every, voxel, noise: noise.map(|sigma| (sigma, seed)) };
    let bar = Bar::new("thinning", console);
    let thinned = Thinned::new(&parts.clouds, thinning, &parts.folder, parts.memory, &bar);
    let thinned = thinned.map_err(|error| parts.failure(error, output.path))?;
    drop(bar);
    let bytes = parts.write(&thinned, output, console)?;
    tell(output.path, thinned.kept(), parts.points, bytes, console);
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
